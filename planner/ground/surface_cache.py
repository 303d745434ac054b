"""Braking of a map's surfaces by a model, in the shape that the core reads.

It depends on the model, the uncertainty and the names of the map's classes only, which stay the
same for many cycles: the last few answers are kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats, Ints, read_only
from slopewise.models.effects import registry
from slopewise.models.parameters import Model
from slopewise.models.recent import Recent
from slopewise.planner.ground.hull_speed import hull_lines
from slopewise.planner.ground.surface_table import FRICTION, braking_on, surface_table
from slopewise.planner.ground.uncertainty import Uncertainty


@dataclass(frozen=True, slots=True)
class SurfaceCache:
    """Coefficients of S surfaces, and what acts on the motion.

    Attributes:
        table: (S, columns) as of :mod:`slopewise.planner.ground.surface_table`.
        class_bits: (classes,) bits of the surfaces that a class of the map may be.
        margins: (S, 4, 4) matrices of the margin of F_b/W; None where all are zero.
        hull: (S, K, 2) as of :func:`slopewise.planner.ground.hull_speed.hull_lines`, None without
            one.
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
    return _caches.get(
        lambda: _gather(model, class_names, uncertainty), model, class_names, uncertainty
    )


def _gather(
    model: Model, class_names: tuple[str, ...], uncertainty: Uncertainty | None
) -> SurfaceCache:
    table, class_bits = surface_table(model, class_names, uncertainty)
    margins = None if uncertainty is None else _margins(len(table), model, uncertainty)
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


def _margins(surfaces: int, model: Model, uncertainty: Uncertainty) -> Floats:
    """Matrices of the margin of F_b/W on each surface, (S, 4, 4), of Uncertainty.force_matrix."""
    names = ["", *model.braking.terrain]
    scale = registry.force_scale(model.effect)
    matrices = np.empty((surfaces, 4, 4))
    for i in range(surfaces):
        # Ground that was never braked on is as uncertain as the ground that is known best of it.
        name = names[i] if i < len(names) else ""
        matrices[i] = scale**2 * uncertainty.force_matrix(braking_on(model, name))
    return matrices
