"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer


def option(text: str, metavar: str | None = None, *names: str) -> Any:
    """An option: its help, what its value is called, and its names where the parameter's differ."""
    return typer.Option(*names, metavar=metavar, help=text)


def output(text: str, metavar: str) -> Any:
    """An option that names a file to write, which must be none that the command reads."""
    return typer.Option(metavar=metavar, help=text, writable=True)


def argument(text: str, metavar: str | None = None) -> Any:
    """An argument: its help, and what it is called."""
    return typer.Argument(metavar=metavar, help=text)


def _nodata(text: str) -> Any:
    from slopewise.services.io.no_data import nodata_of

    return nodata_of(text)


def _without_progress(as_json: bool) -> bool:
    from slopewise.services.jobs.progress import show_progress

    show_progress(not as_json)
    return as_json


MapFile = Annotated[
    Path, argument("Elevation map: GeoTIFF in metres, .npz, or GridMap in a bag.", "MAP")
]
NoDataValue = Annotated[
    Any,
    typer.Option(
        "--nodata",
        parser=_nodata,
        metavar="VALUE",
        help="Height of the map that marks unknown ground; none: all its heights are ground. "
        "By default undeclared no-data values are detected and reported.",
    ),
]
PathFile = Annotated[
    Path, argument("Candidates: CSV with x,y[,candidate], GeoJSON, or a bag.", "PATHS")
]
LogFiles = Annotated[
    list[Path], argument("Drive logs: CSV or Parquet, run,t,v,v_cmd,pitch.", "LOG…")
]
ModelFile = Annotated[
    str, option("Model file, or the name of a shipped vehicle.", "M.toml", "--model", "-m")
]
Connect = Annotated[str, option("Where the service, or a router, listens.", "ENDPOINT")]
Namespace = Annotated[str, option("Prefix of the service's keys.")]
ZenohFile = Annotated[str, option("Settings of zenoh, e.g. certificates.", "FILE", "--zenoh")]
StartSpeed = Annotated[float, option("Speed at the start in m/s.", "V0")]
ClearDistance = Annotated[
    float,
    typer.Option(
        metavar="METRES",
        show_default=False,
        help="Station up to which the path is known to be free for the front of the vehicle; the "
        "middle of the wheelbase stays behind it. Default: the end of the path.",
    ),
]
Spacing = Annotated[float | None, option("Distance between stations.", "METRES")]
Quantile = Annotated[
    float,
    option(
        "One-sided probability that margins cover the model's uncertainty; 0.5 plans with "
        "the mean.",
        "Q",
    ),
]
Smooth = Annotated[bool, option("Limit jerk; else the time-optimal profile.")]
GroundMap = Annotated[
    Path | None, option("Elevation map: grade of the ground at x, y.", "MAP", "--map")
]
Coverage = Annotated[
    float, option("Share of stops like those of the log that margins have to cover.")
]
Topics = Annotated[Path | None, option("Topics of ROS 2 recordings (.mcap, .db3).", "topics.toml")]
Columns = Annotated[
    str,
    option(
        "Columns of tables with other names or units: speed=v:km/h,grade=slope:deg.",
        "NAME=COLUMN:UNIT,…",
    ),
]
FalseAlarm = Annotated[
    float, option("Accepted share of logs without a missing effect that name one.")
]
Seed = Annotated[int, option("Seed of the random numbers; the same one gives the same result.")]
Report = Annotated[Path | None, output("Write a page with charts.", "out.html")]
Timeout = Annotated[float, option("Longest wait for the reply.", "SECONDS")]
AsJson = Annotated[
    bool, typer.Option("--json", callback=_without_progress, help="Print JSON instead of a table.")
]
JsonLine = Annotated[
    bool, option("Print the ready message as JSON, on standard output.", None, "--json")
]
