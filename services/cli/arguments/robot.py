"""Commands of a running service and of robots: serve, ros, guard, doctor, export, query, params,
replay.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from slopewise.services.cli.arguments.grouped import takes
from slopewise.services.cli.arguments.options import (
    NO_ADMISSIBLE,
    VIOLATIONS,
    AsJson,
    ClearDistance,
    Columns,
    Connect,
    JsonLine,
    LogFiles,
    Namespace,
    NoDataValue,
    PathFile,
    StartSpeed,
    Timeout,
    Topics,
    ZenohFile,
    say,
)

app = typer.Typer(rich_markup_mode="rich")


@app.command()
def serve(
    config: Annotated[
        Path, typer.Option("--config", "-c", metavar="service.toml", help="The service's settings.")
    ],
    as_json: JsonLine = False,
) -> None:
    """Answer questions for plans over zenoh until a signal asks to stop.

    [bold]Example[/]  slopewise serve --config configs/service.toml
    """
    from slopewise.services.cli.commands import serve as command

    command.run(config, as_json=as_json)


@app.command("warm-up")
def warm_up(as_json: AsJson = False) -> None:
    """Compile all that plans need, once after an installation; nobody waits for it later.

    [bold]Example[/]  slopewise warm-up
    """
    from slopewise.services.cli.commands import warm_up as command

    say(as_json, command, command.run())


@app.command()
def ros(
    config: Annotated[
        Path, typer.Option("--config", "-c", metavar="ros.toml", help="The edge's settings.")
    ],
    as_json: JsonLine = False,
) -> None:
    """Give a robot with ROS 2 speed limits: paths, maps and odometry in, limits out.

    Speaks as rmw_zenoh does, without ROS, and asks a running `slopewise serve`.

    [bold]Example[/]  slopewise ros --config configs/ros.toml
    """
    from slopewise.services.cli.commands import ros as command

    command.run(config, as_json=as_json)


@app.command()
def guard(
    config: Annotated[
        Path, typer.Option("--config", "-c", metavar="guard.toml", help="The guard's settings.")
    ],
    as_json: JsonLine = False,
) -> None:
    """Stand between command and base: pass, slow or stop what could not be stopped any more.

    Needs no planner. Its model reader and its stopping distances are its own; two processes watch
    each other, and what is not heard in time is a stop.

    [bold]Example[/]  slopewise guard --config configs/guard.toml
    """
    from slopewise.services.cli.commands import guard as command

    command.run(config, as_json=as_json)


@dataclass(frozen=True, slots=True)
class DoctorOptions:
    """Words of `slopewise doctor`."""

    model: Annotated[
        str, typer.Option("--model", "-m", metavar="M.toml", help="Model file, or shipped vehicle.")
    ] = ""
    nav2: Annotated[
        list[Path] | None,
        typer.Option("--nav2", metavar="PARAMS.yaml", help="Parameters of Nav2 or a base; repeat."),
    ] = None
    bag: Annotated[
        Path | None, typer.Option("--bag", metavar="BAG", help="A recording of the robot.")
    ] = None
    config: Annotated[
        Path | None,
        typer.Option("--config", "-c", metavar="ros.toml", help="Settings of slopewise ros."),
    ] = None
    live: Annotated[
        float, typer.Option("--live", metavar="SECONDS", help="Listen to the robot for so long.")
    ] = 0.0
    as_json: AsJson = False


@app.command()
@takes(DoctorOptions)
def doctor(options: DoctorOptions) -> None:
    """Look at a robot, a recording or parameter files, and say what does not fit.

    Decelerations along the chain against the brakes learned, limits that are not obeyed, clocks,
    frames, rates, map age, footprint. Status 3: something does not fit.

    [bold]Example[/]  slopewise doctor --nav2 nav2_params.yaml --model mine.toml --bag drive.mcap
    """
    from slopewise.services.cli.commands import doctor as command

    result = command.run(
        options.model, options.nav2 or [], options.bag, options.config, options.live
    )
    say(options.as_json, command, result)
    if command.has_errors(result):
        raise typer.Exit(VIOLATIONS)


@app.command()
def export(
    model: Annotated[
        str, typer.Argument(metavar="M.toml", help="Model file, or shipped vehicle.")
    ] = "",
    casadi: Annotated[
        Path | None, typer.Option(metavar="FILE", help="All functions, for CasADi to read.")
    ] = None,
    c: Annotated[
        Path | None, typer.Option("--c", metavar="FOLDER", help="C code, header, test vectors.")
    ] = None,
    json_schema: Annotated[
        bool, typer.Option("--json-schema", help="Print the JSON schema of model files.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Take a model elsewhere: stopping distance, speed bound, loads, effects, with derivatives.

    [bold]Example[/]  slopewise export mine.toml --c generated
    """
    from slopewise.services.cli.commands import export as command

    if json_schema:
        typer.echo(command.schema())
        return
    result = command.run(model, casadi, c)
    say(as_json, command, result, *result.files)


@dataclass(frozen=True, slots=True)
class QueryOptions:
    """Words of `slopewise query`."""

    path_file: PathFile
    connect: Connect = "tcp/127.0.0.1:7447"
    namespace: Namespace = "slopewise/robot"
    speed: StartSpeed = 0.0
    clear: ClearDistance = None
    map_file: Annotated[
        Path | None, typer.Option("--map", metavar="MAP", help="Elevation map to send before.")
    ] = None
    nodata: NoDataValue = None
    timeout: Timeout = 2.0
    zenoh_file: ZenohFile = ""
    as_json: AsJson = False


@app.command()
@takes(QueryOptions)
def query(options: QueryOptions) -> None:
    """Ask a running service for plans along candidate paths.

    Where no answer comes in time, the answer is the client's own stop. Status 3: no plan may be
    driven.

    [bold]Example[/]  slopewise query paths.csv --map hill.tif --speed 2
    """
    from slopewise.services.cli.commands import query as command

    outcome = command.run(options)
    say(options.as_json, command, outcome)
    if not command.admissible(outcome):
        raise typer.Exit(NO_ADMISSIBLE)


@dataclass(frozen=True, slots=True)
class ParamsOptions:
    """Words of `slopewise params`."""

    group: Annotated[
        str,
        typer.Argument(
            help="braking, braking.SURFACE, terrain, limits, effects; all if left out. diff: "
            "compare two model files, without a service."
        ),
    ] = ""
    files: Annotated[
        list[Path] | None, typer.Argument(metavar="[A.toml B.toml]", help="Files of diff.")
    ] = None
    history: Annotated[
        bool,
        typer.Option("--history", help="The last changes: when, who or what, to which values."),
    ] = False
    most: Annotated[int, typer.Option(min=1, max=10_000, help="Changes that are listed.")] = 20
    rollback: Annotated[
        int | None,
        typer.Option(metavar="VERSION", help="Go back to how GROUP, or all, was at a version."),
    ] = None
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Set a parameter of GROUP; repeat it."),
    ] = None
    investigate: Annotated[
        bool,
        typer.Option("--investigate", help="Hold the stops that it keeps against the model."),
    ] = False
    adopt: Annotated[
        str, typer.Option(metavar="OFFER", help="Plan with what it found and offers.")
    ] = ""
    faster: Annotated[
        bool,
        typer.Option("--faster", help="Even if stops get shorter than by the model file."),
    ] = False
    connect: Connect = "tcp/127.0.0.1:7447"
    namespace: Namespace = "slopewise/robot"
    timeout: Timeout = 2.0
    zenoh_file: ZenohFile = ""
    as_json: AsJson = False


@app.command()
@takes(ParamsOptions)
def params(options: ParamsOptions) -> None:
    """Read the parameters of a running service, set them, or go back to an earlier version.

    Limits may be set tighter than in the model file, not wider; braking above it counts in plans
    once stops confirm it. What is missing in the model is offered, and an operator adopts it.

    [bold]Examples[/]  slopewise params braking --history
              slopewise params limits --set speed=1.5
              slopewise params --investigate
              slopewise params diff configs/vehicles/atv.toml learned.toml
    """
    if options.group == "diff" or options.files:
        from slopewise.services.cli.commands import params_diff

        words = options.files or []
        say(options.as_json, params_diff, params_diff.run(words))
        return
    from slopewise.services.cli.commands import params as command

    reply = command.run(options)
    say(options.as_json, command.ReplyView(options), reply)


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """Words of `slopewise replay`."""

    logs: LogFiles
    connect: Connect = "tcp/127.0.0.1:7447"
    namespace: Namespace = "slopewise/robot"
    speed_up: Annotated[
        float, typer.Option(metavar="X", help="Seconds of the log in a second; inf: all it can.")
    ] = 1.0
    topics: Topics = None
    columns: Columns = ""
    timeout: Annotated[float, typer.Option(metavar="SECONDS", help="For each answer.")] = 5.0
    zenoh_file: ZenohFile = ""
    as_json: AsJson = False


@app.command()
@takes(ReplayOptions)
def replay(options: ReplayOptions) -> None:
    """Play recorded drives through a running service, and say what it learned from them.

    Samples are told as a robot would tell them, and each batch is waited for, so that nothing is
    lost however fast it goes. Stops that come quicker than the vehicle can make them teach nothing
    that makes plans faster, unless the service's settings allow it (stops_at_once).

    [bold]Example[/]  slopewise replay drive.csv --speed-up 20
    """
    from slopewise.services.cli.commands import replay as command

    result = command.run(options, quiet=options.as_json)
    say(options.as_json, command, result)
