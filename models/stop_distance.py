"""The stop distance that a calibration promises: allowed over predicted, by speed, grade and level.

Predicted is the distance of the braking law with its dead time and every named effect. What stops
do beyond it is one distribution of their logarithmic residual
(:mod:`slopewise.models.calibration.distance_model`), kept here as a table of its quantiles.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.errors import ParameterError
from slopewise.models.quantity import STEEPEST, Matrix, non_negative, validate_quantities

MIN_PULL = 0.01
"""Deceleration as a share of gravity below which there is no finite stop [1]."""
MIN_DISTANCE = 1e-3
"""Of a stop [m]: a shorter one is raised to it, the log says that there was one."""
MAX_FACTOR = 50.0
"""Largest factor [1]: a stop fifty times as long as predicted is no stop of the same brakes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StopDistance:
    """Factors of the stop distance at quantiles, over onset speed, grade and brake level.

    Attributes:
        quantiles: (Q,) shares of stops that are no longer, increasing, in (0, 1).
        speeds: (V,) at the command [m/s], increasing. grades: (G,) [rad], increasing, uphill
            positive. levels: (L,) shares of full application, increasing, in (0, 1].
        stop_factor: (Q L G, V) allowed over predicted distance; rows by quantile, then by level,
            then by grade. Beyond the table its edge holds; between quantiles the logarithm is
            linear in the normal score, and above the last one, too.
        session_std: part of the spread of its logarithm that all stops of a session share [1];
            0: a table that no session changes.
    """

    quantiles: tuple[float, ...]
    speeds: tuple[float, ...]
    grades: tuple[float, ...]
    levels: tuple[float, ...]
    stop_factor: Matrix
    session_std: float = non_negative(
        "1", "Spread of ln(actual / predicted) between sessions.", default=0.0, at_most=1.0
    )

    def __post_init__(self) -> None:
        validate_quantities(self)
        _axis("quantiles", self.quantiles, 0.0, 1.0, open_ends=True)
        _axis("speeds", self.speeds, 0.0, np.inf)
        _axis("grades", self.grades, -STEEPEST, STEEPEST)
        _axis("levels", self.levels, 0.0, 1.0)
        rows = len(self.quantiles) * len(self.grades) * len(self.levels)
        if len(self.stop_factor) != rows or any(
            len(row) != len(self.speeds) for row in self.stop_factor
        ):
            expected = f"{rows} rows (quantiles x levels x grades) of {len(self.speeds)} speeds"
            raise ParameterError("stop_factor", expected)
        factor = np.array(self.stop_factor, np.float64)
        if not np.all((factor > 0.0) & (factor <= MAX_FACTOR)):
            raise ParameterError("stop_factor", f"numbers in (0, {MAX_FACTOR:g}]")
        if np.any(np.diff(np.log(factor).reshape(len(self.quantiles), -1), axis=0) < 0.0):
            raise ParameterError("stop_factor", "factors that grow with the quantile")

    def row(self, quantile: float) -> Floats:
        """(L, G, V) allowed over predicted distance at a quantile."""
        shape = len(self.quantiles), len(self.levels), len(self.grades), len(self.speeds)
        table = np.log(np.array(self.stop_factor)).reshape(shape)
        scores = np.array([NormalDist().inv_cdf(q) for q in self.quantiles])
        score = NormalDist().inv_cdf(quantile)
        log_factor = _between(table, scores, score)
        if len(scores) > 1 and score > scores[-1]:
            step = (score - scores[-1]) / (scores[-1] - scores[-2])
            log_factor = table[-1] + step * (table[-1] - table[-2])
        return np.exp(log_factor)

    def at(self, quantile: float, level: float, speed: Floats, grade: Floats) -> Floats:
        """(n,) factors of stops, linear in speed [m/s] and grade [rad], with the edge beyond."""
        table = np.exp(_between(np.log(self.row(quantile)), np.array(self.levels), level))
        (up, above), (right, beyond) = _place(self.grades, grade), _place(self.speeds, speed)
        last_up, last_right = len(self.grades) - 1, len(self.speeds) - 1
        next_up, next_right = np.minimum(up + 1, last_up), np.minimum(right + 1, last_right)
        low = (1.0 - beyond) * table[up, right] + beyond * table[up, next_right]
        high = (1.0 - beyond) * table[next_up, right] + beyond * table[next_up, next_right]
        return (1.0 - above) * low + above * high

    def worst(self, quantile: float) -> float:
        """Largest factor at a quantile."""
        return float(self.row(quantile).max())

    def with_factors(self, factor: Floats) -> StopDistance:
        """The same axes with other factors (Q L G, V)."""
        rows = tuple(map(tuple, factor.tolist()))
        return dataclasses.replace(self, stop_factor=rows)


def _between(table: Floats, axis: Floats, at: float) -> Floats:
    """Linear along the first axis of a table, constant beyond its ends."""
    if len(axis) == 1:
        return np.asarray(table[0])
    k = int(np.clip(np.searchsorted(axis, at) - 1, 0, len(axis) - 2))
    share = float(np.clip((at - axis[k]) / (axis[k + 1] - axis[k]), 0.0, 1.0))
    return np.asarray((1.0 - share) * table[k] + share * table[k + 1])


def _place(axis: tuple[float, ...], at: Floats) -> tuple[Ints, Floats]:
    """(n,) index of the point below, and share of the way to the next one."""
    points = np.array(axis)
    place = np.interp(at, points, np.arange(len(points), dtype=np.float64))
    below = place.astype(np.int64)
    return below, place - below


def _axis(
    name: str, values: tuple[float, ...], low: float, high: float, *, open_ends: bool = False
) -> None:
    axis = np.array(values, np.float64)
    inside = (axis > low) & (axis < high) if open_ends else (axis >= low) & (axis <= high)
    if not len(axis) or not inside.all() or np.any(np.diff(axis) <= 0.0):
        raise ParameterError(name, f"increasing numbers in {low:g} … {high:g}, got {values}")
