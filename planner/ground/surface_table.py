"""Braking of each surface by the model, as one table of coefficients for compiled code."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.effects import registry
from slopewise.models.effects.effect_law import Enters
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking, Model
from slopewise.models.surface_names import candidate_surfaces, resolve_class
from slopewise.planner.ground.uncertainty import Uncertainty

(
    M_M,
    B_M,
    M_B,
    B_B,
    UP_M_M,
    UP_B_M,
    DEAD,
    OFFSET,
    SLOWEST,
    FASTEST,
    STEEPEST_DOWN,
    STEEPEST_UP,
    LEAST_SIN_ROLL,
    MOST_SIN_ROLL,
    FRICTION,
    MOST_FRICTION,
    COLUMNS,
) = range(17)
"""Columns of the table."""

MAX_SURFACES = 62
"""A station's surfaces are bits of one integer, one of them ground never braked on."""


def surface_table(
    model: Model, class_names: tuple[str, ...], uncertainty: Uncertainty | None
) -> tuple[Floats, Ints]:
    """Coefficients of each surface, and for each class the bits of the surfaces it may be.

    With uncertainty the last row is ground that the vehicle never braked on.
    """
    names = ["", *model.braking.terrain]
    if len(names) > MAX_SURFACES:
        raise ParameterError("braking.terrain", f"at most {MAX_SURFACES - 1} surfaces")
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
        for surface in candidate_surfaces(model.braking.terrain, name):
            bits[index] |= 1 << names.index(surface)
        if uncertainty is not None and resolve_class(model.braking.terrain, name) is None:
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
    lowest = highest = np.inf
    for effect in model.effect:
        law = registry.LAWS[effect.name]
        if law.enters is Enters.CAP:
            ((name, mu),) = registry.validate(effect).items()
            margin = 0.0 if uncertainty is None else uncertainty.margin_of(effect, name)
            lowest = min(lowest, max(mu - margin, 0.0))
            highest = min(highest, mu + margin)
    return lowest, highest


def braking_on(model: Model, surface: str) -> Braking:
    """The braking model on a named surface; "" is the base."""
    return model.braking.on(surface) if surface else model.braking
