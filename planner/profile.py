"""Time-optimal speed profile: one backward and one forward pass over v², all candidates at once.

With v² linear between stations, acceleration is constant on each segment, and the pointwise highest
feasible v² is reached by lowering the bound once from the end (what braking can still slow) and
once from the start (what the drive can reach). Braking follows the model inside the pass: it
depends on the slope and on the speed at which it begins.
"""

from __future__ import annotations

import numpy as np

from models.quantity import GRAVITY
from planner.bounds import Numbers
from planner.compiled import TILE, Floats, kernel


@kernel
def time_optimal(
    station: Floats, speed_sq_max: Floats, sin_grade: Floats, weak_speed: Floats,
    weak_rest: Floats, slowest: Floats, accel_max: Floats, demand: Floats,
    start_sq: Floats, decel: float, specific_power: float,
    speed_sq: Floats, reachable_start_sq: Floats,
) -> None:  # fmt: skip
    """Fastest profile under the bounds, station-major.

    Args:
        station, speed_sq_max, sin_grade, weak_speed, weak_rest, slowest: (N, M) from bounds and
            ground.
        accel_max: (N, M) highest acceleration by comfort, thrust and front axle load [m/s²].
        demand: (N, M) share of the weight that holding the speed costs.
        start_sq: (M,) v² at the first station.
        decel: service deceleration [m/s²], inf to brake as hard as the model allows.
        specific_power: drive power / weight [m/s].
        speed_sq: (N, M) out, v² [m²/s²].
        reachable_start_sq: (M,) out, highest v² at the first station from which the bounds can
            still be kept; below ``start_sq`` the profile begins there all the same.
    """
    stations, candidates = speed_sq_max.shape
    for first in range(0, candidates, TILE):
        end = min(first + TILE, candidates)
        for j in range(first, end):
            speed_sq[stations - 1, j] = speed_sq_max[stations - 1, j]
        for k in range(stations - 2, -1, -1):
            for j in range(first, end):
                ds = station[k + 1, j] - station[k, j]
                after = speed_sq[k + 1, j]
                speed_part = min(weak_speed[k, j], weak_speed[k + 1, j])
                rest_part = min(
                    weak_rest[k, j] + sin_grade[k, j], weak_rest[k + 1, j] + sin_grade[k + 1, j]
                )
                # The brakes' least force on the segment: at its slower end where force grows with
                # speed, else at its faster end, which is the root of a quadratic.
                slow = slowest[k, j]
                growing = max(speed_part, 0.0) * max(np.sqrt(after), slow)
                half = GRAVITY * ds * min(speed_part, 0.0)
                reach = after + 2.0 * GRAVITY * ds * (rest_part + growing)
                speed = half + np.sqrt(max(half * half + reach, 0.0))
                braked = min(speed * speed, reach + 2.0 * slow * half)
                braked = max(braked, 0.0)
                comfortable = after + 2.0 * ds * decel
                speed_sq[k, j] = min(speed_sq_max[k, j], min(braked, comfortable))
        for j in range(first, end):
            reachable_start_sq[j] = speed_sq[0, j]
            speed_sq[0, j] = min(speed_sq[0, j], start_sq[j])
        for k in range(stations - 1):
            for j in range(first, end):
                ds = station[k + 1, j] - station[k, j]
                here = speed_sq[k, j]
                accel = min(accel_max[k, j], accel_max[k + 1, j])
                top = min(speed_sq[k + 1, j], here + 2.0 * ds * accel)
                # Power at the segment's end, where it is scarcest; holding speed is always possible
                # because no bound is above what power sustains.
                hold = GRAVITY * max(demand[k, j], demand[k + 1, j])
                powered = GRAVITY * specific_power / np.sqrt(max(top, 1e-6)) - hold
                speed_sq[k + 1, j] = min(top, here + 2.0 * ds * max(powered, 0.0))


def time_optimal_profile(
    station: Floats,
    speed_sq_max: Floats,
    sin_grade: Floats,
    weak_speed: Floats,
    weak_rest: Floats,
    slowest: Floats,
    accel_max: Floats,
    demand: Floats,
    start_sq: Floats,
    scalars: Numbers,
    *,
    decel: float | None = None,
) -> tuple[Floats, Floats]:
    """:func:`time_optimal` into new arrays: v² (N, M), and the reachable v² at the start (M,)."""
    speed_sq = np.empty_like(speed_sq_max)
    reachable = np.empty(speed_sq_max.shape[1])
    time_optimal(
        station, speed_sq_max, sin_grade, weak_speed, weak_rest, slowest, accel_max, demand,
        start_sq, scalars.decel if decel is None else decel, scalars.specific_power,
        speed_sq, reachable,
    )  # fmt: skip
    return speed_sq, reachable
