"""A terrain result as `terrain --json` prints it; unknown numbers are null."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import msgspec
import numpy as np

from slopewise.models.terrain.observation import Features
from slopewise.services.jobs.summary import Summary, finite
from slopewise.services.jobs.terrain_outputs import stretch_rows
from slopewise.services.jobs.terrain_result import RunEvents, TerrainResult

FEATURES = ("motion_resistance", "lateral_resistance", "slip_track")


class FeatureValue(Summary, frozen=True):
    """Estimate of f_r [1], μ_t [1] or B_s [m]."""

    value: float | None
    std: float | None


class ChangeRow(Summary, frozen=True):
    """A change of terrain at a time of the log [s]; `again`: within ten seconds of the last."""

    t: float
    strength: float
    classes: tuple[str, str] | None
    again: bool


class ExcludedRow(Summary, frozen=True):
    """A part of a channel that nothing is learned from [s]."""

    t: float
    t_end: float
    channel: str
    kind: str
    reason: str


class RunRow(Summary, frozen=True, kw_only=True):
    """Terrain of one run; `stretches` have the columns of the table."""

    run: str
    terrain: dict[str, FeatureValue]
    typical_class: str = msgspec.field(name="class")
    stuck: float
    probabilities: dict[str, float]
    changes: list[ChangeRow]
    compared_seconds: int
    not_compared_seconds: int
    excluded: list[ExcludedRow]
    stretches: list[dict[str, Any]]


class TerrainSummary(Summary, frozen=True):
    """Output of `terrain --json`."""

    model: str
    seconds: float
    notes: list[str]
    terrain: dict[str, FeatureValue]
    agreement: float | None
    reliability: list[dict[str, Any]]
    unknown_ground: list[str]
    classes: dict[str, dict[str, Any]]
    runs: list[RunRow]


def summarise(result: TerrainResult, *notes: str) -> TerrainSummary:
    """All runs; notes: further ones, of files that were written."""
    return TerrainSummary(
        result.model.name,
        result.seconds,
        [*result.notes, *filter(None, notes)],
        _features(result.known),
        result.agreement,
        [asdict(level) for level in result.reliability],
        [run for run, _ in result.unknown_ground],
        {name: _spread(values) for name, values in result.class_values.items()},
        [_run(run, result) for run in result.runs],
    )


def _run(run: RunEvents, result: TerrainResult) -> RunRow:
    t = result.log.columns["t"]
    return RunRow(
        run=run.run,
        terrain=_features(run.known),
        typical_class=run.typical_class,
        stuck=run.stuck_seconds,
        probabilities=run.probabilities,
        changes=[ChangeRow(c.time, c.strength, c.classes, c.again) for c in run.changes],
        compared_seconds=run.compared,
        not_compared_seconds=run.not_compared,
        excluded=[
            ExcludedRow(float(t[s.start]), float(t[s.stop - 1]), s.channel, s.kind.value, s.reason)
            for s in run.excluded
        ],
        stretches=[
            {k: finite(v) if isinstance(v, float) else v for k, v in row.items()}
            | {"probabilities": event.answer.probabilities}
            for row, event in zip(stretch_rows(run), run.classified, strict=True)
        ],
    )


def _features(known: Features) -> dict[str, FeatureValue]:
    estimates = {name: getattr(known, name) for name in FEATURES}
    return {n: FeatureValue(finite(e.value), finite(e.std)) for n, e in estimates.items()}


def _spread(values: list[tuple[float, float, float]]) -> dict[str, Any]:
    table: dict[str, Any] = {"stretches": len(values)}
    for name, column in zip(FEATURES, np.array(values).T, strict=True):
        known = column[np.isfinite(column)]
        mean = float(np.mean(known)) if len(known) else None
        table[name] = {"mean": mean, "std": float(np.std(known)) if len(known) else None}
    return table


def run_cells(run: RunEvents, spread: str = "") -> list[str]:
    """A run as a row of a table; spread: how a standard deviation follows its value."""
    values = [
        f"{value:.3f}{spread.format(std)}" if math.isfinite(value) else "–"
        for value, std in zip(run.known.values, run.known.stds, strict=True)
    ]
    counts = (
        len(run.classified),
        sum(not change.again for change in run.changes),
        round(run.stuck_seconds),
        len(run.excluded),
    )
    name = run.typical_class
    probability = f"{run.probabilities[name]:.2f}" if name else "–"
    cells = [str(count) if count else "–" for count in counts]
    return [run.run, *values, name or "–", probability, *cells]
