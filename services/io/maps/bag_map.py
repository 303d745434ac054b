"""Elevation maps and candidate paths out of ROS 2 recordings."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.services.io.access import fault
from slopewise.services.io.bags.recording import Bag, Recorded, opened, state_of
from slopewise.services.io.bags.ros_types import GRID_MAP, PATH
from slopewise.services.io.bags.topics import MapSource, read_sources
from slopewise.services.io.maps.grid_map_message import elevation_map_of
from slopewise.services.io.maps.no_data import NoData

_MOST_PATHS = 100_000


def read_bag_map(path: Path, topics: Path | None = None, nodata: NoData = None) -> ElevationMap:
    """The last elevation map of a recording, or the one that a mapping names.

    Args:
        path: folder of a recording, or a file of one.
        topics: mapping; table ``map``. Without one, the only topic of grid maps is taken.
        nodata: what the user says of markers of missing data.

    Raises:
        InputError: names the recording, the topic and the field.
    """
    return map_and_frame(path, topics, nodata)[0]


def map_and_frame(
    path: Path, topics: Path | None, nodata: NoData = None
) -> tuple[ElevationMap, str]:
    """The map, and the frame that it is in; decoded once as long as the recording is the same.

    Raises:
        InputError: names the recording, the topic and the field.
    """
    source, _ = read_sources(topics)
    return _decoded(path, source, nodata, state_of(path))


@lru_cache(maxsize=2)
def _decoded(
    path: Path, source: MapSource, nodata: NoData, state: object
) -> tuple[ElevationMap, str]:
    with opened(path) as bag:
        topic = source.topic or _only_topic(bag)
        recorded = bag.messages_of([topic], GRID_MAP, last=source.message == -1)
    try:
        one = recorded[source.message]
    except IndexError:
        words = f"expected message {source.message} of {len(recorded)}"
        raise fault(path, f"topic {topic}", words) from None
    try:
        ground = elevation_map_of(one.message, source.layer, nodata)
    except ParameterError as error:
        raise fault(path, f"topic {topic}, {error.field}", f"expected {error.expected}") from None
    return ground, one.message.header.frame_id


def _only_topic(bag: Bag) -> str:
    found = bag.topics_of(GRID_MAP)
    if len(found) > 1:
        words = f"expected one topic of grid maps, or --topics that names one: {', '.join(found)}"
        raise fault(bag.path, "topics", words)
    return found[0]


def read_bag_paths(path: Path, topics: Path | None = None, frame: str = "") -> list[CandidatePath]:
    """Candidates of a recording: the last message of each topic of paths, or all of them.

    Args:
        path: folder of a recording, or a file of one.
        topics: mapping; table ``paths``. Without one, all topics of nav_msgs/Path are taken.
        frame: of the map, if it has one; paths in another frame are refused.

    Raises:
        InputError: names the recording, the topic and the field.
    """
    _, source = read_sources(topics)
    with opened(path) as bag:
        wanted = list(source.topics) or bag.topics_of(PATH)
        recorded = bag.messages_of(wanted, PATH, last=not source.all_messages)
    if len(recorded) > _MOST_PATHS:
        raise fault(path, "", f"expected at most {_MOST_PATHS} paths, got {len(recorded)}")
    count = dict.fromkeys(wanted, 0)
    candidates = []
    for one in recorded:
        name = one.topic
        if source.all_messages:
            name = f"{one.topic}#{count[one.topic]}"
            count[one.topic] += 1
        candidates.append(_candidate(path, name, one, frame))
    return candidates


def _candidate(path: Path, name: str, one: Recorded, frame: str) -> CandidatePath:
    if frame and (other := other_frame(one.message, frame)):
        words = f"expected frame {frame} as the map has it, got {other}"
        raise fault(path, f"{name}, header.frame_id", words)
    try:
        return CandidatePath(name, points_of(one.message))
    except ParameterError as error:
        raise fault(path, f"{name}, {error.field}", f"expected {error.expected}") from None


def other_frame(message: Any, frame: str) -> str:
    """A frame that a nav_msgs/Path, or a pose in it, has instead of another; empty if none has."""
    own = dict.fromkeys([message.header.frame_id, *(p.header.frame_id for p in message.poses)])
    return next((name for name in own if name and name.lstrip("/") != frame.lstrip("/")), "")


def points_of(message: Any) -> np.ndarray:
    """(n, 2) of x, y [m] of a nav_msgs/Path."""
    positions = [pose.pose.position for pose in message.poses]
    return np.array([(p.x, p.y) for p in positions], np.float64).reshape(-1, 2)
