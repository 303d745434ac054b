"""The numbers of a braking model with which no stop is allowed less than its promised distance.

A plan bounds a stop by a force that is bilinear in speed and grade, a dead time and a constant.
The table of a calibration is no such line, so the shortest of these lines that nowhere allows less
than the table takes its place. The mean force is unchanged, since loads, holding and lock-up rest
on it: what is given up becomes the covariance D Dᵀ/z², whose margin at z standard deviations is the
difference D of the coefficients.

Along varying ground the line integrates: where every part of the stop obeys it, the sum does.
Source: none; asymmetric least squares (Newey and Powell 1987) over the points of the table.
"""

from __future__ import annotations

import dataclasses
from functools import lru_cache
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.force_design import design
from slopewise.models.parameters import Braking, Model
from slopewise.models.quantity import GRAVITY, Matrix
from slopewise.models.stop_distance import MIN_PULL, StopDistance

_LATER = (1.0, 1.1, 1.25, 1.5, 2.0)
"""Dead times that are tried, as factors of the predicted one [1]: a longer one allows more where
stops are short, by less than its share where they are long."""
_CONSTANTS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8)
"""Constants that are tried, as shares of the shortest promised stop [1]."""
_MIN_LEVEL_FORCE = 1e-3
"""Least promised F_b/W on level ground [1]: a model file holds no brakes that do nothing."""
_MIN_GRADES, _MIN_SPEEDS = 0.035, 0.05
"""Spread of grades [rad] and speeds [m/s] below which a line keeps the slope of the mean."""
_ABOVE = tuple(np.geomspace(10.0, 1e6, 16).tolist())
"""Weights of points above their bound [1], pass by pass."""
_RIDGE = 1e-12
"""Share of the squares of the columns that is added to each [1]: above rounding."""
_CELL = 0.2
"""Points of the table that are this share of its speeds above what was driven still count [1]."""
_BETWEEN = 5
"""Points per step of the table at which the line must hold [1]; in between both are smooth."""


class PromisedLine(NamedTuple):
    """Coefficients m_m, b_m, m_b, b_b of full application, dead time [s] and constant [m]."""

    coefficients: tuple[float, float, float, float]
    uphill: tuple[float, float] | None
    dead_time: float
    constant: float


def promised(model: Model, quantile: float, *, as_mean: bool = False) -> Model:
    """The model whose plans at a quantile keep the promised distances; unchanged without a table.

    Args:
        model: any. quantile: one-sided probability that stops are no longer [1].
        as_mean: write the promised force as the force itself instead of as a margin, for those
            that read no covariance.
    """
    rolling = model.terrain.rolling_while_braking
    braking = promised_braking(model.braking, rolling, quantile, as_mean=as_mean)
    return model if braking is model.braking else dataclasses.replace(model, braking=braking)


def promised_braking(
    braking: Braking, rolling: float, quantile: float, *, as_mean: bool = False
) -> Braking:
    """The same of the braking model; ``rolling``: resistance that stays at a part of the brakes."""
    if braking.distance is None and all(t.distance is None for t in braking.terrain.values()):
        return braking
    tables = dict(braking.terrain)
    for name, table in tables.items():
        on = braking.on(name)
        if on.distance is not None:
            changes = _changes(on, rolling, quantile, as_mean)
            tables[name] = dataclasses.replace(table, distance=None, **changes)
    base = {} if braking.distance is None else _changes(braking, rolling, quantile, as_mean)
    return dataclasses.replace(braking, terrain=tables, distance=None, **base)


def _changes(on: Braking, rolling: float, quantile: float, as_mean: bool) -> dict[str, Any]:
    line = promised_line(on, rolling, quantile)
    mean = np.array(on.coefficients)
    width = float(NormalDist().inv_cdf(quantile))
    changes: dict[str, Any] = {
        "dead_time": line.dead_time,
        "dead_time_std": 0.0,
        "distance_offset": on.distance_offset + line.constant,
        "force_scatter": 0.0,
    }
    if as_mean or width < 1e-6:
        names = ("m_m", "b_m", "m_b", "b_b")
        changes |= dict(zip(names, line.coefficients, strict=True))
        if on.uphill is not None and line.uphill is not None:
            m_m, b_m = line.uphill
            changes["uphill"] = dataclasses.replace(on.uphill, m_m=m_m, b_m=b_m)
        return changes | {"covariance": tuple((0.0,) * 4 for _ in range(4))}
    given_up = (mean - np.array(line.coefficients)) / width
    square = np.outer(given_up, given_up)
    return changes | {"covariance": tuple(map(tuple, square.tolist()))}


def promised_line(on: Braking, rolling: float, quantile: float) -> PromisedLine:
    """The shortest line that allows no less than the table of a surface.

    Args:
        on: braking of one surface, with its table. rolling: resistance [1] that stays when the
            brakes are applied in part. quantile: any; interpolated in the normal score.
    """
    assert on.distance is not None
    law = _Law(
        on.coefficients,
        None if on.uphill is None else (on.uphill.m_m, on.uphill.b_m),
        on.dead_time,
        on.share_at(),
        rolling,
        on.level,
        on.speed_by_grade,
    )
    return _shortest(law, on.distance, float(quantile))


@lru_cache(maxsize=256)
def _shortest(law: _Law, table: StopDistance, quantile: float) -> PromisedLine:
    speeds = _refined(np.maximum(np.array(table.speeds), 1e-3))
    grades = _refined(np.array(table.grades))
    v, theta = (axis.ravel() for axis in np.meshgrid(speeds, grades))
    factor = table.at(quantile, law.level, v, theta)
    if law.driven is not None:
        corners = np.array(law.driven)
        inside = v <= np.interp(theta, corners[:, 0], corners[:, 1]) + _CELL * float(np.ptp(speeds))
        inside |= not inside.any()
        v, theta, factor = v[inside], theta[inside], factor[inside]
    allowed = factor * law.distance(v, theta)
    if not np.isfinite(allowed).any():
        return _weakest(law, v, theta, allowed)
    best = _best_line(law, v, theta, allowed)
    return _weakest(law, v, theta, allowed) if best is None else best


class _Law(NamedTuple):
    """Parameters of a braking model that the prediction rests on."""

    mean: tuple[float, float, float, float]
    slopes: tuple[float, float] | None
    dead_time: float
    share: float
    rolling: float
    level: float
    driven: Matrix | None

    def fixed(self, speed: Floats, grade: Floats) -> Bools:
        """(4,) coefficients that are kept, as speeds and grades do not distinguish them."""
        one_grade, one_speed = np.ptp(grade) < _MIN_GRADES, np.ptp(speed) < _MIN_SPEEDS
        return np.array([one_grade or one_speed, one_grade, one_speed, False])

    def change(self, speed: Floats, grade: Floats) -> Floats:
        """(n,) force that coefficients uphill add to the others."""
        if self.slopes is None:
            return np.zeros_like(speed)
        more = (self.slopes[0] - self.mean[0]) * speed + self.slopes[1] - self.mean[1]
        return more * np.maximum(grade, 0.0)

    def at_level(self, full: Floats) -> Floats:
        """(n,) F_b/W at the level, from that of full application."""
        return self.rolling + self.share * (full - self.rolling)

    def full(self, at_level: Floats) -> Floats:
        """(n,) F_b/W of full application, from that at the level."""
        return (at_level - self.rolling) / max(self.share, 1e-3) + self.rolling

    def distance(self, speed: Floats, grade: Floats) -> Floats:
        """(n,) predicted stop distance on even ground [m]; inf without a finite one."""
        full = design(speed, grade) @ np.array(self.mean) + self.change(speed, grade)
        pull = self.at_level(full) + np.sin(grade)
        distance = _stop(speed, pull, self.dead_time, 0.0)
        return np.where(pull > MIN_PULL, distance, np.inf)


def _stop(
    speed: Floats, pull: Floats, dead_time: Floats | float, constant: Floats | float
) -> Floats:
    """(n,) or (K, n) stop distances [m] under a deceleration of ``pull`` g > 0.

    Not that of the laws: `check` and guard read the promise, and share no stop with the planner.
    """
    return speed * dead_time + speed * speed / (2.0 * GRAVITY * np.maximum(pull, 1e-9)) + constant


def _best_line(law: _Law, v: Floats, theta: Floats, allowed: Floats) -> PromisedLine | None:
    """The line of least mean excess over all dead times and constants (K,); None if none stops."""
    finite = np.isfinite(allowed)
    later = np.array(_LATER) * max(law.dead_time, 1e-3)
    constants = np.array(_CONSTANTS) * float(allowed.min())
    dead, constant = (a.ravel() for a in np.meshgrid(later, constants, indexing="ij"))
    # Where dead time and constant alone allow more than the table, the force is no constraint.
    braked = np.maximum(allowed - v * dead[:, None] - constant[:, None], 1e-6)
    needed = np.where(finite, v * v / (2.0 * GRAVITY * braked), MIN_PULL) - np.sin(theta)
    change, x, mean = law.change(v, theta), design(v, theta), np.array(law.mean)
    # Nowhere stronger than the prediction; nowhere stronger than the table needs.
    upper = np.minimum(law.full(needed) - change, x @ mean)
    weight = np.maximum(v / np.maximum(allowed, 1e-9), 1e-6)
    coefficients = _highest_below(x, upper, weight, law.fixed(v, theta), mean)
    pull = law.at_level(coefficients @ x.T + change) + np.sin(theta)
    length = _stop(v, pull, dead[:, None], constant[:, None])[:, finite]
    excess = np.mean(length / allowed[finite] - 1.0, axis=1)
    excess[np.any(pull[:, finite] <= 0.5 * MIN_PULL, axis=1)] = np.inf
    k = int(np.argmin(excess))
    if not np.isfinite(excess[k]):
        return None
    return _with_uphill(law, tuple(coefficients[k].tolist()), float(dead[k]), float(constant[k]))


def _highest_below(x: Floats, upper: Floats, weight: Floats, fixed: Bools, mean: Floats) -> Floats:
    """(K, 4) coefficients whose forces x·c are nowhere above (K, n) and close to it by weight.

    Least squares in which what is above weighs more and more, and a last step down to the bound.
    """
    free, c = ~fixed, np.tile(mean, (len(upper), 1))
    columns = x[:, free]
    pairs = (columns[:, :, None] * columns[:, None, :]).reshape(len(x), -1)
    target = upper - x[:, fixed] @ mean[fixed]
    above = np.zeros(upper.shape, np.bool_)
    for heavier in _ABOVE:
        w = weight * np.where(above, heavier, 1.0)
        square = (w @ pairs).reshape(len(upper), columns.shape[1], -1)
        # A coefficient that no point depends on is that of the mean.
        ridge = _RIDGE * np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(len(mean[free]))
        right = ((w * (target - columns @ mean[free])) @ columns)[:, :, None]
        c[:, free] = mean[free] + np.linalg.solve(square + ridge, right)[:, :, 0]
        above = c @ x.T > upper
    c[:, 3] -= np.maximum(np.max(c @ x.T - upper, axis=1), 0.0)
    return c


def _weakest(law: _Law, v: Floats, theta: Floats, allowed: Floats) -> PromisedLine:
    """A line of even deceleration, where none that leans on the mean exists."""
    finite = np.isfinite(allowed)
    pull = v * v / (2.0 * GRAVITY * np.maximum(allowed - v * law.dead_time, 1e-6))
    min_pull = float(np.min(pull[finite])) if finite.any() else MIN_PULL
    min_pull -= float(np.max(theta - np.sin(theta)))
    slope = -1.0 / max(law.share, 1e-3)
    full = max(float(law.full(np.array(min_pull))), _MIN_LEVEL_FORCE)
    # Distance that such a force does not allow is added to each stop.
    pull = np.maximum(law.at_level(full + slope * theta) + np.sin(theta), 1e-3)
    short = allowed - _stop(v, pull, law.dead_time, 0.0)
    constant = max(float(np.max(short[finite])), 0.0) if finite.any() else 0.0
    return _with_uphill(law, (0.0, slope, 0.0, full), law.dead_time, constant)


def _with_uphill(
    law: _Law, coefficients: tuple[float, ...], dead: float, constant: float
) -> PromisedLine:
    m_m, b_m, m_b, b_b = coefficients
    uphill = None
    if law.slopes is not None:
        uphill = (m_m + law.slopes[0] - law.mean[0], b_m + law.slopes[1] - law.mean[1])
    return PromisedLine((m_m, b_m, m_b, b_b), uphill, dead, constant)


def _refined(axis: Floats) -> Floats:
    if len(axis) == 1:
        return axis
    at = np.linspace(0.0, len(axis) - 1.0, _BETWEEN * (len(axis) - 1) + 1)
    return np.interp(at, np.arange(len(axis)), axis)
