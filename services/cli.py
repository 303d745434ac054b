"""The command line. Each command reads its words here and does its work in `services.commands`.

Exit status: 0 done; 2 bad input, one line on standard error; 3 no admissible candidate; 1 a fault
of the program.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from models.errors import SlopewiseError

NO_ADMISSIBLE = 3
BAD_INPUT = 2
FAULT = 1

# Recent versions of typer bring a click of their own, so its classes are taken from typer.
_UsageError: Any = typer.BadParameter.__base__

app = typer.Typer(
    name="slopewise",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    rich_markup_mode="rich",
    help="How fast may the robot go here, so that it can always still stop?\n\n"
    "Plans the fastest speed along each candidate path over an elevation map from which the "
    "vehicle can stop on ground that is known, without tipping.\n\n"
    "[bold]Try[/]  slopewise demo",
)

MapFile = Annotated[
    Path,
    typer.Argument(
        metavar="MAP", help="Elevation map: GeoTIFF in metres, .npz, or GridMap in a bag."
    ),
]
PathFile = Annotated[
    Path,
    typer.Argument(
        metavar="PATHS", help="Candidates: CSV with x,y[,candidate], GeoJSON, or a bag."
    ),
]
LogFiles = Annotated[
    list[Path],
    typer.Argument(metavar="LOG…", help="Drive logs: CSV or Parquet, run,t,v,v_cmd,pitch."),
]
ModelFile = Annotated[
    str,
    typer.Option(
        "--model", "-m", metavar="M.toml", help="Model file, or the name of a shipped vehicle."
    ),
]
Connect = Annotated[
    str, typer.Option(metavar="ENDPOINT", help="Where the service, or a router, listens.")
]
Namespace = Annotated[str, typer.Option(help="Of the service's keys.")]
ZenohFile = Annotated[
    str, typer.Option("--zenoh", metavar="FILE", help="Zenoh's own settings, e.g. certificates.")
]
StartSpeed = Annotated[float, typer.Option(metavar="V0", help="Speed at the start in m/s.")]
ClearDistance = Annotated[
    float | None,
    typer.Option(
        metavar="METRES",
        help="Station up to which the way is known free; the whole path if left out.",
    ),
]
Spacing = Annotated[float | None, typer.Option(metavar="METRES", help="Distance between stations.")]
Quantile = Annotated[
    float | None,
    typer.Option(
        metavar="Q",
        help="Survive this share of what the model leaves open, e.g. 0.999; else its mean.",
    ),
]
Smooth = Annotated[bool, typer.Option(help="Limit jerk; else the time-optimal profile.")]
GroundMap = Annotated[
    Path | None,
    typer.Option("--map", metavar="MAP", help="Elevation map: grade of the ground at x, y."),
]
Coverage = Annotated[
    float, typer.Option(help="Share of future stops that predictions have to cover.")
]
Topics = Annotated[
    Path | None,
    typer.Option(metavar="topics.toml", help="Topics of ROS 2 recordings (.mcap, .db3)."),
]
FalseAlarm = Annotated[
    float,
    typer.Option(help="Share of logs without a missing effect that may be said to have one."),
]
Seed = Annotated[int, typer.Option(help="Of the random numbers; the same gives the same.")]
Report = Annotated[Path | None, typer.Option(metavar="out.html", help="Write a page to look at.")]
Timeout = Annotated[float, typer.Option(metavar="SECONDS", help="For the answer.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for machines instead of a table.")]


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        from importlib.metadata import version as installed

        typer.echo(f"slopewise {installed('slopewise')}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


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

    from planner.settings import PlannerSettings
    from services.commands import plan as command

    settings = PlannerSettings(smooth=smooth)
    job = command.PlanJob(
        map_file,
        path_file,
        model,
        speed,
        math.inf if clear is None else clear,
        command.with_spacing(settings, spacing),
        command.uncertainty_at(quantile),
        explain,
        topics,
    )
    result = command.run(job, quiet=as_json)
    if out is not None:
        command.write(result, out)
    if report is not None:
        command.write_page(result, job, report)
    _print(as_json, lambda: command.as_json(result), lambda screen: command.show(result, screen))
    _say_written(as_json, out, report)
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
    from services.commands import calibrate as command

    job = command.CalibrateJob(logs, model, map_file, topics, coverage)
    result = command.run(job, quiet=as_json)
    if out is not None:
        command.write_learned_model(result, out)
    if stops is not None:
        command.write_stops(result, stops)
    if report is not None:
        command.write_page(result, job, report)
    _print(as_json, lambda: command.as_json(result), lambda screen: command.show(result, screen))
    _say_written(as_json, out, stops, report)


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
    from services.commands import terrain as command
    from services.commands import terrain_result as results
    from services.commands import terrain_view as view

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
    _print(as_json, lambda: view.as_json(result), lambda screen: view.show(result, screen))
    _say_written(as_json, out, update, learn, report)


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
    from services.commands import simulate as command

    result = command.run(logs, model, quiet=as_json)
    if out is not None:
        command.write(result, out)
    _print(as_json, lambda: command.as_json(result), lambda screen: command.show(result, screen))
    _say_written(as_json, out)


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
    false_alarm: FalseAlarm = 0.01,
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
    from services.commands import discrepancy as command

    settings = command.with_settings(false_alarm, seed)
    job = command.DiscrepancyJob(logs, model, map_file, topics, settings)
    result = command.run(job, quiet=as_json)
    written = command.write(result, job, out)
    _print(as_json, lambda: command.as_json(result), lambda screen: command.show(result, screen))
    _say_written(as_json, *written)


@app.command()
def demo(
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where map, paths, plans and report go.")
    ] = Path("out/demo"),
) -> None:
    """Plan a dozen candidates over a generated hill, and write a page to look at."""
    from services.commands import demo as command

    page = command.run(out)
    typer.echo(f"\nLook at {page}")


@app.command()
def bench(
    what: Annotated[
        Literal["planner", "cycle", "optimality", "closed-loop", "discrepancy", "fleet"],
        typer.Argument(help="What to measure, see above."),
    ] = "planner",
    quick: Annotated[bool, typer.Option(help="Fewer repetitions, half a minute.")] = False,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write all figures as JSON.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="out.html", help="Write the growth plots as a page.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="closed-loop: write report and pictures, and keep every drive: a run that was "
            "interrupted goes on. discrepancy: likewise, a line of JSON a set. fleet: a folder "
            "with room for the map.",
        ),
    ] = None,
    sets: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="discrepancy: sets at most.")
    ] = None,
    minutes: Annotated[
        float | None,
        typer.Option(metavar="M", min=0.0, help="discrepancy: begin no further set after that."),
    ] = None,
) -> None:
    r"""Benchmark the planner beside its peers, in one run on one thread.

    [bold]cycle[/] times 10,000 cycles of the moving horizon on one core, alone and beside others,
    and watches memory over an hour of simulated driving. [bold]optimality[/] holds smoothed plans
    against IPOPT on 500 generated problems.

    [bold]closed-loop[/] learns a braking model from stops in a physics engine, then lets planner
    and plainer policies drive there, with walls and unknown ground at random, on two processes; the
    extra `sim` brings the engine.

    [bold]discrepancy[/] hides effects in stops of a plant of its own, and of a physics engine, has
    each log investigated by a process that sees nothing else, and compares what was said with what
    is true, on two processes. It takes some two hours, quickly some minutes.

    Times depend on the machine, so ratios are the result. Peers that are not installed are said to
    be missing; `pip install slopewise\[bench]` brings them.
    """
    from services.commands import bench as command

    if what == "closed-loop":
        command.closed_loop(quick=quick, json_file=json_file, out=out)
        return
    if what == "fleet":
        command.fleet(quick=quick, json_file=json_file, out=out)
        return
    if what == "discrepancy":
        command.discrepancy(
            quick=quick, json_file=json_file, plot=plot, out=out, sets=sets, minutes=minutes
        )
        return
    if what != "planner":
        command.horizon(what, quick=quick, json_file=json_file)
        return
    command.run(quick=quick, json_file=json_file, plot=plot)


@app.command()
def serve(
    config: Annotated[
        Path, typer.Option("--config", "-c", metavar="service.toml", help="The service's settings.")
    ],
) -> None:
    """Answer questions for plans over zenoh until a signal asks to stop.

    [bold]Example[/]  slopewise serve --config configs/service.toml
    """
    from services.commands import serve as command

    command.run(config)


@app.command()
def ros(
    config: Annotated[
        Path, typer.Option("--config", "-c", metavar="ros.toml", help="The edge's settings.")
    ],
) -> None:
    """Give a robot with ROS 2 speed limits: paths, maps and odometry in, limits out.

    Speaks as rmw_zenoh does, without ROS, and asks a running `slopewise serve`.

    [bold]Example[/]  slopewise ros --config configs/ros.toml
    """
    from services.commands import ros as command

    command.run(config)


@app.command()
def query(
    path_file: PathFile,
    connect: Connect = "tcp/127.0.0.1:7447",
    namespace: Namespace = "slopewise/robot",
    speed: StartSpeed = 0.0,
    clear: ClearDistance = None,
    map_file: Annotated[
        Path | None, typer.Option("--map", metavar="MAP", help="Elevation map to send before.")
    ] = None,
    timeout: Timeout = 2.0,
    zenoh_file: ZenohFile = "",
    as_json: AsJson = False,
) -> None:
    """Ask a running service for plans along candidate paths.

    Where no answer comes in time, the answer is the client's own stop. Status 3: no plan may be
    driven.

    [bold]Example[/]  slopewise query paths.csv --map hill.tif --speed 2
    """
    from services.commands import query as command

    job = command.QueryJob(
        path_file, connect, namespace, speed, clear, timeout, map_file, zenoh_file
    )
    outcome = command.run(job)
    _print(as_json, lambda: command.as_json(outcome), lambda screen: command.show(outcome, screen))
    if not command.admissible(outcome):
        raise typer.Exit(NO_ADMISSIBLE)


@app.command()
def params(
    group: Annotated[
        str,
        typer.Argument(help="braking, braking.SURFACE, terrain, limits, effects; all if left out."),
    ] = "",
    history: Annotated[
        bool,
        typer.Option("--history", help="The last changes: when, who or what, to which values."),
    ] = False,
    most: Annotated[int, typer.Option(min=1, max=10_000, help="Changes that are listed.")] = 20,
    rollback: Annotated[
        int | None,
        typer.Option(metavar="VERSION", help="Go back to how GROUP, or all, was at a version."),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Set a parameter of GROUP; repeat it."),
    ] = None,
    investigate: Annotated[
        bool,
        typer.Option("--investigate", help="Hold the stops that it keeps against the model."),
    ] = False,
    adopt: Annotated[
        str, typer.Option(metavar="OFFER", help="Plan with what it found and offers.")
    ] = "",
    faster: Annotated[
        bool,
        typer.Option("--faster", help="Even if stops get shorter than by the model file."),
    ] = False,
    connect: Connect = "tcp/127.0.0.1:7447",
    namespace: Namespace = "slopewise/robot",
    timeout: Timeout = 2.0,
    zenoh_file: ZenohFile = "",
    as_json: AsJson = False,
) -> None:
    """Read the parameters of a running service, set them, or go back to an earlier version.

    Limits may be set tighter than in the model file, not wider; braking above it counts in plans
    once stops confirm it. What is missing in the model is offered, and an operator adopts it.

    [bold]Examples[/]  slopewise params braking --history
              slopewise params limits --set speed=1.5
              slopewise params --investigate
    """
    from services.commands import params as command

    job = command.ParamsJob(
        connect, namespace, timeout, zenoh_file, group, most if history else 0, rollback,
        tuple(changes or ()), investigate, adopt, faster,
    )  # fmt: skip
    reply = command.run(job)
    _print(as_json, lambda: command.as_json(reply), lambda screen: command.show(reply, job, screen))


@app.command()
def replay(
    logs: LogFiles,
    connect: Connect = "tcp/127.0.0.1:7447",
    namespace: Namespace = "slopewise/robot",
    speed_up: Annotated[
        float, typer.Option(metavar="X", help="Seconds of the log in a second; inf: all it can.")
    ] = 1.0,
    topics: Topics = None,
    timeout: Annotated[float, typer.Option(metavar="SECONDS", help="For each answer.")] = 5.0,
    zenoh_file: ZenohFile = "",
    as_json: AsJson = False,
) -> None:
    """Play recorded drives through a running service, and say what it learned from them.

    Samples are told as a robot would tell them, and each batch is waited for, so that nothing is
    lost however fast it goes.

    [bold]Example[/]  slopewise replay drive.csv --speed-up 20
    """
    from services.commands import replay as command

    job = command.ReplayJob(logs, topics, connect, namespace, speed_up, timeout, zenoh_file)
    result = command.run(job, quiet=as_json)
    _print(as_json, lambda: command.as_json(result), lambda screen: command.show(result, screen))


fleet = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="rich",
    help="Many paths over large maps, the logs of many vehicles: on several processes or machines.",
)
app.add_typer(fleet, name="fleet")

ByFolder = Annotated[
    bool, typer.Option("--by-folder", help="A folder is a vehicle; else each file is one.")
]
FleetWorkers = Annotated[
    int | None,
    typer.Option(min=0, help="Processes here; 0 works in this one. One for each processor."),
]
Scheduler = Annotated[
    str, typer.Option(metavar="ADDRESS", help="A running Dask scheduler, e.g. tcp://10.0.0.1:8786.")
]


@fleet.command("plan")
def fleet_plan(
    map_file: Annotated[
        Path, typer.Argument(metavar="MAP", help="Elevation map: tiled GeoTIFF in metres.")
    ],
    path_files: Annotated[
        list[Path],
        typer.Argument(metavar="PATHS…", help="Candidates: CSV or Parquet with x,y[,candidate]."),
    ],
    model: ModelFile,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where the results go, as Parquet in parts.")
    ],
    speed: StartSpeed = 0.0,
    clear: ClearDistance = None,
    spacing: Spacing = None,
    quantile: Quantile = None,
    smooth: Smooth = True,
    workers: FleetWorkers = None,
    scheduler: Scheduler = "",
    as_json: AsJson = False,
) -> None:
    r"""Plan the candidates of many files over a map that need not fit into memory.

    DIR/plans has a row a station, DIR/candidates a row a candidate, in parts. A run that was
    interrupted goes on where it was; any number of workers gives the same bytes. Status 3: no
    candidate may be driven. Needs `pip install slopewise\[fleet]`.

    [bold]Example[/]  slopewise fleet plan county.tif paths-*.csv --model atv --out out/county
    """
    import math

    from planner.settings import PlannerSettings
    from services.commands import fleet_plan as command
    from services.commands import plan as one

    job = command.FleetPlanJob(
        map_file, path_files, model, out, speed, math.inf if clear is None else clear,
        one.with_spacing(PlannerSettings(smooth=smooth), spacing), one.uncertainty_at(quantile),
        workers, scheduler,
    )  # fmt: skip
    result = command.run(job, quiet=as_json)
    _print(as_json, lambda: command.as_json(result), lambda screen: command.show(result, screen))
    _say_written(as_json, out)
    if not result.admissible:
        raise typer.Exit(NO_ADMISSIBLE)


@fleet.command("calibrate")
def fleet_calibrate(
    logs: LogFiles,
    model: ModelFile,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for a model file a vehicle.")],
    by_folder: ByFolder = False,
    map_file: GroundMap = None,
    coverage: Coverage = 0.995,
    workers: FleetWorkers = None,
    scheduler: Scheduler = "",
    as_json: AsJson = False,
) -> None:
    """Learn a braking model for each vehicle of a fleet, pooled where its own stops say little.

    Surface by surface: how the vehicles differ, and each as far as its stops tell. One without
    stops gets the fleet's mean and a longer offset.

    [bold]Example[/]  slopewise fleet calibrate logs/*.csv --model atv --out out/fleet
    """
    from services.commands import fleet_calibrate as command

    job = command.FleetCalibrateJob(
        logs, model, out, by_folder, map_file, coverage, workers, scheduler
    )
    result = command.run(job, quiet=as_json)
    _print(as_json, lambda: command.as_json(result), lambda screen: command.show(result, screen))
    if not as_json:
        typer.echo(f"wrote {len(result.vehicles)} model files to {out}")


@fleet.command("discrepancy")
def fleet_discrepancy(
    logs: LogFiles,
    models: Annotated[
        str,
        typer.Option(
            metavar="MODEL|DIR",
            help="Model file or name for all, or a folder with NAME.toml for each vehicle.",
        ),
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for what is found.")],
    by_folder: ByFolder = False,
    map_file: GroundMap = None,
    topics: Topics = None,
    false_alarm: FalseAlarm = 0.01,
    seed: Seed = 20,
    pages: Annotated[
        bool,
        typer.Option("--pages/--no-pages", help="Draw a page for each, and one for the fleet."),
    ] = True,
    workers: FleetWorkers = None,
    scheduler: Scheduler = "",
    as_json: AsJson = False,
) -> None:
    r"""Hold the logs of many vehicles against their models: who lacks which effect, and how sure.

    DIR/vehicles/NAME has discrepancy.json, model.toml and report.html as `slopewise discrepancy`
    writes them; DIR/findings a row a vehicle as Parquet; DIR/findings.jsonl a line each. A log that
    cannot be used is told in its row. A second run looks at what is new: logs that grew, models
    that changed. Needs `pip install slopewise\[fleet,report]`.

    [bold]Examples[/]  slopewise fleet discrepancy logs/*.csv --models atv --out out/fleet
              slopewise fleet discrepancy logs/*/* --by-folder --models out/vehicles --out out/may
    """
    from services.commands import discrepancy as one
    from services.commands import fleet_discrepancy as command

    job = command.FleetDiscrepancyJob(
        logs, models, out, by_folder, map_file, topics, one.with_settings(false_alarm, seed), pages,
        workers, scheduler,
    )  # fmt: skip
    result = command.run(job, quiet=as_json)
    _print(as_json, lambda: command.as_json(result), lambda screen: command.show(result, screen))
    if not as_json:
        typer.echo(f"wrote {out / command.PAGE if pages else out}")


def _print(as_json: bool, data: Any, show: Any) -> None:
    if as_json:
        typer.echo(json.dumps(data(), allow_nan=False))
        return
    from rich.console import Console

    show(Console())


def _say_written(as_json: bool, *files: Path | None) -> None:
    if not as_json:
        for file in files:
            if file is not None:
                typer.echo(f"wrote {file}")


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its status."""
    try:
        status = app(args=arguments, prog_name="slopewise", standalone_mode=False)
    except _UsageError as error:
        _fail(f"{error.format_message()} (see slopewise --help)", BAD_INPUT)
    except SlopewiseError as error:
        _fail(" ".join(str(error).split()), BAD_INPUT)
    except OSError as error:
        _fail(f"{error.filename or 'file'}: {error.strerror or error}", BAD_INPUT)
    except typer.Abort:
        _fail("stopped", 130)
    except Exception as error:
        if os.environ.get("SLOPEWISE_DEBUG"):
            raise
        text = f"fault of slopewise, not of your input: {type(error).__name__}: {error}"
        _fail(f"{text} (SLOPEWISE_DEBUG=1 shows where)", FAULT)
    sys.exit(status if isinstance(status, int) else 0)


def _fail(line: str, status: int) -> None:
    sys.stdout.flush()
    print(f"slopewise: {line}", file=sys.stderr)
    sys.exit(status)


if __name__ == "__main__":
    main()
