"""Stops of a drive log as speed lost since the onset, averaged in bins: what two peers regress.

Integral form of the base model, deceleration g (F_b/W + sin θ): v_i − v(t) − ∫ g sin θ dt is linear
in the coefficients of F_b/W = (m_m v_i + b_m) θ + m_b v_i + b_b, and to first order in the dead
time. Stops differ at random in friction, dead time and the speed before the onset; the covariance
of the bins of a stop follows from these and from white noise of the samples.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from .peer_traces import BINS, Traces, traces_of
from .physics import Floats
from .plant import GRAVITY
from .sensing import Columns

BASE = 5
"""Columns of the base: four coefficients and the dead time."""


class StopScatter(NamedTuple):
    """Standard deviations: of a sample's speed [m/s], of friction [1], of the dead time [s]."""

    sample: float
    friction: float
    delay: float


class BaseFit(NamedTuple):
    """The base model fitted to all stops.

    Attributes:
        traces: about the fitted dead time. lost: (n, BINS) what F_b/W has to explain [m/s].
        base: (n, BINS, 5) columns of the four coefficients and of the dead time.
        force: (n, m) fitted F_b/W. shape: (n, BINS, 2) speed lost per friction and per delay.
        scatter: of the stops about it. fit: −2 log likelihood.
    """

    traces: Traces
    lost: Floats
    base: Floats
    force: Floats
    shape: Floats
    scatter: StopScatter
    fit: float


def fit_base(columns: Columns, configured: dict[str, float]) -> BaseFit:
    """Coefficients, dead time and scatter of the stops in a log, by maximum likelihood.

    Args:
        columns: of the drive log, one stop a run. configured: coefficients and dead time to begin
            with.

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
        known = t.lost(np.sin(t.grade))
        lost = (t.v_i[:, None] - t.binned(t.measured) - known) * (t.samples > 0)
        begun = np.argmax(t.weight > 0.0, axis=1)[:, None]
        hard = GRAVITY * np.take_along_axis(force + np.sin(t.grade), begun, axis=1)
        delayed = -hard * t.binned((t.since > 0.0).astype(float))
        base = np.stack([*(t.lost(term) for term in terms), delayed], axis=2)
        shape = np.stack((t.lost(force), delayed), axis=2)
        found = BaseFit(t, lost, base, force, shape, scatter, np.inf)
        found = found._replace(**likeliest(found, base)._asdict())
        scatter = found.scatter
        rows, wanted = whitened(found, base, scatter)
        best = np.linalg.lstsq(rows, wanted, rcond=None)[0]
        values = best[:4]
        dead_time += float(np.clip(best[4], -0.1, 0.1))
    return found


class Likeliest(NamedTuple):
    """The scatter that suits best, and −2 log likelihood with it."""

    scatter: StopScatter
    fit: float


def likeliest(stops: BaseFit, columns: Floats, most: int = 120) -> Likeliest:
    """Scatter of the stops with these (n, BINS, k) columns fitted; ``most`` likelihoods tried."""

    def unlikely(logs: Floats) -> float:
        scatter = StopScatter(*np.exp(np.clip(logs, -9.0, 1.0)))
        rows, wanted = whitened(stops, columns, scatter)
        best = np.linalg.lstsq(rows, wanted, rcond=None)[0]
        left = wanted - rows @ best
        return float(left @ left) + _log_determinant(stops, scatter)

    start = np.log(np.array(stops.scatter))
    corners = np.vstack((start, start + 0.4 * np.eye(3)))
    options = {"maxfev": most, "initial_simplex": corners, "xatol": 0.01, "fatol": 0.02}
    found = minimize(unlikely, start, method="Nelder-Mead", options=options)
    return Likeliest(StopScatter(*np.exp(np.clip(found.x, -9.0, 1.0)).tolist()), float(found.fun))


def whitened(stops: BaseFit, columns: Floats, scatter: StopScatter) -> tuple[Floats, Floats]:
    """(n BINS, k) columns and (n BINS,) speed lost as rows of unit noise; empty bins are 0."""
    root = np.linalg.cholesky(_covariance(stops, scatter))
    both = np.concatenate((columns, stops.lost[:, :, None]), axis=2)
    both = both * (stops.traces.samples > 0)[:, :, None]
    rows = np.linalg.solve(root, both).reshape(-1, both.shape[2])
    return rows[:, :-1], rows[:, -1]


def _covariance(stops: BaseFit, scatter: StopScatter) -> Floats:
    t = stops.traces
    filled = (t.samples > 0).astype(float)
    sample = scatter.sample**2
    diagonal = np.where(t.samples > 0, sample / np.maximum(t.samples, 1), 1.0)
    friction, delayed = (stops.shape[:, :, k] * filled for k in (0, 1))
    level = filled * np.sqrt(1.0 / t.held)[:, None]
    found = diagonal[:, :, None] * np.eye(BINS)
    for one, size in ((friction, scatter.friction), (delayed, scatter.delay)):
        found = found + size**2 * one[:, :, None] * one[:, None, :]
    both: Floats = found + sample * level[:, :, None] * level[:, None, :]
    return both


def _log_determinant(stops: BaseFit, scatter: StopScatter) -> float:
    return float(np.sum(np.linalg.slogdet(_covariance(stops, scatter))[1]))
