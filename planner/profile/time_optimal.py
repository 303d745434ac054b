"""Time-optimal speed profile: one backward and one forward pass over v², all candidates at once.

With v² linear between stations, acceleration is constant on each segment, and the pointwise highest
feasible v² is reached by lowering the bound once from the end (what braking can still slow) and
once from the start (what the drive can reach). Braking follows the model inside the pass: it
depends on the slope and on the speed at which it begins.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY
from slopewise.planner.bounds.speed_bounds import SpeedBounds
from slopewise.planner.ground.braking_ground import BrakingGround
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.kernels.compiled import TILE, inlined, kernel, row_pass
from slopewise.planner.kernels.limits import PlanningLimits
from slopewise.planner.kernels.workspace import empty

_SURELY = 1.0 + 1e-9
"""Factor by which a required deceleration is rounded up [1]."""
_SLOW = 1e-3
"""Below this speed power is no matter [m/s]."""

_CRAWL = _SLOW * _SLOW


class ProfileProblem(NamedTuple):
    """What the fastest profiles of M candidates with up to N stations are made from.

    Attributes, (N, M) unless said otherwise:
        station: [m], increasing.
        speed_sq_max: highest v² [m²/s²].
        sin_grade: sine of the grade.
        lower_slope, lower_intercept: of the force that braking may count on [s/m], [1].
        slowest: below it the force does not change with speed [m/s].
        accel_max: by comfort, thrust and front axle load [m/s²].
        demand: share of the weight that holding the speed costs.
        start_sq: (M,) v² at the first station [m²/s²].
        decel: service deceleration, inf to brake as hard as the model allows [m/s²].
        specific_power: drive power / weight [m/s].
    """

    station: Floats
    speed_sq_max: Floats
    sin_grade: Floats
    lower_slope: Floats
    lower_intercept: Floats
    slowest: Floats
    accel_max: Floats
    demand: Floats
    start_sq: Floats
    decel: float
    specific_power: float


def profile_problem(
    profile: TerrainProfile,
    ground: BrakingGround,
    bounds: SpeedBounds,
    limits: PlanningLimits,
    start_sq: Floats,
) -> ProfileProblem:
    """The problem of a batch; ``start_sq`` is (M,) [m²/s²]."""
    return ProfileProblem(
        profile.station,
        bounds.speed_sq_max,
        profile.sin_grade,
        ground.lower_slope,
        ground.braking_intercept,
        ground.slowest,
        bounds.accel_max,
        bounds.demand,
        start_sq,
        limits.decel,
        limits.specific_power,
    )


class _TileRow(NamedTuple):
    """One row of a tile; v² is written."""

    station: Floats
    speed_sq_max: Floats
    sin_grade: Floats
    lower_slope: Floats
    lower_intercept: Floats
    slowest: Floats
    accel_max: Floats
    demand: Floats
    speed_sq: Floats


@inlined
def _row(p: ProfileProblem, speed_sq: Floats, k: int, first: int, end: int) -> _TileRow:
    return _TileRow(
        p.station[k, first:end],
        p.speed_sq_max[k, first:end],
        p.sin_grade[k, first:end],
        p.lower_slope[k, first:end],
        p.lower_intercept[k, first:end],
        p.slowest[k, first:end],
        p.accel_max[k, first:end],
        p.demand[k, first:end],
        speed_sq[k, first:end],
    )


def time_optimal_profile(problem: ProfileProblem) -> tuple[Floats, Floats]:
    """Fastest profile under the bounds.

    Returns:
        v² (N, M), and (M,) the highest v² at the first station from which the bounds can still be
        kept; below ``start_sq`` the profile begins there all the same [m²/s²].
    """
    speed_sq = empty(*problem.speed_sq_max.shape)
    reachable = np.empty(problem.speed_sq_max.shape[1])
    _time_optimal(problem, speed_sq, reachable)
    return speed_sq, reachable


@kernel
def _time_optimal(problem: ProfileProblem, speed_sq: Floats, reachable: Floats) -> None:
    candidates = speed_sq.shape[1]
    for first in range(0, candidates, TILE):
        end = min(first + TILE, candidates)
        _backward(problem, speed_sq, first, end)
        for j in range(first, end):
            reachable[j] = speed_sq[0, j]
            speed_sq[0, j] = min(speed_sq[0, j], problem.start_sq[j])
        _forward(problem, speed_sq, first, end)


@inlined
def _backward(problem: ProfileProblem, speed_sq: Floats, first: int, end: int) -> None:
    stations = speed_sq.shape[0]
    for j in range(first, end):
        speed_sq[stations - 1, j] = problem.speed_sq_max[stations - 1, j]
    for k in range(stations - 2, -1, -1):
        row = _row(problem, speed_sq, k, first, end)
        ahead = _row(problem, speed_sq, k + 1, first, end)
        if _slow_down(row, ahead, problem.decel) > 0:
            _brake(row, ahead)


@inlined
def _forward(problem: ProfileProblem, speed_sq: Floats, first: int, end: int) -> None:
    for k in range(speed_sq.shape[0] - 1):
        row = _row(problem, speed_sq, k, first, end)
        ahead = _row(problem, speed_sq, k + 1, first, end)
        if _speed_up(row, ahead, problem.specific_power) > 0:
            _power_up(row, ahead, problem.specific_power)


@row_pass
def _slow_down(row: _TileRow, ahead: _TileRow, decel: float) -> int:
    """One row back at service deceleration; counts where the brakes may be too weak for it."""
    count = 0
    wanted = decel / GRAVITY * _SURELY
    for j in range(row.station.shape[0]):
        top = row.speed_sq_max[j]
        ds = ahead.station[j] - row.station[j]
        row.speed_sq[j] = min(top, ahead.speed_sq[j] + 2.0 * ds * decel)
        slope = min(row.lower_slope[j], ahead.lower_slope[j])
        intercept = min(
            row.lower_intercept[j] + row.sin_grade[j], ahead.lower_intercept[j] + ahead.sin_grade[j]
        )
        spare = intercept - wanted
        weak = spare + slope * row.slowest[j] < 0.0
        weak |= (slope < 0.0) & (spare * spare < slope * slope * top)
        count += 1 if weak & (top > 0.0) else 0
    return count


@row_pass
def _brake(row: _TileRow, ahead: _TileRow) -> None:
    """Lower a row to what the brakes can slow down from.

    Their least force on a segment is at its slower end where force grows with speed, else at its
    faster end, which is the root of a quadratic: one square root serves either.
    """
    for j in range(row.station.shape[0]):
        ds = ahead.station[j] - row.station[j]
        after = ahead.speed_sq[j]
        slope = min(row.lower_slope[j], ahead.lower_slope[j])
        intercept = min(
            row.lower_intercept[j] + row.sin_grade[j], ahead.lower_intercept[j] + ahead.sin_grade[j]
        )
        half = GRAVITY * ds * slope
        reach = after + 2.0 * GRAVITY * ds * intercept
        root = np.sqrt(max(after if half > 0.0 else half * half + reach, 0.0))
        speed = max(root, row.slowest[j]) if half > 0.0 else half + root
        braked = reach + 2.0 * half * max(speed, row.slowest[j])
        braked = braked if half > 0.0 else min(speed * speed, braked)
        row.speed_sq[j] = min(row.speed_sq[j], max(braked, 0.0))


@row_pass
def _speed_up(row: _TileRow, ahead: _TileRow, specific_power: float) -> int:
    """One row on under acceleration; counts where power may not do for it.

    Power is scarcest at the segment's faster end.
    """
    count = 0
    for j in range(row.station.shape[0]):
        twice = 2.0 * (ahead.station[j] - row.station[j])
        here = row.speed_sq[j]
        top = min(ahead.speed_sq[j], here + twice * min(row.accel_max[j], ahead.accel_max[j]))
        ahead.speed_sq[j] = top
        needed = top - here + twice * GRAVITY * max(row.demand[j], ahead.demand[j])
        power = twice * GRAVITY * specific_power
        count += 1 if (needed > 0.0) & (needed * needed * top > power * power) else 0
    return count


@row_pass
def _power_up(row: _TileRow, ahead: _TileRow, specific_power: float) -> None:
    """Lower a row to what power can reach.

    The speed there is the root of a cubic, which Newton's steps approach from above; v² is the root
    of a concave function, so that the last step, on its tangent, ends at or below it. Holding the
    speed is always possible, because no bound is above what power sustains.
    """
    for j in range(row.station.shape[0]):
        twice = 2.0 * (ahead.station[j] - row.station[j])
        here, top = row.speed_sq[j], ahead.speed_sq[j]
        cost = twice * GRAVITY * max(row.demand[j], ahead.demand[j]) - here
        power = twice * GRAVITY * specific_power
        v = np.sqrt(max(top, _CRAWL))
        for _ in range(2):
            lacking = max(v * (v * v + cost) - power, 0.0)
            v -= lacking / max(3.0 * v * v + cost, _CRAWL)
            v = max(v, _SLOW)
        gain, reached = power / v, v * v
        lacking = max(reached + cost - gain, 0.0)
        reached -= lacking * reached / (reached + 0.5 * gain)
        ahead.speed_sq[j] = min(top, max(reached, here))


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
    for k in range(station.shape[0] - 1):
        for j in range(station.shape[1]):
            ds = station[k + 1, j] - station[k, j]
            both = np.sqrt(speed_sq[k, j]) + np.sqrt(speed_sq[k + 1, j])
            cost[j] += 2.0 * ds / both if both > 0.0 else penalty * ds
