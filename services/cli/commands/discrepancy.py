"""`slopewise discrepancy`: where a model and a log disagree, and the model that does not."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from slopewise.models.discrepancy.findings import Findings, Gap
from slopewise.models.discrepancy.progress import Stage
from slopewise.models.discrepancy.report.evidence import Evidence
from slopewise.models.discrepancy.report.words import answers, closed_words, sure_words
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.workflow import investigate_with_evidence
from slopewise.models.errors import ParameterError
from slopewise.services.cli.screen import progress_bar
from slopewise.services.io.drive_log import DriveLog, read_logs
from slopewise.services.io.files import fault
from slopewise.services.io.findings_file import PAGE, findings_as_json, source_of, write_findings
from slopewise.services.io.logs.log_source import grade_by_map, names_of
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.no_data import nodata_of


@dataclass(frozen=True, slots=True)
class DiscrepancyJob:
    """What to compare, as the command line gives it.

    Attributes:
        logs: drive logs or ROS 2 bags. model_file: the model to hold against them.
        map_file: elevation map that the logs' x, y lie on, if there is one.
        topics: topic mapping of the bags. settings: how sure to be.
        columns: of tables that have other names or units. nodata: value of `--nodata`.
    """

    logs: list[Path]
    model_file: str
    map_file: Path | None = None
    topics: Path | None = None
    settings: DiscrepancySettings | None = None
    columns: str = ""
    nodata: str | None = None


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
    with progress_bar("comparing", Stage.FINDINGS + 1, quiet=quiet) as advance:
        log = read_logs(job.logs, job.topics, job.columns)
        ground = grade_by_map(log, job.map_file, model.vehicle, nodata_of(job.nodata))
        advance(1)
        try:
            findings, evidence = investigate_with_evidence(
                log.columns,
                log.runs,
                model,
                ground=ground,
                settings=job.settings,
                source=source_of(job.logs, find_model(job.model_file), f"{date.today()}"),
                advance=advance,
            )
        except ParameterError as error:
            raise fault(names_of(job.logs), error.field, f"expected {error.expected}") from None
    return DiscrepancyResult(findings, evidence, log)


def write(result: DiscrepancyResult, job: DiscrepancyJob, folder: Path) -> list[Path]:
    """DIR/discrepancy.json, DIR/model.toml, DIR/report.html; each all or nothing."""
    from slopewise.services.report.discrepancy_page import write_discrepancy_page

    files = write_findings(result.findings, folder)
    page = folder / PAGE
    provenance = {
        "logs": ", ".join(log.name for log in job.logs),
        "model so far": job.model_file,
        "written": f"{datetime.now():%Y-%m-%d %H:%M}",
    }
    title = f"{result.findings.model.name} against its log"
    write_discrepancy_page(
        page, result.findings, result.evidence, title=title, provenance=provenance
    )
    return [*files, page]


def as_json(result: DiscrepancyResult) -> dict[str, Any]:
    """Everything for machines, SI units and radians."""
    return findings_as_json(result.findings)


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
                f"{n} = {p.value:.4g} ± {p.std:.2g} {'' if p.unit == '1' else p.unit}".rstrip()
                for n, p in e.parameters.items()
            )
            table.add_row(
                e.name, values, sure_words(e.confidence), ", ".join(e.alternatives), e.where
            )
        console.print(table)
    for gap in (f.gap, f.stop_distance):
        console.print(gap_words(gap))
    for axis in f.located[:3]:
        console.print(
            f"follows {axis.axis}: {axis.share_of_gap:.0%} of what is left, p = {axis.p_value:.2g}"
        )
    for question, answer in list(answers(f).items())[1:]:
        console.print(f"{question}: {answer}")
    for note in f.notes:
        console.print(f"note: {note}", style="yellow")


def gap_words(gap: Gap) -> str:
    """One line: before, after, floor, and how much is closed."""
    return (
        f"{gap.metric}: {gap.before:.3f} {gap.unit} as configured, {gap.refit:.3f} refitted, "
        f"{gap.after:.3f} with what was found, floor {gap.noise_floor:.3f}; {closed_words(gap)}"
    )


def with_settings(
    *, false_alarm: float, practical_share: float, practical_length: float, seed: int
) -> DiscrepancySettings:
    """Settings of the command line.

    Raises:
        InputError: names the option.
    """
    try:
        return DiscrepancySettings(
            false_alarm=false_alarm,
            practical_share=practical_share,
            practical_length=practical_length,
            seed=seed,
        )
    except ParameterError as error:
        raise fault(
            f"--{error.field.replace('_', '-')}", "", f"expected {error.expected}"
        ) from None
