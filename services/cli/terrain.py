"""`slopewise terrain`: resistances, slip track, description and changes of terrain from logs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from slopewise.services.cli.command import command, print_result
from slopewise.services.cli.options import AsJson, Columns, LogFiles, ModelFile, Report, Topics
from slopewise.services.cli.tables import LISTED, line, table
from slopewise.services.report.plural import plural

if TYPE_CHECKING:
    from slopewise.services.jobs.terrain_result import RunEvents, TerrainResult


_COLUMNS = (
    "run",
    "f_r",
    "μ_t",
    "B_s\nm",
    "hardness",
    "grip",
    "agrees with",
    "parts",
    "changed",
    "stuck\ns",
    "excluded",
)


@dataclass(frozen=True, slots=True)
class TerrainOptions:
    """Options of `slopewise terrain`."""

    logs: LogFiles
    model: ModelFile
    out: Annotated[
        Path | None, typer.Option(metavar="terrain.csv", help="Write one row per stretch.")
    ] = None
    report: Report = None
    update: Annotated[
        Path | None,
        typer.Option(metavar="M2.toml", help="Write the model with the ground driven now."),
    ] = None
    terrains: Annotated[
        str | None,
        typer.Option(metavar="T.toml", help="Known classes and settings: file, or a shipped name."),
    ] = None
    learn: Annotated[
        Path | None,
        typer.Option(
            metavar="T2.toml",
            help="Write classes and thresholds learned from the columns terrain and site.",
        ),
    ] = None
    topics: Topics = None
    columns: Columns = ""
    as_json: AsJson = False


@command("terrain_summary.TerrainSummary")
def terrain(options: TerrainOptions) -> None:
    """Resistances, slip track and changes of terrain from the logs of a skid-steered robot.

    The ground is hard or soft, gripping or slippery, or undecided, and agrees with known classes;
    it has a single name only where three days or sites were measured. Needs wheel speeds and motor
    currents of both sides and the yaw rate. Stuck and suspect stretches are listed and excluded.

    [bold]Example[/]  slopewise terrain drive.csv --model husky --out terrain.csv --update mine.toml
    """
    from slopewise.services.io.model_file import write_model
    from slopewise.services.jobs import terrain_outputs as outputs
    from slopewise.services.jobs.terrain import terrain as job
    from slopewise.services.jobs.terrain_summary import summarise

    result = job(
        options.logs,
        options.model,
        terrains=options.terrains,
        topics=options.topics,
        columns=options.columns,
        quiet=options.as_json,
    )
    note = ""
    if options.out is not None:
        outputs.write_events(result, options.out)
    if options.update is not None:
        write_model(outputs.updated_model(result), options.update)
    if options.learn is not None:
        note = outputs.write_learned(result, options.learn)
    if options.report is not None:
        _write_page(result, options, options.report, note)
    files = options.out, options.update, options.learn, options.report
    print_result(options.as_json, summarise(result, note), _tables(result, note), *files)


def _tables(result: TerrainResult, note: str) -> Iterator[Any]:
    """One row per run, then events and notes."""
    yield from table(
        _COLUMNS,
        (_cells(run) for run in result.runs),
        title="terrain by run",
        more="more runs; --out or --json gives all",
    )
    for run in result.runs[:LISTED]:
        for change in run.changes:
            again = ", again" if change.again else ""
            words = f"from {change.before} to {change.now}{again}"  # words: ok
            yield line(f"  {run.run}: the ground changed before {change.time:.1f} s, {words}")
        for reason in dict.fromkeys(stretch.reason for stretch in run.excluded):
            yield line(f"  {run.run}: excluded: {reason}")
    if (share := result.agreement) is not None:
        yield f"  agrees with its label in the log: {share:.0%} of each label, on average"
    for name, count in result.unknown_ground:
        action = "name it in the column terrain and --learn it"
        yield line(f"  {name}: {plural(count, 'stretch')} that agree with no class: {action}")
    for text in filter(None, (*result.notes, note)):
        yield line(f"  note: {text}")


def _cells(run: RunEvents, spread: str = "") -> list[str]:
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
    ground = [run.hardness, run.grip, run.name or f"{{{', '.join(run.agrees_with)}}}"]
    return [run.run, *values, *ground, *(str(count) if count else "–" for count in counts)]


def _write_page(result: TerrainResult, options: TerrainOptions, path: Path, note: str) -> None:
    """Write a page with details of the run that has most variety."""
    from slopewise.models.terrain.phases import Phase
    from slopewise.services.jobs.terrain import trace_run
    from slopewise.services.report.terrain_page import TerrainPage, write_terrain_page

    def variety(run: RunEvents) -> float:
        """Straights and turns; else many stretches."""
        phases = [stretch.observation.phase for stretch in run.stretches]
        turns = sum(phase in (Phase.TURN, Phase.SPOT) for phase in phases)
        return min(turns, phases.count(Phase.STRAIGHT)) + 1e-3 * len(phases)

    shown = max(result.runs, key=variety)
    t = result.log.columns["t"]
    page = TerrainPage(
        title=", ".join(log.name for log in options.logs[:3]) + " …" * (len(options.logs) > 3),
        verdict=_verdict(result),
        run=shown.run,
        trace=trace_run(result, shown),
        changes=[change.time for change in shown.changes],
        points=[
            (label or "unnamed", stretch.observation.known.values)
            for run in result.runs
            for stretch, label in zip(run.stretches, run.labels, strict=True)
            if not stretch.is_stuck
        ],
        classes=result.terrains.classes,
        rows=[_cells(run, spread=" ± {:.3f}")[:-1] for run in result.runs],
        excluded=[
            (run.run, f"{t[stretch.start]:.2f} s", stretch.reason)
            for run in result.runs
            for stretch in run.excluded
        ],
        notes=[text for text in (*result.notes, note) if text],
        facts={
            "model": f"{result.model.name} ({options.model})",
            "classes": f"{result.terrains.name}, {len(result.terrains.terrain)} known",
            "samples": f"{len(t)} in {plural(len(result.runs), 'run')}",
            "computed in": f"{result.seconds:.2f} s",
        },
    )
    write_terrain_page(path, page)


def _verdict(result: TerrainResult) -> str:
    numbers = zip(("f_r", "μ_t", "B_s"), result.known.values, result.known.stds, strict=True)
    values = [f"{name} {v:.2f} ± {std:.2f}" for name, v, std in numbers if math.isfinite(v)]
    changes = sum(not change.again for run in result.runs for change in run.changes)
    stuck = sum(run.stuck_seconds for run in result.runs)
    ground = f"In the end {', '.join(values)}." if values else "The ground was not observed."
    return f"{ground} {plural(changes, 'change')} of ground, stuck for {stuck:.0f} s."
