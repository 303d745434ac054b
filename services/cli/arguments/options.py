"""Options that several commands share, and how all of them say what they did."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Protocol

import typer

NO_ADMISSIBLE = 3
"""Exit status: no candidate may be driven."""

VIOLATIONS = 3
"""Exit status: a plan breaks a rule."""

OF_NO_USE = 3
"""Exit status: what was learned is of no use, or a model does not cover a log."""

MapFile = Annotated[
    Path,
    typer.Argument(
        metavar="MAP", help="Elevation map: GeoTIFF in metres, .npz, or GridMap in a bag."
    ),
]
NoDataValue = Annotated[
    str | None,
    typer.Option(
        "--nodata",
        metavar="VALUE",
        help="Height of the map that marks unknown ground; none: all its heights are ground. "
        "By default undeclared no-data values are detected and reported.",
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
        help="Station up to which the way is known free for the front of the vehicle; the middle "
        "of the wheelbase stays behind it. The whole path if left out.",
    ),
]
Spacing = Annotated[float | None, typer.Option(metavar="METRES", help="Distance between stations.")]
HorizonPenalty = Annotated[
    float | None,
    typer.Option(
        metavar="S/M", help="Ranking: seconds charged for each metre of path not reached."
    ),
]
MarginWeight = Annotated[
    float | None,
    typer.Option(metavar="S/M", help="Ranking: seconds that a metre of spare distance is worth."),
]
MarginEnough = Annotated[
    float | None,
    typer.Option(metavar="METRES", help="Ranking: spare distance beyond which more is worth 0."),
]
Quantile = Annotated[
    float,
    typer.Option(
        metavar="Q", help="Survive this share of what the model leaves open; 0.5 is its mean."
    ),
]
Solving = Annotated[
    str,
    typer.Option(
        "--solver",
        metavar="NAME",
        help="Who limits jerk: interior_point, osqp, or ipopt (exact, slow). All are judged.",
    ),
]
Smooth = Annotated[bool, typer.Option(help="Limit jerk; else the time-optimal profile.")]
GroundMap = Annotated[
    Path | None,
    typer.Option("--map", metavar="MAP", help="Elevation map: grade of the ground at x, y."),
]
Coverage = Annotated[
    float, typer.Option(help="Share of stops like those of the log that margins have to cover.")
]
LeastSpeed = Annotated[
    float | None,
    typer.Option(
        metavar="M/S",
        help="Slower vehicles have nothing to stop; what the log's noise hides if left out.",
    ),
]
LongestStop = Annotated[
    float, typer.Option(metavar="SECONDS", help="Later standstills are not of this stop.")
]
Ramp = Annotated[
    float, typer.Option(metavar="SECONDS", help="A command that comes down over longer is a ramp.")
]
CommandStep = Annotated[
    float, typer.Option("--step", metavar="SHARE", help="Of the speed that a command has to drop.")
]
FullBrake = Annotated[
    float, typer.Option(metavar="SHARE", help="Application from which brakes count as full.")
]
FewestSamples = Annotated[
    int, typer.Option("--fewest", help="Samples between onset and standstill of a stop.")
]
SettledSpeed = Annotated[
    float,
    typer.Option(metavar="M/S", help="Standstill of sensors that never read 0, at least."),
]
TurnRate = Annotated[
    float | None,
    typer.Option(
        metavar="RAD/S",
        help="Mean yaw rate from which a stop is a turn and left out. By default 0.35, or none "
        "where the model has the effect turning_resistance.",
    ),
]
Topics = Annotated[
    Path | None,
    typer.Option(metavar="topics.toml", help="Topics of ROS 2 recordings (.mcap, .db3)."),
]
Columns = Annotated[
    str,
    typer.Option(
        metavar="NAME=COLUMN:UNIT,…",
        help="Columns of tables with other names or units: speed=v:km/h,grade=slope:deg.",
    ),
]
FalseAlarm = Annotated[
    float,
    typer.Option(help="Share of logs without a missing effect that may be said to have one."),
]
PracticalShare = Annotated[
    float, typer.Option(help="Change of a stop, as a share of it, from which an effect matters.")
]
PracticalLength = Annotated[
    float, typer.Option(metavar="M", help="The same in metres; the larger of both counts.")
]
Seed = Annotated[int, typer.Option(help="Of the random numbers; the same gives the same.")]
Report = Annotated[Path | None, typer.Option(metavar="out.html", help="Write a page to look at.")]
Sheet = Annotated[
    Path | None,
    typer.Option(
        metavar="sheet.pdf", help="Write the brake sheet, one page to file: .pdf or .html."
    ),
]
Timeout = Annotated[float, typer.Option(metavar="SECONDS", help="For the answer.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for machines instead of a table.")]
JsonLine = Annotated[
    bool, typer.Option("--json", help="Say in JSON that it is ready; a line on standard output.")
]


class ResultView(Protocol):
    """How a command shows what it did; its module, most often."""

    def as_json(self, result: Any, /) -> dict[str, Any]:
        """For machines."""

    def show(self, result: Any, console: Any, /) -> None:
        """For people."""


def say(as_json: bool, view: ResultView, result: Any, *files: Path | None) -> None:
    """The result as JSON; or as tables, with the files that were written."""
    if as_json:
        typer.echo(json.dumps(view.as_json(result), allow_nan=False))
        return
    from rich.console import Console

    view.show(result, Console())
    for file in files:
        if file is not None:
            typer.echo(f"wrote {file}")
