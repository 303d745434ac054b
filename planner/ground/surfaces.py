"""Braking of a map's surfaces by a model, as tables of numbers that the core reads.

They depend on the model, the uncertainty and the names of the map's classes only, which stay the
same for many cycles: the last few are cached.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats, Ints, read_only
from slopewise.models.effects import registry
from slopewise.models.effects.effect_law import Enters
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.quantity import Matrix
from slopewise.models.recent import Recent
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
    MIN_SIN_ROLL,
    MAX_SIN_ROLL,
    FRICTION,
    MAX_FRICTION,
    COLUMNS,
) = range(17)
"""Columns of the table."""

MAX_SURFACES = 62
"""A station's surfaces are bits of one integer, one of them ground never braked on."""


@dataclass(frozen=True, slots=True)
class SurfaceCache:
    """Coefficients of S surfaces, and what acts on the motion.

    Attributes:
        table: (S, COLUMNS) coefficients.
        class_bits: (classes,) bits of the surfaces that a class of the map may be.
        margins: (S, 4, 4) matrices of the margin of F_b/W; None where all are zero.
        hull: (S, K, 2) as of :func:`hull_lines`, None without one.
        motion: terms that act on the motion itself, without friction, brakes cold.
        slides: friction caps the force of some surface.
        closed_form: nothing acts on the motion.
    """

    table: Floats
    class_bits: Ints
    margins: Floats | None
    hull: Floats | None
    motion: registry.MotionTerms
    slides: bool
    closed_form: bool


_caches: Recent[SurfaceCache] = Recent()


def surface_cache_of(
    model: Model, class_names: tuple[str, ...], uncertainty: Uncertainty | None
) -> SurfaceCache:
    """Braking of these classes by this model, which never changes."""

    def gather() -> SurfaceCache:
        table, class_bits = surface_table(model, class_names, uncertainty)
        margins = None
        if uncertainty is not None:
            # Ground never braked on is as uncertain as the ground that is known best of it.
            names, scale = (
                ("", *model.braking.terrain, "")[: len(table)],
                registry.force_scale(model.effect),
            )
            margins = np.array(
                [scale**2 * uncertainty.force_matrix(model.braking.on(name)) for name in names]
            )
        motion = registry.motion(model.effect)._replace(friction=np.inf)
        return SurfaceCache(
            read_only(table),
            read_only(class_bits),
            margins if margins is not None and margins.any() else None,
            hull_lines(len(table), model),
            motion,
            bool(np.isfinite(table[:, FRICTION]).any()),
            motion == registry.NO_MOTION,
        )

    return _caches.get(gather, model, class_names, uncertainty)


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
        braking = model.braking.on(name)
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


def hull_lines(surfaces: int, model: Model) -> Floats | None:
    """(S, K, 2) intercept and slope of the lines of each surface; None where none has a hull.

    Surfaces without one, and lines that one has less than another, have an intercept of inf. Ground
    never braked on, the row behind the last, has the lines of all.
    """
    tables = [model.braking, *(model.braking.on(name) for name in model.braking.terrain)]
    if model.braking.extrapolate:
        return None
    hulls = [table.speed_by_grade for table in tables]
    by_surface = [np.empty((0, 2)) if hull is None else lines(hull) for hull in hulls]
    if not any(map(len, by_surface)):
        return None
    if surfaces > len(by_surface):
        by_surface.append(np.concatenate(by_surface))
    table = np.zeros((surfaces, max(map(len, by_surface)), 2))
    table[:, :, 0] = np.inf
    for row, held in zip(table, by_surface, strict=True):
        row[: len(held)] = held
    return table


def lines(corners: Matrix) -> Floats:
    """(K, 2) intercept [m/s] and slope [m/s per rad] of the lines between corners of a hull."""
    table = np.array(corners)
    slope = np.diff(table[:, 1]) / np.diff(table[:, 0])
    return np.column_stack((table[:-1, 1] - slope * table[:-1, 0], slope))
