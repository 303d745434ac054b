"""Highest speed from which the vehicle can still stop, where the stopping path has a closed form.

Nothing but the grade acts on the motion: the energy that the brakes take out from onset to the
target is an integral, summed once from the target back. The onset lies a dead time's way behind the
command, so each station looks for the place where the speed that the way allows and the speed that
the integral allows are one. Most stations need not look: they are slower for other reasons.

Source: Braking (7), (8), (12), as in :mod:`planner.bounds.stopping_path`.
"""

from __future__ import annotations

import numpy as np

from models.quantity import GRAVITY
from planner.bounds.stopping_path import onset_speed
from planner.kernels.compiled import Bools, Floats, Ints, inlined, kernel, row_pass
from planner.limiting import Limiting

_BLOCK = 128
"""Candidates worked on together: what is summed along their paths stays in the cache."""

_QUEUE = 512
"""Stations that wait to be solved together."""

_STOPPING_PATH = int(Limiting.STOPPING_PATH)
_CLEARLY = 1.0 + 1e-6
"""By how much v² must be free of the stopping path to be called free."""

# Rows of the queue: what is known of the segment in which the onset lies.
(
    _HERE, _DEAD, _LEFT, _RIGHT, _R_LEFT, _R_RIGHT, _START, _PER_LENGTH, _SPEED, _SPEED_RISE,
    _INTERCEPT, _INTERCEPT_RISE, _SPEED_SUM, _INTERCEPT_SUM, _SLOWEST, _COLUMNS,
) = range(16)  # fmt: skip


@kernel
def stopping_bound(
    station: Floats, grade: Floats, sin_grade: Floats, known: Bools, count: Ints,
    lower_slope: Floats, lower_intercept: Floats, dead_time: Floats, slowest: Floats,
    target: Floats, barrier: Ints, barrier_station: Ints, fastest: float, longest: float,
    speed_sq_max: Floats, limiting: Ints,
) -> None:  # fmt: skip
    """Lower ``speed_sq_max`` so that every stop ends before the target; −1 where none can.

    Args:
        station, grade, sin_grade, known: (N, M) terrain; count: (M,) stations.
        lower_slope, lower_intercept, dead_time, slowest: (N, M) ground.
        target: (M,) the vehicle must stand here [m].
        barrier, barrier_station: (M,) what bars the way, and the index of its first station.
        fastest: no bound is above this speed [m/s]; longest: nor any dead time above this [s].
        speed_sq_max, limiting: (N, M) bounds so far, lowered in place.
    """
    stations, candidates = station.shape
    width = min(_BLOCK, candidates)
    sums = np.zeros((3, stations, width))
    first_sums = np.empty((2, width))
    last = np.empty(width, np.int64)
    least = np.empty(width)
    near = np.empty(width, np.int64)
    pointer = np.empty(width, np.int64)
    queue = np.empty((_COLUMNS, _QUEUE + _BLOCK))
    place = np.empty((2, _QUEUE + _BLOCK), np.int64)
    for first in range(0, candidates, _BLOCK):
        end = min(first + _BLOCK, candidates)
        speed_sum, intercept_sum, onset = sums[0], sums[1], sums[2]
        # 1. From the last station before the target on.
        for j in range(first, end):
            t = j - first
            last[t] = _last_before(target[j], barrier_station[j], count[j], station, j)
            pointer[t] = last[t]
            first_sums[0, t], first_sums[1, t] = _to_target(
                j, last[t], target[j], count[j], station, grade, sin_grade, known,
                lower_slope, lower_intercept,
            )  # fmt: skip
        # 2. From every station before that; those before ``first_tight`` are free.
        first_tight = stations
        for k in range(stations - 1, -1, -1):
            after = min(k + 1, stations - 1)
            tight = _sum_up(
                k, last, first_sums[0], first_sums[1],
                station[k, first:end], grade[k, first:end], sin_grade[k, first:end],
                lower_slope[k, first:end], lower_intercept[k, first:end],
                station[after, first:end], grade[after, first:end], sin_grade[after, first:end],
                lower_slope[after, first:end], lower_intercept[after, first:end],
                slowest[k, first:end], fastest, speed_sum[after], intercept_sum[after],
                speed_sum[k], intercept_sum[k],
            )  # fmt: skip
            first_tight = k if tight > 0 else first_tight
        # 3. A dead time earlier, as long as the way driven in it reaches rows that are not free.
        waiting = 0
        reach = stations - 1
        rise = stations
        for k in range(stations - 1, -1, -1):
            while reach > k and _covers(
                reach - 1, last, station[k, first:end], station[reach - 1, first:end],
                longest * fastest,
            ):  # fmt: skip
                reach -= 1
            if reach < first_tight:
                break
            rises = _onsets(
                k, last, speed_sum[k], intercept_sum[k], slowest[k, first:end],
                onset[min(k + 1, stations - 1)], onset[k],
            )  # fmt: skip
            rise = k if rises > 0 else rise
            least[:] = onset[reach]
            if rise < reach:
                for i in range(k, reach):
                    _lower(onset[i], least)
            some = _sort_out(
                k, last, target[first:end], barrier[first:end], barrier_station[first:end],
                station[k, first:end], dead_time[k, first:end], station[reach, first:end],
                fastest, least, onset[k], speed_sq_max[k, first:end], limiting[k, first:end], near,
            )  # fmt: skip
            if some == 0:
                continue
            for t in range(end - first):
                if near[t] != 0:
                    _enqueue(
                        waiting, k, first + t, t, last[t], target[first + t], count[first + t],
                        station, sin_grade, known, lower_slope, lower_intercept, dead_time, slowest,
                        speed_sum, intercept_sum, onset, pointer, queue,
                    )  # fmt: skip
                    place[0, waiting], place[1, waiting] = k, first + t
                    waiting += 1
            if waiting >= _QUEUE:
                _solve(waiting, queue, place, speed_sq_max, limiting)
                waiting = 0
        _solve(waiting, queue, place, speed_sq_max, limiting)


@inlined
def _last_before(target: float, barred: int, count: int, station: Floats, j: int) -> int:
    """Index of the last station up to the target, 0 if all are beyond."""
    k = max(min(barred, count) - 1, 0)
    while k > 0 and station[k, j] > target:
        k -= 1
    return int(k)


@inlined
def _to_target(
    j: int, k: int, target: float, count: int, station: Floats, grade: Floats, sin_grade: Floats,
    known: Bools, lower_slope: Floats, lower_intercept: Floats,
) -> tuple[float, float]:  # fmt: skip
    """Sums over the segment in which the target lies, from its station k."""
    ds = max(min(target - station[k, j], 1e9), 0.0)
    nxt = min(k + 1, count - 1)
    length = station[nxt, j] - station[k, j]
    u = min(ds / length, 1.0) if length > 0.0 else 0.0
    seen = u if known[nxt, j] else 0.0
    turn = u * (grade[nxt, j] - grade[k, j])
    speed, rest, sine = lower_slope[k, j], lower_intercept[k, j], sin_grade[k, j]
    half = 0.5 * ds
    speed_sum = half * (2.0 * speed + seen * (lower_slope[nxt, j] - speed))
    intercept_sum = half * (2.0 * rest + seen * (lower_intercept[nxt, j] - rest))
    sine_sum = half * (2.0 * sine + seen * (sin_grade[nxt, j] - sine))
    return speed_sum, intercept_sum + sine_sum * (1.0 + turn * turn / 12.0)


@row_pass
def _sum_up(
    k: int, last: Ints, first_speed: Floats, first_intercept: Floats, station: Floats, grade:
    Floats, sin_grade: Floats, lower_slope: Floats, lower_intercept: Floats, station_2: Floats,
    grade_2: Floats, sin_grade_2: Floats, lower_slope_2: Floats, lower_intercept_2: Floats, slowest:
    Floats, fastest: float, speed_ahead: Floats, intercept_ahead: Floats, speed_sum: Floats,
    intercept_sum: Floats,
) -> int:  # fmt: skip
    """What the brakes take out from this row to the target.

    Returns for how many candidates that is not clearly enough to stop from the fastest speed.
    """
    tight = 0
    for t in range(station.shape[0]):
        half = 0.5 * (station_2[t] - station[t])
        turn = grade_2[t] - grade[t]
        # sin of a linear grade: trapezoid, with the next term of its expansion.
        sine = half * (sin_grade[t] + sin_grade_2[t]) * (1.0 + turn * turn * (1.0 / 12.0))
        speed = speed_ahead[t] + half * (lower_slope[t] + lower_slope_2[t])
        rest = intercept_ahead[t] + half * (lower_intercept[t] + lower_intercept_2[t]) + sine
        speed = speed if k < last[t] else first_speed[t]
        rest = rest if k < last[t] else first_intercept[t]
        speed_sum[t] = speed
        intercept_sum[t] = rest
        enough = 2.0 * GRAVITY * (max(fastest, slowest[t]) * speed + rest)
        tight += 1 if (enough < _CLEARLY * fastest * fastest) | (k >= last[t]) else 0
    return tight


@row_pass
def _onsets(
    k: int, last: Ints, speed_sum: Floats, intercept_sum: Floats, slowest: Floats,
    onset_ahead: Floats, onset: Floats,
) -> int:  # fmt: skip
    """Speed at onset in this row; returns for how many candidates it is higher in the row ahead."""
    rises = 0
    for t in range(onset.shape[0]):
        v = onset_speed(speed_sum[t], intercept_sum[t], slowest[t])
        v = v if k <= last[t] else 0.0
        rises += 1 if v < onset_ahead[t] else 0
        onset[t] = v
    return rises


@row_pass
def _covers(i: int, last: Ints, station: Floats, station_i: Floats, way: float) -> bool:
    """Does row i lie beyond the dead time's way of all candidates that reach so far?"""
    short = 0
    for t in range(station.shape[0]):
        short += 1 if (station_i[t] < station[t] + way) & (i <= last[t]) else 0
    return short == 0


@row_pass
def _lower(onset: Floats, least: Floats) -> None:
    for t in range(onset.shape[0]):
        least[t] = min(least[t], onset[t])


@row_pass
def _sort_out(
    k: int, last: Ints, target: Floats, barrier: Ints, barrier_station: Ints, station: Floats,
    dead_time: Floats, station_reach: Floats, fastest: float, least: Floats, onset: Floats,
    speed_sq_max: Floats, limiting: Ints, near: Ints,
) -> int:  # fmt: skip
    """Settle the candidates of a row that need no search; mark and count the others."""
    some = 0
    for t in range(station.shape[0]):
        here, dead, bound, label, end = (
            station[t], dead_time[t], speed_sq_max[t], limiting[t], barrier[t],
        )  # fmt: skip
        at_onset = onset[t] * onset[t]
        inside = k < barrier_station[t]
        beyond = inside & ((k > last[t]) | (target[t] <= here))
        # The least speed at onset on the dead time's way is high enough.
        free = station_reach[t] >= here + dead * fastest
        free = free & (least[t] * least[t] > _CLEARLY * bound)
        searching = inside & (dead > 0.0) & (not beyond) & (not free)
        near[t] = 1 if searching else 0
        some += near[t]
        at_once = inside & (dead <= 0.0) & (at_onset < bound)
        bound = at_onset if at_once else bound
        label = _STOPPING_PATH if at_once else label
        speed_sq_max[t] = -1.0 if beyond else bound
        limiting[t] = end if beyond else label
    return some


@inlined
def _enqueue(
    q: int, k: int, j: int, t: int, last: int, target: float, count: int,
    station: Floats, sin_grade: Floats, known: Bools, lower_slope: Floats, lower_intercept: Floats,
    dead_time: Floats, slowest: Floats, speed_sum: Floats, intercept_sum: Floats, onset: Floats,
    pointer: Ints, queue: Floats,
) -> None:  # fmt: skip
    """Find the segment [i, i + 1] in which the onset lies, and note what is needed of it."""
    here, dead = station[k, j], dead_time[k, j]
    i = min(pointer[t], last)
    while i > k and here + dead * onset[i, t] <= station[i, j]:
        i -= 1
    while i < last and here + dead * onset[i + 1, t] > station[i + 1, j]:
        i += 1
    pointer[t] = i
    left = station[i, j]
    right, fast_right = target, 0.0
    if i < last:
        right, fast_right = station[i + 1, j], onset[i + 1, t]
    nxt = min(i + 1, count - 1)
    length = station[nxt, j] - left
    rest = lower_intercept[i, j] + sin_grade[i, j]
    seen = known[nxt, j]
    queue[_HERE, q] = here
    queue[_DEAD, q] = dead
    queue[_LEFT, q] = left
    queue[_RIGHT, q] = right
    queue[_R_LEFT, q] = here + dead * onset[i, t] - left
    queue[_R_RIGHT, q] = here + dead * fast_right - right
    queue[_START, q] = left
    queue[_PER_LENGTH, q] = 1.0 / length if length > 0.0 else 0.0
    queue[_SPEED, q] = lower_slope[i, j]
    queue[_SPEED_RISE, q] = lower_slope[nxt, j] - lower_slope[i, j] if seen else 0.0
    queue[_INTERCEPT, q] = rest
    queue[_INTERCEPT_RISE, q] = lower_intercept[nxt, j] + sin_grade[nxt, j] - rest if seen else 0.0
    queue[_SPEED_SUM, q] = speed_sum[i, t]
    queue[_INTERCEPT_SUM, q] = intercept_sum[i, t]
    queue[_SLOWEST, q] = slowest[i, j]


@inlined
def _solve(waiting: int, queue: Floats, place: Ints, speed_sq_max: Floats, limiting: Ints) -> None:
    """Solve what waits, and lower the bounds where the stopping path is the tightest."""
    speed = np.empty(waiting)
    _onset_speeds(queue, speed)
    for q in range(waiting):
        k, j = place[0, q], place[1, q]
        if speed[q] * speed[q] < speed_sq_max[k, j]:
            speed_sq_max[k, j] = speed[q] * speed[q]
            limiting[k, j] = _STOPPING_PATH


@row_pass
def _onset_speeds(queue: Floats, speed: Floats) -> None:
    """Regula falsi on the place of onset; each iterate is itself a safe speed."""
    here, dead = queue[_HERE], queue[_DEAD]
    left, right, r_left, r_right = queue[_LEFT], queue[_RIGHT], queue[_R_LEFT], queue[_R_RIGHT]
    start, per_length = queue[_START], queue[_PER_LENGTH]
    speed_part, speed_rise = queue[_SPEED], queue[_SPEED_RISE]
    intercept_part, intercept_rise = queue[_INTERCEPT], queue[_INTERCEPT_RISE]
    speed_sum, intercept_sum, slowest = queue[_SPEED_SUM], queue[_INTERCEPT_SUM], queue[_SLOWEST]
    for q in range(speed.shape[0]):
        a, b, ra, rb = left[q], right[q], r_left[q], r_right[q]
        best = 0.0
        for _ in range(3):
            u = ra / (ra - rb) if ra > rb else 0.0
            p = a + u * (b - a)
            back = p - start[q]
            w = back * per_length[q]
            v = onset_speed(
                speed_sum[q] - 0.5 * back * (2.0 * speed_part[q] + w * speed_rise[q]),
                intercept_sum[q] - 0.5 * back * (2.0 * intercept_part[q] + w * intercept_rise[q]),
                slowest[q],
            )
            best = max(best, min(v, (p - here[q]) / dead[q]))
            residual = here[q] + dead[q] * v - p
            short = residual > 0.0
            a, ra = (p, residual) if short else (a, ra)
            b, rb = (b, rb) if short else (p, residual)
        speed[q] = best
