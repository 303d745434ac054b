"""Highest speed from which the vehicle can still stop, where the stopping path has a closed form.

Nothing but the grade acts on the motion: the energy that the brakes take out from onset to the
target is an integral, summed once from the target back. The onset lies a dead time behind the
command, so each station looks for the place where the speed that the distance up to it allows and
the speed that the integral allows are one. Most stations need not look: they are slower for other
reasons.

Source: Braking (7), (8), (12), as in :mod:`slopewise.planner.bounds.stopping_path`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.quantity import GRAVITY
from slopewise.planner.bounds.pointwise import PointwiseBounds
from slopewise.planner.bounds.stopping_path import StopProblem, onset_speed
from slopewise.planner.kernels.compiled import inlined, kernel, row_pass
from slopewise.planner.limiting import Limiting

_BLOCK = 128
"""Candidates worked on together: what is summed along their paths stays in the cache."""

_QUEUE = 512
"""Stations that wait to be solved together."""

_STOPPING_PATH = int(Limiting.STOPPING_PATH)
_CLEARLY = 1.0 + 1e-6
"""By how much v² must be free of the stopping path to be called free."""

# Rows of the queue: what is known of the segment in which the onset lies, and the answer.
(
    _HERE,
    _DEAD,
    _LEFT,
    _RIGHT,
    _R_LEFT,
    _R_RIGHT,
    _PER_LENGTH,
    _SLOPE,
    _SLOPE_RISE,
    _INTERCEPT,
    _INTERCEPT_RISE,
    _SLOPE_SUM,
    _INTERCEPT_SUM,
    _SLOWEST,
    _ANSWER,
    _COLUMNS,
) = range(16)


class _Block(NamedTuple):
    """Candidates worked on together: up to B of them, from ``first`` on.

    Attributes:
        first, end: which candidates.
        last: (B,) last station up to the target.
        first_slope, first_intercept: (B,) sums from there to the target.
        slope_sum, intercept_sum: (N, B) what the brakes take out from each station to the target.
        onset: (N, B) speed at onset that leaves nothing of it [m/s].
        least: (B,) least of these speeds on the distance of the dead time [m/s].
        near: (B,) 1 where a search is needed.
        segment: (B,) where the last search ended.
    """

    first: int
    end: int
    last: Ints
    first_slope: Floats
    first_intercept: Floats
    slope_sum: Floats
    intercept_sum: Floats
    onset: Floats
    least: Floats
    near: Ints
    segment: Ints


class _BlockRow(NamedTuple):
    """One row of a block: terrain and the lower bound of the force."""

    station: Floats
    grade: Floats
    sin_grade: Floats
    lower_slope: Floats
    lower_intercept: Floats
    slowest: Floats
    dead_time: Floats


@inlined
def _row(k: int, problem: StopProblem, block: _Block) -> _BlockRow:
    terrain, forces, first, end = problem.terrain, problem.forces, block.first, block.end
    return _BlockRow(
        terrain.station[k, first:end],
        terrain.grade[k, first:end],
        terrain.sin_grade[k, first:end],
        forces.lower_slope[k, first:end],
        forces.lower_intercept[k, first:end],
        forces.slowest[k, first:end],
        forces.dead_time[k, first:end],
    )


@kernel
def stopping_bound(
    problem: StopProblem, fastest: float, longest: float, bounds: PointwiseBounds
) -> None:
    """Lower bounds so that every stop ends before the target; −1 where none can.

    Args:
        problem: terrain, forces and targets.
        fastest: no bound is above this speed [m/s]; longest: nor any dead time above this [s].
        bounds: v² and its labels are lowered in place, barriers are read.
    """
    stations, candidates = problem.terrain.station.shape
    width = min(_BLOCK, candidates)
    floats, ints = np.zeros((3, stations, width)), np.empty((3, width), np.int64)
    lines = np.empty((3, width))
    queue = np.empty((_COLUMNS, _QUEUE + _BLOCK))
    place = np.empty((2, _QUEUE + _BLOCK), np.int64)
    for first in range(0, candidates, _BLOCK):
        block = _Block(
            first,
            min(first + _BLOCK, candidates),
            ints[0],
            lines[0],
            lines[1],
            floats[0],
            floats[1],
            floats[2],
            lines[2],
            ints[1],
            ints[2],
        )
        first_tight = _sum_block(problem, block, bounds.barrier_station, fastest)
        _bound_block(problem, block, (fastest, longest, first_tight), bounds, queue, place)


@inlined
def _sum_block(problem: StopProblem, block: _Block, barrier_station: Ints, fastest: float) -> int:
    """Sums from every station to the target; the stations before what it returns are free."""
    for j in range(block.first, block.end):
        t = j - block.first
        block.last[t] = _last_before(j, problem, barrier_station[j])
        block.segment[t] = block.last[t]
        block.first_slope[t], block.first_intercept[t] = _to_target(j, block.last[t], problem)
    stations = problem.terrain.station.shape[0]
    first_tight = stations
    for k in range(stations - 1, -1, -1):
        after = min(k + 1, stations - 1)
        row, ahead = _row(k, problem, block), _row(after, problem, block)
        tight = _sum_up(k, after, row, ahead, block, fastest)
        first_tight = k if tight > 0 else first_tight
    return int(first_tight)


@inlined
def _bound_block(
    problem: StopProblem,
    block: _Block,
    limits: tuple[float, float, int],
    bounds: PointwiseBounds,
    queue: Floats,
    place: Ints,
) -> None:
    """A dead time earlier, as long as the distance driven in it reaches rows that are not free."""
    fastest, longest, first_tight = limits
    station = problem.terrain.station
    stations = station.shape[0]
    first, end = block.first, block.end
    waiting = 0
    reach = stations - 1
    rise = stations
    for k in range(stations - 1, -1, -1):
        row = _row(k, problem, block)
        while reach > k and _covers(
            reach - 1, row.station, station[reach - 1, first:end], block.last, longest * fastest
        ):
            reach -= 1
        if reach < first_tight:
            break
        rise = k if _onsets(k, min(k + 1, stations - 1), row.slowest, block) > 0 else rise
        for t in range(end - first):
            block.least[t] = block.onset[reach, t]
        if rise < reach:
            for i in range(k, reach):
                _lower(block.onset[i], block.least)
        if (
            _sort_out(
                k,
                _SettleRow(
                    row.station,
                    row.dead_time,
                    station[reach, first:end],
                    problem.target[first:end],
                    bounds.barrier[first:end],
                    bounds.barrier_station[first:end],
                    bounds.speed_sq_max[k, first:end],
                    bounds.limiting[k, first:end],
                ),
                block,
                fastest,
            )
            == 0
        ):
            continue
        for t in range(end - first):
            if block.near[t] != 0:
                _enqueue(waiting, k, t, problem, block, queue)
                place[0, waiting], place[1, waiting] = k, first + t
                waiting += 1
        if waiting >= _QUEUE:
            _solve(waiting, queue, place, bounds)
            waiting = 0
    _solve(waiting, queue, place, bounds)


@inlined
def _last_before(j: int, problem: StopProblem, barred: int) -> int:
    """Index of the last station up to the target, 0 if all are beyond."""
    k = max(min(barred, problem.terrain.counts[j]) - 1, 0)
    while k > 0 and problem.terrain.station[k, j] > problem.target[j]:
        k -= 1
    return int(k)


@inlined
def _to_target(j: int, k: int, problem: StopProblem) -> tuple[float, float]:
    """Sums over the segment in which the target lies, from its station k."""
    terrain, forces = problem.terrain, problem.forces
    station, sin_grade = terrain.station, terrain.sin_grade
    ds = max(min(problem.target[j] - station[k, j], 1e9), 0.0)
    nxt = min(k + 1, terrain.counts[j] - 1)
    length = station[nxt, j] - station[k, j]
    u = min(ds / length, 1.0) if length > 0.0 else 0.0
    seen = u if terrain.known[nxt, j] else 0.0
    turn = u * (terrain.grade[nxt, j] - terrain.grade[k, j])
    slope, intercept = forces.lower_slope[k, j], forces.lower_intercept[k, j]
    sine = sin_grade[k, j]
    half = 0.5 * ds
    slope_sum = half * (2.0 * slope + seen * (forces.lower_slope[nxt, j] - slope))
    intercept_sum = half * (2.0 * intercept + seen * (forces.lower_intercept[nxt, j] - intercept))
    sine_sum = half * (2.0 * sine + seen * (sin_grade[nxt, j] - sine))
    falls = sine_sum * (1.0 + turn * turn / 12.0) - problem.height
    return slope_sum, intercept_sum + falls


@row_pass
def _sum_up(
    k: int, after: int, row: _BlockRow, ahead: _BlockRow, block: _Block, fastest: float
) -> int:
    """What the brakes take out from row k to the target.

    Returns for how many candidates that is not clearly enough to stop from the fastest speed.
    """
    slope_sum, slope_ahead = block.slope_sum[k], block.slope_sum[after]
    intercept_sum, intercept_ahead = block.intercept_sum[k], block.intercept_sum[after]
    last, first_slope, first_intercept = block.last, block.first_slope, block.first_intercept
    tight = 0
    for t in range(row.station.shape[0]):
        half = 0.5 * (ahead.station[t] - row.station[t])
        turn = ahead.grade[t] - row.grade[t]
        # sin of a linear grade: trapezoid, with the next term of its expansion.
        sine = half * (row.sin_grade[t] + ahead.sin_grade[t]) * (1.0 + turn * turn * (1.0 / 12.0))
        slope = slope_ahead[t] + half * (row.lower_slope[t] + ahead.lower_slope[t])
        forces = half * (row.lower_intercept[t] + ahead.lower_intercept[t])
        intercept = intercept_ahead[t] + forces + sine
        slope = slope if k < last[t] else first_slope[t]
        intercept = intercept if k < last[t] else first_intercept[t]
        slope_sum[t] = slope
        intercept_sum[t] = intercept
        enough = 2.0 * GRAVITY * (max(fastest, row.slowest[t]) * slope + intercept)
        tight += 1 if (enough < _CLEARLY * fastest * fastest) | (k >= last[t]) else 0
    return tight


@row_pass
def _onsets(k: int, after: int, slowest: Floats, block: _Block) -> int:
    """Speed at onset in row k; returns for how many candidates it is higher in the row ahead."""
    slope_sum, intercept_sum, last = block.slope_sum[k], block.intercept_sum[k], block.last
    onset, onset_ahead = block.onset[k], block.onset[after]
    rises = 0
    for t in range(slowest.shape[0]):
        v = onset_speed(slope_sum[t], intercept_sum[t], slowest[t])
        v = v if k <= last[t] else 0.0
        rises += 1 if v < onset_ahead[t] else 0
        onset[t] = v
    return rises


@row_pass
def _covers(i: int, station: Floats, station_i: Floats, last: Ints, distance: float) -> bool:
    """Does row i lie beyond this distance for all candidates that reach so far?"""
    short = 0
    for t in range(station.shape[0]):
        short += 1 if (station_i[t] < station[t] + distance) & (i <= last[t]) else 0
    return short == 0


@row_pass
def _lower(onset: Floats, least: Floats) -> None:
    for t in range(onset.shape[0]):
        least[t] = min(least[t], onset[t])


class _SettleRow(NamedTuple):
    """One row of a block as :func:`_sort_out` sees it; v² and its labels are written."""

    station: Floats
    dead_time: Floats
    station_reach: Floats
    target: Floats
    barrier: Ints
    barrier_station: Ints
    speed_sq_max: Floats
    limiting: Ints


@row_pass
def _sort_out(k: int, row: _SettleRow, block: _Block, fastest: float) -> int:
    """Settle the candidates of a row that need no search; mark and count the others."""
    onset, last, least, near = block.onset[k], block.last, block.least, block.near
    some = 0
    for t in range(row.station.shape[0]):
        here, dead, bound = row.station[t], row.dead_time[t], row.speed_sq_max[t]
        label, end = row.limiting[t], row.barrier[t]
        at_onset = onset[t] * onset[t]
        inside = k < row.barrier_station[t]
        beyond = inside & ((k > last[t]) | (row.target[t] <= here))
        # The least speed at onset on the distance of the dead time is high enough.
        free = row.station_reach[t] >= here + dead * fastest
        free = free & (least[t] * least[t] > _CLEARLY * bound)
        searching = inside & (dead > 0.0) & (not beyond) & (not free)
        near[t] = 1 if searching else 0
        some += near[t]
        at_once = inside & (dead <= 0.0) & (at_onset < bound)
        bound = at_onset if at_once else bound
        label = _STOPPING_PATH if at_once else label
        row.speed_sq_max[t] = -1.0 if beyond else bound
        row.limiting[t] = end if beyond else label
    return some


@inlined
def _enqueue(q: int, k: int, t: int, problem: StopProblem, block: _Block, queue: Floats) -> None:
    """Find the segment [i, i + 1] in which the onset lies, and note what is needed of it."""
    terrain, forces, onset = problem.terrain, problem.forces, block.onset
    station, sin_grade, lower_slope = terrain.station, terrain.sin_grade, forces.lower_slope
    lower_intercept = forces.lower_intercept
    j, last = block.first + t, block.last[t]
    here, dead = station[k, j], forces.dead_time[k, j]
    i = min(block.segment[t], last)
    while i > k and here + dead * onset[i, t] <= station[i, j]:
        i -= 1
    while i < last and here + dead * onset[i + 1, t] > station[i + 1, j]:
        i += 1
    block.segment[t] = i
    left = station[i, j]
    right, fast_right = problem.target[j], 0.0
    if i < last:
        right, fast_right = station[i + 1, j], onset[i + 1, t]
    nxt = min(i + 1, terrain.counts[j] - 1)
    length = station[nxt, j] - left
    intercept = lower_intercept[i, j] + sin_grade[i, j]
    rise = lower_intercept[nxt, j] + sin_grade[nxt, j] - intercept
    seen = terrain.known[nxt, j]
    queue[_HERE, q] = here
    queue[_DEAD, q] = dead
    queue[_LEFT, q] = left
    queue[_RIGHT, q] = right
    queue[_R_LEFT, q] = here + dead * onset[i, t] - left
    queue[_R_RIGHT, q] = here + dead * fast_right - right
    queue[_PER_LENGTH, q] = 1.0 / length if length > 0.0 else 0.0
    queue[_SLOPE, q] = lower_slope[i, j]
    queue[_SLOPE_RISE, q] = lower_slope[nxt, j] - lower_slope[i, j] if seen else 0.0
    queue[_INTERCEPT, q] = intercept
    queue[_INTERCEPT_RISE, q] = rise if seen else 0.0
    queue[_SLOPE_SUM, q] = block.slope_sum[i, t]
    queue[_INTERCEPT_SUM, q] = block.intercept_sum[i, t]
    queue[_SLOWEST, q] = forces.slowest[i, j]


@inlined
def _solve(waiting: int, queue: Floats, place: Ints, bounds: PointwiseBounds) -> None:
    """Solve what waits, and lower the bounds where the stopping path is the tightest."""
    speed = queue[_ANSWER, :waiting]
    _onset_speeds(queue, speed)
    for q in range(waiting):
        k, j = place[0, q], place[1, q]
        if speed[q] * speed[q] < bounds.speed_sq_max[k, j]:
            bounds.speed_sq_max[k, j] = speed[q] * speed[q]
            bounds.limiting[k, j] = _STOPPING_PATH


@row_pass
def _onset_speeds(queue: Floats, speed: Floats) -> None:
    """Regula falsi on the place of onset; each iterate is itself a safe speed."""
    here, dead = queue[_HERE], queue[_DEAD]
    left, right, r_left, r_right = queue[_LEFT], queue[_RIGHT], queue[_R_LEFT], queue[_R_RIGHT]
    per_length, slowest = queue[_PER_LENGTH], queue[_SLOWEST]
    slope, slope_rise, slope_sum = queue[_SLOPE], queue[_SLOPE_RISE], queue[_SLOPE_SUM]
    intercept, intercept_rise = queue[_INTERCEPT], queue[_INTERCEPT_RISE]
    intercept_sum = queue[_INTERCEPT_SUM]
    for q in range(speed.shape[0]):
        a, b, ra, rb = left[q], right[q], r_left[q], r_right[q]
        best = 0.0
        for _ in range(3):
            u = ra / (ra - rb) if ra > rb else 0.0
            p = a + u * (b - a)
            back = p - left[q]
            w = back * per_length[q]
            v = onset_speed(
                slope_sum[q] - 0.5 * back * (2.0 * slope[q] + w * slope_rise[q]),
                intercept_sum[q] - 0.5 * back * (2.0 * intercept[q] + w * intercept_rise[q]),
                slowest[q],
            )
            best = max(best, min(v, (p - here[q]) / dead[q]))
            residual = here[q] + dead[q] * v - p
            short = residual > 0.0
            a, ra = (p, residual) if short else (a, ra)
            b, rb = (b, rb) if short else (p, residual)
        speed[q] = best
