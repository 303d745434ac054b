"""A planning result as `plan --json` prints it."""

from __future__ import annotations

import time
from importlib import metadata
from pathlib import Path
from typing import Any

import msgspec

from slopewise.planner.explain.explain import Explanation
from slopewise.planner.plan import SpeedPlan
from slopewise.services.io.files import sha256_of
from slopewise.services.io.plan_file import driven, summary
from slopewise.services.jobs.plan import PlanResult
from slopewise.services.jobs.summary import Summary

_REPEATED = ("candidate", "status", "reason")
"""Columns of a plan file with one value for all stations of a plan."""


class MadeFrom(Summary, frozen=True):
    """Files and version that plans were made from, to identify them later; age in seconds."""

    slopewise: str
    map_id: str
    map_age: float
    map_hash: str
    model_id: str
    model_hash: str


class StretchRow(Summary, frozen=True, kw_only=True):
    """Stations with one limiting bound, and the time driven along them [s]."""

    begin: float = msgspec.field(name="from")
    end: float = msgspec.field(name="to")
    limiting: str
    seconds: float


class BoundCost(Summary, frozen=True):
    """Time [s] and distance [m] gained without a bound."""

    limiting: str
    seconds: float
    reach: float


class MeasurementRow(Summary, frozen=True):
    """Time [s] and distance [m] gained by a measurement."""

    name: str
    seconds: float
    reach: float
    sentence: str


class ExplanationSummary(Summary, frozen=True):
    """Bounds that slow the best candidate, and measurements that would relax them."""

    candidate: str
    stretches: list[StretchRow]
    costs: list[BoundCost]
    measurements: list[MeasurementRow]


class PlanSummary(Summary, frozen=True):
    """Output of `plan --json`; a plan has its facts, `path_deviation` and `columns`.

    A path that cannot be planned is in `refused`, with `candidate`, `status` and `reason`.
    """

    model: str
    admissible: bool
    seconds: float
    notes: list[str]
    plans: list[dict[str, Any]]
    made_from: MadeFrom | None = None
    explain: ExplanationSummary | None = None
    refused: list[dict[str, str]] = msgspec.field(default_factory=list)


class DemoSummary(PlanSummary, frozen=True):
    """Output of `demo --json`; `page`: file of the report."""

    page: str = ""


def summarise(result: PlanResult, page: Path | None = None) -> PlanSummary:
    """Facts and columns of each plan, best first; with a page: as `demo --json` prints them."""
    fields: dict[str, Any] = {
        "model": result.model.name,
        "admissible": result.admissible,
        "seconds": result.seconds,
        "notes": list(result.notes),
        "plans": [_plan(plan) for plan in result.plans],
        "made_from": _made_from(result),
        "explain": None if result.explanation is None else _explained(result.explanation),
        "refused": [{**path._asdict(), "status": "refused"} for path in result.refused],
    }
    return PlanSummary(**fields) if page is None else DemoSummary(**fields, page=str(page))


def _made_from(result: PlanResult) -> MadeFrom | None:
    if result.files is None:
        return None
    map_file, model_file = result.files
    return MadeFrom(
        metadata.version("slopewise"),
        map_file.name,
        max(time.time() - map_file.stat().st_mtime, 0.0),
        sha256_of(map_file),
        model_file.name,
        sha256_of(model_file),
    )


def _plan(plan: SpeedPlan) -> dict[str, Any]:
    """Facts, columns, and the speed needed on a hill that thrust alone cannot climb."""
    deviation, run_up = plan.path_deviation, plan.momentum
    keys = ("largest", "station", "x", "y", "limit", "sentence")
    facts: dict[str, Any] = {
        **summary(plan),
        "path_deviation": None if deviation is None else {k: getattr(deviation, k) for k in keys},
    }
    if run_up is not None:
        needed = run_up.least_speed > 0.0
        facts["momentum"] = {
            **{k: getattr(run_up, k) for k in ("station", "speed", "until", "allowed")},
            "stations": plan.station[needed].tolist(),
            "least_speed": run_up.least_speed[needed].tolist(),
        }
    facts["columns"] = {
        name: values if isinstance(values, list) else values.tolist()
        for name, values in driven(plan).items()
        if name not in _REPEATED
    }
    return facts


def _explained(explanation: Explanation) -> ExplanationSummary:
    return ExplanationSummary(
        explanation.plan.candidate,
        [
            StretchRow.of(stretch, limiting=stretch.limiting.label)
            for stretch in explanation.stretches
        ],
        [BoundCost.of(cost, limiting=cost.limiting.label) for cost in explanation.costs],
        [MeasurementRow.of(measurement) for measurement in explanation.measurements],
    )
