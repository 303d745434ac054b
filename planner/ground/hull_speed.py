"""Speeds that were driven on each grade, held against every station: where a model has a hull."""

from __future__ import annotations

import numpy as np

from models import speed_by_grade
from models.arrays import Floats, Ints
from models.parameters import Model
from planner.kernels.compiled import kernel, row_pass


def hull_lines(surfaces: int, model: Model) -> Floats | None:
    """(S, K, 2) intercept and slope of the lines of each surface; None where none has a hull.

    Surfaces without one, and lines that one has less than another, have an intercept of inf. Ground
    never braked on, the row behind the last, has the lines of all.
    """
    tables = [model.braking, *(model.braking.on(name) for name in model.braking.terrain)]
    if model.braking.extrapolate:
        return None
    own = [np.empty((0, 2)) if t.speed_by_grade is None else speed_by_grade.lines(t.speed_by_grade)
           for t in tables]  # fmt: skip
    if not any(map(len, own)):
        return None
    if surfaces > len(own):
        own.append(np.concatenate(own))
    found = np.zeros((surfaces, max(map(len, own)), 2))
    found[:, :, 0] = np.inf
    for row, held in zip(found, own, strict=True):
        row[: len(held)] = held
    return found


def hold_below(fastest: Floats, grade: Floats, bits: Ints, hull: Floats) -> None:
    """Lower the highest trained speeds to what was driven on the grade.

    A station counts with the grades of its neighbours as well, so that nothing in between is
    faster than the hull, which is concave.

    Args:
        fastest: (N, M) highest trained speeds [m/s], changed. grade: (N, M) [rad].
        bits: (N, M) surfaces that each station may be on. hull: of :func:`hull_lines`.
    """
    if len(hull) == 1:
        _on_one(fastest, grade, hull[0])
    else:
        _on_many(fastest, grade, bits, hull)


@row_pass
def _line_row(fastest: Floats, grade: Floats, intercept: float, slope: float) -> None:
    for j in range(grade.shape[0]):
        speed = max(intercept + slope * grade[j], 0.0)
        fastest[j] = speed if speed < fastest[j] else fastest[j]


@kernel
def _on_one(fastest: Floats, grade: Floats, hull: Floats) -> None:
    last = grade.shape[0] - 1
    for k in range(grade.shape[0]):
        for i in range(hull.shape[0]):
            for near in range(max(k - 1, 0), min(k + 1, last) + 1):
                _line_row(fastest[k], grade[near], hull[i, 0], hull[i, 1])


@kernel
def _on_many(fastest: Floats, grade: Floats, bits: Ints, hull: Floats) -> None:
    last = grade.shape[0] - 1
    for k in range(grade.shape[0]):
        for j in range(grade.shape[1]):
            for s in range(hull.shape[0]):
                if (bits[k, j] >> s) & 1 == 0:
                    continue
                for i in range(hull.shape[1]):
                    for near in range(max(k - 1, 0), min(k + 1, last) + 1):
                        speed = max(hull[s, i, 0] + hull[s, i, 1] * grade[near, j], 0.0)
                        if speed < fastest[k, j]:
                            fastest[k, j] = speed
