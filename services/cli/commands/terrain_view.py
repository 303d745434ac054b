"""What `slopewise terrain` prints and writes."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console, JustifyMethod
from rich.markup import escape
from rich.table import Table

from slopewise.models.terrain.observation import Features
from slopewise.models.terrain.phases import Phase
from slopewise.services.cli.commands.terrain import TerrainJob, trace_of
from slopewise.services.cli.commands.terrain_result import (
    RunEvents,
    TerrainResult,
    agreement,
    class_values,
    probabilities,
    reliability,
    stuck_seconds,
    unknown_ground,
    usual_class,
)
from slopewise.services.io.terrain_table import event_row, excluded_row, write_terrain_table
from slopewise.services.report.plan_labels import plural

_LISTED = 30
_TITLES = ("run", "f_r", "μ_t", "B_s\nm", "class", "p", "parts", "changed", "stuck\ns", "left\nout")
_FEATURES = ("motion_resistance", "lateral_resistance", "slip_track")


def write(result: TerrainResult, path: Path) -> None:
    """A row a stretch, a change or an excluded part, in order of time."""
    time = result.log.columns["t"]
    rows: list[dict[str, Any]] = []
    for one in result.runs:
        own = [event_row(one.run, event) for event in one.changes]
        own += _stretch_rows(one)
        own += [excluded_row(one.run, time, stretch) for stretch in one.excluded]
        rows += sorted(own, key=lambda row: float(row["t"]))
    write_terrain_table(rows, path)


def as_json(result: TerrainResult) -> dict[str, Any]:
    """Everything for machines; what is not known is null."""
    return {
        "model": result.model.name,
        "seconds": result.seconds,
        "notes": result.notes,
        "terrain": _features(result.known),
        "agreement": agreement(result),
        "reliability": [dataclasses.asdict(one) for one in reliability(result)],
        "unknown_ground": [run for run, _ in unknown_ground(result)],
        "classes": {name: _spread(values) for name, values in class_values(result).items()},
        "runs": [_run(one, result) for one in result.runs],
    }


def _run(one: RunEvents, result: TerrainResult) -> dict[str, Any]:
    time = result.log.columns["t"]
    return {
        "run": one.run,
        "terrain": _features(one.known),
        "class": usual_class(one),
        "stuck": stuck_seconds(one),
        "probabilities": probabilities(one),
        "changes": [
            {"t": c.time, "strength": c.strength, "classes": c.classes, "again": c.again}
            for c in one.changes
        ],
        "compared_seconds": one.compared,
        "not_compared_seconds": one.not_compared,
        "excluded": [
            {
                "t": float(time[s.start]),
                "t_end": float(time[s.stop - 1]),
                "channel": s.channel,
                "kind": s.kind.value,
                "reason": s.reason,
            }
            for s in one.excluded
        ],
        "stretches": [
            {key: _plain(value) for key, value in row.items()} | {"probabilities": probable}
            for row, probable in zip(
                _stretch_rows(one),
                [event.answer.probabilities for event in one.classified],
                strict=True,
            )
        ],
    }


def _stretch_rows(one: RunEvents) -> list[dict[str, Any]]:
    return [
        event_row(one.run, event, centres)
        for event, centres in zip(one.classified, one.centres, strict=True)
    ]


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _features(known: Features) -> dict[str, Any]:
    return {
        name: {"value": _plain(getattr(known, name).value), "std": _plain(getattr(known, name).std)}
        for name in _FEATURES
    }


def _spread(values: list[tuple[float, float, float]]) -> dict[str, Any]:
    table: dict[str, Any] = {"stretches": len(values)}
    for name, column in zip(_FEATURES, np.array(values).T, strict=True):
        known = column[np.isfinite(column)]
        mean = float(np.mean(known)) if len(known) else None
        table[name] = {"mean": mean, "std": float(np.std(known)) if len(known) else None}
    return table


def show(result: TerrainResult, console: Console) -> None:
    """A row a run, then what to know of the whole."""
    table = Table(
        title="terrain by run", box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True
    )
    for title in _TITLES:
        justify: JustifyMethod = "left" if title in ("run", "class") else "right"
        table.add_column(title, justify=justify, no_wrap=True, max_width=16)
    for one in result.runs[:_LISTED]:
        table.add_row(*(escape(cell) for cell in _cells(one)))
    console.print(table)
    if len(result.runs) > _LISTED:
        console.print(f"… and {len(result.runs) - _LISTED} more runs; --out or --json gives all")
    for one in result.runs[:_LISTED]:
        for change in one.changes:
            told = "" if change.classes is None else f", {change.classes[0]} to {change.classes[1]}"
            told += ", again" if change.again else ""
            words = f"  {one.run}: the ground changed before {change.time:.1f} s{told}"
            console.print(words, markup=False)
        for reason in dict.fromkeys(stretch.reason for stretch in one.excluded):
            console.print(f"  {one.run}: left out: {reason}", markup=False)
    if (share := agreement(result)) is not None:
        console.print(f"  class as labelled in the log: {share:.0%} of each label, on average")
    for run, many in unknown_ground(result):
        words = "name it in the column terrain and --learn it, or let it arise by --adapt"
        console.print(f"  {run}: {plural(many, 'stretch')} of none of these: {words}", markup=False)
    for note in result.notes:
        console.print(f"  note: {note}", markup=False)


def _cells(one: RunEvents, spread: str = "") -> list[str]:
    values = [
        f"{value:.3f}{spread.format(std)}" if math.isfinite(value) else "–"
        for value, std in zip(one.known.values, one.known.stds, strict=True)
    ]
    counts = (
        len(one.classified),
        sum(not c.again for c in one.changes),
        round(stuck_seconds(one)),
        len(one.excluded),
    )
    shown = [str(count) if count else "–" for count in counts]
    usual = usual_class(one)
    probable = f"{probabilities(one)[usual]:.2f}" if usual else "–"
    return [one.run, *values, usual or "–", probable, *shown]


def write_page(result: TerrainResult, job: TerrainJob, path: Path) -> None:
    """A page with the run that shows most in detail; works without a network."""
    from slopewise.services.report.terrain_page import TerrainPage, write_terrain_page

    one = max(result.runs, key=_variety)
    points = [
        (event.answer.name, event.observation.known.values)
        for run in result.runs
        for event in run.classified
        if event.observation.phase is not Phase.STUCK
    ]
    time = result.log.columns["t"]
    content = TerrainPage(
        title=", ".join(log.name for log in job.logs[:3]) + (" …" if len(job.logs) > 3 else ""),
        verdict=_verdict(result),
        run=one.run,
        trace=trace_of(result, one),
        changes=[change.time for change in one.changes],
        points=points,
        classes=result.classes,
        rows=[_cells(run, spread=" ± {:.3f}")[:-1] for run in result.runs],
        excluded=[
            (run.run, f"{time[stretch.start]:.2f} s", stretch.reason)
            for run in result.runs
            for stretch in run.excluded
        ],
        notes=result.notes,
        reliability=[
            (f"{one.said:.2f}", f"{one.right:.2f}", str(one.count)) for one in reliability(result)
        ],
        facts={
            "model": f"{result.model.name} ({job.model_file})",
            "classes": f"{result.terrains.name}, {len(result.classes.terrain)} known",
            "samples": f"{len(time)} in {plural(len(result.runs), 'run')}",
            "computed in": f"{result.seconds:.2f} s",
        },
    )
    write_terrain_page(path, content)


def _variety(one: RunEvents) -> float:
    """How much a run shows: straights and turns both, else many stretches."""
    phases = [event.observation.phase for event in one.classified]
    turns = sum(phase in (Phase.TURN, Phase.SPOT) for phase in phases)
    return min(turns, phases.count(Phase.STRAIGHT)) + 1e-3 * len(phases)


def _verdict(result: TerrainResult) -> str:
    values = zip(("f_r", "μ_t", "B_s"), result.known.values, result.known.stds, strict=True)
    told = [f"{name} {v:.2f} ± {std:.2f}" for name, v, std in values if math.isfinite(v)]
    changes = sum(not change.again for run in result.runs for change in run.changes)
    stuck = sum(stuck_seconds(run) for run in result.runs)
    ground = f"In the end {', '.join(told)}." if told else "Nothing was told of the ground."
    return f"{ground} {plural(changes, 'change')} of ground, stuck for {stuck:.0f} s."
