"""Coefficients of many vehicles together: each its own, pooled as far as its own stops say little.

y = x β_i + e for the stops of vehicle i, β_i normal around the fleet's mean with a covariance that
is the vehicles' difference from each other, e the measurement's noise and a scatter from stop to
stop that all vehicles share. Differences and scatter are estimated by restricted maximum likelihood
(expectation-maximisation; the scatter by a search along its likelihood); coefficients of a vehicle
are the best linear unbiased prediction: own stops and fleet weighed by what they know. A vehicle
without stops gets the mean, with the whole difference as its uncertainty.

A stop is an outlier against its own vehicle, never against the fleet: stops that agree with each
other are how their vehicle brakes. A vehicle that brakes far less than the others keeps what its
stops say. One that brakes far more is as likely one whose speed is misread, so its stops are
excluded and it counts as a vehicle without stops.

Validity: vehicles of one kind. The difference is taken as known once it is estimated; of very few
vehicles that would be overconfident, so one imagined vehicle of a typical difference is counted in.
Source: none in the papers. Laird and Ware 1982; Patterson and Thompson 1971.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.errors import ParameterError
from slopewise.models.stop_logs import random_effects
from slopewise.models.stop_logs.random_effects import PER_MAD

TYPICAL_SPREAD = (0.02, 0.1, 0.01, 0.04)
"""Standard deviations between vehicles of one kind, of the coefficients in the order of
:data:`slopewise.models.calibration.force_fit.NAMES`: those of the imagined vehicle [s/m, 1, s/m,
1]."""

_MIN_STOPS = 2
"""Vehicles from which differences between vehicles can be estimated [1]."""
_REJECT = 4.0  # standard deviations: one good observation in 16,000 is lost
_MAX_PASSES = 6
"""Alternations of outlier weights and variances at most [1]."""
_MAX_STEPS = 2000
"""Steps of the variance estimate at most [1]; it ends by its tolerance."""
_STILL = 1e-5  # relative change of the differences below which the search ends
_WIDE = 1e3  # prior standard deviations, in typical ones, of the fit that looks for gross errors
_ALONE = 10.0  # the same of one vehicle's fit: that of a vehicle calibrated alone
_MIN_SLOPE_STOPS = 8
"""Stops from which a vehicle's own slopes show; those of fewer are judged by their median [1]."""
_CONTRADICTS = 4.0
"""Standard deviations between vehicles by which one contradicts the others [1]."""


@dataclass(frozen=True, slots=True)
class Hierarchy:
    """A fleet of m vehicles with p coefficients each.

    Attributes:
        mean: (p,) of the fleet. mean_covariance: (p, p) of that estimate.
        spread: (p, p) covariance from vehicle to vehicle.
        scatter: standard deviation from stop to stop beyond the measurement noise.
        coefficients: (m, p) of each vehicle. covariance: (m, p, p) of their errors.
        inliers: (n,) stops that the fit rests on.
        contradiction: (m,) by how much the stops of a vehicle brake more than those of the others
            where it contradicts them, else 0 [1]; those with a positive one are excluded.
    """

    mean: Floats
    mean_covariance: Floats
    spread: Floats
    scatter: float
    coefficients: Floats
    covariance: Floats
    inliers: Bools
    contradiction: Floats


class _State(NamedTuple):
    """Everything that follows from sums and spread; the names are those of :class:`Hierarchy`."""

    mean: Floats
    mean_covariance: Floats
    effects: Floats
    conditional: Floats
    cost: float


class _Sums(NamedTuple):
    """Sums over the stops in the likelihood: XᵀWX (m, p, p), XᵀWy (m, p), yᵀWy and log det W⁻¹."""

    info: Floats
    score: Floats
    square: float
    log_variance: float

    def solve(self, spread: Floats) -> _State:
        """Mean and vehicles at a spread; nothing is inverted that a vehicle without stops has."""
        grown = np.eye(len(spread)) + spread @ self.info  # (m, p, p), I + T A
        conditional = np.linalg.solve(grown, np.broadcast_to(spread, self.info.shape))
        turned = np.swapaxes(grown, -1, -2)  # I + A T
        weight = np.linalg.solve(turned, self.info)
        solved = np.linalg.solve(turned, self.score[..., None])[..., 0]
        mean_covariance: Floats = np.asarray(np.linalg.inv(weight.sum(axis=0)), np.float64)
        mean: Floats = mean_covariance @ solved.sum(axis=0)
        left = self.score - self.info @ mean
        effects = (conditional @ left[..., None])[..., 0]
        quadratic = self.square - mean @ (2.0 * self.score - self.info @ mean).sum(axis=0)
        quadratic -= float(np.sum(left * effects))
        logs = np.linalg.slogdet(grown)[1].sum() - np.linalg.slogdet(mean_covariance)[1]
        cost = float(self.log_variance + logs + quadratic)
        return _State(mean, mean_covariance, effects, np.asarray(conditional, np.float64), cost)

    def spread(self, spread: Floats, typical: Floats, imagined: float) -> Floats:
        """Expectation-maximisation at a given scatter."""
        vehicles = len(self.info)
        for _ in range(_MAX_STEPS):
            state = self.solve(spread)
            known = state.conditional @ self.info
            second = np.einsum("mi,mj->ij", state.effects, state.effects)
            second = second + state.conditional.sum(axis=0)
            second += (known @ state.mean_covariance @ np.swapaxes(known, -1, -2)).sum(axis=0)
            better = (second + imagined * typical) / (vehicles + imagined)
            better = 0.5 * (better + better.T)
            size = np.sqrt(np.outer(*[np.diag(better)] * 2))
            moved = float(np.max(np.abs(better - spread) / size))
            spread = better
            if moved < _STILL:
                break
        return spread

    def errors(self, state: _State) -> Floats:
        """(m, p, p): unknown of a vehicle at a known mean, and its share of the mean's error."""
        share = np.eye(len(state.mean)) - state.conditional @ self.info
        total = state.conditional + share @ state.mean_covariance @ np.swapaxes(share, -1, -2)
        return 0.5 * (total + np.swapaxes(total, -1, -2))


class _Fit(NamedTuple):
    """Differences between vehicles (p, p), scatter, and what follows from them."""

    spread: Floats
    scatter: float
    state: _State


class _Stops(NamedTuple):
    """Stops of a fleet, (n,) each; of them those in `inliers` (n,) count."""

    design: Floats
    observed: Floats
    noise: Floats
    vehicle: Ints
    vehicles: int

    def sums(self, inliers: Bools, scatter: float) -> _Sums:
        x, y, i = self.design[inliers], self.observed[inliers], self.vehicle[inliers]
        variance = self.noise[inliers] ** 2 + scatter**2
        p = x.shape[1]
        info, score = np.zeros((self.vehicles, p, p)), np.zeros((self.vehicles, p))
        weighted = x / variance[:, None]
        np.add.at(info, i, weighted[:, :, None] * x[:, None, :])
        np.add.at(score, i, weighted * y[:, None])
        return _Sums(info, score, float(y @ (y / variance)), float(np.log(variance).sum()))

    def scatter(self, inliers: Bools, spread: Floats, before: float) -> float:
        """Restricted maximum likelihood of the scatter at a given spread."""

        def cost(log_scatter: float) -> float:
            return self.sums(inliers, float(np.exp(log_scatter))).solve(spread).cost

        typical = max(before, 0.1 * float(np.median(self.noise)), 1e-6)
        bounds = (np.log(1e-2 * typical), np.log(10.0 * typical))
        best = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 1e-3})
        return float(np.exp(best.x))

    def within(self, state: _State, scatter: float) -> Bools:
        """(n,) stops that are no gross errors."""
        x = self.design
        coefficients = (state.mean + state.effects)[self.vehicle]
        residual = self.observed - np.einsum("np,np->n", x, coefficients)
        uncertainty = np.einsum("ni,nij,nj->n", x, state.conditional[self.vehicle], x)
        limit = _REJECT * np.sqrt(self.noise**2 + scatter**2 + uncertainty)
        return np.asarray(np.abs(residual) <= limit)

    def within_vehicle(self, common: Floats, typical: Floats) -> tuple[Bools, float]:
        """(n,) stops that agree with the others of their vehicle, and their scatter.

        common: (p,) coefficients of the fleet, for the slopes of vehicles with few stops.
        """
        residual = self.observed - self.design @ common
        for i in range(self.vehicles):
            mine = self.vehicle == i
            if (count := int(mine.sum())) >= _MIN_SLOPE_STOPS:
                x, y, noise = self.design[mine], residual[mine], self.noise[mine]
                mean, wide = np.zeros(x.shape[1]), _ALONE**2 * typical
                residual[mine] = random_effects.fit(x, y, noise, mean, wide).residuals
            elif count:
                residual[mine] -= np.median(residual[mine])
        spread = PER_MAD * float(np.median(np.abs(residual)))
        scatter = max(spread**2 - float(np.median(self.noise)) ** 2, 0.0) ** 0.5
        return np.abs(residual) <= _REJECT * np.hypot(self.noise, scatter), max(scatter, 1e-9)

    def contradictions(self, inliers: Bools, fit: _Fit, typical: Floats) -> Floats:
        """(m,) difference of a vehicle's stops from the median vehicle, 0 where it is ordinary.

        Medians bear less than half of the vehicles being different; a typical difference counts as
        one more vehicle.
        """
        counts = np.bincount(self.vehicle[inliers], minlength=self.vehicles)
        known, result = np.flatnonzero(counts), np.zeros(self.vehicles)
        coefficients = (fit.state.mean + fit.state.effects)[known]
        for i in known:
            mine = inliers & (self.vehicle == i)
            x = self.design[mine].mean(axis=0)
            levels = coefficients @ x
            median = float(np.median(levels))
            spread = PER_MAD * float(np.median(np.abs(levels - median)))
            between = (len(known) * spread**2 + x @ typical @ x) / (len(known) + 1)
            error = (np.median(self.noise[mine]) ** 2 + fit.scatter**2) / counts[i]
            shift = float(self.observed[mine].mean()) - median
            if abs(shift) > _CONTRADICTS * np.sqrt(between + error):
                result[i] = shift
        return result

    def settle(
        self, inliers: Bools, members: Bools, fit: _Fit, typical: Floats, imagined: float
    ) -> tuple[Bools, _Fit]:
        """Inliers among stops of ``members`` (m,), and differences and scatter that go with them.

        inliers: (n,) and fit: where the search begins.
        """
        for _ in range(_MAX_PASSES):
            spread, scatter = fit.spread, fit.scatter
            for _ in range(3):
                spread = self.sums(inliers, scatter).spread(spread, typical, imagined)
                scatter = self.scatter(inliers, spread, scatter)
            fit = _Fit(spread, scatter, self.sums(inliers, scatter).solve(spread))
            again = self.within(fit.state, scatter) & members[self.vehicle]
            if (again == inliers).all():
                break
            inliers = again
        return inliers, fit


def fit(
    design: Floats,
    observed: Floats,
    noise: Floats,
    vehicle: Ints,
    vehicles: int,
    *,
    typical_spread: tuple[float, ...] = TYPICAL_SPREAD,
    imagined: float = 1.0,
) -> Hierarchy:
    """Fit a fleet.

    Args:
        design: (n, p), one row per stop. observed: (n,). noise: (n,) its measurement noise.
        vehicle: (n,) index of the vehicle, below ``vehicles``; one may have few stops or none.
        typical_spread: (p,) standard deviations of the imagined vehicle; where the search begins.
        imagined: vehicles counted in; 0 gives plain restricted maximum likelihood.

    Raises:
        ParameterError: stops of fewer than two vehicles, or fewer stops than coefficients.
    """
    n, p = design.shape
    if not all(np.isfinite(values).all() for values in (design, observed, noise)):
        raise ParameterError("stops", "finite numbers")
    if n <= p:
        raise ParameterError("stops", f"more than {p} of the whole fleet, got {n}")
    if (some := len(np.unique(vehicle))) < _MIN_STOPS:
        raise ParameterError("stops", f"stops of at least {_MIN_STOPS} vehicles, got {some}")
    stops = _Stops(design, observed, noise, vehicle, vehicles)
    typical = np.diag(np.square(typical_spread))
    start = random_effects.fit(design, observed, noise, np.zeros(p), _WIDE**2 * typical)
    inliers, scatter = stops.within_vehicle(start.coefficients, typical)
    fitted = _Fit(typical, scatter, stops.sums(inliers, scatter).solve(typical))
    members, stronger = np.ones(vehicles, np.bool_), np.zeros(vehicles)
    while True:
        inliers, fitted = stops.settle(inliers, members, fitted, typical, imagined)
        contradiction = stops.contradictions(inliers, fitted, typical)
        if not (contradiction > 0.0).any():
            break
        members &= contradiction <= 0.0
        stronger = np.maximum(stronger, contradiction)
        inliers = inliers & members[vehicle]
        if (count := int(inliers.sum())) <= p:
            expected = f"more than {p} of vehicles that do not contradict each other, got {count}"
            raise ParameterError("stops", expected)
    sums = stops.sums(inliers, fitted.scatter)
    state = sums.solve(fitted.spread)
    return Hierarchy(
        state.mean,
        state.mean_covariance,
        fitted.spread,
        fitted.scatter,
        state.mean + state.effects,
        sums.errors(state),
        inliers,
        np.where(members, contradiction, stronger),
    )
