"""`slopewise discrepancy`: effects that a model lacks, found in drive logs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from slopewise.services.cli import options
from slopewise.services.cli.command import print_result, provenance_of
from slopewise.services.cli.options import option
from slopewise.services.cli.tables import line, notes, table

if TYPE_CHECKING:
    from slopewise.models.discrepancy.findings import Findings

_AXES = 3  # axes of the disagreement that are listed, strongest first; --json has all


def discrepancy(
    logs: options.LogFiles,
    model: options.ModelFile,
    out: Annotated[Path, option("Folder for discrepancy.json, model.toml, report.html.", "DIR")],
    map_file: options.GroundMap = None,
    nodata: options.NoDataValue = None,
    topics: options.Topics = None,
    columns: options.Columns = "",
    false_alarm: options.FalseAlarm = 0.005,
    seed: options.Seed = 20,
    as_json: options.AsJson = False,
) -> None:
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
    from slopewise.models.discrepancy.settings import DiscrepancySettings
    from slopewise.services.io.findings_file import PAGE, findings_as_json, write_findings
    from slopewise.services.jobs.discrepancy import discrepancy as job
    from slopewise.services.jobs.log_input import LogInput
    from slopewise.services.jobs.summary import from_options
    from slopewise.services.report.discrepancy_page import write_discrepancy_page

    settings = from_options(DiscrepancySettings, false_alarm=false_alarm, seed=seed)
    log_input = LogInput(logs, map_file, nodata, topics, columns)
    findings = job(log_input, model, settings=settings)
    files, page = write_findings(findings, out), out / PAGE
    title, facts = f"{findings.model.name} against its log", provenance_of(logs, model)
    write_discrepancy_page(page, findings, title=title, provenance=facts)
    print_result(as_json, findings_as_json(findings), _tables(findings), *files, page)


def _tables(findings: Findings) -> Iterator[Any]:
    """Verdict, named effects, gap, and the next stops to drive."""
    from slopewise.models.discrepancy.report.text import answers, closed_text
    from slopewise.services.report.discrepancy_page import effect_cells

    summary = f" – {findings.summary}" if findings.summary else ""
    yield line(f"{findings.verdict.value}{summary}", "bold")
    if findings.effects:
        columns = ("effect", "parameters", "confidence", "or", "where")
        yield from table(columns, map(effect_cells, findings.effects), left=columns)
    for gap in (findings.gap, findings.stop_distance):
        yield line(
            f"{gap.metric}: {gap.before:.3f} {gap.unit} as configured, {gap.refit:.3f} refitted, "
            f"{gap.after:.3f} with the effects, floor {gap.noise_floor:.3f}; {closed_text(gap)}"
        )
    for axis in findings.located[:_AXES]:
        share = f"{axis.share_of_gap:.0%} of the remainder"
        yield line(f"follows {axis.axis}: {share}, p = {axis.p_value:.2g}")
    for title, text in list(answers(findings).items())[1:]:
        yield line(f"{title}: {text}")
    yield from notes(findings.notes)
