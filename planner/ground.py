"""Braking force that the ground of each station offers: the model, the surface and its effects.

Two forces are kept. Where surfaces meet, or where the model extrapolates, the *weaker* one decides
where the vehicle stops and the *stronger* one whether it tips; elsewhere they are the same. Either
is linear in the speed at brake onset: F_b/W = speed_part * v_i + rest_part. Where friction caps the
force at some trained speed, both are constants: the least and the most that it can then be.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from models import effects
from models.parameters import Braking, Model
from models.quantity import GRAVITY
from planner.compiled import Bools, Floats, Ints, inlined, kernel, row_pass
from planner.terrain_profile import TerrainProfile
from planner.uncertainty import Uncertainty
from planner.workspace import empty

_M_M, _B_M, _M_B, _B_B, _UP_M_M, _UP_B_M, _DEAD, _OFFSET = range(8)
_SLOWEST, _FASTEST, _STEEPEST_DOWN, _STEEPEST_UP, _FRICTION, _COLUMNS = range(8, 14)


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
        push: what wind takes away from planned braking, <= 0, as a share of the weight.
        motion: terms that act on the motion itself; friction is in the forces already.
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
    push: Floats
    motion: effects.Motion
    closed_form: bool

    @property
    def braking_rest(self) -> Floats:
        """Rest part of the force that planned braking may count on, (N, M)."""
        return self.weak_rest + self.push if self.motion.wind_drag > 0.0 else self.weak_rest


def resolve_surface(braking: Braking, name: str) -> tuple[str, ...]:
    """Names of the surfaces that a map's class may be; "" is the base.

    ``#3`` is a class known by its number: the table with that `class_id`, else the third table. A
    surface that the model does not know may be any that it knows.
    """
    tables = list(braking.terrain)
    if name == "" or name in braking.terrain:
        return (name,)
    if name.startswith("#") and name[1:].isdecimal():
        number = int(name[1:])
        for table in tables:
            if braking.terrain[table].class_id == number:
                return (table,)
        if number == 0:
            return ("",)
        if number <= len(tables) and braking.terrain[tables[number - 1]].class_id is None:
            return (tables[number - 1],)
    return ("", *tables)


def _surface_table(
    model: Model, class_names: tuple[str, ...], uncertainty: Uncertainty | None
) -> tuple[Floats, Ints]:
    """Coefficients of each surface, and for each class the bits of the surfaces it may be.

    With uncertainty the last row is ground that the vehicle never braked on.
    """
    names = ["", *model.braking.terrain]
    table = np.empty((len(names), _COLUMNS))
    scale = effects.force_scale(model.effect)
    lockup = effects.motion(model.effect).friction
    for row, name in zip(table, names, strict=True):
        braking = braking_on(model, name)
        level, resistance = braking.level, model.terrain.motion_resistance
        up = braking.uphill or braking
        row[_M_M : _OFFSET + 1] = (
            scale * level * braking.m_m,
            scale * level * braking.b_m,
            scale * level * braking.m_b,
            scale * (level * braking.b_b + (1.0 - level) * resistance),
            scale * level * up.m_m,
            scale * level * up.b_m,
            braking.dead_time if uncertainty is None else uncertainty.dead_time(braking),
            braking.distance_offset,
        )
        sliding = np.inf if braking.sliding_friction is None else braking.sliding_friction
        row[_SLOWEST:] = (*braking.speed_range, *braking.grade_range, min(sliding, lockup))
    bits = np.zeros(len(class_names), np.int64)
    strange = False
    for index, name in enumerate(class_names):
        surfaces = resolve_surface(model.braking, name)
        for surface in surfaces:
            bits[index] |= 1 << names.index(surface)
        if uncertainty is not None and len(surfaces) == len(names) and not _is_known(model, name):
            bits[index] |= 1 << len(names)
            strange = True
    if uncertainty is not None and strange:
        weakest = table[np.argmin(table[:, _B_B])].copy()
        weakest[_M_M : _UP_B_M + 1] *= uncertainty.untrained_share
        table = np.vstack((table, weakest))
    return table, bits


def braking_on(model: Model, surface: str) -> Braking:
    """The braking model on a named surface; "" is the base."""
    return model.braking.on(surface) if surface else model.braking


def _is_known(model: Model, name: str) -> bool:
    """Is the class one that the model has learned, or the ground that it learned on?"""
    known = resolve_surface(model.braking, name)
    return (
        name in ("", "#0")
        or name in model.braking.terrain
        or (name.startswith("#") and len(known) == 1)
    )


def ground_along(
    profile: TerrainProfile,
    model: Model,
    class_names: tuple[str, ...] = ("",),
    conditions: Conditions | None = None,
    uncertainty: Uncertainty | None = None,
) -> Ground:
    """Braking force along candidates.

    Args:
        profile: terrain under the wheels.
        model: braking model, effects and limits.
        class_names: names of the map's terrain classes.
        conditions: session time and brake heat; both zero if left out.
        uncertainty: what to survive; left out, the model's mean counts.
    """
    now = conditions or Conditions()
    braking = model.braking
    table, class_bits = _surface_table(model, class_names, uncertainty)
    margin = braking.extrapolation_margin if braking.extrapolate else -1.0
    bits = _surface_bits(profile, class_bits)
    if len(table) == 1:
        forces = _on_one_surface(profile.grade, table[0], margin)
    else:
        forces = _on_many_surfaces(profile.grade, bits, table, margin)
    motion = effects.motion(model.effect, None, now.brake_heat)._replace(friction=np.inf)
    push = forces.weak_rest
    if model.effect:
        yaw = np.arctan2(profile.heading_y, profile.heading_x)
        lowest, highest = _ground_terms(model, profile, yaw, now.session_time)
        if uncertainty is not None:
            margin = sum(uncertainty.ground_margin(e) for e in model.effect)
            lowest, highest = lowest - margin, highest + margin
        forces = forces._replace(
            weak_rest=forces.weak_rest + lowest, strong_rest=forces.strong_rest + highest
        )
        pushes = [
            effects.motion_deceleration(speed, profile.curvature, yaw, motion) / GRAVITY
            for speed in (0.0, model.limits.speed)
        ]
        push = np.minimum(0.0, np.minimum(*pushes))
    if uncertainty is not None:
        forces = _widened(forces, profile.grade, bits, table, model, uncertainty)
    if np.isfinite(table[:, _FRICTION]).any():
        forces = _capped(forces, profile, bits, table)
    closed_form = motion == effects.motion(())._replace(heat=now.brake_heat)
    one_slowest = bool(np.ptp(table[:, _SLOWEST]) == 0.0)
    return Ground(*forces, push, motion, closed_form and one_slowest)


def _surface_bits(profile: TerrainProfile, class_bits: Ints) -> Ints:
    """Surfaces that each station may be on, (N, M) as bits.

    A surface may begin anywhere between two stations: it counts for both.
    """
    if len(class_bits) == 1:
        return np.broadcast_to(class_bits, profile.grade.shape)
    classes = profile.surfaces.copy()
    inside = np.arange(len(classes))[:, None] < profile.count
    own = np.where(inside, profile.surfaces, 0)
    classes[1:] |= own[:-1]
    classes[:-1] |= own[1:]
    bits = np.zeros_like(classes)
    for index, surfaces in enumerate(class_bits):
        bits |= np.where((classes >> index) & 1, surfaces, 0)
    return np.where(bits == 0, 1, bits)


def _widened(
    forces: _Forces,
    grade: Floats,
    bits: Ints,
    table: Floats,
    model: Model,
    uncertainty: Uncertainty,
) -> _Forces:
    """Both forces with the margin of the least certain surface, (N, M)."""
    names = ["", *model.braking.terrain]
    scale = effects.force_scale(model.effect)
    matrices = np.empty((len(table), 4, 4))
    for i in range(len(table)):
        # Ground that was never braked on is as uncertain as the ground that is known best of it.
        name = names[i] if i < len(names) else ""
        matrices[i] = scale**2 * uncertainty.force_matrix(braking_on(model, name))
    if not matrices.any():
        return forces
    weak_speed, weak_rest, strong_speed, strong_rest = empty(4, *grade.shape)
    _widen(
        grade, np.ascontiguousarray(bits), matrices, forces.slowest, forces.fastest,
        forces.weak_speed, forces.weak_rest, forces.strong_speed, forces.strong_rest,
        weak_speed, weak_rest, strong_speed, strong_rest,
    )  # fmt: skip
    return forces._replace(
        weak_speed=weak_speed, weak_rest=weak_rest, strong_speed=strong_speed,
        strong_rest=strong_rest,
    )  # fmt: skip


@kernel
def _widen(
    grade: Floats, bits: Ints, matrices: Floats, slowest: Floats, fastest: Floats,
    weak_speed_in: Floats, weak_rest_in: Floats, strong_speed_in: Floats, strong_rest_in: Floats,
    weak_speed: Floats, weak_rest: Floats, strong_speed: Floats, strong_rest: Floats,
) -> None:  # fmt: skip
    """Give up √(φᵀ S φ), which is convex in v_i: its chord over the trained speeds is above it."""
    stations, candidates = grade.shape
    for k in range(stations):
        for j in range(candidates):
            theta, slow, fast = grade[k, j], slowest[k, j], fastest[k, j]
            at_slow, at_fast = 0.0, 0.0
            for i in range(matrices.shape[0]):
                if (bits[k, j] >> i) & 1 == 0:
                    continue
                s = matrices[i]
                vv = (s[0, 0] * theta + 2.0 * s[0, 2]) * theta + s[2, 2]
                v1 = (s[0, 1] * theta + s[0, 3] + s[1, 2]) * theta + s[2, 3]
                one = (s[1, 1] * theta + 2.0 * s[1, 3]) * theta + s[3, 3]
                at_slow = max(at_slow, (vv * slow + 2.0 * v1) * slow + one)
                at_fast = max(at_fast, (vv * fast + 2.0 * v1) * fast + one)
            at_slow, at_fast = np.sqrt(at_slow), np.sqrt(at_fast)
            rise = (at_fast - at_slow) / max(fast - slow, 1e-6)
            rest = at_slow - rise * slow
            weak_speed[k, j] = weak_speed_in[k, j] - rise
            weak_rest[k, j] = weak_rest_in[k, j] - rest
            strong_speed[k, j] = strong_speed_in[k, j] + rise
            strong_rest[k, j] = strong_rest_in[k, j] + rest


def _capped(forces: _Forces, profile: TerrainProfile, bits: Ints, table: Floats) -> _Forces:
    """Cap both forces by friction times the share of the weight that presses on the ground."""
    on = [((bits >> i) & 1).astype(np.bool_) for i in range(len(table))]
    friction = table[:, _FRICTION]
    least = np.min([np.where(m, f, np.inf) for m, f in zip(on, friction, strict=True)], axis=0)
    most = np.max([np.where(m, f, 0.0) for m, f in zip(on, friction, strict=True)], axis=0)
    upright = np.sqrt((1.0 - profile.sin_grade**2) * (1.0 - profile.sin_roll**2))
    slow, fast = forces.slowest, forces.fastest

    def extremes(speed_part: Floats, rest_part: Floats) -> tuple[Floats, Floats]:
        ends = slow * speed_part + rest_part, fast * speed_part + rest_part
        return np.minimum(*ends), np.maximum(*ends)

    low, high = extremes(forces.weak_speed, forces.weak_rest)
    slides = high > least * upright
    _, highest = extremes(forces.strong_speed, forces.strong_rest)
    may_slide = highest > most * upright
    # Over a crest the ground is more upright between two stations than at either.
    uppermost = np.cos(_level_between(profile.grade)) * np.cos(_level_between(profile.roll))
    return forces._replace(
        weak_speed=np.where(slides, 0.0, forces.weak_speed),
        weak_rest=np.where(slides, np.minimum(low, least * upright), forces.weak_rest),
        strong_speed=np.where(may_slide, 0.0, forces.strong_speed),
        strong_rest=np.where(may_slide, np.minimum(highest, most * uppermost), forces.strong_rest),
    )


def _ground_terms(
    model: Model, profile: TerrainProfile, yaw: Floats, session_time: float
) -> tuple[Floats, Floats]:
    """Least and most that the ground terms can be around each station, (N, M).

    Terms that bend where grade or roll change sign are zero in between. A patch has a sharp edge
    and may lie between two stations: it counts as larger by a step where that is the safe side, and
    for the neighbours as well.
    """
    place = (profile.x, profile.y, yaw, session_time)
    lowest, highest = np.zeros_like(profile.grade), np.zeros_like(profile.grade)
    step = float(np.max(np.diff(profile.station, axis=0)))
    for effect in model.effect:
        own = effects.ground_term([effect], profile.grade, profile.roll, *place)
        least, most = own, own
        if effect.name in effects.BENT_AT_LEVEL:
            grade, roll = (_level_between(slope) for slope in (profile.grade, profile.roll))
            level = effects.ground_term([effect], grade, roll, *place)
            least, most = np.minimum(own, level), np.maximum(own, level)
        elif effect.name == "surface_patch":
            larger = {**effect.parameters, "radius": effect.parameters["radius"] + step}
            grown = [replace(effect, parameters=larger)]
            near = effects.ground_term(grown, profile.grade, profile.roll, *place)
            least, _ = _spread_to_neighbours(np.minimum(own, near))
            _, most = _spread_to_neighbours(np.maximum(own, near))
        lowest, highest = lowest + least, highest + most
    return lowest, highest


def _level_between(slope: Floats) -> Floats:
    """The slope, but level where it changes sign on the way to a neighbour, (N, M) [rad]."""
    lowest, highest = _spread_to_neighbours(slope)
    return np.where((lowest < 0.0) & (highest > 0.0), 0.0, slope)


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
    """Where it has no kink and does not extrapolate, the stronger force *is* the weaker one."""
    weak_speed, weak_rest, dead_time, slowest, fastest = empty(5, *grade.shape)
    strong_speed, strong_rest = weak_speed, weak_rest
    two = margin > 0.0 or _has_kink(surface)
    if two:
        strong_speed, strong_rest = empty(2, *grade.shape)
    trained = np.empty(grade.shape, np.bool_)
    _forces_on_one_surface(
        grade, surface, margin, two, strong_speed, strong_rest, weak_speed, weak_rest, trained
    )
    dead_time[:], slowest[:], fastest[:] = surface[_DEAD], surface[_SLOWEST], surface[_FASTEST]
    offset = np.full(grade.shape[1], surface[_OFFSET])
    return _Forces(
        weak_speed, weak_rest, strong_speed, strong_rest, dead_time, slowest, fastest, trained,
        offset,
    )  # fmt: skip


def _on_many_surfaces(grade: Floats, bits: Ints, table: Floats, margin: float) -> _Forces:
    weak_speed, weak_rest, strong_speed, strong_rest, dead_time, slowest, fastest = (
        np.empty(grade.shape) for _ in range(7)
    )
    trained, distance_offset = np.empty(grade.shape, np.bool_), np.zeros(grade.shape[1])
    forces = _Forces(
        weak_speed, weak_rest, strong_speed, strong_rest, dead_time, slowest, fastest, trained,
        distance_offset,
    )  # fmt: skip
    _forces(grade, bits, table, margin, *forces)
    return forces


def _spread_to_neighbours(term: Floats) -> tuple[Floats, Floats]:
    """Lowest and highest value among each station and its neighbours."""
    padded = np.pad(term, ((1, 1), (0, 0)), mode="edge")
    stack = np.stack((padded[:-2], term, padded[2:]))
    return stack.min(axis=0), stack.max(axis=0)


@kernel
def _forces_on_one_surface(
    grade: Floats, surface: Floats, margin: float, two: bool, strong_speed: Floats,
    strong_rest: Floats, weak_speed: Floats, weak_rest: Floats, trained: Bools,
) -> None:  # fmt: skip
    """Both forces, of which the stronger one is written only where the two may differ."""
    extra = max(margin, 0.0)
    for k in range(grade.shape[0]):
        before, after = grade[max(k - 1, 0)], grade[min(k + 1, grade.shape[0] - 1)]
        if two:
            _force_row(
                grade[k], before, after, surface, extra, 1.0, strong_speed[k], strong_rest[k]
            )
        _force_row(grade[k], before, after, surface, extra, -1.0, weak_speed[k], weak_rest[k])
        _trained_row(grade[k], surface, margin, trained[k])


@inlined
def _has_kink(surface: Floats) -> bool:
    """Other slope coefficients uphill: the force bends where the grade changes sign."""
    return bool((surface[_UP_M_M] != surface[_M_M]) | (surface[_UP_B_M] != surface[_B_M]))


@row_pass
def _force_row(
    grade: Floats, before: Floats, after: Floats, surface: Floats, extra: float, sign: float,
    speed_part: Floats, rest_part: Floats,
) -> None:  # fmt: skip
    """Weaker (sign −1) or stronger (+1) force of one surface.

    Where it extrapolates, also to a neighbour, it counts with an extra share of itself; where the
    grade changes sign on the way to a neighbour, the force on level ground counts as well.
    """
    m_m, b_m, m_b, b_b = surface[_M_M], surface[_B_M], surface[_M_B], surface[_B_B]
    up_m_m, up_b_m = surface[_UP_M_M], surface[_UP_B_M]
    down, up = surface[_STEEPEST_DOWN], surface[_STEEPEST_UP]
    kink = _has_kink(surface)
    for j in range(grade.shape[0]):
        theta = grade[j]
        speed = sign * ((up_m_m if theta > 0.0 else m_m) * theta + m_b)
        rest = sign * ((up_b_m if theta > 0.0 else b_m) * theta + b_b)
        steepest_down = min(theta, min(before[j], after[j]))
        steepest_up = max(theta, max(before[j], after[j]))
        bends = kink & (steepest_down < 0.0) & (steepest_up > 0.0)
        speed = max(speed, sign * m_b) if bends else speed
        rest = max(rest, sign * b_b) if bends else rest
        share = extra if (steepest_down < down) | (steepest_up > up) else 0.0
        speed_part[j] = sign * (speed + share * abs(speed))
        rest_part[j] = sign * (rest + share * abs(rest))


@row_pass
def _trained_row(grade: Floats, surface: Floats, margin: float, trained: Bools) -> None:
    down, up = surface[_STEEPEST_DOWN], surface[_STEEPEST_UP]
    for j in range(grade.shape[0]):
        trained[j] = ((grade[j] >= down) & (grade[j] <= up)) | (margin >= 0.0)


@kernel
def _forces(
    grade: Floats, surfaces: Ints, table: Floats, margin: float,
    weak_speed: Floats, weak_rest: Floats, strong_speed: Floats, strong_rest: Floats,
    dead_time: Floats, slowest: Floats, fastest: Floats, trained: Bools, distance_offset: Floats,
) -> None:  # fmt: skip
    stations, candidates = grade.shape
    for k in range(stations):
        for j in range(candidates):
            theta = grade[k, j]
            before, after = grade[max(k - 1, 0), j], grade[min(k + 1, stations - 1), j]
            steepest_down = min(theta, min(before, after))
            steepest_up = max(theta, max(before, after))
            bits = surfaces[k, j]
            low_speed, low_rest = np.inf, np.inf
            high_speed, high_rest = -np.inf, -np.inf
            dead, offset, fast = 0.0, 0.0, np.inf
            least_slow, most_slow = np.inf, 0.0
            inside, near_inside = True, True
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
                if steepest_down < 0.0 and steepest_up > 0.0 and _has_kink(table[i]):
                    low_speed = min(low_speed, table[i, _M_B])
                    low_rest = min(low_rest, table[i, _B_B])
                    high_speed = max(high_speed, table[i, _M_B])
                    high_rest = max(high_rest, table[i, _B_B])
                dead = max(dead, table[i, _DEAD])
                offset = max(offset, table[i, _OFFSET])
                least_slow = min(least_slow, table[i, _SLOWEST])
                most_slow = max(most_slow, table[i, _SLOWEST])
                fast = min(fast, table[i, _FASTEST])
                if theta < table[i, _STEEPEST_DOWN] or theta > table[i, _STEEPEST_UP]:
                    inside = False
                if steepest_down < table[i, _STEEPEST_DOWN] or steepest_up > table[i, _STEEPEST_UP]:
                    near_inside = False
            if not near_inside and margin >= 0.0:
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
