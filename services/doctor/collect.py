"""Messages of a robot into what was seen of it, whether they come from a recording or live."""

from __future__ import annotations

import math
from typing import Any

from slopewise.services.doctor.facts import Seen, TopicSeen

_NANO = 1e-9
_MOST = 200_000
ODOMETRY, SPEED_LIMIT, BOOL = (
    "nav_msgs/msg/Odometry",
    "nav2_msgs/msg/SpeedLimit",
    "std_msgs/msg/Bool",
)
TRANSFORMS, PATH, GRID_MAP = (
    "tf2_msgs/msg/TFMessage",
    "nav_msgs/msg/Path",
    "grid_map_msgs/msg/GridMap",
)
TYPES = (ODOMETRY, SPEED_LIMIT, BOOL, TRANSFORMS, PATH, GRID_MAP)
"""What is looked at; of other topics only that they are there."""


class Collector:
    """Takes one message after the other."""

    def __init__(self) -> None:
        """Nothing seen yet."""
        self.seen = Seen()
        self._first: float | None = None

    def take(self, topic: str, kind: str, message: Any, at: float) -> None:
        """One message, and when it was received [s]."""
        self._first = at if self._first is None else self._first
        self.seen.span = at - self._first
        told = self.seen.topics.setdefault(topic, TopicSeen(kind))
        if len(told.at) >= _MOST:
            return
        told.at.append(at)
        header = getattr(message, "header", None)
        if header is not None:
            told.stamps.append(header.stamp.sec + _NANO * header.stamp.nanosec)
            if header.frame_id:
                told.frames.add(header.frame_id.lstrip("/"))
        if kind == ODOMETRY:
            place, speed = message.pose.pose.position, message.twist.twist.linear.x
            if all(map(math.isfinite, (place.x, place.y, speed))):
                self.seen.odometry.append((at, place.x, place.y, speed))
        elif kind == SPEED_LIMIT:
            self.seen.limits.append((at, float(message.speed_limit), bool(message.percentage)))
        elif kind == BOOL:
            self.seen.stops.append((at, bool(message.data)))
        elif kind == TRANSFORMS:
            for link in message.transforms:
                child, parent = link.child_frame_id.lstrip("/"), link.header.frame_id.lstrip("/")
                self.seen.links[child] = parent
