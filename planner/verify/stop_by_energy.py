"""Emergency stops of which brakes and grade alone decide: where they end, and the least loads.

What the brakes take out is summed once along the path, exactly for a grade that is linear between
stations; a stop ends where the sum has taken all of its energy. This is the judge's own writing of
a stop: sums of sines of angles from the first station on, and the end of a given stop, where the
bound (:mod:`slopewise.planner.bounds.stopping_path`) sums backwards and looks for a speed. For
plans on which no effect acts on the motion; :mod:`slopewise.planner.verify.stop_in_time` is for the
others.

Source: Braking (7), (8), (12), with v dv = −a(θ(s), v_i) ds; the dead time at held speed first.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.quantity import GRAVITY
from slopewise.planner.kernels.compiled import inlined
from slopewise.planner.verify.track import StopCommand, Survey, Track, at, segment

_LONGEST = 1e3
"""A stop longer than this is called no stop [m]."""


Shares = tuple[float, float, float]
"""Of the level static loads: rear axle, lighter side, lightest wheel."""


@inlined
def work_up_to(track: Track, survey: Survey, s: float, i: int, v_i: float) -> float:
    """What full braking takes out from the first station to s in segment i, over m g [m].

    Beyond the last station the ground stays as it was there.
    """
    station = track.station
    ds = station[i + 1] - station[i]
    u = (s - station[i]) / ds
    if u > 1.0:
        force = v_i * track.lower_slope[i + 1] + track.lower_intercept[i + 1] + survey.sine[i + 1]
        whole = v_i * survey.slope_work[i + 1] + survey.intercept_work[i + 1]
        return float(whole + (s - station[i + 1]) * force)
    first = v_i * track.lower_slope[i] + track.lower_intercept[i] + survey.sine[i]
    second = v_i * track.lower_slope[i + 1] + track.lower_intercept[i + 1] + survey.sine[i + 1]
    before = v_i * survey.slope_work[i] + survey.intercept_work[i]
    gain = v_i * survey.slope_work[i + 1] + survey.intercept_work[i + 1] - before
    # The cubic with the sums and the forces of both stations.
    first, second = ds * first, ds * second
    rise = first + second - 2.0 * gain
    return float(before + u * (first + u * (3.0 * gain - 2.0 * first - second + u * rise)))


class Target(NamedTuple):
    """Where stops have to end [m], and the sums up to there."""

    station: float
    slope_work: float
    intercept_work: float


class StopEnd(NamedTuple):
    """How a stop goes on.

    Attributes:
        station: where it ends [m].
        onset: where braking begins [m].
        needed: the sum that has to be reached at its end [m].
        onset_in, end_in: the segments of onset and end.
    """

    station: float
    onset: float
    needed: float
    onset_in: int
    end_in: int


@inlined
def target_at(track: Track, survey: Survey, station: float) -> Target:
    """The sums up to a station."""
    last = segment(track.station, station, track.station.shape[0] - 2)
    intercept_work = work_up_to(track, survey, station, last, 0.0)
    slope_work = work_up_to(track, survey, station, last, 1.0) - intercept_work
    return Target(station, slope_work, intercept_work)


@inlined
def ends_before(
    track: Track, survey: Survey, command: StopCommand, i: int, target: Target, height: float
) -> tuple[bool, int]:
    """Does a stop end before the target? The same as asking :func:`stop_by_energy` where.

    Args:
        track, survey, command, i, height: as there.
        target: of the stop.

    Returns:
        The answer, and the segment of the onset.
    """
    v_i = max(command.speed, command.slowest)
    onset = command.station + command.speed * command.dead_time
    i = segment(track.station, onset, i)
    needed = work_up_to(track, survey, onset, i, v_i)
    needed += 0.5 * command.speed * command.speed / GRAVITY + height
    enough = v_i * target.slope_work + target.intercept_work >= needed
    return (onset <= target.station) & enough, i


@inlined
def stop_by_energy(
    track: Track, survey: Survey, command: StopCommand, i: int, j: int, height: float
) -> StopEnd:
    """Where a stop ends of which nothing but brakes and grade decide.

    Args:
        track, survey: the path, (N,) each.
        command: of the stop.
        i, j: segments to look for onset and end from.
        height: the stop may fall by this much further than the track [m].
    """
    s, v = command.station, command.speed
    station = track.station
    v_i = max(v, command.slowest)
    onset = s + v * command.dead_time
    i = segment(station, onset, i)
    needed = work_up_to(track, survey, onset, i, v_i) + 0.5 * v * v / GRAVITY + height
    j = max(j, i)
    last = station.shape[0] - 2
    while j > i and v_i * survey.slope_work[j] + survey.intercept_work[j] >= needed:
        j -= 1
    while j < last and v_i * survey.slope_work[j + 1] + survey.intercept_work[j + 1] < needed:
        j += 1
    low = max(onset, station[j])
    high = station[j + 1]
    at_low = work_up_to(track, survey, low, j, v_i) - needed
    at_high = v_i * survey.slope_work[j + 1] + survey.intercept_work[j + 1] - needed
    if at_high < 0.0 or onset >= high:
        # Off the end of the path.
        low = max(onset, high)
        at_low = work_up_to(track, survey, low, j, v_i) - needed
        force = v_i * track.lower_slope[j + 1] + track.lower_intercept[j + 1] + survey.sine[j + 1]
        end = low - at_low / force if force > 0.0 else np.inf
        return StopEnd(min(end, s + _LONGEST), onset, needed, i, j)
    end = high
    for _ in range(4):
        # Regula falsi on what is as good as linear.
        end = low - at_low * (high - low) / (at_high - at_low) if at_high > at_low else high
        left = work_up_to(track, survey, end, j, v_i) - needed
        if abs(left) < 1e-12:
            break
        if left < 0.0:
            low, at_low = end, left
        else:
            high, at_high = end, left
    return StopEnd(end, onset, needed, i, j)


@inlined
def _shares_at(
    track: Track, survey: Survey, i: int, u: float, energy: float, v_i: float, braking: bool
) -> Shares:
    """Shares of rear, lighter side and lightest wheel between i and i + 1 at v² = ``energy``."""
    # Angles are linear in between: sines and cosines bulge above their chords.
    pitched, rolled = track.grade[i + 1] - track.grade[i], track.roll[i + 1] - track.roll[i]
    bulge = 1.0 + 0.5 * u * (1.0 - u) * (pitched * pitched + rolled * rolled)
    normal = max(-at(track.vertical_curvature, i, u), 0.0) * energy / GRAVITY
    rear = bulge * at(survey.rear, i, u) - normal
    front = bulge * at(survey.front, i, u) - normal
    if braking:
        upper = v_i * at(track.upper_slope, i, u) + at(track.upper_intercept, i, u)
        decel = GRAVITY * (upper + bulge * at(survey.sine, i, u))
        rear -= survey.per_decel * decel
        front += survey.per_accel * decel
    lateral = survey.per_lateral * energy * at(survey.lean, i, u)
    left, right = bulge * at(survey.left, i, u), bulge * at(survey.right, i, u)
    side = min(left - lateral, right + lateral) - normal
    upright = 0.5 * (left + right) - normal
    return rear, side, min(rear, front) + side - upright


@inlined
def lesser(a: Shares, b: Shares) -> Shares:
    """Each share the lesser of two."""
    return min(a[0], b[0]), min(a[1], b[1]), min(a[2], b[2])


@inlined
def loads_by_energy(
    track: Track, survey: Survey, command: StopCommand, k: int, stop: StopEnd
) -> Shares:
    """Least shares of the rear axle, of a side and of a wheel on a stop of :func:`stop_by_energy`.

    Args:
        track, survey, command: as there.
        k: the segment of the command.
        stop: what it returned.
    """
    station = track.station
    end, onset, needed, i, j = stop
    v_i = max(command.speed, command.slowest)
    held = command.speed * command.speed
    ds = station[k + 1] - station[k]
    least = _shares_at(track, survey, k, (command.station - station[k]) / ds, held, v_i, False)
    for m in range(k + 1, i + 1):
        least = lesser(least, _shares_at(track, survey, m, 0.0, held, v_i, False))
    u = min((onset - station[i]) / (station[i + 1] - station[i]), 1.0)
    least = lesser(least, _shares_at(track, survey, i, u, held, v_i, True))
    for m in range(i + 1, j + 1):
        left = needed - v_i * survey.slope_work[m] - survey.intercept_work[m]
        energy = 2.0 * GRAVITY * max(left, 0.0)
        least = lesser(least, _shares_at(track, survey, m, 0.0, energy, v_i, True))
    if end > station[j + 1]:
        # It runs off the end of the path.
        left = needed - v_i * survey.slope_work[j + 1] - survey.intercept_work[j + 1]
        energy = 2.0 * GRAVITY * max(left, 0.0)
        least = lesser(least, _shares_at(track, survey, j, 1.0, energy, v_i, True))
    u = min((end - station[j]) / (station[j + 1] - station[j]), 1.0)
    return lesser(least, _shares_at(track, survey, j, u, 0.0, v_i, True))
