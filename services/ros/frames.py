"""Frames of ROS 2: pose of the vehicle in the frame of map and paths.

Only the vehicle's pose is transformed. Maps and paths are not: a map that is turned, or moved by a
transform that is late, is another map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.services.ros.conversions import UNIT_TOLERANCE, OdometrySample

_MAX_DEPTH = 64  # Links from a frame to its root; robots have fewer than 20 [1]
_MAX_FRAMES = 10_000  # Frames that are stored, so that a faulty sender cannot fill the memory [1]


@dataclass(frozen=True, slots=True)
class _Link:
    """Transform (4, 4) to a parent frame; ``at``: arrival, monotonic, inf if it is fixed [s]."""

    parent: str
    matrix: Floats
    at: float


class Frames:
    """Tree of frames by the newest transforms."""

    def __init__(self, max_age: float) -> None:
        """Use transforms up to an age [s]; fixed ones always."""
        self._max_age = max_age
        self._links: dict[str, _Link] = {}

    def take(self, message: Any, at: float, *, fixed: bool = False) -> None:
        """Store the transforms of a tf2_msgs/TFMessage."""
        for stamped in message.transforms:
            child, parent = _name(stamped.child_frame_id), _name(stamped.header.frame_id)
            t, q = stamped.transform.translation, stamped.transform.rotation
            turn = np.array([q.x, q.y, q.z, q.w])
            is_finite = np.isfinite((t.x, t.y, t.z, *turn)).all()
            if not (child and parent and child != parent and is_finite):
                raise ParameterError("transforms", "finite numbers between two frames")
            if not abs(float(np.linalg.norm(turn)) - 1.0) < UNIT_TOLERANCE:
                raise ParameterError("transforms", f"a rotation of {child}, got {turn.tolist()}")
            matrix = np.eye(4)
            matrix[:3, :3] = Rotation.from_quat(turn).as_matrix()
            matrix[:3, 3] = t.x, t.y, t.z
            if child in self._links or len(self._links) < _MAX_FRAMES:
                self._links[child] = _Link(parent, matrix, math.inf if fixed else at)

    def motion_in(self, frame: str, motion: OdometrySample, now: float) -> OdometrySample:
        """Motion in another frame; its speed is along the vehicle and stays."""
        source, target = _name(motion.frame), _name(frame)
        if source == target:
            return motion
        ours, theirs = self._to_root(source, now), self._to_root(target, now)
        shared = next((name for name in ours if name in theirs), None)
        if shared is None:
            raise ParameterError("frame", f"a transform from {source} to {target}, got none")
        matrix = np.linalg.inv(theirs[shared]) @ ours[shared]
        x, y = (matrix @ (motion.x, motion.y, 0.0, 1.0))[:2]
        ahead = matrix[:3, :3] @ (np.cos(motion.heading), np.sin(motion.heading), 0.0)
        heading = float(np.arctan2(ahead[1], ahead[0]))
        return replace(motion, frame=frame, x=float(x), y=float(y), heading=heading)

    def _to_root(self, frame: str, now: float) -> dict[str, Floats]:
        """Transform to each frame above; ends before a transform that is old."""
        matrices = {frame: np.eye(4)}
        for _ in range(_MAX_DEPTH):
            link = self._links.get(frame)
            if link is None or now - link.at > self._max_age or link.parent in matrices:
                break
            matrices[link.parent] = link.matrix @ matrices[frame]
            frame = link.parent
        return matrices


def _name(frame: str) -> str:
    return frame.lstrip("/")
