"""Emergency stops from several speeds along several courses, integrated over the distance.

With F_b/W = (m_m v_i + b_m) θ + (m_b v_i + b_b) and v_i the speed at onset, v²/2 falls by
g (F_b/W + sin θ) on each metre of ground. Before that the speed is held, or gained downhill with
the drive cut, for as long as a command is in force and the brakes are dead.
Source: Braking (2), (7), (8), (12); loads as free body.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.effects import registry
from slopewise.models.effects.effect_law import Place
from slopewise.models.quantity import GRAVITY
from slopewise.models.vehicle import Vehicle
from slopewise.services.guard.guard_model import GuardModel
from slopewise.services.guard.stop_courses import StopCourses
from slopewise.services.physics.force import NO_FRICTION_LIMIT, force_line
from slopewise.services.physics.loads import BodyAttitude, attitude_of, braking_cap, shares_of

_MIN_DECEL = 1e-9
"""Deceleration that a distance is divided by at least, far below any that ends a stop [m/s²]."""


class StopOutcomes(NamedTuple):
    """Outcomes of stops from K speeds on the worst course, (K,) each."""

    # to rest, safety offset included; inf where a stop does not end on its course [m]
    distance: Floats
    loaded: Bools  # axles and sides keep enough load throughout


def stops_along(
    model: GuardModel, courses: StopCourses, speeds: Floats, held: Floats, min_load: float
) -> StopOutcomes:
    """Stop from K speeds [m/s], (K,), each ``held`` for a time before the dead time [s].

    Speeds and distances are those of the fastest wheel.
    """
    tables, step, possible = model.tables, courses.step, courses.possible
    turn, crest = courses.share * courses.turn, np.minimum(courses.vertical_curvature, 0.0)
    pose = attitude_of(courses.grade, courses.roll, courses.vertical_curvature, turn)
    sine = pose.sine
    dead = max(table.dead_time[possible].max() for table in tables)
    v = speeds[:, None] + tables[0].speed_error[possible].max()
    # Share of each sample interval before the brakes take hold.
    covered = v * (held[:, None] + dead) - step * np.arange(sine.shape[-1])
    holds = np.minimum(np.maximum(covered / step, 0.0), 1.0)
    rolling = model.promised.terrain.rolling_while_braking
    gain = GRAVITY * np.maximum(-sine - rolling, 0.0) * step
    onset_sq = v * v + 2.0 * np.sum(holds * gain, axis=-1, keepdims=True)
    onset = np.sqrt(onset_sq)
    weakest, strongest = _force(model, courses, pose, onset)
    if model.motion.fade > 0.0:
        # Heat of this stop and of one more before it.
        weakest = weakest / (1.0 + model.motion.fade * onset_sq)
    unloaded = -crest * onset_sq / (GRAVITY * pose.normal_ratio)
    share = registry.crest_share(model.promised.effect) or 0.0
    weakest = weakest * np.maximum(1.0 - unloaded * max(1.0, share), 0.0)
    decel = GRAVITY * (weakest + sine) - _push(model, courses, onset)
    decel[..., :-1] = np.minimum(decel[..., :-1], decel[..., 1:])
    energy = onset_sq - 2.0 * np.cumsum((1.0 - holds) * decel * step, axis=-1)
    distance = _rest(energy, decel, onset_sq, holds, step)
    moving = np.concatenate((np.ones_like(onset_sq, np.bool_), energy[..., :-1] > 0.0), axis=-1)
    before = np.maximum(energy, 0.0) + 2.0 * np.maximum(decel, 0.0) * step
    speed_sq = np.minimum(before, onset_sq)
    loaded = _loads(courses.vehicle, pose, speed_sq, strongest) >= min_load
    shape = model.vehicle.shape
    corner = math.hypot(max(shape.front, shape.rear), 0.5 * shape.width)
    # Where the vehicle turns on the spot it is kept by the corners, which are the fastest.
    offset = tables[0].offset[possible].max()
    offset *= max(courses.share, 0.5 * model.vehicle.track_width / corner)
    return StopOutcomes(distance.max(axis=0) + offset, np.all(loaded | ~moving, axis=(0, 2)))


def _force(
    model: GuardModel, courses: StopCourses, pose: BodyAttitude, onset: Floats
) -> tuple[Floats, Floats]:
    """Weakest and strongest F_b/W of the surfaces under the wheels, (N, K, S)."""
    grade, roll, under = courses.grade, courses.roll, courses.under
    scale = registry.force_scale(model.promised.effect)
    place = Place(grade, roll, courses.x, courses.y, courses.yaw, 0.0)
    extra = registry.ground_term(model.promised.effect, place)
    even = pose._replace(vertical_curvature=np.zeros_like(grade))  # crests take their share later
    weakest = np.full((*onset.shape[:2], grade.shape[-1]), np.inf)
    strongest = -weakest
    for k, t in itertools.product(courses.possible, model.tables):
        speed = np.maximum(onset, t.slowest[k])
        downhill, uphill = (t.m_m[k], t.b_m[k]), (t.up_m[k], t.up_b[k])
        slope, intercept = force_line(downhill, uphill, (t.m_b[k], t.b_b[k]), grade)
        force = slope * speed + intercept
        force = scale * t.level[k] * force + (1.0 - t.level[k]) * t.rolling[k] + extra
        force = np.minimum(force, t.friction[k] * pose.normal_ratio)
        weak = force
        if t.friction[k] < NO_FRICTION_LIMIT:
            # Turn and bank take most of it, and axles lock first, at the highest speed.
            weak = np.minimum(
                force, braking_cap(courses.vehicle, even, t.friction[k], onset * onset)
            )
        present = courses.may_be[:, k][under].any(axis=0)
        np.minimum(weakest, weak, out=weakest, where=present)
        np.maximum(strongest, force * t.stronger[k] + t.extra[k], out=strongest, where=present)
    return weakest, strongest


def _push(model: GuardModel, courses: StopCourses, onset: Floats) -> Floats | float:
    """Largest acceleration by wind and the like, 0 where they brake [m/s²]."""
    if not model.motion.moves:
        return 0.0
    yaw = courses.yaw
    slowest, fastest = (
        registry.motion_deceleration(v + 0.0 * yaw, courses.turn, yaw, model.motion)
        for v in (0.0 * onset, onset)
    )
    push: Floats = np.maximum(-np.minimum(fastest, slowest), 0.0)
    return push


def _rest(energy: Floats, decel: Floats, onset_sq: Floats, holds: Floats, step: float) -> Floats:
    """Distance at which each stop ends; inf where it does not, (N, K) [m]."""
    n, k = np.arange(energy.shape[0])[:, None], np.arange(energy.shape[1])
    last = np.argmax(energy <= 0.0, axis=-1)
    before = np.where(last > 0, energy[n, k, last - 1], onset_sq[..., 0])
    before = np.minimum(np.maximum(before, 0.0), onset_sq[..., 0])
    braked = before / (2.0 * np.maximum(decel[n, k, last], _MIN_DECEL))
    part = np.minimum(holds[k, last] * step + braked, step)
    distance: Floats = np.where(energy[n, k, last] <= 0.0, last * step + part, np.inf)
    return distance


def _loads(vehicle: Vehicle, pose: BodyAttitude, speed_sq: Floats, force: Floats) -> Floats:
    """Lowest load share of axles and sides while braking as hard as possible, (N, K, S) [1]."""
    # The trailing axle, in the direction of motion, loses the load that the brakes transfer; the
    # leading one has least before they take hold.
    decel = GRAVITY * (np.maximum(force, 0.0) + pose.sine)
    braked = shares_of(vehicle, pose, speed_sq, decel)
    held = braked.front - vehicle.cg_z / (vehicle.cg_x * GRAVITY) * decel
    lowest: Floats = np.minimum(np.minimum(braked.rear, held), braked.side)
    return lowest
