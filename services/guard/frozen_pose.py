"""Age of a pose that does not change although the base reports that it moves."""

from __future__ import annotations

from slopewise.services.guard.decide import VehicleMotion
from slopewise.services.guard.stop_courses import Pose2d

_MIN_SPEED, _MIN_YAW_RATE = 0.1, 0.05
"""Speed [m/s] and yaw rate [rad/s] of a base that moves: above the noise of odometry at rest."""

_ROUNDING = 1e-6  # of moments [s]


class PoseAge:
    """Follows the poses of one base; a localisation that fails may repeat one with new stamps."""

    def __init__(self) -> None:
        self._pose: Pose2d | None = None
        self._measured, self._is_frozen = 0.0, False

    def update(self, motion: VehicleMotion, age: float, now: float) -> float:
        """Age of the newest pose [s]; ``age``: that of the message that has it.

        A base that has moved since is not where its pose says, at rest either.
        """
        excess = now - age - self._measured  # of a newer message with the same pose [s]
        if motion.pose != self._pose:
            self._pose, self._measured, self._is_frozen = motion.pose, now - age, False
        elif abs(motion.speed) >= _MIN_SPEED or abs(motion.yaw_rate) >= _MIN_YAW_RATE:
            self._is_frozen |= excess > _ROUNDING
        elif not self._is_frozen:
            self._measured = now - age
        return max(age, now - self._measured)
