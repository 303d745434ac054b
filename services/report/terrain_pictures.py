"""Pictures of terrain estimation: the paper's figures, remade on the user's own drives.

Slip, Fig. 7 (a run: turning, currents, slip track), Fig. 8 (variance of the filter in its first
turn) and Fig. 12 (observations in the space of the three features).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.terrain.classes import TerrainClasses
from slopewise.models.terrain.trace import TerrainTrace
from slopewise.services.report.figures import (
    COLOURS,
    FAINT,
    FIRST,
    INK,
    SECOND,
    house_style,
    svg_uri,
)

Point = tuple[str, tuple[float, float, float]]
"""Class, and (f_r, μ_t, B_s) of a stretch."""

_MOST = 3000  # points of a line
_AXES = ("motion resistance f_r", "lateral resistance μ_t", "slip track B_s, m")


def pictures(
    trace: TerrainTrace, points: Sequence[Point], classes: TerrainClasses, changes: Sequence[float]
) -> dict[str, str]:
    """Name -> data URI of an SVG.

    Args:
        trace: of one run. changes: times of its changes [s].
        points: of all stretches. classes: known ones, drawn behind them.

    Raises:
        InputError: matplotlib is not installed.
    """
    with house_style() as figure:
        return {
            "run": svg_uri(_run(figure((7.4, 6.6), layout="constrained"), trace, changes)),
            "variance": svg_uri(_variance(figure((7.4, 3.6), layout="constrained"), trace)),
            "features": svg_uri(
                _features(figure((7.4, 6.6), layout="constrained"), points, classes)
            ),
        }


def _run(figure: Any, trace: TerrainTrace, changes: Sequence[float]) -> Any:
    turning, currents, slip = figure.subplots(3, 1, sharex=True)
    few = slice(None, None, max(len(trace.time) // _MOST, 1))
    t = trace.time[few]
    turning.plot(t, trace.yaw_rate[few], color=FAINT, lw=0.8, label="yaw rate, rad/s")
    turning.plot(t, trace.speed_difference[few], color=INK, lw=1.1, label="ΔV, m/s")
    turning.legend(loc="upper right", ncols=2, fontsize=8.5)
    currents.plot(t, trace.current_left[few], color=FAINT, lw=0.8, label="left")
    currents.plot(t, trace.current_right[few], color=INK, lw=0.9, label="right")
    currents.set_ylabel("current, A")
    currents.legend(loc="upper right", ncols=2, fontsize=8.5)
    b_s, std = _shown(trace.slip_track[few]), _shown(trace.slip_track_std[few])
    slip.plot(t, b_s, color=FIRST, lw=1.2)
    slip.fill_between(t, b_s - std, b_s + std, color=FIRST, alpha=0.15, lw=0)
    for axes in (turning, currents, slip):
        _shade(axes, t, trace.stuck[few])
        for change in changes:
            axes.axvline(change, color=SECOND, lw=1.0, ls="--")
    slip.set(xlabel="time, s", ylabel=_AXES[2])
    return figure


def _shown(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(np.isfinite(values), values, np.nan)


def _shade(axes: Any, t: NDArray[np.float64], stuck: NDArray[np.bool_]) -> None:
    low, high = axes.get_ylim()
    axes.fill_between(t, low, high, where=stuck, color=SECOND, alpha=0.12, lw=0, step="mid")
    axes.set_ylim(low, high)


def _variance(figure: Any, trace: TerrainTrace) -> Any:
    axes = figure.add_subplot()
    variances = trace.predicted_variance[:120]
    axes.semilogy(np.arange(1, len(variances) + 1), variances, color=FIRST, marker=".", lw=0.8)
    if math.isfinite(trace.settled_variance):
        words = f"Riccati: {trace.settled_variance:.2g} m⁻²"
        axes.axhline(trace.settled_variance, color=SECOND, lw=1.0, ls="--", label=words)
        axes.legend()
    axes.set(xlabel="sample of the first turn", ylabel="variance of 1/B_s, m⁻²")
    return figure


def _features(figure: Any, points: Sequence[Point], classes: TerrainClasses) -> Any:
    grid = figure.subplots(2, 2)
    names = list(
        dict.fromkeys([one.name for one in classes.terrain] + [name for name, _ in points])
    )
    colour = {name: COLOURS[i % len(COLOURS)] for i, name in enumerate(names)}
    for axes, (first, second) in zip(grid.flat, ((0, 1), (0, 2), (2, 1)), strict=False):
        for one in classes.terrain:
            a, b = one.features[first], one.features[second]
            if a is not None and b is not None:
                axes.errorbar(
                    a.mean,
                    b.mean,
                    xerr=2.0 * a.std,
                    yerr=2.0 * b.std,
                    color=colour[one.name],
                    lw=6.0,
                    alpha=0.2,
                )
        for name in names:
            chosen = np.array([v for given, v in points if given == name]).reshape(-1, 3)
            axes.scatter(
                chosen[:, first],
                chosen[:, second],
                s=14,
                color=colour[name],
                label=name or "unknown",
            )
        axes.set(xlabel=_AXES[first], ylabel=_AXES[second])
    handles, labels = grid.flat[0].get_legend_handles_labels()
    grid.flat[3].axis("off")
    if handles:
        grid.flat[3].legend(handles, labels, loc="center", fontsize=9)
    return figure
