"""`slopewise terrain`: resistances, slip track, description and changes of terrain from logs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from slopewise.services.cli import options
from slopewise.services.cli.command import print_result, schema_of
from slopewise.services.cli.options import option, output
from slopewise.services.cli.tables import LISTED, line, table
from slopewise.services.jobs.plural import plural

if TYPE_CHECKING:
    from slopewise.services.jobs.terrain_result import TerrainResult


def terrain(
    logs: options.LogFiles,
    model: options.ModelFile,
    out: Annotated[Path | None, output("Write one row per stretch.", "terrain.csv")] = None,
    report: options.Report = None,
    update: Annotated[
        Path | None, output("Write the model with the ground driven now.", "M2.toml")
    ] = None,
    terrains: Annotated[
        str | None, option("Known classes and settings: file, or a shipped name.", "T.toml")
    ] = None,
    learn: Annotated[
        Path | None,
        output(
            "Write classes and thresholds learned from the columns terrain and session.", "T2.toml"
        ),
    ] = None,
    topics: options.Topics = None,
    columns: options.Columns = "",
    as_json: options.AsJson = False,
    json_schema: Annotated[bool, schema_of("jobs.terrain_summary.TerrainSummary")] = False,
) -> None:
    """Resistances, slip track and changes of terrain from the logs of a skid-steered robot.

    The ground is hard or soft, gripping or slippery, or undecided, and agrees with known classes;
    it has a single name only where three days or sites were measured. Needs wheel speeds and motor
    currents of both sides and the yaw rate. Stuck and suspect stretches are listed and excluded.

    [bold]Example[/]  slopewise terrain drive.csv --model husky --out terrain.csv --update mine.toml
    """
    from slopewise.services.io.files import check_ending
    from slopewise.services.io.model_file import write_model
    from slopewise.services.jobs import terrain_outputs as outputs
    from slopewise.services.jobs.log_input import LogInput
    from slopewise.services.jobs.terrain import terrain as job
    from slopewise.services.jobs.terrain_summary import summarise

    check_ending(out, ".csv")
    log_input = LogInput(logs, topics=topics, columns=columns)
    result = job(log_input, model, terrains=terrains)
    note = ""
    if out is not None:
        outputs.write_events(result, out)
    if update is not None:
        write_model(outputs.updated_model(result), update)
    if learn is not None:
        note = outputs.write_learned(result, learn)
    if report is not None:
        from slopewise.services.report.terrain_page import write_terrain_page

        title = ", ".join(log.name for log in logs[:3]) + " …" * (len(logs) > 3)
        write_terrain_page(report, result, title=title, model=model, note=note)
    tables = _tables(result, note)
    print_result(as_json, summarise(result, note), tables, out, update, learn, report)


def _tables(result: TerrainResult, note: str) -> Iterator[Any]:
    """One row per run, then events and notes."""
    from slopewise.services.jobs.terrain_summary import agreement_text, run_cells

    yield from table(
        ("run", "f_r", "μ_t", "B_s\nm", "ground", "parts", "changed", "stuck\ns", "excluded"),
        (run_cells(run) for run in result.runs),
        title="terrain by run",
        more="more runs; --out or --json gives all",
    )
    for run in result.runs[:LISTED]:
        ground = run.name or f"agrees with {agreement_text(run)}"
        yield line(f"  {run.run}: {ground}")
        for change in run.changes:
            again = ", again" if change.again else ""
            turn = f"from {change.before} to {change.now}{again}"
            yield line(f"  {run.run}: the ground changed before {change.time:.1f} s, {turn}")
        for reason in dict.fromkeys(stretch.reason for stretch in run.excluded):
            yield line(f"  {run.run}: excluded: {reason}")
    if (share := result.agreement) is not None:
        yield f"  agrees with its label in the log: {share:.0%} of each label, on average"
    for name, count in result.unknown_ground:
        action = "name it in the column terrain and --learn it"
        yield line(f"  {name}: {plural(count, 'stretch')} that agree with no class: {action}")
    for text in filter(None, (*result.notes, note)):
        yield line(f"  note: {text}")
