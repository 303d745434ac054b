"""Time-optimal speed profile: one backward and one forward pass over v², all candidates at once.

With v² linear between stations, acceleration is constant on each segment, and the pointwise highest
feasible v² is reached by lowering the bound once from the end (what braking can still slow) and
once from the start (what the drive can reach). Braking follows the model inside the pass: it
depends on the slope and on the speed at which it begins.
"""

from __future__ import annotations

import numpy as np

from models.quantity import GRAVITY
from planner.kernels.compiled import TILE, Floats, kernel, row_pass
from planner.kernels.limits import PlanningLimits
from planner.kernels.workspace import empty

_SURELY = 1.0 + 1e-9
_SLOW = 1e-3
"""Below this speed power is no matter [m/s]."""

_CRAWL = _SLOW * _SLOW


@kernel
def time_optimal(
    station: Floats, speed_sq_max: Floats, sin_grade: Floats, lower_slope: Floats,
    lower_intercept: Floats, slowest: Floats, accel_max: Floats, demand: Floats,
    start_sq: Floats, decel: float, specific_power: float,
    speed_sq: Floats, reachable_start_sq: Floats,
) -> None:  # fmt: skip
    """Fastest profile under the bounds, station-major.

    Args:
        station, speed_sq_max, sin_grade, lower_slope, lower_intercept, slowest: (N, M) from bounds
            and ground.
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
        speed_sq[stations - 1, first:end] = speed_sq_max[stations - 1, first:end]
        for k in range(stations - 2, -1, -1):
            weak = _slow_down(
                station[k, first:end], station[k + 1, first:end], speed_sq_max[k, first:end], decel,
                sin_grade[k, first:end], sin_grade[k + 1, first:end], lower_slope[k, first:end],
                lower_slope[k + 1, first:end], lower_intercept[k, first:end], lower_intercept[k + 1,
                first:end], slowest[k, first:end], speed_sq[k + 1, first:end], speed_sq[k,
                first:end],
            )  # fmt: skip
            if weak > 0:
                _brake(
                    station[k, first:end], station[k + 1, first:end], sin_grade[k, first:end],
                    sin_grade[k + 1, first:end], lower_slope[k, first:end], lower_slope[k + 1,
                    first:end], lower_intercept[k, first:end], lower_intercept[k + 1, first:end],
                    slowest[k, first:end], speed_sq[k + 1, first:end], speed_sq[k, first:end],
                )  # fmt: skip
        for j in range(first, end):
            reachable_start_sq[j] = speed_sq[0, j]
            speed_sq[0, j] = min(speed_sq[0, j], start_sq[j])
        for k in range(stations - 1):
            short = _speed_up(
                station[k, first:end], station[k + 1, first:end],
                accel_max[k, first:end], accel_max[k + 1, first:end],
                demand[k, first:end], demand[k + 1, first:end], specific_power,
                speed_sq[k, first:end], speed_sq[k + 1, first:end],
            )  # fmt: skip
            if short > 0:
                _power_up(
                    station[k, first:end], station[k + 1, first:end],
                    demand[k, first:end], demand[k + 1, first:end], specific_power,
                    speed_sq[k, first:end], speed_sq[k + 1, first:end],
                )  # fmt: skip


@row_pass
def _slow_down(
    station: Floats, station_2: Floats, speed_sq_max: Floats, decel: float,
    sin_grade: Floats, sin_grade_2: Floats, lower_slope: Floats, lower_slope_2: Floats,
    lower_intercept: Floats, lower_intercept_2: Floats, slowest: Floats,
    speed_sq_2: Floats, speed_sq: Floats,
) -> int:  # fmt: skip
    """One row back at service deceleration; counts where the brakes may be too weak for it."""
    count = 0
    wanted = decel / GRAVITY * _SURELY
    for j in range(station.shape[0]):
        top = speed_sq_max[j]
        ds = station_2[j] - station[j]
        speed_sq[j] = min(top, speed_sq_2[j] + 2.0 * ds * decel)
        speed_part = min(lower_slope[j], lower_slope_2[j])
        intercept_part = min(
            lower_intercept[j] + sin_grade[j], lower_intercept_2[j] + sin_grade_2[j]
        )
        spare = intercept_part - wanted
        weak = spare + speed_part * slowest[j] < 0.0
        weak |= (speed_part < 0.0) & (spare * spare < speed_part * speed_part * top)
        count += 1 if weak & (top > 0.0) else 0
    return count


@row_pass
def _brake(
    station: Floats, station_2: Floats, sin_grade: Floats, sin_grade_2: Floats,
    lower_slope: Floats, lower_slope_2: Floats, lower_intercept: Floats, lower_intercept_2: Floats,
    slowest: Floats, speed_sq_2: Floats, speed_sq: Floats,
) -> None:  # fmt: skip
    """Lower a row to what the brakes can slow down from.

    Their least force on a segment is at its slower end where force grows with speed, else at its
    faster end, which is the root of a quadratic: one square root serves either.
    """
    for j in range(station.shape[0]):
        ds = station_2[j] - station[j]
        after = speed_sq_2[j]
        speed_part = min(lower_slope[j], lower_slope_2[j])
        intercept_part = min(
            lower_intercept[j] + sin_grade[j], lower_intercept_2[j] + sin_grade_2[j]
        )
        half = GRAVITY * ds * speed_part
        reach = after + 2.0 * GRAVITY * ds * intercept_part
        root = np.sqrt(max(after if half > 0.0 else half * half + reach, 0.0))
        speed = max(root, slowest[j]) if half > 0.0 else half + root
        braked = reach + 2.0 * half * max(speed, slowest[j])
        braked = braked if half > 0.0 else min(speed * speed, braked)
        speed_sq[j] = min(speed_sq[j], max(braked, 0.0))


@row_pass
def _speed_up(
    station: Floats, station_2: Floats, accel_max: Floats, accel_max_2: Floats,
    demand: Floats, demand_2: Floats, specific_power: float,
    speed_sq: Floats, speed_sq_2: Floats,
) -> int:  # fmt: skip
    """One row on under acceleration; counts where power may not do for it.

    Power is scarcest at the segment's faster end.
    """
    count = 0
    for j in range(station.shape[0]):
        twice = 2.0 * (station_2[j] - station[j])
        here = speed_sq[j]
        top = min(speed_sq_2[j], here + twice * min(accel_max[j], accel_max_2[j]))
        speed_sq_2[j] = top
        needed = top - here + twice * GRAVITY * max(demand[j], demand_2[j])
        power = twice * GRAVITY * specific_power
        count += 1 if (needed > 0.0) & (needed * needed * top > power * power) else 0
    return count


@row_pass
def _power_up(
    station: Floats, station_2: Floats, demand: Floats, demand_2: Floats, specific_power: float,
    speed_sq: Floats, speed_sq_2: Floats,
) -> None:  # fmt: skip
    """Lower a row to what power can reach.

    The speed there is the root of a cubic, which Newton's steps approach from above; v² is the root
    of a concave function, so that the last step, on its tangent, ends at or below it. Holding the
    speed is always possible, because no bound is above what power sustains.
    """
    for j in range(station.shape[0]):
        twice = 2.0 * (station_2[j] - station[j])
        here, top = speed_sq[j], speed_sq_2[j]
        cost = twice * GRAVITY * max(demand[j], demand_2[j]) - here
        power = twice * GRAVITY * specific_power
        v = np.sqrt(max(top, _CRAWL))
        for _ in range(2):
            lacking = max(v * (v * v + cost) - power, 0.0)
            v -= lacking / max(3.0 * v * v + cost, _CRAWL)
            v = max(v, _SLOW)
        gain, reached = power / v, v * v
        lacking = max(reached + cost - gain, 0.0)
        reached -= lacking * reached / (reached + 0.5 * gain)
        speed_sq_2[j] = min(top, max(reached, here))


def time_optimal_profile(
    station: Floats,
    speed_sq_max: Floats,
    sin_grade: Floats,
    lower_slope: Floats,
    lower_intercept: Floats,
    slowest: Floats,
    accel_max: Floats,
    demand: Floats,
    start_sq: Floats,
    scalars: PlanningLimits,
    *,
    decel: float | None = None,
) -> tuple[Floats, Floats]:
    """:func:`time_optimal` into new arrays: v² (N, M), and the reachable v² at the start (M,)."""
    speed_sq = empty(*speed_sq_max.shape)
    reachable = np.empty(speed_sq_max.shape[1])
    time_optimal(
        station, speed_sq_max, sin_grade, lower_slope, lower_intercept, slowest, accel_max, demand,
        start_sq, scalars.decel if decel is None else decel, scalars.specific_power,
        speed_sq, reachable,
    )  # fmt: skip
    return speed_sq, reachable


def travel_cost(station: Floats, speed_sq: Floats, horizon_penalty: float) -> Floats:
    """Travel time plus a charge for each metre not reached, (M,) [s].

    Args:
        station: (N, M) [m].
        speed_sq: (N, M) v², linear between stations [m²/s²].
        horizon_penalty: time charged for each metre on which the vehicle does not move [s/m].
    """
    cost = np.zeros(station.shape[1])
    _add_times(station, speed_sq, horizon_penalty, cost)
    return cost


@kernel
def _add_times(station: Floats, speed_sq: Floats, penalty: float, cost: Floats) -> None:
    speed = np.sqrt(speed_sq[0])
    for k in range(station.shape[0] - 1):
        _add_time(station[k], station[k + 1], speed_sq[k + 1], penalty, speed, cost)


@row_pass
def _add_time(
    station: Floats, station_2: Floats, speed_sq_2: Floats, penalty: float,
    speed: Floats, cost: Floats,
) -> None:  # fmt: skip
    """One row on; ``speed`` is that of this row before and of the next one after."""
    for j in range(station.shape[0]):
        ds = station_2[j] - station[j]
        speed_2 = np.sqrt(speed_sq_2[j])
        both = speed[j] + speed_2
        cost[j] += 2.0 * ds / both if both > 0.0 else penalty * ds
        speed[j] = speed_2
