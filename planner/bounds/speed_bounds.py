"""Speed bounds along candidates: how fast each station may be passed, and what says so.

Ground on which the vehicle must not even stand is a *barrier*: unknown ground, ground steeper than
the model was trained on, a slope on which an axle or a side is too light, that the brakes cannot
hold or the drive cannot climb. The clear distance ends at the last station before it, and the
stopping path must end before the clear distance. All other bounds are speeds.

What a station says by itself is in :mod:`slopewise.planner.bounds.pointwise`; the stopping path,
which looks ahead, in :mod:`slopewise.planner.bounds.closed_form_stop` and, stop by stop, in
:mod:`slopewise.planner.bounds.integrated_stop`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.effects.registry import crest_share
from slopewise.models.parameters import Model
from slopewise.planner.bounds.closed_form_stop import stopping_bound
from slopewise.planner.bounds.crest_force import lose_on_crests
from slopewise.planner.bounds.integrated_stop import integrated_bound
from slopewise.planner.bounds.pointwise import PointProblem, PointwiseBounds, pointwise_bounds
from slopewise.planner.bounds.speed_excess import add_speed, speed_excess
from slopewise.planner.bounds.stopping_path import StopProblem
from slopewise.planner.ground.braking_ground import BrakingGround
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.kernels.compiled import inlined, kernel, row_pass
from slopewise.planner.kernels.limits import PlanningLimits, planning_limits
from slopewise.planner.kernels.workspace import empty
from slopewise.planner.limiting import Limiting
from slopewise.planner.swept.hazards import Hazards, nothing_looked_for

STOP_GUARD = 2e-3
"""Kept free between stopping path and clear distance, above all errors of integration [m]."""

_SHARE_KEPT = 0.5
"""Least share of a bound that is left where the next station may be passed as well."""

_CHORD = 1.0 / 6.0
"""Share of the second difference given up, so that v² linear between stations stays below a convex
bound: 1/8 for a parabola, the rest for bounds that are not quite one."""

_SPEED_LIMIT = int(Limiting.SPEED_LIMIT)
_STOPPING_PATH = int(Limiting.STOPPING_PATH)
_TIP_OVER = int(Limiting.TIP_OVER)
_ROLLOVER = int(Limiting.ROLLOVER)


@dataclass(frozen=True, slots=True)
class SpeedBounds:
    """Bounds along M candidates; arrays are (N, M) unless said otherwise.

    Attributes:
        speed_sq_max: highest v² with which v² may be linear between stations [m²/s²].
        limiting: which bound that is, as :class:`Limiting`.
        accel_max: highest acceleration by comfort, thrust and front axle load [m/s²].
        demand: thrust that holds the speed, as a share of the weight.
        clear_distance: (M,) station up to which the vehicle may stop [m].
        barrier: (M,) what ends the clear distance, as :class:`Limiting`; STOPPING_PATH if it is
            the end of the path or of the way known free.
        barrier_station: (M,) index of the first station that is barred, the count if none is.
        ground: braking with what crests and friction leave of the lower bound of its force.
        even_ground: with the force as it is learned; where the model says itself what crests take,
            the same as ``ground``.
    """

    speed_sq_max: Floats
    limiting: Ints
    accel_max: Floats
    demand: Floats
    clear_distance: Floats
    barrier: Ints
    barrier_station: Ints
    ground: BrakingGround
    even_ground: BrakingGround


def speed_bounds(
    profile: TerrainProfile,
    ground: BrakingGround,
    model: Model,
    clear: Floats,
    speed_limit: Floats | None = None,
    hazards: Hazards | None = None,
    *,
    holds_anywhere: bool = False,
) -> SpeedBounds:
    """Bounds on speed along candidates.

    Args:
        profile: terrain under the wheels.
        ground: braking along the candidates.
        model: vehicle, terrain and limits.
        clear: (M,) station up to which the vehicle may come, inf if unlimited [m].
        speed_limit: (N, M) limits of the path itself [m/s].
        hazards: what body and wheels meet; left out, nothing.
        holds_anywhere: for what-if questions: a vehicle at rest is held on any slope.
    """
    shape = profile.grade.shape
    speed_sq_max, accel_max, demand, lower_slope, lower_intercept, codes = empty(6, *shape)
    barrier, barrier_station, first_risk, last_risk = np.empty((4, shape[1]), np.int64)
    found = PointwiseBounds(
        speed_sq_max,
        codes.view(np.int64),
        accel_max,
        demand,
        barrier,
        barrier_station,
        lower_slope,
        lower_intercept,
        first_risk,
        last_risk,
    )
    nothing, trained = np.empty((0, 0)), float(ground.fastest.max())
    limits, most = planning_limits(model), model.limits.speed
    # What crests and turns take of brakes and drive is that at the highest trained speed: at the
    # speed limit a lower one would leave more of them, and make a plan faster.
    limits = limits._replace(holding=0.0 if holds_anywhere else 1.0, speed=max(most, trained))
    excess = speed_excess(profile, ground, limits)
    pointwise_bounds(
        PointProblem(
            profile.rows,
            ground.forces,
            (hazards or nothing_looked_for()).rows,
            nothing if ground.friction is None else ground.friction,
            nothing if speed_limit is None else speed_limit,
            nothing if excess is None else excess,
        ),
        limits,
        found,
    )
    clear_distance = _clear_distance(profile, clear, barrier, barrier_station)
    left = replace(ground, lower_slope=lower_slope, lower_intercept=lower_intercept)
    _stopping_path((profile, left), clear_distance, excess, limits, found)
    _keep_chords_below(speed_sq_max, found.limiting, barrier)
    _keep_limit(speed_sq_max, found.limiting, most * most)
    return SpeedBounds(
        speed_sq_max,
        found.limiting,
        accel_max,
        demand,
        clear_distance,
        barrier,
        barrier_station,
        left,
        ground if crest_share(model.effect) is None else left,
    )


def _stopping_path(
    track: tuple[TerrainProfile, BrakingGround],
    clear_distance: Floats,
    excess: Floats | None,
    limits: PlanningLimits,
    found: PointwiseBounds,
) -> None:
    """Lower v² to what stops before the clear distance, from the speed that it may really have."""
    profile, ground = track
    speed_sq_max, errors = found.speed_sq_max, ground.errors
    forces = ground.forces
    if errors.latency > 0.0:
        forces = forces._replace(dead_time=ground.dead_time + errors.latency)
    problem = StopProblem(
        profile.rows,
        forces,
        clear_distance - ground.distance_offset - errors.along_track - STOP_GUARD,
        errors.height,
    )
    fastest = float(ground.fastest.max())
    if excess is not None:
        fastest += float(excess.max())
        add_speed(speed_sq_max, excess, 1.0)
    # In place: the forces of the problem are those of what is found.
    lose_on_crests(problem, fastest, limits, ground.motion, found)
    # Drag may allow more than the closed form, which knows of none: those stops are tried for.
    tried = (found.limiting.copy(), speed_sq_max.copy()) if ground.motion.moves else ()
    stopping_bound(problem, fastest, float(forces.dead_time.max()), found)
    everywhere = not ground.closed_form
    integrated = np.arange(len(clear_distance))
    if not everywhere:
        integrated = np.flatnonzero(found.last_risk >= 0)
    if len(integrated) > 0:
        for array, standing in zip((found.limiting, speed_sq_max), tried, strict=False):
            np.copyto(array, standing, where=speed_sq_max > 0.0)
        integrated_bound(integrated, problem, everywhere, ground.motion, limits, found)
    if excess is not None:
        add_speed(speed_sq_max, excess, -1.0)


def _clear_distance(
    profile: TerrainProfile, clear: Floats, barrier: Ints, barrier_station: Ints
) -> Floats:
    """Station up to which the vehicle may stop, (M,) [m]; what is clear at most is no barrier."""
    last = np.maximum(np.minimum(barrier_station, profile.count) - 1, 0)
    reach = np.where(barrier_station > 0, profile.station[last, np.arange(len(last))], 0.0)
    barrier[clear < reach] = _STOPPING_PATH
    return np.minimum(reach, clear)


class _Rows(NamedTuple):
    """v² of a row and of the next two, labels of a row and of the next, (M,) each."""

    here: Floats
    ahead: Floats
    beyond: Floats
    label: Ints
    label_ahead: Ints


class _Chords(NamedTuple):
    """What is carried from row to row, (M,) each.

    Attributes:
        previous, bend_before: bound and its bend in the row before.
        stop: station at which the candidate comes to its stop.
        barrier: what ends its clear distance.
    """

    previous: Floats
    bend_before: Floats
    stop: Ints
    barrier: Ints


@kernel
def _keep_limit(speed_sq_max: Floats, limiting: Ints, highest: float) -> None:
    """The speed limit of the model, by its square."""
    for k in range(speed_sq_max.shape[0]):
        _cap(speed_sq_max[k], limiting[k], highest)


@row_pass
def _cap(row: Floats, row_label: Ints, highest: float) -> None:
    for j in range(row.shape[0]):
        here, label = row[j], row_label[j]
        row[j] = min(here, highest)
        row_label[j] = _SPEED_LIMIT if here >= highest else label


@kernel
def _keep_chords_below(speed_sq_max: Floats, limiting: Ints, barrier: Ints) -> None:
    """Lower a convex stopping path at its stations until v² linear between them stays below it.

    The last station that is not below zero then becomes the one to stop at.
    """
    stations, candidates = speed_sq_max.shape
    chords = _Chords(
        speed_sq_max[0].copy(), np.zeros(candidates), np.full(candidates, stations), barrier
    )
    for k in range(stations):
        ahead, beyond = min(k + 1, stations - 1), min(k + 2, stations - 1)
        rows = _Rows(
            speed_sq_max[k], speed_sq_max[ahead], speed_sq_max[beyond], limiting[k], limiting[ahead]
        )
        if _lower_row(k, k + 1 < stations, rows, chords) > 0 and k > 0:
            _stop_before(k, speed_sq_max[k - 1], limiting[k - 1], chords)


@inlined
def _looks_ahead(label: int) -> bool:
    return (label == _STOPPING_PATH) | (label == _TIP_OVER) | (label == _ROLLOVER)


@row_pass
def _lower_row(k: int, has_ahead: bool, rows: _Rows, chords: _Chords) -> int:
    """Lower row k; notes in ``chords.stop`` and counts which candidates come to their stop."""
    row, row_label = rows.here, rows.label
    row_ahead, label_ahead, row_beyond = rows.ahead, rows.label_ahead, rows.beyond
    previous, bend_before = chords.previous, chords.bend_before
    stop, barrier = chords.stop, chords.barrier
    stops = 0
    for j in range(row.shape[0]):
        here, label, end = row[j], row_label[j], barrier[j]
        ahead = max(row_ahead[j], 0.0) if has_ahead else here
        beyond = max(row_beyond[j], 0.0) if has_ahead else here
        # Steps of bounds that do not look ahead hold between stations already.
        bends = (here <= 0.0) | _looks_ahead(label)
        bends_ahead = (ahead <= 0.0) | _looks_ahead(label_ahead[j])
        bend = max(previous[j] - 2.0 * here + ahead, 0.0) if bends else 0.0
        bend_ahead = max(here - 2.0 * ahead + beyond, 0.0) if bends_ahead else 0.0
        lowered = here - _CHORD * max(max(bend_before[j], bend), bend_ahead)
        # A step of the stopping path is not the stop at its end: the judge sees to the rest.
        ends = (ahead <= 0.0) | (here <= 0.0)
        lowered = lowered if ends else max(lowered, _SHARE_KEPT * here)
        previous[j] = here
        bend_before[j] = bend
        before = stop[j] > k
        stays = before & (lowered > 0.0)
        comes = before & (lowered <= 0.0)
        row[j] = lowered if stays else 0.0
        row_label[j] = label if stays else end
        stop[j] = k if comes else stop[j]
        stops += 1 if comes else 0
    return stops


@row_pass
def _stop_before(k: int, row: Floats, row_label: Ints, chords: _Chords) -> None:
    stop, barrier = chords.stop, chords.barrier
    for j in range(stop.shape[0]):
        bound, label, end = row[j], row_label[j], barrier[j]
        row[j] = 0.0 if stop[j] == k else bound
        row_label[j] = end if stop[j] == k else label
