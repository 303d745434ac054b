"""The judge of a finished plan: is every constraint kept, at the stations and between them?

It shares no approximation with what made the plan. Every emergency stop is integrated in time with
a fourth-order Runge–Kutta scheme on the laws of `models`, grade linear between stations, whereas
bounds work along the path, in v², with sums and tangents.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from models import effects, slip_track, wheel_loads
from models.effects import Motion
from models.parameters import Model
from models.quantity import GRAVITY
from planner.bounds import Numbers, numbers
from planner.compiled import Bools, Floats, Ints, inlined, kernel
from planner.ground import Ground
from planner.limiting import Limiting
from planner.terrain_profile import TerrainProfile

TIME_STEP = 0.02
"""Step of the integrator [s]; halving it moves a stop by less than 10 µm."""

BETWEEN = 3
"""Points inside each segment from which a stop is tried as well."""

_TOLERANCE = 1e-6
_rear_share = inlined(wheel_loads.rear_load_share)
_front_share = inlined(wheel_loads.front_load_share)
_left_share = inlined(wheel_loads.left_load_share)
_right_share = inlined(wheel_loads.right_load_share)
_rim_ratio = inlined(slip_track.outer_wheel_speed_ratio)
_motion_deceleration = inlined(effects.motion_deceleration)


class Track(NamedTuple):
    """One candidate as the judge walks it; arrays are (N,) over its stations."""

    station: Floats
    grade: Floats
    roll: Floats
    curvature: Floats
    yaw: Floats
    weak_speed: Floats
    weak_rest: Floats
    strong_speed: Floats
    strong_rest: Floats
    dead_time: Floats
    slowest: Floats
    speed_limit: Floats


class Body(NamedTuple):
    """The vehicle as the judge weighs it; SI."""

    wheelbase: float
    track_width: float
    cg_x: float
    cg_z: float
    slip_track: float


class Offence(NamedTuple):
    """The worst breach of one kind: by how much, in the unit of what is breached; 0 is none."""

    overrun: float
    axle_load: float
    side_load: float
    speed: float
    lateral: float
    wheel_speed: float
    accel: float
    decel: float


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the judge found.

    Attributes:
        stop_distance: (N,) emergency stop from each station at its speed, with its safety offset;
            0 where the plan stands [m].
        rear_load: (N,) least rear axle load on that stop, as share of its level static load.
        side_load: (N,) least side load on that stop, as share of half the weight.
        offence: the worst breaches, all 0 for a valid plan.
        where: (N − 1,) segments in or at the start of which something is breached.
    """

    stop_distance: Floats
    rear_load: Floats
    side_load: Floats
    offence: Offence
    where: Ints

    @property
    def valid(self) -> bool:
        """No constraint is breached."""
        return max(self.offence) <= 0.0


def track_of(
    profile: TerrainProfile, ground: Ground, candidate: int, speed_limit: Floats | None = None
) -> Track:
    """One candidate out of a batch, contiguous and without padding."""
    n, j = int(profile.count[candidate]), candidate

    def column(array: Floats) -> Floats:
        return np.ascontiguousarray(array[:n, j])

    limit = column(ground.fastest)
    if speed_limit is not None:
        limit = np.minimum(limit, column(speed_limit))
    return Track(
        column(profile.station), column(profile.grade), np.arcsin(column(profile.sin_roll)),
        column(profile.curvature),
        np.unwrap(np.arctan2(column(profile.heading_y), column(profile.heading_x))),
        column(ground.weak_speed), column(ground.weak_rest),
        column(ground.strong_speed), column(ground.strong_rest),
        column(ground.dead_time), column(ground.slowest), limit,
    )  # fmt: skip


def body_of(model: Model) -> Body:
    """The vehicle's numbers for the judge."""
    v = model.vehicle
    rim = model.terrain.slip_track if v.drive == "skid_steer" else v.track_width
    return Body(v.wheelbase, v.track_width, v.cg_x, v.cg_z, rim)


def check(
    track: Track,
    speed_sq: Floats,
    clear_distance: float,
    distance_offset: float,
    motion: Motion,
    model: Model,
    *,
    decel: float | None = None,
    between: int = BETWEEN,
    time_step: float = TIME_STEP,
) -> Verdict:
    """Judge one plan.

    Args:
        track: the candidate.
        speed_sq: (N,) v², linear between stations [m²/s²].
        clear_distance: station before which every stop must end [m].
        distance_offset: safety offset of the model [m].
        motion: effects on the motion.
        model: vehicle and limits.
        decel: planned deceleration allowed, inf for an emergency; that of the model if left out.
        between: points inside each segment to try as well.
        time_step: of the integrator [s].
    """
    n = len(speed_sq)
    stop_distance, rear_load, side_load = np.empty((3, n))
    worst = np.zeros(len(Offence._fields))
    bad = np.zeros(max(n - 1, 1), np.bool_)
    scalars = numbers(model)
    if decel is not None:
        scalars = scalars._replace(decel=decel)
    _check(
        track, body_of(model), scalars, motion, speed_sq, clear_distance, distance_offset,
        between, time_step, stop_distance, rear_load, side_load, worst, bad,
    )  # fmt: skip
    offence = Offence(*(float(w) for w in worst))
    return Verdict(stop_distance, rear_load, side_load, offence, np.flatnonzero(bad))


@inlined
def _at(values: Floats, i: int, u: float) -> float:
    return float(values[i] + u * (values[i + 1] - values[i]))


@inlined
def _segment(station: Floats, s: float, i: int) -> int:
    """Index of the segment that holds s, walking forward from i."""
    while i + 2 < station.shape[0] and station[i + 1] <= s:
        i += 1
    return i


@inlined
def _rates(
    track: Track, motion: Motion, s: float, v: float, f: float, q: float, v_i: float, i: int
) -> tuple[float, float, float]:
    """Deceleration, growth of the built-up force and of the heat."""
    i = _segment(track.station, s, i)
    # Beyond the last station the ground stays as it was there.
    u = min((s - track.station[i]) / (track.station[i + 1] - track.station[i]), 1.0)
    grade = _at(track.grade, i, u)
    upright = np.cos(grade) * np.cos(_at(track.roll, i, u))
    wanted = v_i * _at(track.weak_speed, i, u) + _at(track.weak_rest, i, u)
    force = (f if motion.lag > 0.0 else wanted) / (1.0 + motion.fade * max(q, 0.0))
    force = min(force, motion.friction * upright)
    speed = max(v, 0.0)
    extra = _motion_deceleration(speed, _at(track.curvature, i, u), _at(track.yaw, i, u), motion)
    growth = (wanted - f) / motion.lag if motion.lag > 0.0 else 0.0
    heating = GRAVITY * max(force, 0.0) * speed - q / motion.fade_tau
    return GRAVITY * (force + np.sin(grade)) + extra, growth, heating


@inlined
def _shares(
    track: Track, body: Body, motion: Motion, s: float, v: float, v_i: float, i: int, braking: bool
) -> tuple[float, float]:
    """Least axle share and least side share at s, braking or holding the speed."""
    i = _segment(track.station, s, i)
    u = min((s - track.station[i]) / (track.station[i + 1] - track.station[i]), 1.0)
    grade, roll = _at(track.grade, i, u), _at(track.roll, i, u)
    bend = _at(track.curvature, i, u)
    decel = 0.0
    if braking:
        strong = v_i * _at(track.strong_speed, i, u) + _at(track.strong_rest, i, u)
        strong = min(strong, motion.friction * np.cos(grade) * np.cos(roll))
        decel = GRAVITY * (strong + np.sin(grade))
        decel += max(_motion_deceleration(max(v, 0.0), bend, _at(track.yaw, i, u), motion), 0.0)
    rear = _rear_share(grade, roll, decel, body.wheelbase, body.cg_x, body.cg_z)
    lateral = v * v * bend / np.cos(roll)
    left = _left_share(grade, roll, lateral, body.track_width, body.cg_z)
    right = _right_share(grade, roll, lateral, body.track_width, body.cg_z)
    return rear, min(left, right)


@inlined
def _stop(
    track: Track, body: Body, motion: Motion, s: float, v: float, dead: float, slowest: float,
    i: int, limit: float, h: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Where an emergency stop ends, and the least shares on its way. Gives up beyond the limit.

    Grade is linear between stations, so loads are taken at every station on the way, and at every
    step between them for the sake of the sides, which depend on speed.
    """
    station = track.station
    v_i = max(v, slowest)
    onset = s + v * dead
    rear, side = _shares(track, body, motion, s, v, v_i, i, False)
    while station[i + 1] < onset and i + 2 < station.shape[0]:
        i += 1
        r, d = _shares(track, body, motion, station[i], v, v_i, i, False)
        rear, side = min(rear, r), min(side, d)
    r, d = _shares(track, body, motion, onset, v, v_i, i, False)
    rear, side = min(rear, r), min(side, d)
    f, q = 0.0, motion.heat
    s = onset
    while s <= limit:
        r, d = _shares(track, body, motion, s, v, v_i, i, True)
        rear, side = min(rear, r), min(side, d)
        a1, f1, q1 = _rates(track, motion, s, v, f, q, v_i, i)
        if v <= 0.0:
            break
        b = 0.5 * h
        v2 = v - b * a1
        a2, f2, q2 = _rates(track, motion, s + b * v, v2, f + b * f1, q + b * q1, v_i, i)
        v3 = v - b * a2
        a3, f3, q3 = _rates(track, motion, s + b * v2, v3, f + b * f2, q + b * q2, v_i, i)
        v4 = v - h * a3
        a4, f4, q4 = _rates(track, motion, s + h * v3, v4, f + h * f3, q + h * q3, v_i, i)
        after = v - h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
        if after <= 0.0:
            # Within the last step the deceleration is as good as constant.
            s += 0.5 * v * h * v / (v - after)
        else:
            s += h * (v + 2.0 * v2 + 2.0 * v3 + v4) / 6.0
            f += h * (f1 + 2.0 * f2 + 2.0 * f3 + f4) / 6.0
            q += h * (q1 + 2.0 * q2 + 2.0 * q3 + q4) / 6.0
        while station[i + 1] < s and i + 2 < station.shape[0]:
            i += 1
            r, d = _shares(track, body, motion, station[i], v, v_i, i, True)
            rear, side = min(rear, r), min(side, d)
        v = after
        if v <= 0.0:
            r, d = _shares(track, body, motion, s, 0.0, v_i, i, True)
            rear, side = min(rear, r), min(side, d)
            break
    return s, rear, side


@kernel
def _check(
    track: Track, body: Body, n: Numbers, motion: Motion, speed_sq: Floats,
    clear_distance: float, distance_offset: float, between: int, h: float,
    stop_distance: Floats, rear_load: Floats, side_load: Floats, worst: Floats, bad: Bools,
) -> None:  # fmt: skip
    last = speed_sq.shape[0] - 1
    station = track.station
    limit = max(clear_distance, station[0]) + 5.0
    for k in range(last + 1):
        stop_distance[k] = 0.0
        rear, side = _shares(track, body, motion, station[k], 0.0, 0.0, max(k - 1, 0), False)
        rear_load[k], side_load[k] = rear, side
        points = between + 1 if k < last else 1
        for point in range(points):
            u = point / points
            i = min(k, last - 1)
            energy = speed_sq[k] if point == 0 else _at(speed_sq, k, u)
            if energy <= 0.0:
                continue
            v = np.sqrt(energy)
            s = station[k] if point == 0 else _at(station, k, u)
            dead = track.dead_time[k]
            slowest = track.slowest[k]
            top = track.speed_limit[k]
            if point > 0:
                # A surface that begins in a segment counts at both of its ends.
                dead = min(dead, track.dead_time[k + 1])
                top = max(top, track.speed_limit[k + 1])
            end, rear, side = _stop(track, body, motion, s, v, dead, slowest, i, limit, h)
            if point == 0:
                stop_distance[k] = end - s + distance_offset
                rear_load[k], side_load[k] = rear, side
            lateral = energy * abs(_at(track.curvature, i, u if point > 0 else k - i))
            lean = np.cos(_at(track.roll, i, u if point > 0 else k - i))
            rim = v * _rim_ratio(
                _at(track.curvature, i, u if point > 0 else k - i), body.slip_track
            )
            breach = (
                end + distance_offset - clear_distance,
                n.min_load - rear,
                n.min_load - side,
                v - min(n.speed, top),
                lateral / lean - n.lateral_accel,
                rim - n.max_wheel_speed,
            )
            for kind in range(6):
                # What is not a number is a breach as well.
                if not (breach[kind] <= _TOLERANCE):
                    bad[i] = True
                    amount = breach[kind] if np.isfinite(breach[kind]) else np.inf
                    worst[kind] = max(worst[kind], amount)
        if k < last and (speed_sq[k] > 0.0 or speed_sq[k + 1] > 0.0):
            ds = station[k + 1] - station[k]
            accel = 0.5 * (speed_sq[k + 1] - speed_sq[k]) / ds
            # What brakes, thrust and axle loads allow, at whichever end allows less.
            slow, fast = (
                np.sqrt(min(speed_sq[k], speed_sq[k + 1])),
                np.sqrt(max(speed_sq[k], speed_sq[k + 1])),
            )
            for end_point in range(2):
                m = k + end_point
                grade, roll = track.grade[m], track.roll[m]
                lean = np.cos(grade)
                weak = (
                    min(
                        max(slow, track.slowest[m]) * track.weak_speed[m],
                        max(fast, track.slowest[m]) * track.weak_speed[m],
                    )
                    + track.weak_rest[m]
                )
                # Drag and turning help to slow down, which is not counted on; wind may push.
                pushed = min(
                    _motion_deceleration(slow, track.curvature[m], track.yaw[m], motion),
                    _motion_deceleration(fast, track.curvature[m], track.yaw[m], motion),
                )
                braking = GRAVITY * (weak + np.sin(grade)) + min(pushed, 0.0)
                holding = np.sin(grade) + lean * (
                    n.resistance + n.turning_drag * abs(track.curvature[m])
                )
                thrust = GRAVITY * (
                    min(n.specific_force, n.specific_power / max(fast, 1e-9)) - holding
                )
                front = _front_share(
                    grade, roll, -max(accel, 0.0), body.wheelbase, body.cg_x, body.cg_z
                )
                if accel > 0.0 or thrust < 0.0:
                    over = accel - min(n.accel, thrust)
                    if over > _TOLERANCE:
                        bad[k] = True
                        worst[6] = max(worst[6], over)
                if n.min_load - front > _TOLERANCE:
                    bad[k] = True
                    worst[1] = max(worst[1], n.min_load - front)
                over = -accel - min(n.decel, braking)
                if over > _TOLERANCE:
                    bad[k] = True
                    worst[7] = max(worst[7], over)


OFFENCE_LIMITING: dict[str, Limiting] = {
    "overrun": Limiting.STOPPING_PATH,
    "axle_load": Limiting.TIP_OVER,
    "side_load": Limiting.ROLLOVER,
    "speed": Limiting.SPEED_LIMIT,
    "lateral": Limiting.LATERAL,
    "wheel_speed": Limiting.WHEEL_SPEED,
    "accel": Limiting.ACCEL,
    "decel": Limiting.DECEL,
}
"""Which bound a breach belongs to."""
