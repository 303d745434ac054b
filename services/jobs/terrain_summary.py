"""A terrain result as `terrain --json` prints it; unknown numbers are null."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np

from slopewise.models.terrain.agreement import ALPHA
from slopewise.models.terrain.classes import FEATURES
from slopewise.models.terrain.description import UNDECIDED
from slopewise.models.terrain.evidence import evidence_of
from slopewise.models.terrain.observation import Features, TerrainEstimate
from slopewise.services.io.units import finite
from slopewise.services.jobs.summary import Summary
from slopewise.services.jobs.terrain_outputs import stretch_row
from slopewise.services.jobs.terrain_result import RunEvents, TerrainResult


class FeatureValue(Summary, frozen=True):
    """Estimate of f_r [1], μ_t [1] or B_s [m], with its 95 % interval."""

    value: float | None
    std: float | None
    interval: tuple[float, float] | None


class GroundText(Summary, frozen=True):
    """`hard`, `soft` and `gripping`, `slippery`, or `undecided`."""

    hardness: str
    grip: str


class ChangeRow(Summary, frozen=True):
    """A change of terrain at a time of the log [s], from one word to its opposite.

    `again`: within ten seconds of the last. `classes` is null: a change has no class.
    """

    t: float
    strength: float
    classes: tuple[str, str] | None
    before: str
    now: str
    again: bool


class ExcludedRow(Summary, frozen=True):
    """A part of a channel that nothing is learned from [s]."""

    t: float
    t_end: float
    channel: str
    kind: str
    reason: str


class RunRow(Summary, frozen=True, kw_only=True):
    """Terrain of one run; `stretches` have the columns of the table.

    `class` is null unless a single name may be given; `probabilities` then holds its own. Compared
    seconds are those of stretches that a description and changes are made of.
    """

    run: str
    terrain: dict[str, FeatureValue]
    description: GroundText = msgspec.field(name="words")
    agrees_with: list[str]
    class_name: str | None = msgspec.field(name="class")
    stuck: float
    probabilities: dict[str, float]
    changes: list[ChangeRow]
    compared_seconds: int
    not_compared_seconds: int
    excluded: list[ExcludedRow]
    stretches: list[dict[str, Any]]


class TerrainSummary(Summary, frozen=True):
    """Output of `terrain --json`; `reliability` is empty, as no class has a probability."""

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
        [],
        [run for run, _ in result.unknown_ground],
        {name: _spread(values) for name, values in result.values_by_name.items()},
        [_run(run, result) for run in result.runs],
    )


def _run(run: RunEvents, result: TerrainResult) -> RunRow:
    t = result.log.columns["t"]
    seconds = {True: 0.0, False: 0.0}  # by whether anything in them is compared
    for o in (stretch.observation for stretch in run.stretches):
        seconds[any(evidence_of(o))] += o.end - o.begin
    return RunRow(
        run=run.run,
        terrain=_features(run.known),
        description=GroundText(run.hardness, run.grip),
        agrees_with=list(run.agrees_with),
        class_name=run.name or None,
        stuck=run.stuck_seconds,
        probabilities=_probabilities(run.name),
        changes=[ChangeRow.of(change, t=change.time, classes=None) for change in run.changes],
        compared_seconds=round(seconds[True]),
        not_compared_seconds=round(seconds[False]),
        excluded=[
            ExcludedRow.of(s, t=float(t[s.start]), t_end=float(t[s.stop - 1]), kind=s.kind.value)
            for s in run.excluded
        ],
        stretches=[
            {
                k: finite(v) if isinstance(v, float) else v
                for k, v in stretch_row(run.run, stretch).items()
            }
            | {
                "agrees_with": list(stretch.agrees_with),
                "p_values": stretch.p_values,
                "probabilities": _probabilities(stretch.name),
            }
            for stretch in run.stretches
        ],
    )


def _probabilities(name: str) -> dict[str, float]:
    """Level of the set of classes that a single name comes from; no other class has one."""
    return {name: 1.0 - ALPHA} if name else {}


def _features(known: Features) -> dict[str, FeatureValue]:
    estimates: dict[str, TerrainEstimate] = {name: getattr(known, name) for name in FEATURES}
    return {
        name: FeatureValue(finite(e.value), finite(e.std), e.interval if e.is_known else None)
        for name, e in estimates.items()
    }


def _spread(values: list[tuple[float, float, float]]) -> dict[str, Any]:
    table: dict[str, Any] = {"stretches": len(values)}
    for name, column in zip(FEATURES, np.array(values).T, strict=True):
        known = column[np.isfinite(column)]
        mean = float(np.mean(known)) if len(known) else None
        table[name] = {"mean": mean, "std": float(np.std(known)) if len(known) else None}
    return table


def agreement_text(run: RunEvents) -> str:
    """Set of the classes that agree, as `{ice, snow}`."""
    return f"{{{', '.join(run.agrees_with)}}}"


def run_cells(run: RunEvents, spread: str = "") -> list[str]:
    """A run as a row of a table; spread: how a standard deviation follows its value, on a page."""
    values = [
        f"{value:.3f}{spread.format(std)}" if math.isfinite(value) else "–"
        for value, std in zip(run.known.values, run.known.stds, strict=True)
    ]
    counts = (
        len(run.stretches),
        sum(not change.again for change in run.changes),
        round(run.stuck_seconds),
        len(run.excluded),
    )
    stated = [text for text in (run.hardness, run.grip) if text != UNDECIDED]
    ground = [", ".join(stated) or UNDECIDED]
    if spread:
        ground.append(run.name or agreement_text(run))
    return [run.run, *values, *ground, *(str(count) if count else "–" for count in counts)]
