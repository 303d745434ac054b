"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer


def _nodata(text: str) -> Any:
    from slopewise.services.io.no_data import nodata_of

    return nodata_of(text)


def _without_progress(as_json: bool) -> bool:
    from slopewise.services.jobs.progress import show_progress

    show_progress(not as_json)
    return as_json


MapFile = Annotated[
    Path,
    typer.Argument(
        metavar="MAP", help="Elevation map: GeoTIFF in metres, .npz, or GridMap in a bag."
    ),
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
Namespace = Annotated[str, typer.Option(help="Prefix of the service's keys.")]
ZenohFile = Annotated[
    str, typer.Option("--zenoh", metavar="FILE", help="Settings of zenoh, e.g. certificates.")
]
StartSpeed = Annotated[float, typer.Option(metavar="V0", help="Speed at the start in m/s.")]
ClearDistance = Annotated[
    float,
    typer.Option(
        metavar="METRES",
        show_default=False,
        help="Station up to which the path is known to be free for the front of the vehicle; the "
        "middle of the wheelbase stays behind it. Default: the end of the path.",
    ),
]
Spacing = Annotated[float | None, typer.Option(metavar="METRES", help="Distance between stations.")]
Quantile = Annotated[
    float,
    typer.Option(
        metavar="Q",
        help="One-sided probability that margins cover the model's uncertainty; 0.5 plans with "
        "the mean.",
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
    typer.Option(help="Accepted share of logs without a missing effect that name one."),
]
Seed = Annotated[
    int, typer.Option(help="Seed of the random numbers; the same one gives the same result.")
]
Report = Annotated[Path | None, typer.Option(metavar="out.html", help="Write a page with charts.")]
Timeout = Annotated[float, typer.Option(metavar="SECONDS", help="Longest wait for the reply.")]
AsJson = Annotated[
    bool,
    typer.Option("--json", callback=_without_progress, help="Print JSON instead of a table."),
]
JsonLine = Annotated[
    bool,
    typer.Option("--json", help="Print the ready message as JSON, on standard output."),
]
