"""One distribution of the stop distance beyond its prediction: hierarchical, with heavy tails.

    y = ln(actual / predicted) = x·β + Σ η_k (Λ/λ)^k + δ_session + ε,   k = 1 … 3

Predicted is the braking law with dead time and every named effect, along the ground of the stop. x
are the derivatives of the logarithm of the distance: by dead time, force, its change with speed,
and the answer to grades, each with a weak prior: the uncertainty of the law is included once. Λ is
the logarithm of the speed over the mean of the log, λ = max(max |Λ|, 0.3): what a force linear in
speed cannot follow. ε = σ √(1 + (a/d)²) t_ν scatters in proportion where stops are long and by the
length a where they are short.

    β ~ N(0, 0.8², 0.8², 0.35², 0.35²)   η_k ~ N(0, s_f²), s_f ~ HalfNormal(0.10)
    δ ~ N(0, s_s²), s_s ~ HalfNormal(S)  σ ~ HalfNormal(0.30)   a ~ HalfNormal(0.3 median d)
    ν in {3, 5, 10, 100} with probabilities 0.2, 0.25, 0.25, 0.3

S is 0.10; from three sessions on at least the spread of their means beyond that of their stops.
The hyperparameters (ν, σ, s_s, s_f, a) are a grid, the rest is Gaussian at each of its points
(Laplace), and a bound is a quantile of the mixture. Deterministic; 0.4 s for 150 stops.

Validity: sessions that differ at random, stops like those of the log. Source: none; a Bayesian
linear mixed model. Tails: Lange, Little and Taylor 1989.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import gammaln, ndtri, stdtr

from slopewise.models.arrays import Floats, Ints
from slopewise.models.stop_logs.random_effects import PER_MAD

_PRIOR_STD = np.array([0.8, 0.8, 0.35, 0.35])
"""Of dead time and force (logarithms), change with speed, answer to grades [1]."""
_LEVEL_STD = 0.3
"""Of the exponent with which the distance changes with the brake level beyond the law [1]."""
_FREEDOM = np.array([3.0, 5.0, 10.0, 100.0])
_FREEDOM_PRIOR = np.array([0.2, 0.25, 0.25, 0.3])
_SIGMA_STD, _FORM_STD, _SHORT_STD, _SESSION_STD = 0.30, 0.10, 0.3, 0.10
"""Scales of the half normal priors; the third as a share of the median distance [1]."""
_MIN_SPREAD = 0.3
"""Least λ [1]: speeds within 30 % of each other show no bend."""
_MIN_GRADE_STD = 0.017
"""Spread of the grades from which a log shows the answer to them [rad]."""
_MIN_LEVEL_STD = 0.05
"""Spread of the logarithms of the levels likewise [1]."""
_SHARES = np.array([0.15, 0.5, 0.85])
"""Quantiles of the half normal priors at which their grids stand."""
_SIGMAS = np.geomspace(0.3, 3.0, 9)
"""Grid of σ, as factors of the spread of the residuals."""
_STEPS = 12
"""Reweighted least squares steps [1]: the mode moves by less than 1e-3 σ in the last."""
_FIRST_STEPS, _HOPELESS = 3, 20.0
"""Steps [1] after which a point is dropped by how far its log density is below the highest [1]: in
40 logs made to be hard, none that counted at the end was more than 9.5 below by then."""
_NEGLIGIBLE = 7.0
"""Log density below the highest from which a grid point is dropped [1]: 1e-3 of its weight."""
_NODES = 5
"""Gauss–Hermite nodes of the normal part of a prediction [1]: the tail to 1e-4 within 2 %."""
_LADDER = np.concatenate((np.linspace(-3.0, 6.0, 25), np.geomspace(6.5, 300.0, 15)))
"""Rungs at which the mixture is evaluated, in its own spread from its mean [1]."""
_ARCSINH = np.linspace(-9.0, 9.0, 1201)
"""Points of the tables of Student's t, even in the arcsinh of t [1]: accurate to 1e-4."""
_SURVIVAL = {nu: np.log(stdtr(nu, -np.sinh(_ARCSINH))) for nu in _FREEDOM.tolist()}
"""Logarithm of P(t > z) of each Student-t, at the arcsinh of z: read off a table, it is 20 times as
fast."""


class StopFeatures(NamedTuple):
    """Features that the residual of stops may depend on, (n,) each.

    Attributes:
        speed: at the command [m/s]. distance: predicted [m].
        late: share of the distance at held speed [1].
        weaker: change of ln d with the logarithm of the force [1].
        grade: change of ln d with the answer to grades [1].
        level: share of full application [1].
    """

    speed: Floats
    distance: Floats
    late: Floats
    weaker: Floats
    grade: Floats
    level: Floats


class _Scale(NamedTuple):
    """How features become columns; as of the log that was fitted."""

    mean_log: float
    spread: float
    top: float
    graded: bool
    levelled: bool

    def columns(self, at: StopFeatures) -> Floats:
        """(n, p) columns: those of β, then those of η."""
        log_speed = (np.log(at.speed) - self.mean_log) / self.spread
        law = [at.late, at.weaker, at.weaker * (at.speed / self.top - 0.5)]
        law.append(at.grade if self.graded else np.zeros_like(at.speed))
        law.append(np.log(at.level) if self.levelled else np.zeros_like(at.speed))
        return np.column_stack((*law, log_speed, log_speed**2, log_speed**3))


class _Grid(NamedTuple):
    """(g,) hyperparameters ν, σ, s_s, s_f, a [m], and the logarithm of their density."""

    freedom: Floats
    sigma: Floats
    session_std: Floats
    form_std: Floats
    short: Floats
    log_density: Floats


@dataclass(frozen=True, slots=True)
class DistanceModel:
    """The posterior: g points of the grid with their weights and Gaussians.

    Attributes:
        weight: (g,). grid: points.
        mean: (g, p) of the columns. covariance: (g, p, p).
        residual: (n,) of the stops beyond the mean curve.
        scale: how features become columns.
    """

    weight: Floats
    grid: _Grid
    mean: Floats
    covariance: Floats
    residual: Floats
    scale: _Scale

    @property
    def between_sessions(self) -> float:
        """Standard deviation of δ over the posterior [1]."""
        return float(np.sqrt(self.weight @ self.grid.session_std**2))

    def log_ratio(self, at: StopFeatures, quantiles: Floats) -> Floats:
        """(Q, n) ln(allowed / predicted) in a new session.

        Where more stops are promised than the log has, no bound is below the worst stop of the log,
        carried along the mean curve.
        """
        columns, grid = self.scale.columns(at), self.grid
        middle = columns @ self.mean.T  # (n, g)
        variance = np.einsum("np,gpq,nq->ng", columns, self.covariance, columns)
        normal = np.sqrt(variance + grid.session_std**2)
        scale = grid.sigma * np.sqrt(1.0 + (grid.short / at.distance[:, None]) ** 2)
        result = np.empty((len(quantiles), len(columns)))
        for i, component in enumerate(zip(middle, normal, scale, strict=True)):
            result[:, i] = self._quantiles(*component, quantiles)
        worst = float(self.residual.max()) + columns @ (self.weight @ self.mean)
        beyond = quantiles >= len(self.residual) / (len(self.residual) + 1.0)
        result[beyond] = np.maximum(result[beyond], worst)
        return np.maximum.accumulate(result, axis=0)

    def _quantiles(
        self, middle: Floats, normal: Floats, scale: Floats, quantiles: Floats
    ) -> Floats:
        """Quantiles of a mixture of Student-t, each convolved with a normal (g,), off a ladder."""
        weight = self.weight
        nodes, share = np.polynomial.hermite_e.hermegauss(_NODES)
        share = share / share.sum()
        typical, reach = float(weight @ middle), float(weight @ np.hypot(normal, scale))
        ladder = typical + reach * _LADDER
        beyond = np.zeros(len(ladder))
        for nu, log_survival in _SURVIVAL.items():
            of = self.grid.freedom == nu
            center = middle[of, None] + normal[of, None] * nodes  # (k, nodes)
            z = (ladder[:, None, None] - center) / scale[of, None]
            at = np.clip(
                (np.arcsinh(z) - _ARCSINH[0]) / (_ARCSINH[1] - _ARCSINH[0]),
                0.0,
                len(_ARCSINH) - 1.001,
            )
            below = at.astype(np.int64)
            each = np.exp(log_survival[below] + (at - below) * np.diff(log_survival)[below])
            beyond += np.einsum("ykh,k,h->y", each, weight[of], share)
        # Between its rungs the logarithm of what is beyond is taken as linear.
        falling = np.minimum.accumulate(np.log(np.maximum(beyond, 1e-300)))
        return np.interp(-np.log1p(-quantiles), -falling, ladder)


def fit_distance(at: StopFeatures, log_ratio: Floats, session: Ints) -> DistanceModel:
    """The posterior given stops.

    Args:
        at: (n,) stops. log_ratio: (n,) ln(actual / predicted). session: (n,) numbers 0 … m − 1.
    """
    log_speed = np.log(at.speed)
    scale = _Scale(
        float(log_speed.mean()),
        max(float(np.abs(log_speed - log_speed.mean()).max()), _MIN_SPREAD),
        float(at.speed.max()),
        float(np.std(at.grade)) > 0.0
        and float(np.std(at.grade / np.minimum(at.weaker, -1e-6))) > _MIN_GRADE_STD,
        float(np.std(np.log(at.level))) > _MIN_LEVEL_STD,
    )
    x = scale.columns(at)
    belongs = np.zeros((len(x), int(session.max()) + 1))
    belongs[np.arange(len(x)), session] = 1.0
    prior = _grid(log_ratio, at.distance, session)
    pairs, columns = (
        (left[:, :, None] * x[:, None, :]).reshape(len(x), -1) for left in (x, belongs)
    )
    data = _Data(x, log_ratio, at.distance, belongs, pairs, columns)
    grid, mean, covariance = _laplace(data, prior)
    best = grid.log_density.max()
    keep = grid.log_density > best - _NEGLIGIBLE
    weight = np.exp(grid.log_density[keep] - best)
    weight /= weight.sum()
    residual = log_ratio - x @ (weight @ mean[keep])
    grid = _Grid(*(values[keep] for values in grid))
    return DistanceModel(weight, grid, mean[keep], covariance[keep], residual, scale)


def _grid(y: Floats, distance: Floats, session: Ints) -> _Grid:
    spread = max(PER_MAD * float(np.median(np.abs(y - np.median(y)))), 0.003)
    session_scale = _session_scale(y, session)
    half = ndtri(0.5 + 0.5 * _SHARES)
    axes = (
        _FREEDOM,
        np.minimum(spread * _SIGMAS, 1.5),
        session_scale * np.array([0.05, *half, 2.2]),
        _FORM_STD * np.array([0.05, *half]),
        _SHORT_STD * float(np.median(distance)) * np.array([0.0, *half]),
    )
    freedom, sigma, between, form, short = (a.ravel() for a in np.meshgrid(*axes, indexing="ij"))
    # Each point stands for its cell: the density times the width, even in ln σ.
    log_prior = np.log(np.interp(freedom, _FREEDOM, _FREEDOM_PRIOR))
    log_prior += -0.5 * (sigma / _SIGMA_STD) ** 2 + np.log(sigma)
    for values, axis, scale in (
        (between, axes[2], session_scale),
        (form, axes[3], _FORM_STD),
        (short, axes[4], _SHORT_STD * float(np.median(distance))),
    ):
        log_prior += -0.5 * (values / scale) ** 2 + np.log(np.interp(values, axis, _cells(axis)))
    return _Grid(freedom, sigma, between, form, short, log_prior)


def _cells(axis: Floats) -> Floats:
    """(n,) widths of the cells around the points of an axis that begins at 0."""
    edges = np.concatenate(([0.0], 0.5 * (axis[1:] + axis[:-1]), [axis[-1]]))
    edges[-1] += 0.5 * (axis[-1] - axis[-2])
    return np.diff(edges)


def _session_scale(y: Floats, session: Ints) -> float:
    """S: 0.10, from three sessions on at least what their means show."""
    count = np.bincount(session)
    count_seen = count[count > 0]
    if len(count_seen) < 3:
        return _SESSION_STD
    means = np.bincount(session, y)[count > 0] / count_seen
    inside = y - (np.bincount(session, y) / np.maximum(count, 1))[session]
    freedom = max(len(y) - len(count_seen), 1)
    within = float(np.sum(inside**2)) / freedom
    between = float(np.var(means, ddof=1)) - within * float(np.mean(1.0 / count_seen))
    return max(_SESSION_STD, float(np.sqrt(max(between, 0.0))))


class _Data(NamedTuple):
    """Shared data of the fits at all points of the grid.

    Attributes:
        x: (n, p) columns. y: (n,) logarithms. distance: (n,) [m]. belongs: (n, m) to sessions.
        pairs: (n, p²) products of columns. columns: (n, m p) those of each session.
    """

    x: Floats
    y: Floats
    distance: Floats
    belongs: Floats
    pairs: Floats
    columns: Floats


def _laplace(data: _Data, grid: _Grid) -> tuple[_Grid, Floats, Floats]:
    """The grid with posterior densities, modes (g, p) and covariances (g, p, p) at its points.

    Points that are hopeless after a few steps are dropped: most of them, and of the time.
    """
    residual = np.broadcast_to(data.y - float(np.median(data.y)), (len(grid.sigma), len(data.y)))
    log_density, _, _, residual = _fit(data, grid, residual, _FIRST_STEPS)
    keep = log_density > log_density.max() - _HOPELESS
    grid = _Grid(*(values[keep] for values in grid))
    log_density, mean, precision, _ = _fit(data, grid, residual[keep], _STEPS - _FIRST_STEPS)
    covariance = np.asarray(np.linalg.inv(precision), np.float64)
    return grid._replace(log_density=log_density), mean, covariance


def _fit(
    data: _Data, grid: _Grid, residual: Floats, steps: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Log density (g,), mode (g, p), its precision (g, p, p), residuals (g, n) after some steps."""
    nu, by_session = grid.freedom[:, None], grid.session_std[:, None] ** -2
    scale = grid.sigma[:, None] * np.sqrt(1.0 + (grid.short[:, None] / data.distance) ** 2)
    law = np.tile(np.append(_PRIOR_STD, _LEVEL_STD) ** -2, (len(nu), 1))
    prior = np.concatenate((law, np.repeat(grid.form_std[:, None], 3, 1) ** -2), axis=1)
    mean: Floats = np.empty(0)
    offsets: Floats = mean
    for _ in range(steps):
        w = (nu + 1.0) / (nu + (residual / scale) ** 2) / scale**2  # (g, n)
        diagonal, cross, schur = _normal_equations(data, w, by_session, prior)
        wy = w * data.y
        of_sessions = wy @ data.belongs
        right = wy @ data.x - ((of_sessions / diagonal)[:, None, :] @ cross)[:, 0]
        mean = np.asarray(np.linalg.solve(schur, right[:, :, None])[:, :, 0], np.float64)
        offsets = (of_sessions - (cross @ mean[:, :, None])[:, :, 0]) / diagonal
        residual = data.y - mean @ data.x.T - offsets @ data.belongs.T
    z2 = (residual / scale) ** 2
    log_t = gammaln(0.5 * (nu + 1.0)) - gammaln(0.5 * nu) - 0.5 * np.log(np.pi * nu)
    density = np.sum(log_t - np.log(scale) - 0.5 * (nu + 1.0) * np.log1p(z2 / nu), axis=1)
    density += -0.5 * np.sum(prior * mean**2, axis=1) + 0.5 * np.sum(np.log(prior), axis=1)
    density += -0.5 * np.sum(by_session * offsets**2 - np.log(by_session), axis=1)
    # Curvature of the t density at the mode: it may be flat at outliers, never negative here.
    curve = (nu + 1.0) * np.maximum(nu - z2, 0.0) / (nu + z2) ** 2 / scale**2
    diagonal, _, schur = _normal_equations(data, curve, by_session, prior)
    density += -0.5 * np.linalg.slogdet(schur)[1] - 0.5 * np.sum(np.log(diagonal), axis=1)
    return density + grid.log_density, mean, schur, residual


def _normal_equations(
    data: _Data, w: Floats, by_session: Floats, prior: Floats
) -> tuple[Floats, Floats, Floats]:
    """Terms of each session (g, m), shared ones (g, m, p); (g, p, p) without sessions (Schur).

    w: (g, n) weights. by_session: (g, 1), prior: (g, p) precisions.
    """
    g, p = prior.shape
    diagonal = w @ data.belongs + by_session
    cross = (w @ data.columns).reshape(g, -1, p)
    square = (w @ data.pairs).reshape(g, p, p) + prior[:, :, None] * np.eye(p)
    return diagonal, cross, square - cross.transpose(0, 2, 1) @ (cross / diagonal[:, :, None])
