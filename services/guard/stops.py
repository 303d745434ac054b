"""Emergency stops from several speeds along one way, at once; no loop over time.

With F_b/W = (m_m v_i + b_m) θ + (m_b v_i + b_b) and v_i the speed at onset, v²/2 falls by
g (F_b/W + sin θ) on each metre of ground, after the speed was held, or gained downhill with the
drive cut, for as long as a command may stand and the brakes are dead. Source: Braking (2), (7),
(8), (12), integrated over the distance; loads as free body.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple, TypeAlias

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.effects import registry
from slopewise.models.effects.effect_law import Place
from slopewise.models.quantity import GRAVITY
from slopewise.services.guard.arc import ArcAhead
from slopewise.services.guard.model_reader import GuardModel, stands_for

_EPSILON = 1e-9

Tables: TypeAlias = tuple[Floats, ...]
"""Surfaces as rows, of :func:`slopewise.services.guard.model_reader.rows_of`, each table another
belief.
"""


class StopOutcomes(NamedTuple):
    """What becomes of stops from K speeds, (K,).

    Attributes:
        distance: to rest, safety offset included; inf where they do not end on the way [m].
        loaded: axles and sides keep enough load all the way.
        cornering: lateral acceleration is within its limit.
    """

    distance: Floats
    loaded: Bools
    cornering: Bools


def stops_along(
    model: GuardModel,
    tables: Tables,
    way: ArcAhead,
    speeds: Floats,
    held: Floats,
    least_load: float,
) -> StopOutcomes:
    """Stop from some speeds.

    Args:
        model, tables: vehicle, and its surfaces as rows; where there are several tables the worst
            of them counts. way: S samples.
        speeds: (K,) [m/s]. held: (K,) time for which the speed may be held, dead time not counted
            in [s]. least_load: share of the level load that axles and sides keep [1].
    """
    count = min(way.ends + 1, len(way.grade))
    names = list(model.surfaces.values())
    touched = [names[k] for k in way.kinds]
    dead = max(float(rows[k, 15]) for k in way.kinds for rows in tables)
    offset = max(s.offset for s in touched)
    error = max(s.speed_error for s in touched)
    grade, roll, bend = way.grade[:count], way.roll[:count], way.bend[:count]
    sine, upright = np.sin(grade), np.cos(grade) * np.cos(roll)
    v = speeds[:, None] + error
    gone = way.step * np.arange(count)
    coasted = v * (held[:, None] + dead)
    holds = np.minimum(
        np.maximum((coasted - gone) / way.step, 0.0), 1.0
    )  # share of each cell before the brakes
    gain = GRAVITY * np.maximum(-sine - model.resistance, 0.0) * way.step
    onset_sq = v * v + 2.0 * np.cumsum(holds * gain, axis=1)[:, -1:]
    onset = np.sqrt(onset_sq)
    least, most = _force(model, tables, way, onset, count)
    if model.motion.fade > 0.0:
        # Heat of this stop and of one more before it.
        least = least / (1.0 + model.motion.fade * onset_sq)
    lost = np.maximum(-bend, 0.0) * onset_sq / (GRAVITY * upright)
    crest = registry.crest_share(model.effects)
    least = least * np.maximum(1.0 - lost * max(1.0, crest or 0.0), 0.0)
    decel = GRAVITY * (least + sine) - _pushed(model, way, onset, count)
    decel[:, :-1] = np.minimum(decel[:, :-1], decel[:, 1:])
    energy = onset_sq - 2.0 * np.cumsum((1.0 - holds) * decel * way.step, axis=1)
    distance = _rest(energy, decel, onset_sq, holds, way.step) + offset
    moving = np.concatenate((np.ones_like(v, np.bool_), energy[:, :-1] > 0.0), axis=1)
    speed_sq = np.minimum(
        np.maximum(energy, 0.0) + 2.0 * np.maximum(decel, 0.0) * way.step, onset_sq
    )
    loaded = _loaded(model, way, (sine, upright, grade, roll, bend), speed_sq, most, least_load)
    cornering = np.abs(way.curvature) * speeds * speeds <= model.lateral
    return StopOutcomes(distance, np.all(loaded | ~moving, axis=1), cornering)


def _force(
    model: GuardModel, tables: Tables, way: ArcAhead, onset: Floats, count: int
) -> tuple[Floats, Floats]:
    """Least and most F_b/W of the wheels' surfaces, (K, S)."""
    grade = way.grade[:count]
    under = way.surface[:, :count]
    least = most = None
    place = Place(grade, way.roll[:count], way.x[:count], way.y[:count], way.yaw[:count], 0.0)
    extra = registry.ground_term(model.effects, place)
    counts_as = stands_for(model)
    for kind, rows in itertools.product(way.kinds, tables):
        m_m, b_m, m_b, b_b, up_m, up_b, slowest, cap, level, rolls = rows[kind, :10]
        speed = np.maximum(onset, slowest)
        uphill = grade > 0.0
        force = (np.where(uphill, up_m, m_m) * speed + np.where(uphill, up_b, b_m)) * grade
        force = model.scale * level * (force + m_b * speed + b_b) + (1.0 - level) * rolls + extra
        force = np.minimum(force, cap * np.cos(grade) * np.cos(way.roll[:count]))
        strong = force * rows[kind, 16] + rows[kind, 17]
        if len(way.kinds) == len(tables) == 1:
            return force, strong
        wide = (under == kind) | (under == -1) | (under == counts_as[kind])
        on = wide.any(axis=0)
        low, high = np.where(on, force, np.inf), np.where(on, strong, -np.inf)
        least = low if least is None else np.minimum(least, low)
        most = high if most is None else np.maximum(most, high)
    assert least is not None
    assert most is not None
    return least, most


def _pushed(model: GuardModel, way: ArcAhead, onset: Floats, count: int) -> Floats | float:
    """What wind and the like push at most [m/s²], >= 0; where they brake they are left out."""
    if not model.motion.moves:
        return 0.0
    ends = [
        registry.motion_deceleration(v, way.curvature, way.yaw[:count], model.motion)
        for v in (onset + 0.0 * way.yaw[:count], 0.0 * onset + 0.0 * way.yaw[:count])
    ]
    pushed: Floats = np.maximum(-np.minimum(*ends), 0.0)
    return pushed


def _rest(energy: Floats, decel: Floats, onset_sq: Floats, holds: Floats, step: float) -> Floats:
    """Where each stop ends [m]; inf where it does not."""
    ended = energy <= 0.0
    last = np.argmax(ended, axis=1)
    k = np.arange(len(energy))
    before = np.where(last > 0, energy[k, last - 1], onset_sq[:, 0])
    before = np.minimum(np.maximum(before, 0.0), onset_sq[:, 0])
    braked = before / (2.0 * np.maximum(decel[k, last], _EPSILON))
    part = np.minimum(holds[k, last] * step + braked, step)
    found: Floats = np.where(ended.any(axis=1), last * step + part, np.inf)
    return found


def _loaded(
    model: GuardModel,
    way: ArcAhead,
    pose: tuple[Floats, ...],
    speed_sq: Floats,
    force: Floats,
    least_load: float,
) -> Bools:
    """Where axles and sides keep enough load while braking as hard as may be, (K, S)."""
    sine, upright, grade, roll, bend = pose
    normal = upright + np.minimum(bend, 0.0) * speed_sq / GRAVITY
    # The axle behind, in the direction driven, loses what the brakes take.
    levers = (model.wheelbase - model.cg_x, model.cg_x)
    trailing, leading = levers
    axle = normal - model.cg_z / trailing * np.maximum(force, 0.0)
    climbing = normal - model.cg_z / leading * np.maximum(sine, 0.0)
    tilt = np.cos(grade) * np.sin(roll)
    turn = way.curvature * speed_sq / (GRAVITY * np.cos(roll))
    side = normal - 2.0 * model.cg_z / model.track * np.abs(tilt + turn)
    loaded: Bools = np.minimum(np.minimum(axle, climbing), side) >= least_load
    return loaded
