"""The page of `slopewise terrain`: one run in detail, all stretches by feature, all runs.

The figures are those of the paper, remade on the user's drives: Slip, Fig. 7 (a run: turning,
currents, slip track), Fig. 8 (variance of the filter in its first turn) and Fig. 12 (observations
in the space of the three features).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.trace import TerrainTrace
from slopewise.services.jobs.plural import plural
from slopewise.services.jobs.terrain import trace_run
from slopewise.services.jobs.terrain_result import RunEvents, TerrainResult
from slopewise.services.jobs.terrain_summary import run_cells
from slopewise.services.report.figures import COLOURS, FAINT, FIRST, INK, SECOND, draw_figures
from slopewise.services.report.page import MAX_ROWS, write_page

_MAX_POINTS = 3000
"""Points of a line."""
_AXES = ("motion resistance f_r", "lateral resistance μ_t", "slip track B_s, m")


def write_terrain_page(
    path: Path, result: TerrainResult, *, title: str, model: str, note: str
) -> None:
    """Write the page, with details of the run that has most variety, all or nothing.

    The title says what was driven; model: its file as stated; note: on files that were written.
    """
    run = max(result.runs, key=_variety)
    trace, t = trace_run(result, run), result.log.columns["t"]
    excluded = [
        (run.run, f"{t[stretch.start]:.2f} s", stretch.reason)
        for run in result.runs
        for stretch in run.excluded
    ]
    values = {
        "title": title,
        "verdict": _verdict(result),
        "facts": {
            "model": f"{result.model.name} ({model})",
            "classes": f"{result.terrains.name}, {len(result.terrains.terrain)} known",
            "samples": f"{len(t)} in {plural(len(result.runs), 'run')}",
            "computed in": f"{result.seconds:.2f} s",
        },
        "notices": [text for text in (*result.notes, note) if text],
        "run": run.run,
        "rows": [run_cells(run, spread=" ± {:.3f}")[:-1] for run in result.runs],
        "excluded": excluded[:MAX_ROWS],
        "more_excluded": len(excluded) - MAX_ROWS,
        "pictures": draw_figures(
            run=((7.4, 6.6), lambda figure: _draw_run(figure, trace, run)),
            variance=((7.4, 3.6), lambda figure: _draw_variance(figure, trace)),
            features=((7.4, 6.6), lambda figure: _draw_features(figure, result)),
        ),
    }
    write_page(path, "terrain.html", values, "terrain")


def _variety(run: RunEvents) -> float:
    """Smaller of the numbers of straights and of turns; between equals, more stretches."""
    phases = [stretch.observation.phase for stretch in run.stretches]
    turns = sum(phase in (Phase.TURN, Phase.SPOT) for phase in phases)
    return min(turns, phases.count(Phase.STRAIGHT)) + 1e-3 * len(phases)


def _verdict(result: TerrainResult) -> str:
    numbers = zip(("f_r", "μ_t", "B_s"), result.known.values, result.known.stds, strict=True)
    values = [f"{name} {v:.2f} ± {std:.2f}" for name, v, std in numbers if math.isfinite(v)]
    changes = sum(not change.again for run in result.runs for change in run.changes)
    stuck = sum(run.stuck_seconds for run in result.runs)
    ground = f"In the end {', '.join(values)}." if values else "The ground was not observed."
    return f"{ground} {plural(changes, 'change')} of ground, stuck for {stuck:.0f} s."


def _draw_run(figure: Any, trace: TerrainTrace, run: RunEvents) -> None:
    turning, currents, slip = figure.subplots(3, 1, sharex=True)
    thin = slice(None, None, max(len(trace.time) // _MAX_POINTS, 1))
    t = trace.time[thin]
    turning.plot(t, trace.yaw_rate[thin], color=FAINT, lw=0.8, label="yaw rate, rad/s")
    turning.plot(t, trace.speed_difference[thin], color=INK, lw=1.1, label="ΔV, m/s")
    turning.legend(loc="upper right", ncols=2, fontsize=8.5)
    currents.plot(t, trace.current_left[thin], color=FAINT, lw=0.8, label="left")
    currents.plot(t, trace.current_right[thin], color=INK, lw=0.9, label="right")
    currents.set_ylabel("current, A")
    currents.legend(loc="upper right", ncols=2, fontsize=8.5)
    b_s, std = (
        np.where(np.isfinite(v), v, np.nan)[thin] for v in (trace.slip_track, trace.slip_track_std)
    )
    slip.plot(t, b_s, color=FIRST, lw=1.2)
    slip.fill_between(t, b_s - std, b_s + std, color=FIRST, alpha=0.15, lw=0)
    for axes in (turning, currents, slip):
        low, high = axes.get_ylim()
        stuck = trace.stuck[thin]
        axes.fill_between(t, low, high, where=stuck, color=SECOND, alpha=0.12, lw=0, step="mid")
        axes.set_ylim(low, high)
        for change in run.changes:
            axes.axvline(change.time, color=SECOND, lw=1.0, ls="--")
    slip.set(xlabel="time, s", ylabel=_AXES[2])


def _draw_variance(figure: Any, trace: TerrainTrace) -> None:
    axes = figure.add_subplot()
    variances = trace.predicted_variance[:120]
    axes.semilogy(np.arange(1, len(variances) + 1), variances, color=FIRST, marker=".", lw=0.8)
    if math.isfinite(trace.settled_variance):
        label = f"Riccati: {trace.settled_variance:.2g} m⁻²"
        axes.axhline(trace.settled_variance, color=SECOND, lw=1.0, ls="--", label=label)
        axes.legend()
    axes.set(xlabel="sample of the first turn", ylabel="variance of 1/B_s, m⁻²")


def _draw_features(figure: Any, result: TerrainResult) -> None:
    grid = figure.subplots(2, 2)
    known = result.terrains.terrain
    points = [(s.label or "unnamed", s.observation.known.values) for _, s in result.ground]
    names = list(dict.fromkeys([terrain.name for terrain in known] + [name for name, _ in points]))
    colour = {name: COLOURS[i % len(COLOURS)] for i, name in enumerate(names)}
    for axes, (first, second) in zip(grid.flat, ((0, 1), (0, 2), (2, 1)), strict=False):
        for terrain in known:
            a, b = terrain.features[first], terrain.features[second]
            if a is not None and b is not None:
                style = {"color": colour[terrain.name], "lw": 6.0, "alpha": 0.2}
                axes.errorbar(a.mean, b.mean, xerr=2.0 * a.std, yerr=2.0 * b.std, **style)
        for name in names:
            stretches = np.array([v for given, v in points if given == name]).reshape(-1, 3)
            x, y = stretches[:, first], stretches[:, second]
            axes.scatter(x, y, s=14, color=colour[name], label=name)
        axes.set(xlabel=_AXES[first], ylabel=_AXES[second])
    handles, labels = grid.flat[0].get_legend_handles_labels()
    grid.flat[3].axis("off")
    if handles:
        grid.flat[3].legend(handles, labels, loc="center", fontsize=9)
