"""Commands for many paths, logs and vehicles: fleet plan, calibrate, discrepancy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from slopewise.services.cli.arguments.grouped import takes
from slopewise.services.cli.arguments.options import (
    NO_ADMISSIBLE,
    AsJson,
    ClearDistance,
    Coverage,
    FalseAlarm,
    GroundMap,
    LogFiles,
    ModelFile,
    NoDataValue,
    PracticalLength,
    PracticalShare,
    Quantile,
    Seed,
    Smooth,
    Spacing,
    StartSpeed,
    Topics,
    say,
)

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="rich",
    help="Many paths over large maps, the logs of many vehicles: on several processes or machines.",
)

FleetWorkers = Annotated[
    int | None,
    typer.Option(min=0, help="Processes here; 0 works in this one. One for each processor."),
]
Scheduler = Annotated[
    str, typer.Option(metavar="ADDRESS", help="A running Dask scheduler, e.g. tcp://10.0.0.1:8786.")
]
ByFolder = Annotated[
    bool, typer.Option("--by-folder", help="A folder is a vehicle; else each file is one.")
]


@dataclass(frozen=True, slots=True)
class FleetPlanOptions:
    """Words of `slopewise fleet plan`."""

    map_file: Annotated[
        Path, typer.Argument(metavar="MAP", help="Elevation map: tiled GeoTIFF in metres.")
    ]
    path_files: Annotated[
        list[Path],
        typer.Argument(metavar="PATHS…", help="Candidates: CSV or Parquet with x,y[,candidate]."),
    ]
    model: ModelFile
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where the results go, as Parquet in parts.")
    ]
    speed: StartSpeed = 0.0
    clear: ClearDistance = None
    spacing: Spacing = None
    quantile: Quantile = 0.999
    nodata: NoDataValue = None
    smooth: Smooth = True
    workers: FleetWorkers = None
    scheduler: Scheduler = ""
    as_json: AsJson = False


@app.command("plan")
@takes(FleetPlanOptions)
def fleet_plan(options: FleetPlanOptions) -> None:
    r"""Plan the candidates of many files over a map that need not fit into memory.

    DIR/plans has a row a station, DIR/candidates a row a candidate, in parts. A run that was
    interrupted goes on where it was; any number of workers gives the same bytes. Status 3: no
    candidate may be driven. Needs the extra: pip install '.\[fleet]' in a clone.

    [bold]Example[/]  slopewise fleet plan county.tif paths-*.csv --model atv --out out/county
    """
    import math

    from slopewise.services.cli.commands import fleet_plan as command
    from slopewise.services.cli.commands import plan as one
    from slopewise.services.io.no_data import nodata_of

    job = command.FleetPlanJob(
        options.map_file,
        options.path_files,
        options.model,
        options.out,
        options.speed,
        math.inf if options.clear is None else options.clear,
        one.settings_of(options.smooth, spacing=options.spacing),
        one.uncertainty_at(options.quantile),
        options.workers,
        options.scheduler,
        nodata_of(options.nodata),
    )
    result = command.run(job, quiet=options.as_json)
    say(options.as_json, command, result, options.out)
    if not result.admissible:
        raise typer.Exit(NO_ADMISSIBLE)


@dataclass(frozen=True, slots=True)
class FleetCalibrateOptions:
    """Words of `slopewise fleet calibrate`."""

    logs: LogFiles
    model: ModelFile
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for a model file a vehicle.")]
    by_folder: ByFolder = False
    map_file: GroundMap = None
    nodata: NoDataValue = None
    coverage: Coverage = 0.995
    workers: FleetWorkers = None
    scheduler: Scheduler = ""
    as_json: AsJson = False


@app.command("calibrate")
@takes(FleetCalibrateOptions)
def fleet_calibrate(options: FleetCalibrateOptions) -> None:
    """Learn a braking model for each vehicle of a fleet, pooled where its own stops say little.

    Surface by surface: how the vehicles differ, and each as far as its stops tell. One without
    stops gets the fleet's mean and a longer offset.

    [bold]Example[/]  slopewise fleet calibrate logs/*.csv --model atv --out out/fleet
    """
    from slopewise.services.cli.commands import fleet_calibrate as command

    result = command.run(options, quiet=options.as_json)
    say(options.as_json, command, result)
    if not options.as_json:
        typer.echo(f"wrote {len(result.vehicles)} model files to {options.out}")


@dataclass(frozen=True, slots=True)
class FleetDiscrepancyOptions:
    """Words of `slopewise fleet discrepancy`."""

    logs: LogFiles
    models: Annotated[
        str,
        typer.Option(
            metavar="MODEL|DIR",
            help="Model file or name for all, or a folder with NAME.toml for each vehicle.",
        ),
    ]
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for what is found.")]
    by_folder: ByFolder = False
    map_file: GroundMap = None
    nodata: NoDataValue = None
    topics: Topics = None
    false_alarm: FalseAlarm = 0.005
    practical_share: PracticalShare = 0.01
    practical_length: PracticalLength = 0.02
    seed: Seed = 20
    pages: Annotated[
        bool,
        typer.Option("--pages/--no-pages", help="Draw a page for each, and one for the fleet."),
    ] = True
    workers: FleetWorkers = None
    scheduler: Scheduler = ""
    as_json: AsJson = False


@app.command("discrepancy")
@takes(FleetDiscrepancyOptions)
def fleet_discrepancy(options: FleetDiscrepancyOptions) -> None:
    r"""Hold the logs of many vehicles against their models: who lacks which effect, and how sure.

    DIR/vehicles/NAME has discrepancy.json, model.toml and report.html as `slopewise discrepancy`
    writes them; DIR/findings a row a vehicle as Parquet; DIR/findings.jsonl a line each. A log that
    cannot be used is told in its row. A second run looks at what is new: logs that grew, models
    that changed. Needs the extra: pip install '.\[fleet]' in a clone.

    [bold]Examples[/]  slopewise fleet discrepancy logs/*.csv --models atv --out out/fleet
              slopewise fleet discrepancy logs/*/* --by-folder --models out/vehicles --out out/may
    """
    from slopewise.services.cli.commands import discrepancy as one
    from slopewise.services.cli.commands import fleet_discrepancy as command
    from slopewise.services.io.no_data import nodata_of

    job = command.FleetDiscrepancyJob(
        options.logs,
        options.models,
        options.out,
        options.by_folder,
        options.map_file,
        options.topics,
        one.with_settings(
            false_alarm=options.false_alarm,
            practical_share=options.practical_share,
            practical_length=options.practical_length,
            seed=options.seed,
        ),
        options.pages,
        options.workers,
        options.scheduler,
        nodata_of(options.nodata),
    )
    result = command.run(job, quiet=options.as_json)
    say(options.as_json, command, result)
    if not options.as_json:
        typer.echo(f"wrote {options.out / command.PAGE if options.pages else options.out}")
