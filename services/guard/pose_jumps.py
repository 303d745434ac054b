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

_RESTED = 3.0  # time at rest from which a pose may be confirmed [s]
_MOVED = 0.1  # by which reported speeds may add up to a motion meanwhile: noise [m]


class PoseJumps:
    """Follows the poses of one base: a localisation may be reset, or be that of another vehicle.

    No corner of the body moves faster than its fastest point can at the reported speeds. After a
    jump nothing shows which pose is right: poses count again once they agree with the one before
    the jump, moved on by the reported speed and yaw rate, or once an operator confirms the new one
    of a base at rest. That poses at rest agree with each other is no evidence: a wrong one stands
    still as well. Only jumps are seen: a pose that drifts is as wrong later.
    """

    def __init__(self, model: GuardModel, allowed: float, deadline: float) -> None:
        """Begin; ``allowed``: jump that a correction may be, beyond the errors of both poses [m].

        ``deadline``: time for which poses have to agree after a jump [s].
        """
        shape, errors = model.vehicle.shape, model.errors
        half = 0.5j * shape.width
        ends = shape.front, -shape.rear
        self._corners = [end + side for end in ends for side in (half, -half)]
        pose = errors.cross_track + errors.along_track + errors.heading * abs(self._corners[0])
        self._model, self._allowed, self._deadline = model, allowed + 2.0 * pose, deadline
        self._close = allowed  # distance of poses that agree at rest [m]
        self._last: VehicleMotion | None = None
        self._arrived = self._measured = 0.0
        self._reckoned, self._way, self._disagreed = Pose2d(0.0, 0.0, 0.0), 0.0, 0.0
        self._stood: tuple[float, Pose2d, Pose2d] | None = None  # since when, from where
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
            self._reckoned, self._way, self._stood = last.pose, 0.0, None
        if self.fault:
            self._reckon(last, motion, passed)
            separation = self._moved(self._reckoned, motion.pose)
            if separation > self._allowed + fastest * margin + _SLIP * self._way:
                self._disagreed = arrived
            elif arrived - self._disagreed > self._deadline:
                self.fault = ""
            self._follow_rest(motion, arrived, is_at_rest=fastest < _REST)
        self._last, self._arrived, self._measured = motion, arrived, measured

    def _follow_rest(self, motion: VehicleMotion, arrived: float, *, is_at_rest: bool) -> None:
        """Record since when the base has stood, with poses that agree with each other."""
        is_seen = arrived - self._arrived <= self._deadline
        _, pose, reckoned = self._stood or (arrived, motion.pose, self._reckoned)
        agrees = self._moved(pose, motion.pose) <= self._close
        agrees &= self._moved(reckoned, self._reckoned) <= _MOVED
        if not (self._stood and is_at_rest and is_seen and agrees):
            self._stood = (arrived, motion.pose, self._reckoned) if is_at_rest else None

    @property
    def rest_begin(self) -> float | None:
        """Arrival of the odometry since which the base stands after a jump [s]."""
        return self._stood[0] if self._stood else None

    def confirm(self, pose: Pose2d, now: float) -> str:
        """End a jump by the pose that an operator confirms; reason if it is refused, else "".

        Poses have to be close to it, and the base to have stood for :data:`_RESTED`.
        """
        if self._last is None or now - self._arrived > self._deadline:
            return "no odometry"
        separation = self._moved(pose, self._last.pose)
        if not separation <= self._close:
            return f"it is {separation:.1f} m from that of odometry"
        if self.fault and (self._stood is None or self._arrived - self._stood[0] < _RESTED):
            return f"the base has to stand for {_RESTED:g} s before"
        self.fault = ""
        return ""

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
