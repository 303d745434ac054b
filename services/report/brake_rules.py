"""Stopping distances by rules that know no slope, and where they are too short.

All with the level deceleration and the dead time at the quantile, so that nothing but the slope
tells them from the stop of the model.
"""

from __future__ import annotations

from slopewise.models.laws import responsibility_sensitive_safety as rss
from slopewise.services.report.brake_numbers import BrakeNumbers

_HAIR = 1e-3
"""Of distances that are integrated, shorter than that is the same [m]."""

_HALVINGS = 12


def plain_distance(numbers: BrakeNumbers, speed: float) -> float:
    """v²/2a [m]: no dead time, no slope."""
    return float(rss.rule_distance(speed, 0.0, 0.0, _deceleration(numbers, speed)))


def rule_distance(numbers: BrakeNumbers, speed: float, acceleration: float = 0.0) -> float:
    """Responsibility-sensitive safety, at an acceleration through the dead time [m/s²]; [m]."""
    slowing = _deceleration(numbers, speed)
    return float(rss.rule_distance(speed, numbers.dead_time, acceleration, slowing))


def short_from(numbers: BrakeNumbers, speed: float, acceleration: float = 0.0) -> float | None:
    """Grade below which that distance is shorter than the stop without its offset [rad].

    None where it is on no trained grade.
    """
    rule = rule_distance(numbers, speed, acceleration)
    low, high = numbers.tables[0].grade_range[0], 0.0

    def is_short(grade: float) -> bool:
        return rule < numbers.allowed_distance(speed, grade) - numbers.offset - _HAIR

    if not is_short(low):
        return None
    if is_short(high):  # drag or lag: on level ground already
        return high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_short(middle) else (low, middle)
    return low


def _deceleration(numbers: BrakeNumbers, speed: float) -> float:
    return max(numbers.level_deceleration(speed), 1e-9)
