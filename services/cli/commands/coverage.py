"""`slopewise coverage`: does a model cover the stops of a log?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from slopewise.models.arrays import Bools
from slopewise.models.calibration.coverage import Coverage, covered
from slopewise.models.errors import ParameterError
from slopewise.services.cli.screen import progress_bar
from slopewise.services.io.drive_log import read_logs
from slopewise.services.io.files import fault
from slopewise.services.io.logs.log_source import grade_by_map, names_of, refuse_wrong_units
from slopewise.services.io.logs.unseen_channels import unseen_channels
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.no_data import nodata_of
from slopewise.services.report.plan_labels import plural

_PARTS = 4
_LISTED = 20


@dataclass(frozen=True, slots=True)
class CoverageJob:
    """Words of the command line."""

    logs: Sequence[Path]
    model: str
    map_file: Path | None
    topics: Path | None
    quantile: float
    columns: str = ""
    nodata: str | None = None


@dataclass(frozen=True, slots=True)
class CoverageResult:
    """The stops beside what plans allow for them; the model's name; doubts in sentences."""

    coverage: Coverage
    model: str
    notes: tuple[str, ...] = ()

    @property
    def covers(self) -> bool:
        """No more stops are beyond than chance allows."""
        return self.coverage.covers()


def run(job: CoverageJob, *, quiet: bool = False) -> CoverageResult:
    """Read, measure, compare.

    Raises:
        InputError: names file and field, or says why there are no stops.
    """
    if not 0.5 <= job.quantile <= 0.9999:
        raise fault("--quantile", "", f"expected a share in [0.5, 0.9999], got {job.quantile:g}")
    model = read_model(find_model(job.model))
    with progress_bar("holding stops against the model", 2, quiet=quiet) as advance:
        log = read_logs(job.logs, job.topics, job.columns)
        refuse_wrong_units(log)
        ground = grade_by_map(log, job.map_file, model.vehicle, nodata_of(job.nodata))
        advance(1)
        try:
            found = covered(log.columns, log.runs, model, ground=ground, quantile=job.quantile)
        except ParameterError as error:
            raise fault(names_of(job.logs), error.field, f"expected {error.expected}") from None
        advance(1)
    return CoverageResult(found, model.name, unseen_channels(model.effect, log.columns))


def as_json(result: CoverageResult) -> dict[str, Any]:
    """For machines, SI units and radians."""
    found = result.coverage
    everything = np.ones(len(found.records), np.bool_)
    speed = np.array([r.samples.window.held_speed for r in found.records])
    grade = np.array([r.grade for r in found.records])
    return {
        **_part(found, everything),
        "found": len(found.windows),
        "quantile": found.quantile,
        "covers": result.covers,
        "notes": list(result.notes),
        "by_speed": _by_range(found, speed),
        "by_grade": _by_range(found, grade),
        "by_session": [
            {"session": str(name), **_part(found, found.session == name)}
            for name in dict.fromkeys(found.session.tolist())
        ],
    }


def _part(found: Coverage, part: Bools) -> dict[str, Any]:
    excess = found.excess[part]
    ends = excess[np.isfinite(excess)]
    beyond = int(np.sum(excess < 0.0))
    return {
        "stops": len(excess),
        "beyond": beyond,
        "share_beyond": beyond / len(excess) if len(excess) else 0.0,
        "mean_excess_m": float(np.mean(ends)) if len(ends) else None,
        "not_allowed": len(excess) - len(ends),
    }


def _by_range(found: Coverage, values: Any) -> list[dict[str, Any]]:
    """Parts with equally many stops."""
    parts = []
    for members in np.array_split(np.argsort(values, kind="stable"), min(_PARTS, len(values))):
        part = np.zeros(len(values), np.bool_)
        part[members] = True
        ends = [float(values[members].min()), float(values[members].max())]
        parts.append({"range": ends, **_part(found, part)})
    return parts


def show(result: CoverageResult, console: Console) -> None:
    """A row a part; whether the model covers the log."""
    told = as_json(result)
    table = Table(title=f"{result.model} at {told['quantile']:g}", box=box.SIMPLE_HEAD)
    for title in ("", "stops", "beyond", "allowed longer by, mean m", "not allowed at all"):
        table.add_column(title, justify="right")
    rows = [("all", told)]
    rows += [(_range(p["range"], 1.0, "m/s"), p) for p in told["by_speed"]]
    rows += [(_range(p["range"], 180.0 / np.pi, "°"), p) for p in told["by_grade"]]
    sessions = told["by_session"]
    if 1 < len(sessions) <= _LISTED:
        rows += [(f"session {p['session']}", p) for p in sessions]
    for label, p in rows:
        mean = "–" if p["mean_excess_m"] is None else f"{p['mean_excess_m']:.3f}"
        table.add_row(label, str(p["stops"]), str(p["beyond"]), mean, str(p["not_allowed"]))
    console.print(table)
    covers = "covers" if result.covers else "does not cover"
    console.print(f"the model {covers} the {plural(told['stops'], 'measured stop')} of this log")
    for note in result.notes:
        console.print(f"note: {note}", style="yellow")


def _range(ends: list[float], scale: float, unit: str) -> str:
    return f"{scale * ends[0]:.1f} … {scale * ends[1]:.1f} {unit}"
