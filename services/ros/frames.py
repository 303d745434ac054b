"""Frames of ROS 2: where the vehicle is in the frame of map and paths.

Only the vehicle's pose is carried over. Maps and paths are not: a map that is turned, or moved by a
transform that is late, is another map.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.services.ros.conversions import OdometrySample

_DEEPEST = 64
_MOST_FRAMES = 10_000


@dataclass(frozen=True, slots=True)
class _Link:
    """To a parent frame: (4, 4), and when it was heard, monotonic [s]; inf for what is fixed."""

    parent: str
    matrix: Floats
    at: float


class Frames:
    """The tree of frames as it was heard last."""

    def __init__(self, oldest: float) -> None:
        """Believe transforms that are at most so old [s]; fixed ones for ever."""
        self._oldest = oldest
        self._links: dict[str, _Link] = {}

    def take(self, message: Any, at: float, *, fixed: bool = False) -> None:
        """Take up a tf2_msgs/TFMessage.

        Raises:
            ParameterError: a transform is none.
        """
        for stamped in message.transforms:
            child, parent = _name(stamped.child_frame_id), _name(stamped.header.frame_id)
            t, q = stamped.transform.translation, stamped.transform.rotation
            turn = np.array([q.x, q.y, q.z, q.w])
            numbers = np.isfinite((t.x, t.y, t.z, *turn)).all()
            if not (child and parent and child != parent and numbers):
                raise ParameterError("transforms", "finite numbers between two frames")
            if not 0.9 < float(np.linalg.norm(turn)) < 1.1:
                raise ParameterError("transforms", f"a rotation of {child}, got {turn.tolist()}")
            matrix = np.eye(4)
            matrix[:3, :3] = Rotation.from_quat(turn).as_matrix()
            matrix[:3, 3] = t.x, t.y, t.z
            if child in self._links or len(self._links) < _MOST_FRAMES:
                self._links[child] = _Link(parent, matrix, float("inf") if fixed else at)

    def motion_in(self, frame: str, motion: OdometrySample, now: float) -> OdometrySample:
        """A motion in another frame; speed stays, it is along the vehicle.

        Args:
            frame: wanted. motion: with its own frame. now: monotonic [s].

        Raises:
            ParameterError: no transform between them, or one that is old.
        """
        own, wanted = _name(motion.frame), _name(frame)
        if own == wanted:
            return motion
        ours, theirs = self._to_root(own, now), self._to_root(wanted, now)
        shared = next((name for name in ours if name in theirs), None)
        if shared is None:
            raise ParameterError("frame", f"a transform from {own} to {wanted}, got none")
        matrix = np.linalg.inv(theirs[shared]) @ ours[shared]
        x, y = (matrix @ (motion.x, motion.y, 0.0, 1.0))[:2]
        ahead = matrix[:3, :3] @ (np.cos(motion.heading), np.sin(motion.heading), 0.0)
        heading = float(np.arctan2(ahead[1], ahead[0]))
        return replace(motion, frame=frame, x=float(x), y=float(y), heading=heading)

    def _to_root(self, frame: str, now: float) -> dict[str, Floats]:
        """Each frame above, and the way to it; ends before a transform that is old."""
        found = {frame: np.eye(4)}
        for _ in range(_DEEPEST):
            link = self._links.get(frame)
            if link is None or now - link.at > self._oldest or link.parent in found:
                break
            found[link.parent] = link.matrix @ found[frame]
            frame = link.parent
        return found


def _name(frame: str) -> str:
    return frame.lstrip("/")
