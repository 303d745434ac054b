"""`slopewise discrepancy`: where a model and a log disagree, and the model that does not."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from datetime import date, datetime
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from models.discrepancy.findings import Findings, Gap
from models.discrepancy.report.evidence import Evidence
from models.discrepancy.settings import DiscrepancySettings
from models.discrepancy.workflow import STEPS, investigate_with_evidence
from models.errors import ParameterError
from services.cli.screen import progress_bar
from services.io.access import fault, write_atomic
from services.io.logs.drive_log import DriveLog
from services.io.logs.log_source import grade_by_map, names_of, read_logs
from services.io.model_file import find_model, read_model, write_model

FINDINGS, MODEL, PAGE = "discrepancy.json", "model.toml", "report.html"
"""What a folder of results holds."""


@dataclass(frozen=True, slots=True)
class DiscrepancyJob:
    """What to compare, as the command line gives it.

    Attributes:
        logs: drive logs or ROS 2 bags. model_file: the model to hold against them.
        map_file: elevation map that the logs' x, y lie on, if there is one.
        topics: topic mapping of the bags. settings: how sure to be.
    """

    logs: list[Path]
    model_file: str
    map_file: Path | None = None
    topics: Path | None = None
    settings: DiscrepancySettings | None = None


@dataclass(frozen=True, slots=True)
class DiscrepancyResult:
    """What was found, what it rests on, and in which log."""

    findings: Findings
    evidence: Evidence
    log: DriveLog


def run(job: DiscrepancyJob, *, quiet: bool = False) -> DiscrepancyResult:
    """Read and investigate.

    Raises:
        InputError: names file and field, or says why there are too few stops.
    """
    model = read_model(find_model(job.model_file))
    with progress_bar("comparing", STEPS + 1, quiet=quiet) as advance:
        log = read_logs(job.logs, job.topics)
        ground = grade_by_map(log, job.map_file, model.vehicle)
        advance(1)
        try:
            findings, evidence = investigate_with_evidence(
                log.columns, log.runs, model, ground=ground, settings=job.settings,
                source=source_of(job.logs, find_model(job.model_file), f"{date.today()}"),
                advance=advance,
            )  # fmt: skip
        except ParameterError as error:
            raise fault(names_of(job.logs), error.field, f"expected {error.expected}") from None
    return DiscrepancyResult(findings, evidence, log)


def write(result: DiscrepancyResult, job: DiscrepancyJob, folder: Path) -> list[Path]:
    """DIR/discrepancy.json, DIR/model.toml, DIR/report.html; each all or nothing."""
    from services.report.discrepancy_page import write_report

    files = write_findings(result.findings, folder)
    page = folder / PAGE
    provenance = {
        "logs": ", ".join(log.name for log in job.logs),
        "model so far": job.model_file,
        "written": f"{datetime.now():%Y-%m-%d %H:%M}",
    }
    title = f"{result.findings.model.name} against its log"
    write_report(page, result.findings, result.evidence, title=title, provenance=provenance)
    return [*files, page]


def write_findings(findings: Findings, folder: Path) -> list[Path]:
    """DIR/discrepancy.json and DIR/model.toml; each all or nothing."""
    folder.mkdir(parents=True, exist_ok=True)
    told = json.dumps(findings_as_json(findings), allow_nan=False, indent=2, ensure_ascii=False)
    write_atomic(folder / FINDINGS, (told + "\n").encode())
    write_model(findings.model, folder / MODEL)
    return [folder / FINDINGS, folder / MODEL]


def source_of(logs: Sequence[Path], parent: Path, day: str) -> str:
    """Logs, date and parent of what is added to a model: names with a digest of the bytes."""
    told = ", ".join(f"{path.name} {_digest(path)}" for path in logs)
    return f"slopewise discrepancy {day}; {told}; parent {parent.name} {_digest(parent)}"


def _digest(path: Path) -> str:
    """First digits of the SHA-256 of a file, or of all files of a recording's folder."""
    total = hashlib.sha256()
    for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
        if file.is_file():
            with file.open("rb") as stream:
                while chunk := stream.read(1 << 20):
                    total.update(chunk)
    return total.hexdigest()[:12]


def as_json(result: DiscrepancyResult) -> dict[str, Any]:
    """Everything for machines, SI units and radians."""
    return findings_as_json(result.findings)


def findings_as_json(f: Findings) -> dict[str, Any]:
    """What discrepancy.json holds."""
    return {
        "verdict": f.verdict.value,
        "summary": f.summary,
        "effects": [
            {
                "name": e.name,
                "parameters": {name: asdict(value) for name, value in e.parameters.items()},
                "confidence": e.confidence,
                "alternatives": list(e.alternatives),
                "where": e.where,
            }
            for e in f.effects
        ],
        "located": [
            {
                "axis": a.axis, "range": [a.low, a.high], "unit": a.unit,
                "share_of_gap": a.share_of_gap, "p_value": a.p_value,
            }
            for a in f.located
        ],
        "gap": _gap(f.gap),
        "stop_distance": _gap(f.stop_distance),
        "next_experiment": {
            "text": f.next_experiment.text,
            "stops": [
                {k: v for k, v in asdict(stop).items() if v is not None}
                for stop in f.next_experiment.stops
            ],
            "repeats": f.next_experiment.repeats,
        },
        "stops": f.stops,
        "notes": list(f.notes),
        "seconds": f.seconds,
    }  # fmt: skip


def _gap(gap: Gap) -> dict[str, Any]:
    values = asdict(gap)
    values["ci95"] = None if gap.ci95 is None else list(gap.ci95)
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in
            values.items()}  # fmt: skip


def show(result: DiscrepancyResult, console: Console) -> None:
    """The verdict, named effects, the gap, what to drive next."""
    f = result.findings
    console.print(f"[bold]{f.verdict.value}[/] – {f.summary}" if f.summary else f.verdict.value)
    if f.effects:
        table = Table(box=box.SIMPLE_HEAD)
        for title in ("effect", "parameters", "confidence", "or", "where"):
            table.add_column(title)
        for e in f.effects:
            values = ", ".join(
                f"{n} = {p.value:.4g} ± {p.std:.2g} {p.unit}" for n, p in e.parameters.items()
            )
            table.add_row(e.name, values, f"{e.confidence:.0%}", ", ".join(e.alternatives), e.where)
        console.print(table)
    for gap in (f.gap, f.stop_distance):
        console.print(gap_words(gap))
    for axis in f.located[:3]:
        console.print(
            f"follows {axis.axis}: {axis.share_of_gap:.0%} of what is left, p = {axis.p_value:.2g}"
        )
    if f.next_experiment.text:
        console.print(f"next: {f.next_experiment.text}")
    for note in f.notes:
        console.print(f"note: {note}", style="yellow")


def gap_words(gap: Gap) -> str:
    """One line: before, after, floor, and how much is closed."""
    line = (
        f"{gap.metric}: {gap.before:.3f} {gap.unit} as configured, {gap.refit:.3f} refitted, "
        f"{gap.after:.3f} with what was found, floor {gap.noise_floor:.3f}"
    )
    if gap.closed is None or gap.ci95 is None:
        return line + "; too near the floor for a percentage"
    return line + f"; {gap.closed:.0%} closed ({gap.ci95[0]:.0%} … {gap.ci95[1]:.0%})"


def with_settings(false_alarm: float, seed: int) -> DiscrepancySettings:
    """Settings of the command line.

    Raises:
        InputError: names the option.
    """
    try:
        return replace(DiscrepancySettings(), false_alarm=false_alarm, seed=seed)
    except ParameterError as error:
        raise fault(
            f"--{error.field.replace('_', '-')}", "", f"expected {error.expected}"
        ) from None
