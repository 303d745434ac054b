"""The page of `slopewise terrain`: one run in detail, all stretches by feature, all runs.

The figures are those of the paper, remade on the user's drives: Slip, Fig. 7 (a run: turning,
currents, slip track), Fig. 8 (variance of the filter in its first turn) and Fig. 12 (observations
in the space of the three features).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.terrain.classes import TerrainClasses
from slopewise.models.terrain.trace import TerrainTrace
from slopewise.services.report.figures import COLOURS, FAINT, FIRST, INK, SECOND, draw_figures
from slopewise.services.report.page import MAX_ROWS, render, write_page

Point = tuple[str, tuple[float, float, float]]
"""Name of the ground, and (f_r, μ_t, B_s) of a stretch."""

_MAX_POINTS = 3000
"""Points of a line."""
_AXES = ("motion resistance f_r", "lateral resistance μ_t", "slip track B_s, m")


@dataclass(frozen=True, slots=True)
class TerrainPage:
    """Content of the page.

    Attributes:
        title: what was driven. verdict: a sentence.
        run: name of the run in detail. trace: its signals. changes: times of its changes [s].
        points: name of the ground and features of all stretches. classes: known ones.
        rows: cells of the table of runs.
        excluded: (run, time of begin, reason) of excluded intervals.
        notes: messages for the reader. facts: name -> value.
    """

    title: str
    verdict: str
    run: str
    trace: TerrainTrace
    changes: Sequence[float]
    points: Sequence[Point]
    classes: TerrainClasses
    rows: Sequence[Sequence[str]]
    excluded: Sequence[Sequence[str]] = ()
    notes: Sequence[str] = ()
    facts: Mapping[str, str] = field(default_factory=dict)


def write_terrain_page(path: Path, content: TerrainPage) -> None:
    """Write the page, all or nothing.

    Raises:
        InputError: the file cannot be written.
    """
    values = {
        "title": content.title,
        "verdict": content.verdict,
        "facts": content.facts,
        "notices": content.notes,
        "run": content.run,
        "rows": content.rows,
        "excluded": content.excluded[:MAX_ROWS],
        "more_excluded": len(content.excluded) - MAX_ROWS,
        "pictures": draw_figures(
            run=((7.4, 6.6), lambda figure: _draw_run(figure, content)),
            variance=((7.4, 3.6), lambda figure: _draw_variance(figure, content.trace)),
            features=((7.4, 6.6), lambda figure: _draw_features(figure, content)),
        ),
    }
    title, styles = f"{content.title} – slopewise terrain", ("page.css", "calibration.css")
    write_page(path, render("terrain.html", values, title=title, styles=styles))


def _draw_run(figure: Any, content: TerrainPage) -> None:
    turning, currents, slip = figure.subplots(3, 1, sharex=True)
    trace = content.trace
    thin = slice(None, None, max(len(trace.time) // _MAX_POINTS, 1))
    t = trace.time[thin]
    turning.plot(t, trace.yaw_rate[thin], color=FAINT, lw=0.8, label="yaw rate, rad/s")
    turning.plot(t, trace.speed_difference[thin], color=INK, lw=1.1, label="ΔV, m/s")
    turning.legend(loc="upper right", ncols=2, fontsize=8.5)
    currents.plot(t, trace.current_left[thin], color=FAINT, lw=0.8, label="left")
    currents.plot(t, trace.current_right[thin], color=INK, lw=0.9, label="right")
    currents.set_ylabel("current, A")
    currents.legend(loc="upper right", ncols=2, fontsize=8.5)
    b_s, std = _or_nan(trace.slip_track[thin]), _or_nan(trace.slip_track_std[thin])
    slip.plot(t, b_s, color=FIRST, lw=1.2)
    slip.fill_between(t, b_s - std, b_s + std, color=FIRST, alpha=0.15, lw=0)
    for axes in (turning, currents, slip):
        low, high = axes.get_ylim()
        stuck = trace.stuck[thin]
        axes.fill_between(t, low, high, where=stuck, color=SECOND, alpha=0.12, lw=0, step="mid")
        axes.set_ylim(low, high)
        for change in content.changes:
            axes.axvline(change, color=SECOND, lw=1.0, ls="--")
    slip.set(xlabel="time, s", ylabel=_AXES[2])


def _or_nan(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(np.isfinite(values), values, np.nan)


def _draw_variance(figure: Any, trace: TerrainTrace) -> None:
    axes = figure.add_subplot()
    variances = trace.predicted_variance[:120]
    axes.semilogy(np.arange(1, len(variances) + 1), variances, color=FIRST, marker=".", lw=0.8)
    if math.isfinite(trace.settled_variance):
        label = f"Riccati: {trace.settled_variance:.2g} m⁻²"
        axes.axhline(trace.settled_variance, color=SECOND, lw=1.0, ls="--", label=label)
        axes.legend()
    axes.set(xlabel="sample of the first turn", ylabel="variance of 1/B_s, m⁻²")


def _draw_features(figure: Any, content: TerrainPage) -> None:
    grid = figure.subplots(2, 2)
    known, points = content.classes.terrain, content.points
    names = list(dict.fromkeys([terrain.name for terrain in known] + [name for name, _ in points]))
    colour = {name: COLOURS[i % len(COLOURS)] for i, name in enumerate(names)}
    for axes, (first, second) in zip(grid.flat, ((0, 1), (0, 2), (2, 1)), strict=False):
        for terrain in known:
            a, b = terrain.features[first], terrain.features[second]
            if a is not None and b is not None:
                axes.errorbar(
                    a.mean,
                    b.mean,
                    xerr=2.0 * a.std,
                    yerr=2.0 * b.std,
                    color=colour[terrain.name],
                    lw=6.0,
                    alpha=0.2,
                )
        for name in names:
            stretches = np.array([v for given, v in points if given == name]).reshape(-1, 3)
            axes.scatter(
                stretches[:, first],
                stretches[:, second],
                s=14,
                color=colour[name],
                label=name or "unknown",
            )
        axes.set(xlabel=_AXES[first], ylabel=_AXES[second])
    handles, labels = grid.flat[0].get_legend_handles_labels()
    grid.flat[3].axis("off")
    if handles:
        grid.flat[3].legend(handles, labels, loc="center", fontsize=9)
