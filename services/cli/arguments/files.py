"""Commands that work on files: plan, calibrate, terrain, simulate, discrepancy, demo."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from services.cli.arguments.options import (
    NO_ADMISSIBLE,
    AsJson,
    ClearDistance,
    Coverage,
    FalseAlarm,
    GroundMap,
    HorizonPenalty,
    LogFiles,
    MapFile,
    MarginEnough,
    MarginWeight,
    ModelFile,
    PathFile,
    Quantile,
    Report,
    Seed,
    Smooth,
    Spacing,
    StartSpeed,
    Topics,
    say,
    say_written,
)

app = typer.Typer(rich_markup_mode="rich")


@app.command()
def plan(
    map_file: MapFile,
    path_file: PathFile,
    model: ModelFile,
    speed: StartSpeed = 0.0,
    clear: ClearDistance = None,
    spacing: Spacing = None,
    quantile: Quantile = None,
    explain: Annotated[
        bool, typer.Option("--explain", help="Say what the best candidate loses to each bound.")
    ] = False,
    smooth: Smooth = True,
    horizon_penalty: HorizonPenalty = None,
    margin_weight: MarginWeight = None,
    margin_enough: MarginEnough = None,
    topics: Topics = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="plan.csv",
            help="Write all plans, a row a station; .mcap for Foxglove, .rrd for rerun.",
        ),
    ] = None,
    report: Report = None,
    as_json: AsJson = False,
) -> None:
    """Fastest safe speed along candidate paths over an elevation map.

    Every plan is checked after the solver: from each station, and between them, an emergency stop
    ends before the clear distance with every axle and side loaded. Status 3: no candidate may be
    driven.

    [bold]Example[/]  slopewise plan hill.tif paths.csv --model atv --speed 2 --report plan.html
    """
    import math

    from services.cli.commands import plan as command
    from services.cli.commands import plan_view as view

    settings = command.settings_of(
        smooth,
        spacing=spacing,
        horizon_penalty=horizon_penalty,
        margin_weight=margin_weight,
        margin_enough=margin_enough,
    )
    job = command.PlanJob(
        map_file,
        path_file,
        model,
        speed,
        math.inf if clear is None else clear,
        settings,
        command.uncertainty_at(quantile),
        explain,
        topics,
    )
    result = command.run(job, quiet=as_json)
    if out is not None:
        command.write(result, out)
    if report is not None:
        view.write_page(result, job, report)
    say(as_json, lambda: view.as_json(result), lambda screen: view.show(result, screen))
    say_written(as_json, out, report)
    if not result.admissible:
        raise typer.Exit(NO_ADMISSIBLE)


@app.command()
def calibrate(
    logs: LogFiles,
    model: ModelFile,
    out: Annotated[
        Path | None,
        typer.Option(metavar="M2.toml", help="Write the model with what was learned."),
    ] = None,
    stops: Annotated[
        Path | None, typer.Option(metavar="stops.csv", help="Write a row a stop.")
    ] = None,
    report: Report = None,
    map_file: GroundMap = None,
    topics: Topics = None,
    coverage: Coverage = 0.995,
    as_json: AsJson = False,
) -> None:
    """Learn the braking model from the stops of drive logs.

    Finds the stops, measures force and dead time of each on the ground under it, fits all of them
    together, and chooses the safety offsets for a wanted coverage. Suspect stretches are left out
    and named.

    [bold]Example[/]  slopewise calibrate drive.csv --model atv --out mine.toml --report stops.html
    """
    from services.cli.commands import calibrate as command

    job = command.CalibrateJob(logs, model, map_file, topics, coverage)
    result = command.run(job, quiet=as_json)
    if out is not None:
        command.write_learned_model(result, out)
    if stops is not None:
        command.write_stops(result, stops)
    if report is not None:
        command.write_page(result, job, report)
    say(as_json, lambda: command.as_json(result), lambda screen: command.show(result, screen))
    say_written(as_json, out, stops, report)


@app.command()
def terrain(
    logs: LogFiles,
    model: ModelFile,
    out: Annotated[
        Path | None, typer.Option(metavar="terrain.csv", help="Write a row a stretch.")
    ] = None,
    report: Report = None,
    update: Annotated[
        Path | None,
        typer.Option(metavar="M2.toml", help="Write the model with the ground driven now."),
    ] = None,
    terrains: Annotated[
        str | None,
        typer.Option(metavar="T.toml", help="Known classes and settings: file, or a shipped name."),
    ] = None,
    learn: Annotated[
        Path | None,
        typer.Option(
            metavar="T2.toml",
            help="Write classes learned from the column terrain, else from what lies together.",
        ),
    ] = None,
    adapt: Annotated[bool, typer.Option(help="Let classes follow, and new ones arise.")] = False,
    topics: Topics = None,
    as_json: AsJson = False,
) -> None:
    """Resistances, slip track, class and changes of terrain from the logs of a skid-steered robot.

    Needs wheel speeds and motor currents of both sides and the yaw rate. Stuck and suspect
    stretches are named and left out.

    [bold]Example[/]  slopewise terrain drive.csv --model husky --out terrain.csv --update mine.toml
    """
    from services.cli.commands import terrain as command
    from services.cli.commands import terrain_result as results
    from services.cli.commands import terrain_view as view

    job = command.TerrainJob(logs, model, terrains, adapt, learn is not None, topics)
    result = command.run(job, quiet=as_json)
    if out is not None:
        view.write(result, out)
    if update is not None:
        results.write_updated_model(result, update)
    if learn is not None:
        results.write_learned(result, learn)
    if report is not None:
        view.write_page(result, job, report)
    say(as_json, lambda: view.as_json(result), lambda screen: view.show(result, screen))
    say_written(as_json, out, update, learn, report)


@app.command()
def simulate(
    logs: LogFiles,
    model: ModelFile,
    out: Annotated[
        Path | None,
        typer.Option(metavar="sim.csv", help="Write run,t,v_measured,v_simulated,residual."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Replay the stops of a drive log through the model.

    From each stop command on, the model drives: dead time at held speed, then braking along the
    logged grade. Before it the simulation follows the measurement.

    [bold]Example[/]  slopewise simulate drive.csv --model atv --out sim.csv
    """
    from services.cli.commands import simulate as command

    result = command.run(logs, model, quiet=as_json)
    if out is not None:
        command.write(result, out)
    say(as_json, lambda: command.as_json(result), lambda screen: command.show(result, screen))
    say_written(as_json, out)


@app.command()
def discrepancy(
    logs: LogFiles,
    model: ModelFile,
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", help="Folder for discrepancy.json, model.toml, report.html."),
    ],
    map_file: GroundMap = None,
    topics: Topics = None,
    false_alarm: FalseAlarm = 0.005,
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
    model's own numbers would hide it), [bold]unknown[/] (no name fits; the axis is said).

    [bold]Example[/]  slopewise discrepancy drive.csv --model mine.toml --out out/discrepancy
    """
    from services.cli.commands import discrepancy as command

    settings = command.with_settings(false_alarm, seed)
    job = command.DiscrepancyJob(logs, model, map_file, topics, settings)
    result = command.run(job, quiet=as_json)
    written = command.write(result, job, out)
    say(as_json, lambda: command.as_json(result), lambda screen: command.show(result, screen))
    say_written(as_json, *written)


@app.command()
def demo(
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where map, paths, plans and report go.")
    ] = Path("out/demo"),
) -> None:
    """Plan a dozen candidates over a generated hill, and write a page to look at."""
    from services.cli.commands import demo as command

    page = command.run(out)
    typer.echo(f"\nLook at {page}")
