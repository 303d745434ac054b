"""Speed bounds along candidates: how fast each station may be passed, and what says so.

Ground on which the vehicle must not even stand is a *barrier*: unknown ground, ground steeper than
the model was trained on, a slope on which an axle or a side is too light, that the brakes cannot
hold or the drive cannot climb. The clear distance ends at the last station before it, and the
stopping path must end before the clear distance. All other bounds are speeds.

What a station says by itself is in :mod:`planner.bounds.pointwise`; the stopping path, which looks
ahead, in :mod:`planner.bounds.closed_form_stop` and, stop by stop, in
:mod:`planner.bounds.integrated_stop`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.parameters import Model
from planner.bounds.closed_form_stop import stopping_bound
from planner.bounds.integrated_stop import integrated_bound
from planner.bounds.pointwise import pointwise_bounds
from planner.ground.braking_ground import BrakingGround
from planner.ground.terrain_profile import TerrainProfile
from planner.kernels.compiled import Floats, Ints, inlined, kernel, row_pass
from planner.kernels.limits import planning_limits
from planner.kernels.workspace import empty
from planner.limiting import Limiting

STOP_GUARD = 2e-3
"""Kept free between stopping path and clear distance, above all errors of integration [m]."""

_SHARE_KEPT = 0.5
"""Least share of a bound that is left where the next station may be passed as well."""

_CHORD = 1.0 / 6.0
"""Share of the second difference given up, so that v² linear between stations stays below a convex
bound: 1/8 for a parabola, the rest for bounds that are not quite one."""

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
    """

    speed_sq_max: Floats
    limiting: Ints
    accel_max: Floats
    demand: Floats
    clear_distance: Floats
    barrier: Ints
    barrier_station: Ints


def speed_bounds(
    profile: TerrainProfile,
    ground: BrakingGround,
    model: Model,
    clear: Floats,
    speed_limit: Floats | None = None,
) -> SpeedBounds:
    """Bounds on speed along candidates.

    Args:
        profile: terrain under the wheels.
        ground: braking along the candidates.
        model: vehicle, terrain and limits.
        clear: (M,) station up to which the way is known free, inf if unlimited [m].
        speed_limit: (N, M) limits of the path itself [m/s].
    """
    shape = profile.grade.shape
    speed_sq_max, accel_max, demand, codes = empty(4, *shape)
    limiting = codes.view(np.int64)
    barrier, barrier_station, loads_at_risk = (np.empty(shape[1], np.int64) for _ in range(3))
    scalars = planning_limits(model)
    pointwise_bounds(
        profile.sin_grade, profile.sin_roll, profile.curvature, profile.known, profile.count,
        ground.lower_slope, ground.lower_intercept, ground.upper_slope, ground.upper_intercept,
        ground.slowest, ground.fastest, ground.trained,
        np.empty((0, 0)) if speed_limit is None else speed_limit, scalars,
        speed_sq_max, limiting, accel_max, demand, barrier, barrier_station, loads_at_risk,
    )  # fmt: skip
    clear_distance = _clear_distance(profile, clear, barrier, barrier_station)
    target = clear_distance - ground.distance_offset - STOP_GUARD
    # Drag may allow more than the closed form, which knows of none: those stops are tried for.
    drags = ground.motion.viscous + ground.motion.turning + ground.motion.drag
    tried = (limiting.copy(), speed_sq_max.copy()) if drags + ground.motion.wind_drag > 0.0 else ()
    stopping_bound(
        profile.station, profile.grade, profile.sin_grade, profile.known, profile.count,
        ground.lower_slope, ground.lower_intercept, ground.dead_time, ground.slowest,
        target, barrier, barrier_station, scalars.speed, float(ground.dead_time.max()),
        speed_sq_max, limiting,
    )  # fmt: skip
    integrated = np.flatnonzero(loads_at_risk if ground.closed_form else np.ones(shape[1]))
    if len(integrated) > 0:
        for array, standing in zip((limiting, speed_sq_max), tried, strict=False):
            np.copyto(array, standing, where=speed_sq_max > 0.0)
        integrated_bound(
            integrated, target, profile.count, profile.station, profile.grade, profile.sin_grade,
            profile.sin_roll, profile.curvature, profile.heading_x, profile.heading_y,
            ground.lower_slope, ground.lower_intercept, ground.upper_slope, ground.upper_intercept,
            ground.slowest, ground.dead_time, ground.motion, scalars, speed_sq_max, limiting,
        )  # fmt: skip
    _keep_chords_below(speed_sq_max, limiting, barrier)
    return SpeedBounds(
        speed_sq_max, limiting, accel_max, demand, clear_distance, barrier, barrier_station
    )


def _clear_distance(
    profile: TerrainProfile, clear: Floats, barrier: Ints, barrier_station: Ints
) -> Floats:
    """Station up to which the vehicle may stop, (M,) [m]; what is clear at most is no barrier."""
    last = np.maximum(np.minimum(barrier_station, profile.count) - 1, 0)
    reach = np.where(barrier_station > 0, profile.station[last, np.arange(len(last))], 0.0)
    barrier[clear < reach] = _STOPPING_PATH
    return np.minimum(reach, clear)


@kernel
def _keep_chords_below(speed_sq_max: Floats, limiting: Ints, barrier: Ints) -> None:
    """Lower a convex stopping path at its stations until v² linear between them stays below it.

    The last station that is not below zero then becomes the one to stop at.
    """
    stations, candidates = speed_sq_max.shape
    previous = speed_sq_max[0].copy()
    bend_before = np.zeros(candidates)
    stop = np.full(candidates, stations)
    for k in range(stations):
        ahead, beyond = min(k + 1, stations - 1), min(k + 2, stations - 1)
        stops = _lower_row(
            k, k + 1 < stations, speed_sq_max[ahead], speed_sq_max[beyond], limiting[ahead],
            barrier, stop, previous, bend_before, speed_sq_max[k], limiting[k],
        )  # fmt: skip
        if stops > 0 and k > 0:
            _stop_before(k, stop, barrier, speed_sq_max[k - 1], limiting[k - 1])


@inlined
def _looks_ahead(label: int) -> bool:
    return (label == _STOPPING_PATH) | (label == _TIP_OVER) | (label == _ROLLOVER)


@row_pass
def _lower_row(
    k: int, has_ahead: bool, row_ahead: Floats, row_beyond: Floats, label_ahead: Ints,
    barrier: Ints, stop: Ints, previous: Floats, bend_before: Floats,
    speed_sq_max: Floats, limiting: Ints,
) -> int:  # fmt: skip
    """Lower one row; notes in ``stop`` and counts which candidates come to their stop in it."""
    stops = 0
    for j in range(speed_sq_max.shape[0]):
        here, label, end = speed_sq_max[j], limiting[j], barrier[j]
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
        speed_sq_max[j] = lowered if stays else 0.0
        limiting[j] = label if stays else end
        stop[j] = k if comes else stop[j]
        stops += 1 if comes else 0
    return stops


@row_pass
def _stop_before(k: int, stop: Ints, barrier: Ints, speed_sq_max: Floats, limiting: Ints) -> None:
    for j in range(stop.shape[0]):
        bound, label, end = speed_sq_max[j], limiting[j], barrier[j]
        speed_sq_max[j] = 0.0 if stop[j] == k else bound
        limiting[j] = end if stop[j] == k else label
