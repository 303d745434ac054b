"""Emergency stops from several speeds along one arc, integrated over the distance.

With F_b/W = (m_m v_i + b_m) θ + (m_b v_i + b_b) and v_i the speed at onset, v²/2 falls by
g (F_b/W + sin θ) on each metre of ground. Before that the speed is held, or gained downhill with
the drive cut, for as long as a command is in force and the brakes are dead.
Source: Braking (2), (7), (8), (12); loads as free body.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple, TypeAlias

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.effects import registry
from slopewise.models.effects.effect_law import Place
from slopewise.models.quantity import GRAVITY
from slopewise.services.guard.command_arc import CommandArc
from slopewise.services.guard.guard_model import GuardModel, SurfaceTable, governing_surfaces

_MIN_DECEL = 1e-9
"""Deceleration that a distance is divided by at least, far below any that ends a stop [m/s²]."""

Tables: TypeAlias = tuple[SurfaceTable, ...]
"""Tables of the same surfaces, by the model file and as learned; of all the worst case holds."""


class StopOutcomes(NamedTuple):
    """Outcomes of stops from K speeds, (K,) each."""

    # to rest, safety offset included; inf where the stop does not end on the arc [m]
    distance: Floats
    loaded: Bools  # axles and sides keep enough load throughout
    cornering: Bools  # lateral acceleration is within its limit


def stops_along(
    model: GuardModel,
    tables: Tables,
    arc: CommandArc,
    speeds: Floats,
    held: Floats,
    min_load: float,
) -> StopOutcomes:
    """Stop from K speeds [m/s], (K,), each ``held`` for a time before the dead time [s]."""
    count = min(arc.end + 1, len(arc.grade))
    grade, roll = arc.grade[:count], arc.roll[:count]
    sine, upright = np.sin(grade), np.cos(grade) * np.cos(roll)
    crest = np.minimum(arc.vertical_curvature[:count], 0.0)
    dead = max(table.dead_time[arc.possible].max() for table in tables)
    v = speeds[:, None] + tables[0].speed_error[arc.possible].max()
    # Share of each sample interval before the brakes take hold.
    covered = v * (held[:, None] + dead) - arc.step * np.arange(count)
    holds = np.minimum(np.maximum(covered / arc.step, 0.0), 1.0)
    gain = GRAVITY * np.maximum(-sine - model.resistance, 0.0) * arc.step
    onset_sq = v * v + 2.0 * np.cumsum(holds * gain, axis=1)[:, -1:]
    onset = np.sqrt(onset_sq)
    weakest, strongest = _force(model, tables, arc, onset, count)
    if model.motion.fade > 0.0:
        # Heat of this stop and of one more before it.
        weakest = weakest / (1.0 + model.motion.fade * onset_sq)
    unloaded = -crest * onset_sq / (GRAVITY * upright)
    share = registry.crest_share(model.effects) or 0.0
    weakest = weakest * np.maximum(1.0 - unloaded * max(1.0, share), 0.0)
    decel = GRAVITY * (weakest + sine) - _push(model, arc, onset, count)
    decel[:, :-1] = np.minimum(decel[:, :-1], decel[:, 1:])
    energy = onset_sq - 2.0 * np.cumsum((1.0 - holds) * decel * arc.step, axis=1)
    distance = _rest(energy, decel, onset_sq, holds, arc.step)
    moving = np.concatenate((np.ones_like(v, np.bool_), energy[:, :-1] > 0.0), axis=1)
    before = np.maximum(energy, 0.0) + 2.0 * np.maximum(decel, 0.0) * arc.step
    speed_sq = np.minimum(before, onset_sq)
    normal = upright + crest * speed_sq / GRAVITY
    loaded = _loads(model, arc, normal, speed_sq, strongest) >= min_load
    return StopOutcomes(
        distance + tables[0].offset[arc.possible].max(),
        np.all(loaded | ~moving, axis=1),
        np.abs(arc.curvature) * speeds * speeds <= model.lateral,
    )


def _force(
    model: GuardModel, tables: Tables, arc: CommandArc, onset: Floats, count: int
) -> tuple[Floats, Floats]:
    """Weakest and strongest F_b/W of the surfaces under the wheels, (K, S)."""
    grade, roll, under = arc.grade[:count], arc.roll[:count], arc.under[:, :count]
    place = Place(grade, roll, arc.x[:count], arc.y[:count], arc.yaw[:count], 0.0)
    extra = registry.ground_term(model.effects, place)
    governing, uphill = governing_surfaces(model), grade > 0.0
    weakest = np.full((len(onset), count), np.inf)
    strongest = -weakest
    for k, t in itertools.product(arc.possible, tables):
        speed = np.maximum(onset, t.slowest[k])
        slope = np.where(uphill, t.up_m[k], t.m_m[k]) * speed + np.where(
            uphill, t.up_b[k], t.b_m[k]
        )
        force = slope * grade + t.m_b[k] * speed + t.b_b[k]
        force = model.scale * t.level[k] * force + (1.0 - t.level[k]) * t.rolling[k] + extra
        force = np.minimum(force, t.friction[k] * np.cos(grade) * np.cos(roll))
        present = ((under == k) | (under == -1) | (under == governing[k])).any(axis=0)
        np.minimum(weakest, force, out=weakest, where=present)
        np.maximum(strongest, force * t.stronger[k] + t.extra[k], out=strongest, where=present)
    return weakest, strongest


def _push(model: GuardModel, arc: CommandArc, onset: Floats, count: int) -> Floats | float:
    """Largest acceleration by wind and the like, 0 where they brake [m/s²]."""
    if not model.motion.moves:
        return 0.0
    yaw = arc.yaw[:count]
    slowest, fastest = (
        registry.motion_deceleration(v + 0.0 * yaw, arc.curvature, yaw, model.motion)
        for v in (0.0 * onset, onset)
    )
    push: Floats = np.maximum(-np.minimum(fastest, slowest), 0.0)
    return push


def _rest(energy: Floats, decel: Floats, onset_sq: Floats, holds: Floats, step: float) -> Floats:
    """Distance at which each stop ends; inf where it does not [m]."""
    ended = energy <= 0.0
    last, k = np.argmax(ended, axis=1), np.arange(len(energy))
    before = np.where(last > 0, energy[k, last - 1], onset_sq[:, 0])
    before = np.minimum(np.maximum(before, 0.0), onset_sq[:, 0])
    braked = before / (2.0 * np.maximum(decel[k, last], _MIN_DECEL))
    part = np.minimum(holds[k, last] * step + braked, step)
    return np.where(ended.any(axis=1), last * step + part, np.inf)


def _loads(
    model: GuardModel, arc: CommandArc, normal: Floats, speed_sq: Floats, force: Floats
) -> Floats:
    """Lowest load share of axles and sides while braking as hard as possible, (K, S) [1]."""
    count = normal.shape[1]
    grade, roll, v = arc.grade[:count], arc.roll[:count], model.vehicle
    # The trailing axle, in the direction of motion, loses the load that the brakes transfer.
    trailing = normal - v.cg_z / (v.wheelbase - v.cg_x) * np.maximum(force, 0.0)
    leading = normal - v.cg_z / v.cg_x * np.maximum(np.sin(grade), 0.0)
    turn = arc.curvature * speed_sq / (GRAVITY * np.cos(roll))
    lateral = np.abs(np.cos(grade) * np.sin(roll) + turn)
    side = normal - 2.0 * v.cg_z / v.track_width * lateral
    lowest: Floats = np.minimum(np.minimum(trailing, leading), side)
    return lowest
