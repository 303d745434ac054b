"""Stops of a drive log cut out for peers: samples about the onset, bins, smoothed columns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .physics import Floats
from .plant import GRAVITY
from .sensing import Columns

BINS = 12
_EARLY = (-0.25, -0.10, -0.03)  # [s] edges of the bins before the onset
_FIRST = 0.03  # [s] first edge after it
_HELD = (-0.70, -0.25)  # [s] in which the speed before the onset is averaged
_SLOW = 0.25  # [m/s] below it the encoder's zero and the rocking body are left out
_SHORTEST = 0.2  # [s] of braking
_SMOOTH = 9  # samples of attitude and yaw rate


class Traces(NamedTuple):
    """(n, m) samples of n stops, padded; ``weight`` is 0 before the onset and in the padding.

    Attributes:
        since: the onset [s]. weight: part of the step before a sample that lies after the onset
            [s]. step: the whole of it [s]. into: (n, BINS, m) averages samples over bins.
        samples: (n, BINS) in each. held: samples behind v_i, (n,).
        v, grade, roll, yaw, turn, x, y, clock: SI, attitude and yaw rate smoothed.
        v_i: (n,) speed before the onset [m/s]. measured: speed as logged [m/s].
        run: (n,) number of the run of each stop.
    """

    since: Floats
    weight: Floats
    step: Floats
    into: Floats
    samples: Floats
    held: Floats
    v: Floats
    grade: Floats
    roll: Floats
    yaw: Floats
    turn: Floats
    x: Floats
    y: Floats
    clock: Floats
    v_i: Floats
    measured: Floats
    run: NDArray[np.int64]

    def lost(self, share: Floats, *, early: bool = False) -> Floats:
        """(n, BINS) mean speed lost by a deceleration of g ``share``, (n, m) or (n, 1) [m/s].

        Args:
            share: of the weight. early: it acts before the onset, too.
        """
        full = np.broadcast_to(share, self.v.shape)
        middle = np.concatenate((full[:, :1], 0.5 * (full[:, 1:] + full[:, :-1])), axis=1)
        step = self.step if early else self.weight
        return self.binned(GRAVITY * np.cumsum(middle * step, axis=1))

    def binned(self, values: Floats) -> Floats:
        """Mean of (n, m) samples in each bin, (n, BINS); 0 in an empty one."""
        found: Floats = np.einsum("nbm,nm->nb", self.into, values)
        return found


def traces_of(columns: Columns, dead_time: float) -> Traces:
    """Stops that are long enough, about a dead time [s].

    Raises:
        ValueError: fewer than eight are.
    """
    run = columns["run"]
    edges = np.flatnonzero(run[1:] != run[:-1]) + 1
    stops = []
    for number, (a, b) in enumerate(zip([0, *edges], [*edges, len(run)], strict=True)):
        part = {k: np.asarray(v[a:b], float) for k, v in columns.items() if k != "run"}
        one = _stop(part, dead_time)
        if one is not None:
            stops.append((number, *one))
    if len(stops) < 8:
        raise ValueError(f"{len(stops)} stops are long enough, eight are needed")
    longest = max(len(part["t"]) for _, part, *_ in stops)

    def padded(name: str) -> Floats:
        rows = [np.pad(p[name], (0, longest - len(p[name])), mode="edge") for _, p, *_ in stops]
        return np.array(rows)

    since = padded("since")
    inside = np.arange(longest) < np.array([len(p["t"]) for _, p, *_ in stops])[:, None]
    step = np.diff(since, axis=1, prepend=since[:, :1]) * inside
    bins = np.array([edges for *_, edges in stops])
    into = (since[:, None, :] >= bins[:, :-1, None]) & (since[:, None, :] < bins[:, 1:, None])
    into &= inside[:, None, :]
    count = np.sum(into, axis=2).astype(float)
    average = into / np.maximum(count, 1.0)[:, :, None]
    return Traces(
        since=since,
        weight=np.clip(since, 0.0, step),
        step=step,
        into=average,
        samples=count,
        held=np.array([held for *_, held, _ in stops]),
        v=padded("smooth"),
        grade=padded("grade"),
        roll=padded("roll"),
        yaw=padded("yaw"),
        turn=padded("yaw_rate"),
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
    """Samples from shortly before the onset to the end, v_i, samples behind it, edges of bins."""
    told = np.flatnonzero(part["v_cmd"] <= 0.0)
    if not len(told):
        return None
    part["since"] = part["t"] - part["t"][told[0]] - dead_time
    since = part["since"]
    held = (since >= _HELD[0]) & (since < _HELD[1])
    rest = np.flatnonzero((since > 0.0) & (part["v"] < _SLOW))
    end = since[rest[0]] if len(rest) else since[-1]
    if np.sum(held) < 5 or end < _SHORTEST:
        return None
    for name in ("roll", "yaw", "yaw_rate", "x", "y"):
        part.setdefault(name, np.zeros_like(since))
    part["yaw"] = np.unwrap(part["yaw"])
    part["smooth"] = _smoothed(part["v"], 5)
    part["grade"] = _smoothed(-part["pitch"], _SMOOTH)
    for name in ("roll", "yaw", "yaw_rate"):
        part[name] = _smoothed(part[name], _SMOOTH)
    keep = (since >= _EARLY[0]) & (since < end)
    after = _FIRST + (end - _FIRST) * np.linspace(0.0, 1.0, BINS - 2) ** 1.4
    edges = np.concatenate((_EARLY, after))
    kept = {name: values[keep] for name, values in part.items()}
    return kept, float(np.mean(part["v"][held])), float(np.sum(held)), edges


def _smoothed(values: Floats, width: int) -> Floats:
    padded = np.pad(values, width // 2, mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")
