"""Limit on how far learned braking exceeds the model file.

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

_REPORTED_EXCESS = 1e-3
"""Smallest F_b/W above the file that is reported [1]: a tenth of the step that one stop may add."""

_TOLERANCE = 1e-9  # rounding of F_b/W that is not limited [1]


def limit_increase(prior: Braking, used: Braking, share: float) -> tuple[Braking, list[str]]:
    """A learned braking model with no corner above the file's force by more than a share.

    Args:
        prior: braking of the model file. used: braking as learned on top of it.
        share: part of the file's F_b/W by which plans may count on more [1].

    Returns:
        The model to plan with, and the surfaces on which it still exceeds the file; "" is the
        base.
    """
    stronger: list[str] = []
    base, above = _limit_surface(prior, None, used, None, share)
    if above:
        stronger.append("")
    tables = {}
    for name, table in used.terrain.items():
        changes, above = _limit_surface(prior, prior.terrain.get(name), used, table, share)
        tables[name] = dataclasses.replace(table, **changes) if changes else table
        if above:
            stronger.append(name)
    if not base and tables == used.terrain:
        return used, stronger
    return dataclasses.replace(used, terrain=tables, **base), stronger


def _limit_surface(
    prior: Braking,
    known: SurfaceBraking | None,
    used: Braking,
    table: SurfaceBraking | None,
    share: float,
) -> tuple[dict[str, Any], bool]:
    """Coefficients to replace, empty within the limit; True if the force exceeds the file."""
    speeds, grades = _value(used, table, "speed_range"), _value(used, table, "grade_range")
    speed, grade = np.meshgrid(speeds, grades)
    corners = design(speed.ravel(), grade.ravel())
    file = corners @ np.array([_value(prior, known, name) for name in NAMES])
    force = corners @ np.array([_value(used, table, name) for name in NAMES])
    limit = file + share * np.abs(file)
    above = bool(np.any(np.minimum(force, limit) > file + _REPORTED_EXCESS))
    if np.all(force <= limit + _TOLERANCE):
        return {}, above
    lower = np.linalg.solve(corners, np.minimum(force, limit))
    return dict(zip(NAMES, lower.tolist(), strict=True)), above


def _value(base: Braking, table: SurfaceBraking | None, name: str) -> Any:
    """Value on a surface: its key, or the base's where it has none."""
    value = None if table is None else getattr(table, name)
    return getattr(base, name) if value is None else value
