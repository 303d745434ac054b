"""Problem of smoothing: a candidate, its time-optimal profile, and the jerk allowed."""

from __future__ import annotations

from dataclasses import dataclass

from slopewise.models.arrays import Floats


@dataclass(frozen=True, slots=True)
class SmoothingProblem:
    """One candidate; N stations.

    Attributes:
        ds: (N − 1,) segment lengths [m], > 0.
        speed_sq_max: (N,) bound [m²/s²]; the time-optimal profile, above which nothing is feasible.
        accel_max, decel_max: (N − 1,) [m/s²], >= 0, each valid for every v² up to the bound.
        jerk: [m/s³].
        start_accel: acceleration before the first segment [m/s²], None if it does not matter.
    """

    ds: Floats
    speed_sq_max: Floats
    accel_max: Floats
    decel_max: Floats
    jerk: float
    start_accel: float | None = None
