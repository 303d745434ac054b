"""The quadratic program of smoothing, as rows over three neighbouring stations each.

The time in which the acceleration changes, from the middle of one segment to that of the next, is
convex in v². Its tangent never exceeds it, so a limit written with the tangent is on the safe side
wherever the answer ends up, and exact where it touches.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.planner.kernels.compiled import inlined, kernel

REST = 1e-9
"""v² up to this is rest [m²/s²]."""

SLOWEST = 0.15
"""Tangents are taken at this speed or above [m/s]; below it they would be vertical."""

TIGHTER = 1.5e-4
"""Limits are tightened by more than the solvers' tolerance, so that they hold exactly."""

FEWEST = 3
"""Stations that a program has at least."""

_KINDS = 6
"""Rows for each station."""

_ROUNDS = 6
"""In which the time for a segment and the speed at its end become one another's."""


@inlined
def mid_time(
    a: float, b: float, c: float, ds: float, ds_2: float
) -> tuple[float, float, float, float]:
    """Tangent of the time from the middle of one segment to that of the next.

    Args:
        a, b, c: v² at the ends of both segments, around which it is taken [m²/s²].
        ds, ds_2: their lengths [m].

    Returns:
        Its value where all v² are 0 [s], and its derivatives over the three v² [s³/m²].
    """
    u, v, w = (
        max(np.sqrt(max(a, 0.0)), SLOWEST),
        max(np.sqrt(max(b, 0.0)), SLOWEST),
        max(np.sqrt(max(c, 0.0)), SLOWEST),
    )
    time, time_2 = ds / (u + v), ds_2 / (v + w)
    per_sum, per_sum_2 = -time / (u + v), -time_2 / (v + w)
    over_a, over_b, over_c = 0.5 * per_sum / u, 0.5 * (per_sum + per_sum_2) / v, 0.5 * per_sum_2 / w
    value = time + time_2 - (over_a * u * u + over_b * v * v + over_c * w * w)
    return value, over_a, over_b, over_c


@kernel
def reachable(ds: Floats, top: Floats, jerk: float, start_accel: float) -> Floats:
    """A profile, lowered to where the acceleration rises from its first value as fast as it may.

    Args:
        ds: (N − 1,) segment lengths [m]; top: (N,) the profile's v² [m²/s²].
        jerk: [m/s³]; start_accel: before the first segment, NaN if it does not matter [m/s²].
    """
    speed_sq = top.copy()
    if np.isnan(start_accel) or top[0] <= REST:
        return speed_sq
    before, accel = top[0], start_accel + jerk * ds[0] / np.sqrt(top[0])
    taken = 0.0
    for k in range(ds.shape[0]):
        after, last_taken, last_accel = before, taken, accel
        for _ in range(_ROUNDS):
            taken = 2.0 * ds[k] / (np.sqrt(before) + np.sqrt(after))
            if k > 0:
                accel = last_accel + 0.5 * jerk * (last_taken + taken)
            after = max(before + 2.0 * accel * ds[k], SLOWEST * SLOWEST)
        if after >= speed_sq[k + 1]:
            break
        speed_sq[k + 1] = before = after
    return speed_sq


@kernel
def program(
    ds: Floats,
    top: Floats,
    accel_max: Floats,
    decel_max: Floats,
    jerk: float,
    start_accel: float,
    around: Floats,
) -> tuple[Bools, Floats, Floats]:
    """The rows a · x[k] + b · x[k + 1] + c · x[k + 2] <= limit.

    Six kinds: v² at a station at most and at least, acceleration along a segment at most and at
    least, and how much more and less it is in the next one.

    Args:
        ds, top, accel_max, decel_max, jerk, start_accel: of the smoothing problem, N >= FEWEST
            stations; NaN for a start acceleration that does not matter.
        around: (N,) v² at which the tangents are taken [m²/s²].

    Returns:
        (N,) stations whose v² is given; (6, 3, N) a, b, c, all 0 in rows that there are not;
        (6, N) limits.
    """
    n = top.shape[0]
    fixed, rows, limit = np.empty(n, np.bool_), np.zeros((_KINDS, 3, n)), np.ones((_KINDS, n))
    for k in range(n):
        fixed[k] = k == 0 or top[k] <= REST
        if not fixed[k]:
            rows[0, 0, k], limit[0, k] = 1.0, max(top[k] - TIGHTER, 0.0)
            rows[1, 0, k], limit[1, k] = -1.0, 0.0
    for k in range(n - 1):
        half = 0.5 / ds[k]
        # Stations at rest stay there, and nothing is asked of the segments between them.
        if top[k] <= REST and top[k + 1] <= REST:
            continue
        most, least = accel_max[k] - TIGHTER, -(decel_max[k] - TIGHTER)
        if k == 0 and not np.isnan(start_accel):
            reach = jerk * ds[0] / max(np.sqrt(top[0]), 0.05)
            most, least = min(most, start_accel + reach), max(least, start_accel - reach)
        rows[2, 0, k], rows[2, 1, k], limit[2, k] = -half, half, most
        rows[3, 0, k], rows[3, 1, k], limit[3, k] = half, -half, -least
        if k == n - 2 or (top[k + 1] <= REST and top[k + 2] <= REST):
            continue
        half_2 = 0.5 / ds[k + 1]
        time, t0, t1, t2 = mid_time(around[k], around[k + 1], around[k + 2], ds[k], ds[k + 1])
        t0, t1, t2 = jerk * t0, jerk * t1, jerk * t2
        limit[4, k] = limit[5, k] = jerk * time - 2.0 * TIGHTER
        rows[4, 0, k], rows[4, 1, k], rows[4, 2, k] = half - t0, -half - half_2 - t1, half_2 - t2
        rows[5, 0, k], rows[5, 1, k], rows[5, 2, k] = -half - t0, half + half_2 - t1, -half_2 - t2
    return fixed, rows, limit
