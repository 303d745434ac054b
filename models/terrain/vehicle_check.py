"""Checks whether a vehicle file's mass and motor constant can be right for what was measured.

Thrusts over the weight are W⁻¹ τ k_t I/r: a mass, torque constant, gear ratio or radius that is
wrong by a factor shifts them all by it. Found is what no ground allows: more thrust than wheels can
transmit, turns and straights with less than anything rolls or slides with, and a thrust that
changes with the slope by another share of the weight than sin θ. Omits: factors that leave all of
these possible, mostly those below two on ground of medium resistance.
"""

from __future__ import annotations

import math

import numpy as np

from slopewise.models.terrain.observation import GroundObservation
from slopewise.models.terrain.phases import Phase
from slopewise.models.vehicle import Vehicle

_MAX_GRIP = 1.2
"""Thrust over load that no ground transmits [1]: rubber on dry rock holds about 1."""
_MIN_TURNING = 0.05
"""Thrust over weight that no skid-steered turn is below [1]: wheels dragged over wet ice."""
_MIN_ROLLING = 0.004
"""f_r that no rubber wheel is below [1]."""
_MIN_COUNT = 5
"""Stretches behind a statement [1]: the median of fewer may be of one patch."""
_MIN_SLOPES = 12
_MIN_SLOPE_STD = 0.06
"""Stretches, and spread of sin θ among them [1], that a thrust on slopes is checked with: the
error of the pitch, 0.01 to 0.02, then lowers its slope by a tenth at most."""
_CERTAIN, _TOLERANCE = 3.0, 1.5
"""Standard errors, and factor, that the slope may be off [1]; idle current and ground that changes
with the slope explain smaller ones."""
_MAX_STRETCHES = 500
"""Latest stretches that are checked [1], some ten minutes of driving."""
_SENTENCE = (
    "the vehicle file cannot be right: {}; check mass, motor_torque_constant, gear_ratio, "
    "wheel_radius and idle_current"
)


class VehicleCheck:
    """Collects stretches of one vehicle; one thread."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Begin without stretches."""
        self._lever = vehicle.wheelbase / vehicle.track_width
        self._turns: list[float] = []
        self._straights: list[tuple[float, float]] = []

    def add(self, observation: GroundObservation) -> None:
        """Add a stretch that is not stuck."""
        f_r, turning = observation.measured.motion_resistance, observation.turning
        if turning.is_known:
            self._turns = [*self._turns[1 - _MAX_STRETCHES :], self._lever * turning.value]
        if observation.phase is Phase.STRAIGHT and f_r.is_known:
            uphill = -math.sin(observation.pitch) * math.copysign(1.0, observation.speed)
            row = (uphill, f_r.value + uphill)
            self._straights = [*self._straights[1 - _MAX_STRETCHES :], row]

    def message(self) -> str:
        """Sentence about a file that cannot be right, else empty."""
        turns, (uphill, thrust) = np.array(self._turns), np.array(self._straights or [(0, 0)]).T
        rolling = thrust - uphill
        for name, values, lowest in (
            ("turns", turns, _MIN_TURNING),
            ("straights", rolling, _MIN_ROLLING),
        ):
            if len(values) < _MIN_COUNT:
                continue
            median = float(np.median(values))
            if not lowest <= median <= _MAX_GRIP:
                limit = f"at least {lowest:g}" if median < lowest else f"at most {_MAX_GRIP:g}"
                fact = f"{name} take a thrust of {median:.2g} of the weight, ground allows {limit}"
                return _SENTENCE.format(fact)
        if len(uphill) >= _MIN_SLOPES and float(np.std(uphill)) > _MIN_SLOPE_STD:
            (factor, _), covariance = np.polyfit(uphill, thrust, 1, cov=True)
            error = math.sqrt(covariance[0, 0])
            margin = _CERTAIN * error
            if factor - margin > _TOLERANCE or factor + margin < 1.0 / _TOLERANCE:
                share = f"{factor:.2g} ± {error:.2g} of what its weight asks for"
                return _SENTENCE.format(f"on slopes the thrust changes by {share}")
        return ""
