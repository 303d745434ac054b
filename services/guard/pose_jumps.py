"""Poses that the motion of the base does not explain."""

from __future__ import annotations

import cmath
import math

from slopewise.services.guard.arc_limits import point_speed
from slopewise.services.guard.decide import VehicleMotion
from slopewise.services.guard.guard_model import GuardModel
from slopewise.services.guard.stop_courses import Pose2d

_REST = 0.1  # speed of the fastest point below which a pose need not change [m/s]
_SLIP = 0.1  # share of the reckoned way by which wheels may be wrong about it [1]


class PoseJumps:
    """Follows the poses of one base: a localisation may be reset, or be that of another vehicle.

    No corner of the body moves faster than its fastest point can at the reported speeds. After a
    jump nothing shows which pose is right: poses count again once they agree with the one before
    the jump, moved on by the reported speed and yaw rate. Only jumps are seen: a pose that drifts
    is as wrong later.
    """

    def __init__(self, model: GuardModel, allowed: float, deadline: float) -> None:
        """Begin; ``allowed``: jump that a correction may be, beyond the errors of both poses [m].

        ``deadline``: time for which poses have to agree after a jump [s].
        """
        shape, errors = model.shape, model.errors
        half = 0.5j * shape.width
        ends = shape.front, -shape.rear
        self._corners = [end + side for end in ends for side in (half, -half)]
        pose = errors.cross_track + errors.along_track + errors.heading * abs(self._corners[0])
        self._model, self._allowed, self._deadline = model, allowed + 2.0 * pose, deadline
        self._last: VehicleMotion | None = None
        self._arrived = self._measured = 0.0
        self._reckoned, self._way, self._disagreed = Pose2d(0.0, 0.0, 0.0), 0.0, 0.0
        self.fault = ""  # a jump, as text, until poses agree with the one before it

    def update(
        self, motion: VehicleMotion, arrived: float, late: float, margin: float, turning: float
    ) -> None:
        """Record odometry.

        ``late``, ``margin``: delay as its stamp shows it, and by which that may be wrong from one
        message to the next [s]; ``turning``: yaw rate of commands that the base may follow, for
        odometry that reports none [rad/s].
        """
        if not all(map(math.isfinite, (*motion.pose, motion.speed, motion.yaw_rate))):
            return  # no decision uses it
        last, measured = self._last or motion, arrived - late
        speed = max(abs(last.speed), abs(motion.speed))
        turning = max(turning, abs(last.yaw_rate), abs(motion.yaw_rate))
        fastest = point_speed(self._model, speed, turning)
        if motion.pose == last.pose and fastest >= _REST and self._last is not None:
            return  # one that is repeated is as old as when it came first
        passed = max(measured - self._measured, arrived - self._arrived)
        allowed = self._allowed + fastest * (passed + margin)
        moved = self._moved(last.pose, motion.pose)
        if moved > allowed and not self.fault:
            explained = f"{allowed:.1f} m are explained by its speed and errors"
            self.fault = f"the pose jumped by {moved:.1f} m, {explained}"
            self._reckoned, self._way = last.pose, 0.0
        if self.fault:
            self._reckon(last, motion, passed)
            separation = self._moved(self._reckoned, motion.pose)
            if separation > self._allowed + fastest * margin + _SLIP * self._way:
                self._disagreed = arrived
            elif arrived - self._disagreed > self._deadline:
                self.fault = ""
        self._last, self._arrived, self._measured = motion, arrived, measured

    def _reckon(self, last: VehicleMotion, motion: VehicleMotion, passed: float) -> None:
        """Move the pose from before the jump on by the mean speed and yaw rate of two messages."""
        x, y, heading = self._reckoned
        way = 0.5 * (last.speed + motion.speed) * passed
        turned = 0.5 * (last.yaw_rate + motion.yaw_rate) * passed
        shift = way * cmath.exp(1j * (heading + 0.5 * turned))
        self._reckoned = Pose2d(x + shift.real, y + shift.imag, heading + turned)
        self._way += point_speed(self._model, abs(way), turned)

    def _moved(self, before: Pose2d, after: Pose2d) -> float:
        """Distance by which the farthest corner moved [m]."""
        (x0, y0, from_), (x1, y1, to) = before, after
        shift = complex(x1 - x0, y1 - y0)
        turn = complex(math.cos(to) - math.cos(from_), math.sin(to) - math.sin(from_))
        return max(abs(shift + turn * corner) for corner in self._corners)
