"""Speeds that were driven on each grade, where a model has their hull: no bound is above them."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.parameters import Model
from slopewise.models.quantity import Matrix


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
