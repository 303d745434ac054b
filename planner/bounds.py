"""Speed bounds along candidates: how fast each station may be passed, and what says so.

Ground on which the vehicle must not even stand is a *barrier*: unknown ground, ground steeper than
the model was trained on, a slope on which an axle or a side is too light, that the brakes cannot
hold or the drive cannot climb. The clear distance ends at the last station before it, and the
stopping path must end before the clear distance. All other bounds are speeds.

The laws stand in `models` with their sources; they are written out here in sines and cosines that
the terrain profile already has, and tests hold both against each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from models.parameters import Model
from models.quantity import GRAVITY
from planner.compiled import TILE, Bools, Floats, Ints, kernel
from planner.ground import Ground
from planner.limiting import Limiting
from planner.stopping_path import (
    OVERRUN,
    REAR_LOAD,
    SIDE_LOAD,
    marched_bound,
    onset_speed,
)
from planner.terrain_profile import TerrainProfile

STOP_GUARD = 2e-3
"""Kept free between stopping path and clear distance, above all errors of integration [m]."""

HOLDING = 0.02
"""Least F_b/W + sin θ: below it the brakes hardly hold the vehicle, let alone stop it."""

_CHORD = 1.0 / 6.0
"""Share of the second difference given up, so that v² linear between stations stays below a convex
bound: 1/8 for a parabola, the rest for bounds that are not quite one."""

_SPEED_LIMIT = int(Limiting.SPEED_LIMIT)
_STOPPING_PATH = int(Limiting.STOPPING_PATH)
_TIP_OVER = int(Limiting.TIP_OVER)
_ROLLOVER = int(Limiting.ROLLOVER)
_LATERAL = int(Limiting.LATERAL)
_WHEEL_SPEED = int(Limiting.WHEEL_SPEED)
_TRACTION = int(Limiting.TRACTION)
_UNKNOWN_TERRAIN = int(Limiting.UNKNOWN_TERRAIN)
_MODEL_VALIDITY = int(Limiting.MODEL_VALIDITY)


class Numbers(NamedTuple):
    """The model's scalars as the kernels want them; SI.

    Attributes:
        rear_lever: cg_z / (L − cg_x). front_lever: cg_z / cg_x. side_lever: 2 cg_z / B.
        resistance: f_r. turning_drag: μ_t L / 2 of a skid-steer vehicle, else 0 [m].
        half_slip_track: B_s / 2 of a skid-steer vehicle, else B / 2 [m].
        specific_force: max drive force / weight. specific_power: max drive power / weight [m/s].
    """

    rear_lever: float
    front_lever: float
    side_lever: float
    min_load: float
    resistance: float
    turning_drag: float
    half_slip_track: float
    max_wheel_speed: float
    specific_force: float
    specific_power: float
    speed: float
    accel: float
    decel: float
    lateral_accel: float


def numbers(model: Model) -> Numbers:
    """Collect the scalars of a model."""
    vehicle, limits, terrain = model.vehicle, model.limits, model.terrain
    weight = vehicle.mass * GRAVITY
    skid_steer = vehicle.drive == "skid_steer"
    return Numbers(
        rear_lever=vehicle.cg_z / (vehicle.wheelbase - vehicle.cg_x),
        front_lever=vehicle.cg_z / vehicle.cg_x,
        side_lever=2.0 * vehicle.cg_z / vehicle.track_width,
        min_load=float(limits.min_load),
        resistance=float(terrain.motion_resistance),
        turning_drag=0.5 * terrain.lateral_resistance * vehicle.wheelbase if skid_steer else 0.0,
        half_slip_track=0.5 * (terrain.slip_track if skid_steer else vehicle.track_width),
        max_wheel_speed=float(vehicle.max_wheel_speed),
        specific_force=vehicle.max_drive_force / weight,
        specific_power=vehicle.max_drive_power / weight,
        speed=float(limits.speed),
        accel=float(limits.accel),
        decel=float(limits.decel),
        lateral_accel=float(limits.lateral_accel),
    )


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
    ground: Ground,
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
    speed_sq_max, accel_max, demand = np.empty((3, *shape))
    limiting = np.empty(shape, np.int64)
    clear_distance = np.empty(shape[1])
    barrier = np.empty(shape[1], np.int64)
    barrier_station = np.empty(shape[1], np.int64)
    march = np.empty(shape[1], np.bool_)
    scalars = numbers(model)
    _bounds(
        profile.station, profile.grade, profile.sin_grade, profile.sin_roll, profile.curvature,
        profile.known, profile.count,
        ground.weak_speed, ground.weak_rest, ground.strong_speed, ground.strong_rest,
        ground.dead_time, ground.slowest, ground.fastest, ground.trained, ground.distance_offset,
        np.empty((0, 0)) if speed_limit is None else speed_limit, clear, scalars,
        ground.closed_form,
        speed_sq_max, limiting, accel_max, demand, clear_distance, barrier, barrier_station, march,
    )  # fmt: skip
    for j in np.flatnonzero(march):
        _march(int(j), profile, ground, scalars, speed_sq_max, limiting, clear_distance)
    _keep_chords_below(speed_sq_max, limiting, profile.count, barrier)
    return SpeedBounds(
        speed_sq_max, limiting, accel_max, demand, clear_distance, barrier, barrier_station
    )


def _march(
    j: int,
    profile: TerrainProfile,
    ground: Ground,
    scalars: Numbers,
    speed_sq_max: Floats,
    limiting: Ints,
    clear_distance: Floats,
) -> None:
    """Bounds of one candidate whose stopping path has no closed form."""

    def column(array: Floats) -> Floats:
        return np.ascontiguousarray(array[:, j])

    sin_grade, sin_roll = column(profile.sin_grade), column(profile.sin_roll)
    cos_grade, cos_roll = np.sqrt(1.0 - sin_grade**2), np.sqrt(1.0 - sin_roll**2)
    bound = column(speed_sq_max)
    before = bound.copy()
    ending = np.empty(bound.shape)
    curvature = column(profile.curvature)
    side = _side_speed_sq(curvature, cos_grade, cos_roll, sin_roll, scalars)
    marched_bound(
        clear_distance[j] - ground.distance_offset[j] - STOP_GUARD, int(profile.count[j]),
        column(profile.station), column(profile.grade), sin_grade,
        column(ground.weak_speed), column(ground.weak_rest),
        column(ground.strong_speed), column(ground.strong_rest),
        cos_grade * cos_roll, side, curvature,
        np.arctan2(column(profile.heading_y), column(profile.heading_x)),
        column(ground.slowest), column(ground.dead_time), ground.motion,
        scalars.rear_lever, scalars.min_load, bound, ending,
    )  # fmt: skip
    names = {OVERRUN: _STOPPING_PATH, REAR_LOAD: _TIP_OVER, SIDE_LOAD: _ROLLOVER}
    for how, name in names.items():
        limiting[(bound < before) & (ending == how), j] = name
    speed_sq_max[:, j] = bound


def _side_speed_sq(
    curvature: Floats, cos_grade: Floats, cos_roll: Floats, sin_roll: Floats, n: Numbers
) -> Floats:
    """Highest v² that keeps both sides loaded, (N,) like its arguments; inf on a straight."""
    lean = np.sign(curvature) * cos_grade * sin_roll
    reach = GRAVITY * ((cos_grade * cos_roll - n.min_load) / n.side_lever - lean)
    with np.errstate(divide="ignore"):
        bound: Floats = reach * cos_roll / np.abs(curvature)
    return np.where(np.abs(curvature) > 0.0, np.maximum(bound, 0.0), np.inf)


@kernel
def _bounds(
    station: Floats, grade: Floats, sin_grade: Floats, sin_roll: Floats, curvature: Floats,
    known: Bools, count: Ints,
    weak_speed: Floats, weak_rest: Floats, strong_speed: Floats, strong_rest: Floats,
    dead_time: Floats, slowest: Floats, fastest: Floats, trained: Bools, distance_offset: Floats,
    speed_limit: Floats, clear: Floats, n: Numbers, closed_form: bool,
    speed_sq_max: Floats, limiting: Ints, accel_max: Floats, demand: Floats,
    clear_distance: Floats, barrier: Ints, barrier_station: Ints, march: Bools,
) -> None:  # fmt: skip
    stations, candidates = grade.shape
    speed_integral = np.empty((stations, TILE))
    rest_integral = np.empty((stations, TILE))
    onset = np.empty((stations, TILE))
    target = np.empty(TILE)
    end = np.empty(TILE, np.int64)
    pointer = np.empty(TILE, np.int64)
    has_limits = speed_limit.shape[0] > 0
    for first in range(0, candidates, TILE):
        width = min(TILE, candidates - first)
        for t in range(width):
            j = first + t
            barrier[j] = _STOPPING_PATH
            barrier_station[j] = count[j]
            march[j] = not closed_form
        # 1. Speeds of each station by itself, and ground that bars the way.
        for k in range(stations):
            for t in range(width):
                j = first + t
                if k >= barrier_station[j]:
                    speed_sq_max[k, j] = 0.0
                    limiting[k, j] = barrier[j]
                    accel_max[k, j] = 0.0
                    demand[k, j] = 0.0
                    continue
                sine, sin_lean = sin_grade[k, j], sin_roll[k, j]
                cosine = np.sqrt(1.0 - sine * sine)
                cos_lean = np.sqrt(1.0 - sin_lean * sin_lean)
                upright = cosine * cos_lean
                lean = cosine * sin_lean
                bend = abs(curvature[k, j])
                slow = slowest[k, j]
                cap = n.speed
                label = _SPEED_LIMIT
                if has_limits and speed_limit[k, j] < cap:
                    cap = speed_limit[k, j]
                if fastest[k, j] < cap:
                    cap = fastest[k, j]
                    label = _MODEL_VALIDITY
                weak_slow = weak_rest[k, j] + slow * weak_speed[k, j]
                weak_fast = weak_rest[k, j] + max(cap, slow) * weak_speed[k, j]
                strong_slow = strong_rest[k, j] + slow * strong_speed[k, j]
                strong_fast = strong_rest[k, j] + max(cap, slow) * strong_speed[k, j]
                holding = sine + (n.resistance + n.turning_drag * bend) * cosine
                thrust = GRAVITY * (n.specific_force - holding)
                lifting = GRAVITY * ((upright - n.min_load) / n.front_lever - sine)
                accel_max[k, j] = max(min(n.accel, min(thrust, lifting)), 0.0)
                demand[k, j] = holding
                barred = -1
                if not known[k, j]:
                    barred = _UNKNOWN_TERRAIN
                elif not trained[k, j]:
                    barred = _MODEL_VALIDITY
                elif (
                    upright - n.rear_lever * strong_slow < n.min_load
                    or upright + n.rear_lever * sine < n.min_load
                    or upright - n.front_lever * sine < n.min_load
                ):
                    barred = _TIP_OVER
                elif upright - n.side_lever * abs(lean) < n.min_load:
                    barred = _ROLLOVER
                elif min(weak_slow, weak_fast) + sine < HOLDING:
                    barred = _STOPPING_PATH
                elif holding > n.specific_force:
                    barred = _TRACTION
                if barred >= 0:
                    barrier[j] = barred
                    barrier_station[j] = k
                    speed_sq_max[k, j] = 0.0
                    limiting[k, j] = barred
                    continue
                bound = cap * cap
                if bend > 0.0:
                    per_bend = cos_lean / bend
                    turning = n.lateral_accel * per_bend
                    if turning < bound:
                        bound = turning
                        label = _LATERAL
                    signed = lean if curvature[k, j] > 0.0 else -lean
                    reach = GRAVITY * ((upright - n.min_load) / n.side_lever - signed)
                    rolling = max(reach, 0.0) * per_bend
                    if rolling < bound:
                        bound = rolling
                        label = _ROLLOVER
                    if rolling < cap * cap:
                        march[j] = True
                rim = n.max_wheel_speed / (1.0 + bend * n.half_slip_track)
                if rim * rim < bound:
                    bound = rim * rim
                    label = _WHEEL_SPEED
                if holding > 0.0:
                    sustained = n.specific_power / holding
                    if sustained * sustained < bound:
                        bound = sustained * sustained
                        label = _TRACTION
                if upright - n.rear_lever * max(strong_slow, strong_fast) < n.min_load:
                    march[j] = True
                speed_sq_max[k, j] = bound
                limiting[k, j] = label
        for t in range(width):
            j = first + t
            last = max(min(barrier_station[j], count[j]) - 1, 0)
            reach = station[last, j] if barrier_station[j] > 0 else 0.0
            if clear[j] < reach:
                reach = clear[j]
                barrier[j] = _STOPPING_PATH
            clear_distance[j] = reach
            target[t] = reach - distance_offset[j] - STOP_GUARD
            end[t] = last
            while end[t] > 0 and station[end[t], j] > target[t]:
                end[t] -= 1
            pointer[t] = end[t]
        # 2. What the brakes take out from each station to the target, and the onset speed there.
        for k in range(stations - 1, -1, -1):
            for t in range(width):
                j = first + t
                if k > end[t]:
                    continue
                if k == end[t]:
                    # The target lies within the segment that begins here.
                    after = max(min(target[t] - station[k, j], 1e9), 0.0)
                    nxt = min(k + 1, count[j] - 1)
                    length = station[nxt, j] - station[k, j]
                    u = min(after / length, 1.0) if length > 0.0 else 0.0
                    turn = u * (grade[nxt, j] - grade[k, j])
                    same = known[nxt, j]
                    ds = after
                    sp = weak_speed[k, j]
                    sp2 = sp + u * (weak_speed[nxt, j] - sp) if same else sp
                    rp = weak_rest[k, j]
                    rp2 = rp + u * (weak_rest[nxt, j] - rp) if same else rp
                    sn = sin_grade[k, j]
                    sn2 = sn + u * (sin_grade[nxt, j] - sn) if same else sn
                    total_speed, total_rest = 0.0, 0.0
                else:
                    ds = station[k + 1, j] - station[k, j]
                    turn = grade[k + 1, j] - grade[k, j]
                    sp, sp2 = weak_speed[k, j], weak_speed[k + 1, j]
                    rp, rp2 = weak_rest[k, j], weak_rest[k + 1, j]
                    sn, sn2 = sin_grade[k, j], sin_grade[k + 1, j]
                    total_speed = speed_integral[k + 1, t]
                    total_rest = rest_integral[k + 1, t]
                # sin of a linear grade: trapezoid, with the next term of its expansion.
                half = 0.5 * ds
                sine_integral = half * (sn + sn2) * (1.0 + turn * turn / 12.0)
                total_speed += half * (sp + sp2)
                total_rest += half * (rp + rp2) + sine_integral
                speed_integral[k, t] = total_speed
                rest_integral[k, t] = total_rest
                onset[k, t] = onset_speed(total_speed, total_rest, slowest[k, j])
        # 3. From the station of the command, a dead time earlier.
        for k in range(stations - 1, -1, -1):
            for t in range(width):
                j = first + t
                if k >= barrier_station[j]:
                    continue
                if k > end[t] or target[t] <= station[k, j]:
                    speed_sq_max[k, j] = -1.0
                    limiting[k, j] = barrier[j]
                    continue
                here = station[k, j]
                dead = dead_time[k, j]
                i = min(pointer[t], end[t])
                # Find the segment [i, i + 1] in which the onset lies.
                while i > k and here + dead * onset[i, t] <= station[i, j]:
                    i -= 1
                while i < end[t] and here + dead * onset[i + 1, t] > station[i + 1, j]:
                    i += 1
                pointer[t] = i
                speed = onset[k, t]
                if dead > 0.0:
                    left, p_left = onset[i, t], station[i, j]
                    if i < end[t]:
                        right, p_right = onset[i + 1, t], station[i + 1, j]
                    else:
                        right, p_right = 0.0, target[t]
                    r_left = here + dead * left - p_left
                    r_right = here + dead * right - p_right
                    length = p_right - p_left
                    nxt = min(i + 1, count[j] - 1)
                    full = station[nxt, j] - p_left
                    speed = 0.0
                    for _ in range(3):
                        # Regula falsi on the onset position; min() keeps every iterate safe.
                        u = r_left / (r_left - r_right) if r_left > r_right else 0.0
                        p = p_left + u * (p_right - p_left)
                        back = p - station[i, j]
                        w = back / full if full > 0.0 else 0.0
                        base = 0.5 * back
                        sp = weak_speed[i, j]
                        rp = weak_rest[i, j] + sin_grade[i, j]
                        rise_s = w * (weak_speed[nxt, j] - sp) if known[nxt, j] else 0.0
                        rise_r = (
                            w * (weak_rest[nxt, j] + sin_grade[nxt, j] - rp)
                            if known[nxt, j]
                            else 0.0
                        )
                        v = onset_speed(
                            speed_integral[i, t] - base * (2.0 * sp + rise_s),
                            rest_integral[i, t] - base * (2.0 * rp + rise_r),
                            slowest[i, j],
                        )
                        speed = max(speed, min(v, (p - here) / dead))
                        residual = here + dead * v - p
                        if residual > 0.0:
                            r_left, p_left = residual, p
                        else:
                            r_right, p_right = residual, p
                        if length <= 0.0:
                            break
                if speed * speed < speed_sq_max[k, j]:
                    speed_sq_max[k, j] = speed * speed
                    limiting[k, j] = _STOPPING_PATH


@kernel
def _keep_chords_below(speed_sq_max: Floats, limiting: Ints, count: Ints, barrier: Ints) -> None:
    """Lower a convex bound at its stations until v² linear between them stays below it.

    The last station that is not below zero then becomes the one to stop at.
    """
    stations, candidates = speed_sq_max.shape
    previous = np.empty(candidates)
    bend_before = np.zeros(candidates)
    stopped = np.zeros(candidates, np.bool_)
    for j in range(candidates):
        previous[j] = speed_sq_max[0, j]
    for k in range(stations):
        for j in range(candidates):
            here = speed_sq_max[k, j]
            if k + 1 < stations:
                ahead = max(speed_sq_max[k + 1, j], 0.0)
                if k + 2 < stations:
                    beyond = max(speed_sq_max[k + 2, j], 0.0)
                else:
                    beyond = ahead
            else:
                ahead, beyond = here, here
            bend = max(previous[j] - 2.0 * here + ahead, 0.0)
            bend_ahead = max(here - 2.0 * ahead + beyond, 0.0)
            previous[j] = here
            if stopped[j]:
                speed_sq_max[k, j] = 0.0
                limiting[k, j] = barrier[j]
                continue
            lowered = here - _CHORD * max(max(bend_before[j], bend), bend_ahead)
            bend_before[j] = bend
            speed_sq_max[k, j] = max(lowered, 0.0)
            if lowered <= 0.0:
                stopped[j] = True
                limiting[k, j] = barrier[j]
                if k > 0:
                    speed_sq_max[k - 1, j] = 0.0
                    limiting[k - 1, j] = barrier[j]
