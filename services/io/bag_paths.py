"""Candidate paths from `nav_msgs/Path`, live or recorded."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.services.io.bags import PATH, opened
from slopewise.services.io.files import fault, faults_of
from slopewise.services.io.topics import read_sources

_MAX_PATHS = 100_000  # Candidates of one recording: ten paths at 10 Hz are as many in 17 minutes


def read_bag_paths(path: Path, topics: Path | None = None, frame: str = "") -> list[CandidatePath]:
    """Candidates of a recording: the last message of each topic of paths, or all of them.

    Without a mapping, all topics of nav_msgs/Path are taken. Paths in another frame than the map's,
    if it has one, are refused.
    """
    _, source = read_sources(topics)
    with opened(path) as bag:
        used = list(source.topics) or bag.topics_of(PATH)
        recorded = bag.messages_of(used, PATH, last=not source.all_messages)
    if len(recorded) > _MAX_PATHS:
        raise fault(path, "", f"expected at most {_MAX_PATHS} paths, got {len(recorded)}")
    numbers = {topic: itertools.count() for topic in used}
    return [
        _candidate(
            path,
            f"{topic}#{next(numbers[topic])}" if source.all_messages else topic,
            message,
            frame,
        )
        for topic, message in recorded
    ]


def _candidate(path: Path, name: str, message: Any, frame: str) -> CandidatePath:
    if frame and (different := other_frame(message, frame)):
        expected = f"expected frame {frame} as the map has it, got {different}"
        raise fault(path, f"{name}, header.frame_id", expected)
    with faults_of(path, f"{name}, "):
        return CandidatePath(name, points_of(message))


def other_frame(message: Any, frame: str) -> str:
    """A frame of a nav_msgs/Path, or of a pose in it, that is not the given one; empty if none."""
    different = (n for n in stated_frames(message) if n.lstrip("/") != frame.lstrip("/"))
    return next(different, "")


def stated_frames(message: Any) -> list[str]:
    """Frames of a nav_msgs/Path and of the poses in it, each once, without empty ones."""
    frames = dict.fromkeys([message.header.frame_id, *(p.header.frame_id for p in message.poses)])
    return [name for name in frames if name]


def points_of(message: Any) -> Floats:
    """(n, 2) of x, y [m] of a nav_msgs/Path."""
    positions = [pose.pose.position for pose in message.poses]
    return np.array([(p.x, p.y) for p in positions], np.float64).reshape(-1, 2)
