"""The base model of the baseline: speed lost since the onset, averaged in bins, as a regression.

Integral form of the base model, deceleration g (F_b/W + sin θ): v_i − v(t) − ∫ g sin θ dt is linear
in the coefficients of F_b/W = (m_m v_i + b_m) θ + m_b v_i + b_b, and to first order in the dead
time. Stops differ at random in friction, dead time and the speed before the onset; the covariance
of the bins of a stop follows from these and from white noise of the samples.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from .effect_plant import GRAVITY
from .plant_physics import Floats
from .sensing import Columns

BINS = 12  # of the time of a stop
_EARLY = (-0.25, -0.10, -0.03)  # [s] edges of the bins before the onset
_FIRST = 0.03  # [s] first edge after it
_COMMAND_WINDOW = (-0.70, -0.25)  # [s] in which the speed before the onset is averaged
_MIN_SPEED = 0.25  # [m/s]; below it the encoder's zero and the rocking body dominate
_MIN_BRAKING = 0.2  # [s] of a stop that is used
_MIN_STOPS = 8  # for five coefficients and three scatters
_SMOOTHED_SAMPLES = 9  # of attitude and yaw rate


class Traces(NamedTuple):
    """Padded samples of n stops, shape (n, m)."""

    since: Floats  # time since the onset [s]
    # part of the step before a sample that lies after the onset, 0 in the padding [s]
    weight: Floats
    step: Floats  # whole step before a sample [s]
    bin_weights: Floats  # averages of the samples over bins, shape (n, BINS, m)
    samples: Floats  # number of samples in each bin, shape (n, BINS)
    onset_samples: Floats  # number of samples averaged to v_i, shape (n,)
    # v, grade, roll, yaw, yaw_rate, x, y, clock: SI; speed, attitude and yaw rate smoothed
    v: Floats
    grade: Floats
    roll: Floats
    yaw: Floats
    yaw_rate: Floats
    x: Floats
    y: Floats
    clock: Floats
    v_i: Floats  # speed before the onset, shape (n,) [m/s]
    measured: Floats  # logged speed [m/s]
    run: NDArray[np.int64]  # run number of each stop, shape (n,)

    def speed_lost(self, share: Floats, *, early: bool = False) -> Floats:
        """Mean speed lost in each bin by a force over weight, (n, m) or (n, 1), from the onset on.

        With ``early`` it acts before the onset, too. Shape (n, BINS) [m/s].
        """
        full = np.broadcast_to(share, self.v.shape)
        middle = np.concatenate((full[:, :1], 0.5 * (full[:, 1:] + full[:, :-1])), axis=1)
        step = self.step if early else self.weight
        return self.binned(GRAVITY * np.cumsum(middle * step, axis=1))

    def binned(self, values: Floats) -> Floats:
        """Mean of (n, m) samples in each bin, shape (n, BINS); 0 in an empty one."""
        return np.asarray(np.einsum("nbm,nm->nb", self.bin_weights, values))


def traces_of(columns: Columns, dead_time: float) -> Traces:
    """Traces of the stops that are long enough, about a dead time [s]."""
    run = columns["run"]
    edges = np.flatnonzero(run[1:] != run[:-1]) + 1
    stops = []
    for number, (a, b) in enumerate(zip([0, *edges], [*edges, len(run)], strict=True)):
        part = {k: np.asarray(v[a:b], float) for k, v in columns.items() if k != "run"}
        stop = _stop(part, dead_time)
        if stop is not None:
            stops.append((number, *stop))
    if len(stops) < _MIN_STOPS:
        raise ValueError(f"{len(stops)} stops are long enough, eight are needed")
    longest = max(len(part["t"]) for _, part, *_ in stops)

    def padded(name: str) -> Floats:
        rows = [np.pad(p[name], (0, longest - len(p[name])), mode="edge") for _, p, *_ in stops]
        return np.array(rows)

    since = padded("since")
    inside = np.arange(longest) < np.array([len(p["t"]) for _, p, *_ in stops])[:, None]
    step = np.diff(since, axis=1, prepend=since[:, :1]) * inside
    bins = np.array([edges for *_, edges in stops])
    inside_bin = (since[:, None, :] >= bins[:, :-1, None]) & (since[:, None, :] < bins[:, 1:, None])
    inside_bin &= inside[:, None, :]
    count = np.sum(inside_bin, axis=2).astype(float)
    average = inside_bin / np.maximum(count, 1.0)[:, :, None]
    return Traces(
        since=since,
        weight=np.clip(since, 0.0, step),
        step=step,
        bin_weights=average,
        samples=count,
        onset_samples=np.array([count for *_, count, _ in stops]),
        v=padded("smooth"),
        **{name: padded(name) for name in ("grade", "roll", "yaw", "yaw_rate", "x", "y")},
        clock=padded("t"),
        v_i=np.array([v_i for _, _, v_i, *_ in stops]),
        measured=padded("v"),
        run=np.array([number for number, *_ in stops]),
    )


def _stop(
    part: dict[str, Floats], dead_time: float
) -> tuple[dict[str, Floats], float, float, Floats] | None:
    """Samples about the braking of a run, v_i, the number of samples behind it, edges of bins."""
    commanded = np.flatnonzero(part["v_cmd"] <= 0.0)
    if not len(commanded):
        return None
    part["since"] = part["t"] - part["t"][commanded[0]] - dead_time
    since = part["since"]
    before = (since >= _COMMAND_WINDOW[0]) & (since < _COMMAND_WINDOW[1])
    rest = np.flatnonzero((since > 0.0) & (part["v"] < _MIN_SPEED))
    end = since[rest[0]] if len(rest) else since[-1]
    if np.sum(before) < 5 or end < _MIN_BRAKING:
        return None
    for name in ("roll", "yaw", "yaw_rate", "x", "y"):
        part.setdefault(name, np.zeros_like(since))
    part["yaw"] = np.unwrap(part["yaw"])
    part["smooth"] = _smoothed(part["v"], 5)
    part["grade"] = _smoothed(-part["pitch"], _SMOOTHED_SAMPLES)
    for name in ("roll", "yaw", "yaw_rate"):
        part[name] = _smoothed(part[name], _SMOOTHED_SAMPLES)
    used = (since >= _EARLY[0]) & (since < end)
    after = _FIRST + (end - _FIRST) * np.linspace(0.0, 1.0, BINS - 2) ** 1.4
    edges = np.concatenate((_EARLY, after))
    samples = {name: values[used] for name, values in part.items()}
    return samples, float(np.mean(part["v"][before])), float(np.sum(before)), edges


def _smoothed(values: Floats, width: int) -> Floats:
    padded = np.pad(values, width // 2, mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")


BASE = 5  # Number of the base's columns: four coefficients and the dead time


class StopScatter(NamedTuple):
    """Standard deviations of a sample's speed [m/s], of friction [1], of the dead time [s]."""

    sample: float
    friction: float
    delay: float


class BaseFit(NamedTuple):
    """The base model fitted to all stops."""

    traces: Traces  # samples about the fitted dead time
    lost: Floats  # speed that F_b/W has to explain, shape (n, BINS) [m/s]
    base: Floats  # columns of the four coefficients and the dead time, shape (n, BINS, 5)
    force: Floats  # fitted F_b/W, shape (n, m) [1]
    shape: Floats  # speed lost per friction and per delay, shape (n, BINS, 2)
    scatter: StopScatter  # scatter of the stops about the fit
    fit: float  # −2 log likelihood


def fit_base(columns: Columns, configured: dict[str, float]) -> BaseFit:
    """Fit coefficients, dead time and scatter of a log's stops by maximum likelihood."""
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
        fit = fit_scatter(BaseFit(t, lost, base, force, shape, scatter, np.inf), base)
        scatter = fit.scatter
        rows, target = whitened(fit, base, scatter)
        best = np.linalg.lstsq(rows, target, rcond=None)[0]
        values = best[:4]
        dead_time += float(np.clip(best[4], -0.1, 0.1))
    return fit


def fit_scatter(stops: BaseFit, columns: Floats, max_tries: int = 120) -> BaseFit:
    """The fit with the most likely scatter of the stops with these columns, (n, BINS, k)."""

    def unlikely(logs: Floats) -> float:
        scatter = StopScatter(*np.exp(np.clip(logs, -9.0, 1.0)))
        rows, target = whitened(stops, columns, scatter)
        best = np.linalg.lstsq(rows, target, rcond=None)[0]
        left = target - rows @ best
        return float(left @ left + np.sum(np.linalg.slogdet(_covariance(stops, scatter))[1]))

    start = np.log(np.array(stops.scatter))
    corners = np.vstack((start, start + 0.4 * np.eye(3)))
    options = {"maxfev": max_tries, "initial_simplex": corners, "xatol": 0.01, "fatol": 0.02}
    result = minimize(unlikely, start, method="Nelder-Mead", options=options)
    scatter = StopScatter(*np.exp(np.clip(result.x, -9.0, 1.0)).tolist())
    return stops._replace(scatter=scatter, fit=float(result.fun))


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
    return np.asarray(total + sample * level[:, :, None] * level[:, None, :])
