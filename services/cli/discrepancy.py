"""`slopewise discrepancy`: effects that a model lacks, found in drive logs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from slopewise.services.cli.command import command, print_result
from slopewise.services.cli.options import (
    AsJson,
    Columns,
    FalseAlarm,
    GroundMap,
    LogFiles,
    ModelFile,
    NoDataValue,
    Seed,
    Topics,
)
from slopewise.services.cli.tables import line, notes, table

if TYPE_CHECKING:
    from slopewise.models.discrepancy.findings import Findings, Gap
    from slopewise.services.jobs.discrepancy import DiscrepancyResult

_AXES = 3
"""Axes of the disagreement that are listed, strongest first; --json has all."""


@dataclass(frozen=True, slots=True)
class DiscrepancyOptions:
    """Options of `slopewise discrepancy`."""

    logs: LogFiles
    model: ModelFile
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", help="Folder for discrepancy.json, model.toml, report.html."),
    ]
    map_file: GroundMap = None
    nodata: NoDataValue = None
    topics: Topics = None
    columns: Columns = ""
    false_alarm: FalseAlarm = 0.005
    seed: Seed = 20
    as_json: AsJson = False


@command()
def discrepancy(options: DiscrepancyOptions) -> None:
    """Find where a model and a drive log disagree, name the missing effect, add it to the model.

    The stops of the log are replayed. The model's own numbers are fitted first: where that closes
    the gap, only a calibration is missing ([bold]parameter_drift[/]). Else the disagreement is
    followed along grade, speed, time, heading, place and every other column, and the effects of
    the library are tried one by one and together. DIR/model.toml is a model file like any other:
    its uncertainty makes plans slower, not faster.

    Verdicts: [bold]none[/], [bold]parameter_drift[/], [bold]missing_effect[/], [bold]ambiguous[/]
    (several names fit; the stops that distinguish them are proposed), [bold]unidentifiable[/] (the
    model's own numbers would hide it), [bold]unknown[/] (no name fits; the axis is reported),
    [bold]too_noisy[/] (most effects would have shown only above a tenth of a stop). A change of
    stops by less than 1 % and 2 cm is reported in a note, without a name.

    [bold]Example[/]  slopewise discrepancy drive.csv --model mine.toml --out out/discrepancy
    """
    from slopewise.services.io.no_data import nodata_of
    from slopewise.services.jobs import discrepancy as job

    settings = job.discrepancy_settings(false_alarm=options.false_alarm, seed=options.seed)
    result = job.discrepancy(
        options.logs,
        options.model,
        settings=settings,
        map_file=options.map_file,
        nodata=nodata_of(options.nodata),
        topics=options.topics,
        columns=options.columns,
        quiet=options.as_json,
    )
    files = _write(result, options)
    print_result(options.as_json, result.summary, _tables(result.findings), *files)


def _write(result: DiscrepancyResult, options: DiscrepancyOptions) -> list[Path]:
    """Write DIR/discrepancy.json, DIR/model.toml, DIR/report.html; each all or nothing."""
    from slopewise.services.io.findings_file import PAGE, write_findings
    from slopewise.services.report.discrepancy_page import write_discrepancy_page

    files = write_findings(result.findings, options.out)
    page = options.out / PAGE
    provenance = {
        "logs": ", ".join(log.name for log in options.logs),
        "model so far": options.model,
        "written": f"{datetime.now():%Y-%m-%d %H:%M}",
    }
    title = f"{result.findings.model.name} against its log"
    write_discrepancy_page(
        page, result.findings, result.evidence, title=title, provenance=provenance
    )
    return [*files, page]


def _tables(findings: Findings) -> Iterator[Any]:
    """Verdict, named effects, gap, and the next stops to drive."""
    from slopewise.models.discrepancy.report.words import answers, sure_words

    summary = f" – {findings.summary}" if findings.summary else ""
    yield line(f"{findings.verdict.value}{summary}", "bold")
    rows = []
    for effect in findings.effects:
        values = ", ".join(
            f"{n} = {p.value:.4g} ± {p.std:.2g} {'' if p.unit == '1' else p.unit}".rstrip()
            for n, p in effect.parameters.items()
        )
        confidence, names = sure_words(effect.confidence), ", ".join(effect.alternatives)
        rows.append((effect.name, values, confidence, names, effect.where))
    if rows:
        columns = ("effect", "parameters", "confidence", "or", "where")
        yield from table(columns, rows, left=columns)
    for gap in (findings.gap, findings.stop_distance):
        yield line(gap_line(gap))
    for axis in findings.located[:_AXES]:
        share = f"{axis.share_of_gap:.0%} of the remainder"
        yield line(f"follows {axis.axis}: {share}, p = {axis.p_value:.2g}")
    for title, text in list(answers(findings).items())[1:]:
        yield line(f"{title}: {text}")
    yield from notes(findings.notes)


def gap_line(gap: Gap) -> str:
    """One line: before, after, floor, and the closed share."""
    from slopewise.models.discrepancy.report.words import closed_words

    return (
        f"{gap.metric}: {gap.before:.3f} {gap.unit} as configured, {gap.refit:.3f} refitted, "
        f"{gap.after:.3f} with the effects, floor {gap.noise_floor:.3f}; {closed_words(gap)}"
    )
