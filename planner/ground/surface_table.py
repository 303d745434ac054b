"""What the model knows of each surface, as one table of coefficients for compiled code."""

from __future__ import annotations

import numpy as np

from models.arrays import Floats, Ints
from models.effects import registry
from models.effects.effect_law import Enters
from models.errors import ParameterError
from models.parameters import Braking, Model
from planner.ground.terrain_profile import TerrainProfile
from planner.ground.uncertainty import Uncertainty

(
    M_M, B_M, M_B, B_B, UP_M_M, UP_B_M, DEAD, OFFSET,
    SLOWEST, FASTEST, STEEPEST_DOWN, STEEPEST_UP, LEAST_SIN_ROLL, MOST_SIN_ROLL,
    FRICTION, MOST_FRICTION, COLUMNS,
) = range(17)  # fmt: skip
"""Columns of the table."""

MOST_SURFACES = 62
"""A station's surfaces are bits of one integer, one of them ground never braked on."""


def resolve_surface(braking: Braking, name: str) -> tuple[str, ...]:
    """Names of the surfaces that a map's class may be; "" is the base.

    ``#3`` is a class known by its number: the table with that `class_id`, else the third table.
    With a surface come the states that it may turn out to be in. A surface that the model does not
    know may be any that it knows.
    """
    own = _own_surface(braking, name)
    return ("", *braking.terrain) if own is None else (own, *braking.states_of(own))


def _own_surface(braking: Braking, name: str) -> str | None:
    """The surface that a map's class is; None if the model does not know it."""
    tables = list(braking.terrain)
    if name == "" or name in braking.terrain:
        return name
    if name.startswith("#") and name[1:].isdecimal():
        number = int(name[1:])
        for table in tables:
            if braking.terrain[table].class_id == number:
                return table
        if number == 0:
            return ""
        if number <= len(tables) and braking.terrain[tables[number - 1]].class_id is None:
            return tables[number - 1]
    return None


def surface_table(
    model: Model, class_names: tuple[str, ...], uncertainty: Uncertainty | None
) -> tuple[Floats, Ints]:
    """Coefficients of each surface, and for each class the bits of the surfaces it may be.

    With uncertainty the last row is ground that the vehicle never braked on.
    """
    names = ["", *model.braking.terrain]
    if len(names) > MOST_SURFACES:
        raise ParameterError("braking.terrain", f"at most {MOST_SURFACES - 1} surfaces")
    table = np.empty((len(names), COLUMNS))
    scale = registry.force_scale(model.effect)
    lockup = frictions(model, uncertainty)
    for row, name in zip(table, names, strict=True):
        braking = braking_on(model, name)
        level, resistance = braking.share_at(), model.terrain.rolling_while_braking
        up = braking.uphill or braking
        row[M_M : OFFSET + 1] = (
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
        capped = (min(sliding, friction) for friction in lockup)
        rolls = np.sin(braking.trained_roll)
        row[SLOWEST:] = (*braking.speed_range, *braking.grade_range, *rolls, *capped)
    bits = np.zeros(len(class_names), np.int64)
    strange = False
    for index, name in enumerate(class_names):
        surfaces = resolve_surface(model.braking, name)
        for surface in surfaces:
            bits[index] |= 1 << names.index(surface)
        if uncertainty is not None and len(surfaces) == len(names) and not is_known(model, name):
            bits[index] |= 1 << len(names)
            strange = True
    if uncertainty is not None and strange:
        weakest = table[np.argmin(table[:, B_B])].copy()
        weakest[M_M : UP_B_M + 1] *= uncertainty.untrained_share
        table = np.vstack((table, weakest))
    return table, bits


def frictions(model: Model, uncertainty: Uncertainty | None) -> tuple[float, float]:
    """Least and most friction that effects may cap the force with; inf without them.

    The least decides where the vehicle stops, the most how far the rear axle is unloaded.
    """
    least = most = np.inf
    for effect in model.effect:
        law = registry.LAWS[effect.name]
        if law.enters is Enters.CAP:
            ((name, mu),) = registry.validate(effect).items()
            margin = 0.0 if uncertainty is None else uncertainty.margin_of(effect, name)
            least, most = min(least, max(mu - margin, 0.0)), min(most, mu + margin)
    return least, most


def braking_on(model: Model, surface: str) -> Braking:
    """The braking model on a named surface; "" is the base."""
    return model.braking.on(surface) if surface else model.braking


def is_known(model: Model, name: str) -> bool:
    """Is the class one that the model has learned, or the ground that it learned on?"""
    return _own_surface(model.braking, name) is not None


def surface_bits(profile: TerrainProfile, class_bits: Ints) -> Ints:
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
