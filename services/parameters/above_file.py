"""How far what was learned may exceed the model file.

F_b/W is bilinear in speed and grade: a limit at the four corners of the trained rectangle is one
everywhere in it.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from slopewise.models.calibration.force_fit import NAMES, design
from slopewise.models.parameters import Braking
from slopewise.models.surface_braking import SurfaceBraking

_NOTHING = 1e-3
"""Force beyond the file that is not worth telling [1]."""


def limited(prior: Braking, used: Braking, most: float) -> tuple[Braking, list[str]]:
    """A learned braking model with no corner above the file's force by more than a share.

    Args:
        prior: of the model file. used: as it was learned, on top of it.
        most: share of the file's F_b/W by which plans may count on more.

    Returns:
        The model to plan with, and the surfaces on which it still is stronger than the file; ""
        is the base.
    """
    stronger: list[str] = []
    base, above = _limited(prior, None, used, None, most)
    if above:
        stronger.append("")
    tables = {}
    for name, table in used.terrain.items():
        changes, above = _limited(prior, prior.terrain.get(name), used, table, most)
        tables[name] = dataclasses.replace(table, **changes) if changes else table
        if above:
            stronger.append(name)
    if not base and tables == used.terrain:
        return used, stronger
    return dataclasses.replace(used, terrain=tables, **base), stronger


def _limited(
    prior: Braking,
    known: SurfaceBraking | None,
    used: Braking,
    now: SurfaceBraking | None,
    most: float,
) -> tuple[dict[str, Any], bool]:
    """Coefficients to replace, none where nothing has to be; whether it is above the file."""
    speeds, grades = _of(used, now, "speed_range"), _of(used, now, "grade_range")
    speed, grade = np.meshgrid(speeds, grades)
    corners = design(speed.ravel(), grade.ravel())
    file = corners @ np.array([_of(prior, known, name) for name in NAMES])
    force = corners @ np.array([_of(used, now, name) for name in NAMES])
    limit = file + most * np.abs(file)
    above = bool(np.any(np.minimum(force, limit) > file + _NOTHING))
    if np.all(force <= limit + 1e-9):
        return {}, above
    lower = np.linalg.solve(corners, np.minimum(force, limit))
    return dict(zip(NAMES, lower.tolist(), strict=True)), above


def _of(base: Braking, table: SurfaceBraking | None, name: str) -> Any:
    """What holds on a surface: its own key, or the base's."""
    own = None if table is None else getattr(table, name)
    return getattr(base, name) if own is None else own
