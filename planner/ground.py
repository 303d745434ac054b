"""Braking force that the ground of each station offers: the model, the surface and its effects.

Two forces are kept. Where surfaces meet, or where the model extrapolates, the *weaker* one decides
where the vehicle stops and the *stronger* one whether it tips; elsewhere they are the same. Either
is linear in the speed at brake onset: F_b/W = speed_part * v_i + rest_part.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from models import effects
from models.parameters import Braking, Model
from planner.compiled import Bools, Floats, Ints, inlined, kernel
from planner.terrain_profile import TerrainProfile

_M_M, _B_M, _M_B, _B_B, _UP_M_M, _UP_B_M, _DEAD, _OFFSET = range(8)
_SLOWEST, _FASTEST, _STEEPEST_DOWN, _STEEPEST_UP, _COLUMNS = range(8, 13)


@dataclass(frozen=True, slots=True)
class Conditions:
    """What the planner knows of the moment, beside map and model.

    Attributes:
        session_time: since the session began [s], for `session_drift`.
        brake_heat: heat per mass in the brakes now [J/kg], for `brake_fade`.
    """

    session_time: float = 0.0
    brake_heat: float = 0.0


@dataclass(frozen=True, slots=True)
class Ground:
    """Braking along M candidates of up to N stations; arrays are (N, M) unless said otherwise.

    Attributes:
        weak_speed, weak_rest: parts of the weaker F_b/W [s/m], [1].
        strong_speed, strong_rest: parts of the stronger F_b/W [s/m], [1].
        dead_time: from stop command to onset [s].
        slowest: speed below which the coefficients no longer change [m/s].
        fastest: highest trained speed [m/s].
        trained: the grade lies in the trained range, or extrapolation is allowed.
        distance_offset: (M,) safety offset added to every stop [m].
        motion: terms that act on the motion itself.
        closed_form: the stopping path has one: nothing acts on the motion, one slowest speed.
    """

    weak_speed: Floats
    weak_rest: Floats
    strong_speed: Floats
    strong_rest: Floats
    dead_time: Floats
    slowest: Floats
    fastest: Floats
    trained: Bools
    distance_offset: Floats
    motion: effects.Motion
    closed_form: bool


def resolve_surface(braking: Braking, name: str) -> tuple[str, ...]:
    """Names of the surfaces that a map's class may be; "" is the base.

    ``#3`` is a class known by its number: the table with that `class_id`, else the third table. A
    surface that the model does not know may be any that it knows.
    """
    tables = list(braking.terrain)
    if name == "" or name in braking.terrain:
        return (name,)
    if name.startswith("#"):
        number = int(name[1:])
        for table in tables:
            if braking.terrain[table].class_id == number:
                return (table,)
        if number == 0:
            return ("",)
        if number <= len(tables) and braking.terrain[tables[number - 1]].class_id is None:
            return (tables[number - 1],)
    return ("", *tables)


def _surface_table(model: Model, class_names: tuple[str, ...]) -> tuple[Floats, Ints]:
    """Coefficients of each surface, and for each class the bits of the surfaces it may be."""
    names = ["", *model.braking.terrain]
    table = np.empty((len(names), _COLUMNS))
    scale = effects.force_scale(model.effect)
    for row, name in zip(table, names, strict=True):
        braking = model.braking.on(name) if name else model.braking
        level, resistance = braking.level, model.terrain.motion_resistance
        up = braking.uphill or braking
        row[_M_M : _OFFSET + 1] = (
            scale * level * braking.m_m,
            scale * level * braking.b_m,
            scale * level * braking.m_b,
            scale * (level * braking.b_b + (1.0 - level) * resistance),
            scale * level * up.m_m,
            scale * level * up.b_m,
            braking.dead_time,
            braking.distance_offset,
        )
        row[_SLOWEST:] = (*braking.speed_range, *braking.grade_range)
    bits = np.zeros(len(class_names), np.int64)
    for index, name in enumerate(class_names):
        for surface in resolve_surface(model.braking, name):
            bits[index] |= 1 << names.index(surface)
    return table, bits


def ground_along(
    profile: TerrainProfile,
    model: Model,
    class_names: tuple[str, ...] = ("",),
    conditions: Conditions | None = None,
) -> Ground:
    """Braking force along candidates.

    Args:
        profile: terrain under the wheels.
        model: braking model, effects and limits.
        class_names: names of the map's terrain classes.
        conditions: session time and brake heat; both zero if left out.
    """
    now = conditions or Conditions()
    braking = model.braking
    table, class_bits = _surface_table(model, class_names)
    margin = braking.extrapolation_margin if braking.extrapolate else -1.0
    if len(table) == 1:
        forces = _on_one_surface(profile.grade, table[0], margin)
    else:
        forces = _on_many_surfaces(profile, table, class_bits, margin)
    if model.effect:
        yaw = np.arctan2(profile.heading_y, profile.heading_x)
        extra = effects.ground_term(
            model.effect, profile.grade, profile.roll, profile.x, profile.y, yaw, now.session_time
        )
        lowest, highest = _spread_to_neighbours(extra)
        forces = forces._replace(
            weak_rest=forces.weak_rest + lowest, strong_rest=forces.strong_rest + highest
        )
    motion = effects.motion(model.effect, braking.sliding_friction, now.brake_heat)
    at_rest = effects.motion((), None)
    closed_form = motion._replace(heat=0.0) == at_rest and bool(np.ptp(table[:, _SLOWEST]) == 0.0)
    return Ground(*forces, motion, closed_form)


class _Forces(NamedTuple):
    """The arrays of :class:`Ground`, in its order."""

    weak_speed: Floats
    weak_rest: Floats
    strong_speed: Floats
    strong_rest: Floats
    dead_time: Floats
    slowest: Floats
    fastest: Floats
    trained: Bools
    distance_offset: Floats


def _on_one_surface(grade: Floats, surface: Floats, margin: float) -> _Forces:
    """Where it does not extrapolate either, the stronger force *is* the weaker one."""
    weak_speed, weak_rest = np.empty_like(grade), np.empty_like(grade)
    strong_speed, strong_rest = weak_speed, weak_rest
    if margin > 0.0:
        strong_speed, strong_rest = np.empty_like(grade), np.empty_like(grade)
    trained = np.empty(grade.shape, np.bool_)
    _forces_on_one_surface(
        grade, surface, margin, strong_speed, strong_rest, weak_speed, weak_rest, trained
    )
    dead_time, slowest, fastest = (
        np.full(grade.shape, surface[column]) for column in (_DEAD, _SLOWEST, _FASTEST)
    )
    offset = np.full(grade.shape[1], surface[_OFFSET])
    return _Forces(
        weak_speed, weak_rest, strong_speed, strong_rest, dead_time, slowest, fastest, trained,
        offset,
    )  # fmt: skip


def _on_many_surfaces(
    profile: TerrainProfile, table: Floats, class_bits: Ints, margin: float
) -> _Forces:
    shape = profile.grade.shape
    arrays = [np.empty(shape) for _ in range(7)]
    forces = _Forces(*arrays, np.empty(shape, np.bool_), np.zeros(shape[1]))
    _forces(profile.grade, profile.surfaces, profile.count, table, class_bits, margin, *forces)
    return forces


def _spread_to_neighbours(term: Floats) -> tuple[Floats, Floats]:
    """Lowest and highest value among each station and its neighbours: patches have sharp edges."""
    padded = np.pad(term, ((1, 1), (0, 0)), mode="edge")
    stack = np.stack((padded[:-2], term, padded[2:]))
    return stack.min(axis=0), stack.max(axis=0)


@kernel
def _forces_on_one_surface(
    grade: Floats, surface: Floats, margin: float, strong_speed: Floats, strong_rest: Floats,
    weak_speed: Floats, weak_rest: Floats, trained: Bools,
) -> None:  # fmt: skip
    """The weaker force is written last: both may share their arrays."""
    for k in range(grade.shape[0]):
        _force_row(grade[k], surface, max(margin, 0.0), strong_speed[k], strong_rest[k])
        _force_row(grade[k], surface, -max(margin, 0.0), weak_speed[k], weak_rest[k])
        _trained_row(grade[k], surface, margin, trained[k])


@inlined
def _force_row(
    grade: Floats, surface: Floats, extra: float, speed_part: Floats, rest_part: Floats
) -> None:
    """Force of one surface, with an extra share of it where the model extrapolates."""
    m_m, b_m, m_b, b_b = surface[_M_M], surface[_B_M], surface[_M_B], surface[_B_B]
    up_m_m, up_b_m = surface[_UP_M_M], surface[_UP_B_M]
    down, up = surface[_STEEPEST_DOWN], surface[_STEEPEST_UP]
    for j in range(grade.shape[0]):
        theta = grade[j]
        speed = (up_m_m if theta > 0.0 else m_m) * theta + m_b
        rest = (up_b_m if theta > 0.0 else b_m) * theta + b_b
        share = extra if (theta < down) | (theta > up) else 0.0
        speed_part[j] = speed + share * abs(speed)
        rest_part[j] = rest + share * abs(rest)


@inlined
def _trained_row(grade: Floats, surface: Floats, margin: float, trained: Bools) -> None:
    down, up = surface[_STEEPEST_DOWN], surface[_STEEPEST_UP]
    for j in range(grade.shape[0]):
        trained[j] = ((grade[j] >= down) & (grade[j] <= up)) | (margin >= 0.0)


@kernel
def _forces(
    grade: Floats, surfaces: Ints, count: Ints, table: Floats, class_bits: Ints, margin: float,
    weak_speed: Floats, weak_rest: Floats, strong_speed: Floats, strong_rest: Floats,
    dead_time: Floats, slowest: Floats, fastest: Floats, trained: Bools, distance_offset: Floats,
) -> None:  # fmt: skip
    stations, candidates = grade.shape
    one_surface = table.shape[0] == 1
    for k in range(stations):
        for j in range(candidates):
            theta = grade[k, j]
            bits = 1
            if not one_surface:
                # A surface may begin anywhere between two stations: it counts for both.
                classes = surfaces[k, j]
                if k > 0:
                    classes |= surfaces[k - 1, j]
                if k + 1 < count[j]:
                    classes |= surfaces[k + 1, j]
                bits = 0
                for c in range(class_bits.shape[0]):
                    if (classes >> c) & 1:
                        bits |= class_bits[c]
                if bits == 0:
                    bits = 1
            low_speed, low_rest = np.inf, np.inf
            high_speed, high_rest = -np.inf, -np.inf
            dead, offset, fast = 0.0, 0.0, np.inf
            least_slow, most_slow = np.inf, 0.0
            inside = True
            for i in range(table.shape[0]):
                if (bits >> i) & 1 == 0:
                    continue
                uphill = theta > 0.0
                m_m = table[i, _UP_M_M] if uphill else table[i, _M_M]
                b_m = table[i, _UP_B_M] if uphill else table[i, _B_M]
                speed_part = m_m * theta + table[i, _M_B]
                rest_part = b_m * theta + table[i, _B_B]
                low_speed = min(low_speed, speed_part)
                low_rest = min(low_rest, rest_part)
                high_speed = max(high_speed, speed_part)
                high_rest = max(high_rest, rest_part)
                dead = max(dead, table[i, _DEAD])
                offset = max(offset, table[i, _OFFSET])
                least_slow = min(least_slow, table[i, _SLOWEST])
                most_slow = max(most_slow, table[i, _SLOWEST])
                fast = min(fast, table[i, _FASTEST])
                if theta < table[i, _STEEPEST_DOWN] or theta > table[i, _STEEPEST_UP]:
                    inside = False
            if not inside and margin >= 0.0:
                low_speed -= margin * abs(low_speed)
                low_rest -= margin * abs(low_rest)
                high_speed += margin * abs(high_speed)
                high_rest += margin * abs(high_rest)
                inside = True
            weak_speed[k, j] = low_speed
            weak_rest[k, j] = low_rest
            strong_speed[k, j] = high_speed
            strong_rest[k, j] = high_rest
            dead_time[k, j] = dead
            slowest[k, j] = least_slow if low_speed > 0.0 else most_slow
            fastest[k, j] = fast
            trained[k, j] = inside
            if offset > distance_offset[j]:
                distance_offset[j] = offset
