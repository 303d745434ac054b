"""Stops of a drive log as the baseline uses them: samples about the onset, bins, smoothing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
    """Padded samples of n stops, shape (n, m).

    Attributes:
        since: time since the onset [s].
        weight: part of the step before a sample that lies after the onset, 0 in the padding [s].
        step: whole step before a sample [s].
        bin_weights: averages of the samples over bins, shape (n, BINS, m).
        samples: number of samples in each bin, shape (n, BINS).
        onset_samples: number of samples averaged to v_i, shape (n,).
        v, grade, roll, yaw, yaw_rate, x, y, clock: SI; speed, attitude and yaw rate smoothed.
        v_i: speed before the onset, shape (n,) [m/s].
        measured: logged speed [m/s].
        run: run number of each stop, shape (n,).
    """

    since: Floats
    weight: Floats
    step: Floats
    bin_weights: Floats
    samples: Floats
    onset_samples: Floats
    v: Floats
    grade: Floats
    roll: Floats
    yaw: Floats
    yaw_rate: Floats
    x: Floats
    y: Floats
    clock: Floats
    v_i: Floats
    measured: Floats
    run: NDArray[np.int64]

    def speed_lost(self, share: Floats, *, early: bool = False) -> Floats:
        """Mean speed lost in each bin by a deceleration of g ``share``, shape (n, BINS) [m/s].

        Args:
            share: force over weight, shape (n, m) or (n, 1) [1].
            early: whether it acts before the onset, too.
        """
        full = np.broadcast_to(share, self.v.shape)
        middle = np.concatenate((full[:, :1], 0.5 * (full[:, 1:] + full[:, :-1])), axis=1)
        step = self.step if early else self.weight
        return self.binned(GRAVITY * np.cumsum(middle * step, axis=1))

    def binned(self, values: Floats) -> Floats:
        """Mean of (n, m) samples in each bin, shape (n, BINS); 0 in an empty one."""
        means: Floats = np.einsum("nbm,nm->nb", self.bin_weights, values)
        return means


def traces_of(columns: Columns, dead_time: float) -> Traces:
    """Traces of the stops that are long enough, about a dead time [s].

    Raises:
        ValueError: fewer than eight are long enough.
    """
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
        grade=padded("grade"),
        roll=padded("roll"),
        yaw=padded("yaw"),
        yaw_rate=padded("yaw_rate"),
        x=padded("x"),
        y=padded("y"),
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
