"""The base model of the baseline: speed lost since the onset, averaged in bins, as a regression.

Integral form of the base model, deceleration g (F_b/W + sin θ): v_i − v(t) − ∫ g sin θ dt is linear
in the coefficients of F_b/W = (m_m v_i + b_m) θ + m_b v_i + b_b, and to first order in the dead
time. Stops differ at random in friction, dead time and the speed before the onset; the covariance
of the bins of a stop follows from these and from white noise of the samples.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from .effect_plant import GRAVITY
from .plant_physics import Floats
from .sensing import Columns
from .stop_traces import BINS, Traces, traces_of

BASE = 5
"""Number of the base's columns: four coefficients and the dead time."""


class StopScatter(NamedTuple):
    """Standard deviations of a sample's speed [m/s], of friction [1], of the dead time [s]."""

    sample: float
    friction: float
    delay: float


class BaseFit(NamedTuple):
    """The base model fitted to all stops.

    Attributes:
        traces: samples about the fitted dead time.
        lost: speed that F_b/W has to explain, shape (n, BINS) [m/s].
        base: columns of the four coefficients and the dead time, shape (n, BINS, 5).
        force: fitted F_b/W, shape (n, m) [1].
        shape: speed lost per friction and per delay, shape (n, BINS, 2).
        scatter: scatter of the stops about the fit.
        fit: −2 log likelihood.
    """

    traces: Traces
    lost: Floats
    base: Floats
    force: Floats
    shape: Floats
    scatter: StopScatter
    fit: float


def fit_base(columns: Columns, configured: dict[str, float]) -> BaseFit:
    """Fit coefficients, dead time and scatter of a log's stops by maximum likelihood.

    Args:
        columns: drive log, one run per stop.
        configured: start values of coefficients and dead time.

    Raises:
        ValueError: fewer than eight stops are long enough.
    """
    dead_time, scatter = configured["dead_time"], StopScatter(0.02, 0.02, 0.01)
    values = np.array([configured[key] for key in ("m_m", "b_m", "m_b", "b_b")])
    for _ in range(4):
        t = traces_of(columns, dead_time)
        ones = np.ones_like(t.grade)
        terms = (t.v_i[:, None] * t.grade, t.grade, t.v_i[:, None] * ones, ones)
        force = np.tensordot(values, np.array(terms), 1)
        known = t.speed_lost(np.sin(t.grade))
        lost = (t.v_i[:, None] - t.binned(t.measured) - known) * (t.samples > 0)
        begun = np.argmax(t.weight > 0.0, axis=1)[:, None]
        hard = GRAVITY * np.take_along_axis(force + np.sin(t.grade), begun, axis=1)
        delayed = -hard * t.binned((t.since > 0.0).astype(float))
        base = np.stack([*(t.speed_lost(term) for term in terms), delayed], axis=2)
        shape = np.stack((t.speed_lost(force), delayed), axis=2)
        fit = BaseFit(t, lost, base, force, shape, scatter, np.inf)
        fit = fit._replace(**fit_scatter(fit, base)._asdict())
        scatter = fit.scatter
        rows, target = whitened(fit, base, scatter)
        best = np.linalg.lstsq(rows, target, rcond=None)[0]
        values = best[:4]
        dead_time += float(np.clip(best[4], -0.1, 0.1))
    return fit


class ScatterFit(NamedTuple):
    """The most likely scatter, and −2 log likelihood with it."""

    scatter: StopScatter
    fit: float


def fit_scatter(stops: BaseFit, columns: Floats, max_tries: int = 120) -> ScatterFit:
    """Fit the scatter of the stops together with these columns, shape (n, BINS, k)."""

    def unlikely(logs: Floats) -> float:
        scatter = StopScatter(*np.exp(np.clip(logs, -9.0, 1.0)))
        rows, target = whitened(stops, columns, scatter)
        best = np.linalg.lstsq(rows, target, rcond=None)[0]
        left = target - rows @ best
        return float(left @ left) + _log_determinant(stops, scatter)

    start = np.log(np.array(stops.scatter))
    corners = np.vstack((start, start + 0.4 * np.eye(3)))
    options = {"maxfev": max_tries, "initial_simplex": corners, "xatol": 0.01, "fatol": 0.02}
    result = minimize(unlikely, start, method="Nelder-Mead", options=options)
    return ScatterFit(
        StopScatter(*np.exp(np.clip(result.x, -9.0, 1.0)).tolist()), float(result.fun)
    )


def whitened(stops: BaseFit, columns: Floats, scatter: StopScatter) -> tuple[Floats, Floats]:
    """Columns and speed lost as n BINS rows of unit noise; rows of empty bins are 0."""
    root = np.linalg.cholesky(_covariance(stops, scatter))
    table = np.concatenate((columns, stops.lost[:, :, None]), axis=2)
    table = table * (stops.traces.samples > 0)[:, :, None]
    rows = np.linalg.solve(root, table).reshape(-1, table.shape[2])
    return rows[:, :-1], rows[:, -1]


def _covariance(stops: BaseFit, scatter: StopScatter) -> Floats:
    t = stops.traces
    filled = (t.samples > 0).astype(float)
    sample = scatter.sample**2
    diagonal = np.where(t.samples > 0, sample / np.maximum(t.samples, 1), 1.0)
    friction, delayed = (stops.shape[:, :, k] * filled for k in (0, 1))
    level = filled * np.sqrt(1.0 / t.onset_samples)[:, None]
    total = diagonal[:, :, None] * np.eye(BINS)
    for shape, std in ((friction, scatter.friction), (delayed, scatter.delay)):
        total = total + std**2 * shape[:, :, None] * shape[:, None, :]
    covariance: Floats = total + sample * level[:, :, None] * level[:, None, :]
    return covariance


def _log_determinant(stops: BaseFit, scatter: StopScatter) -> float:
    return float(np.sum(np.linalg.slogdet(_covariance(stops, scatter))[1]))
