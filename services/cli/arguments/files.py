"""Commands that work on files: plan, check, calibrate, coverage, terrain, simulate and others."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from slopewise.services.cli.arguments.grouped import takes
from slopewise.services.cli.arguments.options import (
    NO_ADMISSIBLE,
    OF_NO_USE,
    VIOLATIONS,
    AsJson,
    ClearDistance,
    Columns,
    CommandStep,
    Coverage,
    FalseAlarm,
    FewestSamples,
    FullBrake,
    GroundMap,
    HorizonPenalty,
    LeastSpeed,
    LogFiles,
    LongestStop,
    MapFile,
    MarginEnough,
    MarginWeight,
    ModelFile,
    NoDataValue,
    PathFile,
    PracticalLength,
    PracticalShare,
    Quantile,
    Ramp,
    Report,
    Seed,
    SettledSpeed,
    Sheet,
    Smooth,
    Solving,
    Spacing,
    StartSpeed,
    Topics,
    TurnRate,
    say,
)

app = typer.Typer(rich_markup_mode="rich")


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """Words of `slopewise plan`."""

    map_file: MapFile
    path_file: PathFile
    model: ModelFile
    speed: StartSpeed = 0.0
    clear: ClearDistance = None
    spacing: Spacing = None
    quantile: Quantile = 0.999
    explain: Annotated[
        bool, typer.Option("--explain", help="Say what the best candidate loses to each bound.")
    ] = False
    smooth: Smooth = True
    solver: Solving = "interior_point"
    horizon_penalty: HorizonPenalty = None
    margin_weight: MarginWeight = None
    margin_enough: MarginEnough = None
    topics: Topics = None
    nodata: NoDataValue = None
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="plan.csv",
            help="Write all plans, a row a station; .mcap for Foxglove, .rrd for rerun.",
        ),
    ] = None
    report: Report = None
    check: Annotated[
        bool,
        typer.Option(
            "--check", help="Put what was planned before the judge of `slopewise check` as well."
        ),
    ] = False
    as_json: AsJson = False


@app.command()
@takes(PlanOptions)
def plan(options: PlanOptions) -> None:
    """Fastest safe speed along candidate paths over an elevation map.

    Every plan is checked after the solver: from each station, and between them, an emergency stop
    ends before the clear distance with every axle and side loaded. Status 3: no candidate may be
    driven, or --check found a violation.

    [bold]Example[/]  slopewise plan hill.tif paths.csv --model atv --speed 2 --report plan.html
    """
    from slopewise.services.cli.commands import plan as command
    from slopewise.services.cli.commands import plan_view as view
    from slopewise.services.io.no_data import nodata_of

    settings = command.settings_of(
        options.smooth,
        solver=options.solver,
        spacing=options.spacing,
        horizon_penalty=options.horizon_penalty,
        margin_weight=options.margin_weight,
        margin_enough=options.margin_enough,
    )
    job = command.PlanJob(
        options.map_file,
        options.path_file,
        options.model,
        options.speed,
        math.inf if options.clear is None else options.clear,
        settings,
        command.uncertainty_at(options.quantile),
        options.explain,
        options.topics,
        nodata_of(options.nodata),
    )
    command.check_out(options.out)
    result = command.run(job, quiet=options.as_json)
    if options.out is not None:
        command.write(result, options.out)
    if options.report is not None:
        view.write_page(result, job, options.report)
    if options.check:
        result = command.checked(result, options.out, options.clear, quiet=options.as_json)
    say(options.as_json, view, result, options.out, options.report)
    if not result.admissible or (result.check is not None and not result.check.valid):
        raise typer.Exit(NO_ADMISSIBLE)


@dataclass(frozen=True, slots=True)
class CheckOptions:
    """Words of `slopewise check`."""

    plan_file: Annotated[
        Path,
        typer.Argument(
            metavar="PLAN",
            help="Plans: CSV or Parquet with x,y,speed and any further column of a plan file.",
        ),
    ]
    map_file: Annotated[
        Path, typer.Option("--map", metavar="MAP", help="Elevation map: GeoTIFF, .npz, or a bag.")
    ]
    model: ModelFile
    clear: ClearDistance = None
    quantile: Quantile = 0.999
    topics: Topics = None
    nodata: NoDataValue = None
    as_json: AsJson = False


@app.command()
@takes(CheckOptions)
def check(options: CheckOptions) -> None:
    """Judge plans, ours or anybody's: violations by station, kind and size.

    Ground, forces and an emergency stop from every row, and from between rows, are derived anew
    from map and model. Shared with the planner are the readers of both, the formulas of named
    effects and gravity. Status 3: there is a violation.

    [bold]Example[/]  slopewise check plan.csv --map hill.tif --model atv --clear 20
    """
    from slopewise.services.cli.commands import check as command
    from slopewise.services.cli.commands import check_view as view
    from slopewise.services.io.no_data import nodata_of

    clear = math.inf if options.clear is None else options.clear
    job = command.CheckJob(
        options.plan_file,
        options.map_file,
        options.model,
        clear,
        options.topics,
        options.quantile,
        nodata_of(options.nodata),
    )
    result = command.run(job, quiet=options.as_json)
    say(options.as_json, view, result)
    if not result.valid:
        raise typer.Exit(VIOLATIONS)


@dataclass(frozen=True, slots=True)
class CalibrateOptions:
    """Words of `slopewise calibrate`."""

    logs: LogFiles
    model: ModelFile
    out: Annotated[
        Path | None,
        typer.Option(metavar="M2.toml", help="Write the model with what was learned."),
    ] = None
    stops: Annotated[Path | None, typer.Option(metavar="stops.csv", help="Write a row a stop.")] = (
        None
    )
    report: Report = None
    sheet: Sheet = None
    map_file: GroundMap = None
    nodata: NoDataValue = None
    topics: Topics = None
    columns: Columns = ""
    coverage: Coverage = 0.999
    least_speed: LeastSpeed = None
    longest: LongestStop = math.inf
    settled_speed: SettledSpeed = 0.03
    turn_rate: TurnRate = None
    ramp: Ramp = 0.15
    step: CommandStep = 0.7
    full_brake: FullBrake = 0.9
    fewest: FewestSamples = 6
    as_json: AsJson = False


@app.command()
@takes(CalibrateOptions)
def calibrate(options: CalibrateOptions) -> None:
    """Learn the braking model from the stops of drive logs.

    Finds the stops, measures force and dead time of each on the ground under it, fits all of them
    together, and learns how they scatter: margins of force and dead time, and what is left as a
    constant. Suspect stretches are left out and named. Named effects of the model stay in force.
    Status 3: the result is written, but of no use, and why is said. --stops has a row for every
    stop that was found, with the reason where it was left out; it and --report are written also
    where the command refuses. --sheet tells on one page, from the learned model at --coverage, how
    far stops go by speed and grade, which slopes the brakes hold, and how that compares with rules
    that know no slope.

    [bold]Example[/]  slopewise calibrate drive.csv --model atv --out mine.toml --report stops.html
    """
    from slopewise.services.cli.commands import calibrate as command

    if options.sheet is not None:
        from slopewise.services.cli.commands import calibrate_sheet as sheet

        sheet.check_sheet(options.sheet)
    result = command.run(options, quiet=options.as_json)
    if options.out is not None:
        command.write_learned_model(result, options.out)
    if options.sheet is not None:
        result = sheet.with_sheet(result, options, options.sheet)
    if options.stops is not None:
        command.write_stops(result, options.stops)
    if options.report is not None:
        command.write_page(result, options, options.report)
    files = options.out, options.stops, options.report, options.sheet
    say(options.as_json, command, result, *files)
    if result.calibration.objections:
        raise typer.Exit(OF_NO_USE)


@app.command()
def coverage(
    logs: LogFiles,
    model: ModelFile,
    map_file: GroundMap = None,
    nodata: NoDataValue = None,
    topics: Topics = None,
    columns: Columns = "",
    quantile: Quantile = 0.999,
    as_json: AsJson = False,
) -> None:
    """Does this model cover the stops of this log?

    The model learns nothing: every stop that can be measured is held against what plans at the
    quantile allow for, by speed, grade and session. Status 3: more stops are beyond than chance
    makes of the share that the quantile leaves.

    [bold]Example[/]  slopewise coverage today.csv --model mine.toml
    """
    from slopewise.services.cli.commands import coverage as command

    job = command.CoverageJob(logs, model, map_file, topics, quantile, columns, nodata)
    result = command.run(job, quiet=as_json)
    say(as_json, command, result)
    if not result.covers:
        raise typer.Exit(OF_NO_USE)


@dataclass(frozen=True, slots=True)
class TerrainOptions:
    """Words of `slopewise terrain`."""

    logs: LogFiles
    model: ModelFile
    out: Annotated[
        Path | None, typer.Option(metavar="terrain.csv", help="Write a row a stretch.")
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
            help="Write classes learned from the column terrain, else from what lies together.",
        ),
    ] = None
    adapt: Annotated[bool, typer.Option(help="Let classes follow, and new ones arise.")] = False
    topics: Topics = None
    columns: Columns = ""
    as_json: AsJson = False


@app.command()
@takes(TerrainOptions)
def terrain(options: TerrainOptions) -> None:
    """Resistances, slip track, class and changes of terrain from the logs of a skid-steered robot.

    Needs wheel speeds and motor currents of both sides and the yaw rate. Stuck and suspect
    stretches are named and left out.

    [bold]Example[/]  slopewise terrain drive.csv --model husky --out terrain.csv --update mine.toml
    """
    from slopewise.services.cli.commands import terrain as command
    from slopewise.services.cli.commands import terrain_result as results
    from slopewise.services.cli.commands import terrain_view as view

    job = command.TerrainJob(
        options.logs,
        options.model,
        options.terrains,
        options.adapt,
        options.learn is not None,
        options.topics,
        options.columns,
    )
    result = command.run(job, quiet=options.as_json)
    if options.out is not None:
        view.write(result, options.out)
    if options.update is not None:
        results.write_updated_model(result, options.update)
    if options.learn is not None:
        results.write_learned(result, options.learn)
    if options.report is not None:
        view.write_page(result, job, options.report)
    say(options.as_json, view, result, options.out, options.update, options.learn, options.report)


@app.command()
def simulate(
    logs: LogFiles,
    model: ModelFile,
    out: Annotated[
        Path | None,
        typer.Option(metavar="sim.csv", help="Write run,t,v_measured,v_simulated,residual."),
    ] = None,
    topics: Topics = None,
    columns: Columns = "",
    as_json: AsJson = False,
) -> None:
    """Replay the stops of a drive log through the model.

    From each stop command on, the model drives: dead time at held speed, then braking along the
    logged grade. Before it the simulation follows the measurement.

    [bold]Example[/]  slopewise simulate drive.csv --model atv --out sim.csv
    """
    from slopewise.services.cli.commands import simulate as command

    result = command.run(logs, model, topics, columns, quiet=as_json)
    if out is not None:
        command.write(result, out)
    say(as_json, command, result, out)


@app.command()
def discrepancy(
    logs: LogFiles,
    model: ModelFile,
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", help="Folder for discrepancy.json, model.toml, report.html."),
    ],
    map_file: GroundMap = None,
    nodata: NoDataValue = None,
    topics: Topics = None,
    columns: Columns = "",
    false_alarm: FalseAlarm = 0.005,
    practical_share: PracticalShare = 0.01,
    practical_length: PracticalLength = 0.02,
    seed: Seed = 20,
    as_json: AsJson = False,
) -> None:
    """Find where a model and a drive log disagree, name what is missing, add it, show what is left.

    The stops of the log are replayed. The model's own numbers are fitted first: where that closes
    the gap, nothing is missing but a calibration ([bold]parameter_drift[/]). Else the disagreement
    is followed along grade, speed, time, heading, place and every other column, and the effects of
    the library are tried one by one and together. DIR/model.toml is a model file as all others:
    what is not certain in it makes plans slower, not faster.

    Verdicts: [bold]none[/], [bold]parameter_drift[/], [bold]missing_effect[/], [bold]ambiguous[/]
    (several names fit; what to drive to tell them apart is said), [bold]unidentifiable[/] (the
    model's own numbers would hide it), [bold]unknown[/] (no name fits; the axis is said),
    [bold]too_noisy[/] (most effects would have shown only above a tenth of a stop). What changes
    stops by less than --practical-share and --practical-length is told in a note, without a name.

    [bold]Example[/]  slopewise discrepancy drive.csv --model mine.toml --out out/discrepancy
    """
    from slopewise.services.cli.commands import discrepancy as command

    settings = command.with_settings(
        false_alarm=false_alarm,
        practical_share=practical_share,
        practical_length=practical_length,
        seed=seed,
    )
    job = command.DiscrepancyJob(logs, model, map_file, topics, settings, columns, nodata)
    result = command.run(job, quiet=as_json)
    written = command.write(result, job, out)
    say(as_json, command, result, *written)


@app.command()
def demo(
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where map, paths, plans and report go.")
    ] = Path("out/demo"),
    as_json: AsJson = False,
) -> None:
    """Plan a dozen candidates over a generated hill, and write a page to look at."""
    from slopewise.services.cli.commands import demo as command

    say(as_json, command, command.run(out))
