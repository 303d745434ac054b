"""Exact tests on independent rows of stops: errors of prediction, and one more term."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher
from scipy.stats import false_discovery_control

from .physics import Floats

Mask = NDArray[np.bool_]


class Rows(NamedTuple):
    """Whitened rows: (rows, k) base, (rows,) what is wanted, (rows,) number of the stop of each."""

    base: Floats
    wanted: Floats
    stop: NDArray[np.int64]


class Remainder(NamedTuple):
    """Sum of squares that a fit leaves, and how many rows it is of."""

    energy: float
    rows: int


def left_by_fit(rows: Rows, columns: Floats, stops: Mask) -> Remainder:
    """What least squares of (rows, k) columns leave of the rows of some stops."""
    used = stops[rows.stop] & np.any(rows.base != 0.0, axis=1)
    x, y = columns[used], rows.wanted[used]
    left = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    return Remainder(float(left @ left), len(y))


def energy_p_value(rows: Rows, known: Mask, tested: Mask) -> float:
    """P value of the errors with which known stops predict others (Chow, 1960)."""
    alone, both = (left_by_fit(rows, rows.base, mask) for mask in (known, known | tested))
    more, free = both.rows - alone.rows, alone.rows - rows.base.shape[1]
    if more <= 0 or free <= 0:
        return 1.0
    return float(fisher.sf((both.energy - alone.energy) / more * free / alone.energy, more, free))


def term_p_value(rows: Rows, term: Floats, stops: Mask, inside: Mask) -> float:
    """P value of the F-test of the term in its regime, beside the base."""
    acting = term * inside[rows.stop][:, None]
    without = left_by_fit(rows, rows.base, stops)
    added = left_by_fit(rows, np.concatenate((rows.base, acting), axis=1), stops)
    more, free = term.shape[1], added.rows - rows.base.shape[1] - term.shape[1]
    return float(
        fisher.sf((without.energy - added.energy) / more * free / added.energy, more, free)
    )


def adjusted(p_values: list[float]) -> list[float]:
    """Benjamini and Hochberg (1995): the rate of false discoveries at which each is one."""
    return [] if not p_values else false_discovery_control(p_values).tolist()
