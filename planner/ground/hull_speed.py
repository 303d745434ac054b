"""Speeds that were driven on each grade, held against every station: where a model has a hull."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.parameters import Model
from slopewise.models.quantity import Matrix
from slopewise.planner.kernels.compiled import kernel, row_pass
from slopewise.planner.kernels.workspace import empty


def hull_lines(surfaces: int, model: Model) -> Floats | None:
    """(S, K, 2) intercept and slope of the lines of each surface; None where none has a hull.

    Surfaces without one, and lines that one has less than another, have an intercept of inf. Ground
    never braked on, the row behind the last, has the lines of all.
    """
    tables = [model.braking, *(model.braking.on(name) for name in model.braking.terrain)]
    if model.braking.extrapolate:
        return None
    hulls = [table.speed_by_grade for table in tables]
    own = [np.empty((0, 2)) if hull is None else lines(hull) for hull in hulls]
    if not any(map(len, own)):
        return None
    if surfaces > len(own):
        own.append(np.concatenate(own))
    found = np.zeros((surfaces, max(map(len, own)), 2))
    found[:, :, 0] = np.inf
    for row, held in zip(found, own, strict=True):
        row[: len(held)] = held
    return found


def lines(corners: Matrix) -> Floats:
    """(K, 2) intercept [m/s] and slope [m/s per rad] of the lines between corners of a hull."""
    table = np.array(corners)
    slope = np.diff(table[:, 1]) / np.diff(table[:, 0])
    return np.column_stack((table[:-1, 1] - slope * table[:-1, 0], slope))


def hold_below(fastest: Floats, grade: Floats, bits: Ints, hull: Floats) -> None:
    """Lower the highest trained speeds to what was driven on the grade.

    A station counts with the grades of its neighbours as well, so that nothing in between is
    faster than the hull, which is concave.

    Args:
        fastest: (N, M) highest trained speeds [m/s], changed. grade: (N, M) [rad].
        bits: (N, M) surfaces that each station may be on. hull: of :func:`hull_lines`.
    """
    if len(hull) == 1:
        _on_one(fastest, grade, hull[0], empty(3, grade.shape[1]))
    else:
        # One memory layout: each further one would cause another compilation.
        _on_many(fastest, grade, np.ascontiguousarray(bits), hull)


@kernel
def _on_one(fastest: Floats, grade: Floats, hull: Floats, driven: Floats) -> None:
    """Rows in turn; of what was driven on their grades three rows are kept."""
    last = grade.shape[0] - 1
    for ahead in range(last + 2):
        if ahead <= last:
            driven[ahead % 3] = np.inf
            for i in range(0, hull.shape[0], 4):
                _lines_row(driven[ahead % 3], grade[ahead], hull, i)
        k = ahead - 1
        if k >= 0:
            before, after = max(k - 1, 0) % 3, min(k + 1, last) % 3
            _least_row(fastest[k], driven[before], driven[k % 3], driven[after])


@row_pass
def _lines_row(driven: Floats, grade: Floats, hull: Floats, first: int) -> None:
    """Four lines at a time; behind the last one it counts again."""
    last = hull.shape[0] - 1
    one, two = first, min(first + 1, last)
    three, four = min(first + 2, last), min(first + 3, last)
    a, b, c, d = hull[one, 0], hull[two, 0], hull[three, 0], hull[four, 0]
    e, f, g, h = hull[one, 1], hull[two, 1], hull[three, 1], hull[four, 1]
    for j in range(grade.shape[0]):
        theta = grade[j]
        v, w = a + e * theta, b + f * theta
        x, y = c + g * theta, d + h * theta
        v, x = v if v < w else w, x if x < y else y
        v = v if v < x else x
        driven[j] = v if v < driven[j] else driven[j]


@row_pass
def _least_row(fastest: Floats, before: Floats, here: Floats, after: Floats) -> None:
    for j in range(fastest.shape[0]):
        low = before[j] if before[j] < here[j] else here[j]
        low = after[j] if after[j] < low else low
        low = low if low > 0.0 else 0.0
        fastest[j] = low if low < fastest[j] else fastest[j]


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
