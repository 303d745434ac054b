"""A recorded drive in the order received: maps, poses, paths and commands, without ROS."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.planner.horizon.answer import PlanarState
from slopewise.services.io.bag_paths import points_of, stated_frames
from slopewise.services.io.bags import GRID_MAP, ODOMETRY, PATH, Bag, attitude, opened, read_cdr
from slopewise.services.io.files import fault
from slopewise.services.io.grid_map import elevation_map_of
from slopewise.services.io.topics import only_topic, read_sources

_TWISTS = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")

_MAX_AGE = 1.0
"""Age of odometry up to which its stamp is of the recorder's clock [s]: once one was, all are."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedPose(PlanarState):
    """Odometry: the state, its age on arrival, and the yaw rate [rad/s].

    `age_known`: the stamp is of the recorder's clock; else the age is 0.
    """

    yaw_rate: float
    age_known: bool = True


@dataclass(frozen=True, slots=True)
class RecordedCommand:
    """Velocity command: speed [m/s] and yaw rate [rad/s]."""

    speed: float
    yaw_rate: float


@dataclass(frozen=True, slots=True)
class UnusableMessage:
    """A message that cannot be used, with the reason."""

    topic: str
    reason: str


Event = ElevationMap | RecordedPose | CandidatePath | RecordedCommand | UnusableMessage


def _only(bag: Bag, kind: str, conventional: str) -> str:
    """The topic of a type that :func:`only_topic` selects; InputError without one."""
    there = bag.topics_of(kind)
    if topic := only_topic(bag.types, {kind}, conventional):
        return topic
    raise fault(bag.path, "topics", f"expected one topic of {kind}, got {', '.join(there)}")


def drive_events(path: Path, mapping: Path | None = None) -> Iterator[tuple[float, Event]]:
    """Messages of a recording with their times since the first one [s].

    They are decoded one by one, so that a recording may be larger than the memory.
    """
    source, paths = read_sources(mapping)
    with opened(path) as bag:
        twists = (t for kind in _TWISTS for t in sorted(bag.types) if bag.types[t] == kind)
        names = {
            source.topic or _only(bag, GRID_MAP, "elevation_map"),
            _only(bag, ODOMETRY, "odom"),
            *(paths.topics or bag.topics_of(PATH)),
            next(twists, ""),  # of commands; not all robots record them
        }
        connections = [c for c in bag.reader.connections if c.topic in names]
        frames, begin, one_clock = _Frames(path), None, False
        for connection, at, raw in bag.raw(connections):
            topic, kind = connection.topic, connection.msgtype
            begin = at if begin is None else begin
            time = 1e-9 * (at - begin)
            if kind == GRID_MAP:
                message = read_cdr(raw, kind, path, f"topic {topic}")
                frames.check_map(topic, message.header.frame_id)
                try:
                    yield time, elevation_map_of(message, source.layer)
                except ParameterError as error:
                    yield time, UnusableMessage(topic, f"{error.field}: expected {error.expected}")
                continue
            message = bag.decoded(connection, raw)
            if kind == PATH:
                yield time, _path(topic, message, frames)
            elif kind == ODOMETRY:
                frames.check(topic, message.header.frame_id)
                pose = _pose(message, at, one_clock=one_clock)
                one_clock = pose.age_known
                yield time, pose
            else:
                twist = message.twist if kind == _TWISTS[1] else message
                yield time, RecordedCommand(float(twist.linear.x), float(twist.angular.z))


class _Frames:
    """Frames of a recording's messages: all have to be that of the first map, also before it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._before: dict[tuple[str, str], None] = {}  # topics and frames before the first map
        self.map = ""

    def check_map(self, topic: str, frame: str) -> None:
        """Check a map's frame; the first one is that of all other messages. Empty: not stated."""
        if frame:
            self.check(topic, frame)
        self.map = self.map or frame
        before, self._before = self._before, {}
        for earlier, given in before:
            self.check(earlier, given)

    def check(self, topic: str, given: str) -> None:
        """InputError for another frame than the map's, as soon as that is known."""
        if not self.map:
            self._before[topic, given] = None
        elif given.lstrip("/") != self.map.lstrip("/"):
            expected = (
                f"expected frame {self.map} as the map has it, got {given}: transforms of "
                "recordings are not followed, record all in the frame of the map"
            )
            raise fault(self._path, f"topic {topic}, header.frame_id", expected)


def _path(topic: str, message: Any, frames: _Frames) -> CandidatePath | UnusableMessage:
    for given in stated_frames(message):
        frames.check(topic, given)
    try:
        return CandidatePath(topic, points_of(message))
    except ParameterError as error:
        return UnusableMessage(topic, str(error))


def _pose(message: Any, at: int, *, one_clock: bool) -> RecordedPose:
    """Odometry received at a time [ns]; `one_clock`: its stamps are of the recorder's clock."""
    position, q = message.pose.pose.position, message.pose.pose.orientation
    twist, stamp = message.twist.twist, message.header.stamp
    age = 1e-9 * (at - stamp.sec * 1_000_000_000 - stamp.nanosec)
    age_known = one_clock or 0.0 <= age <= _MAX_AGE
    return RecordedPose(
        x=position.x,
        y=position.y,
        heading=attitude(q.w, q.x, q.y, q.z)[2],
        speed=math.copysign(math.hypot(twist.linear.x, twist.linear.y), twist.linear.x),
        age=max(age, 0.0) if age_known else 0.0,
        yaw_rate=float(twist.angular.z),
        age_known=age_known,
    )
