"""Candidate paths: CSV or Parquet with x,y[,candidate,speed_limit,yaw], GeoJSON, recordings.

Coordinates are those of the map [m], speed limits [m/s], yaw [rad]. A further format is a function
and a row of :data:`_FORMATS`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.services.io.bag_paths import read_bag_paths
from slopewise.services.io.bags import is_bag
from slopewise.services.io.files import fault, faults_of
from slopewise.services.io.geojson import read_geojson_paths
from slopewise.services.io.map_grid import Extent, describe_extent
from slopewise.services.io.table import Table, read_table, write_csv

_OPTIONAL = {"speed_limit": "m/s", "yaw": "rad"}

_FORMATS: dict[str, Callable[[Path], list[CandidatePath]]] = {
    ".geojson": read_geojson_paths,
    ".json": read_geojson_paths,
}
"""Readers by the ending of the file's name; any other file is a table."""


def read_paths(path: Path, topics: Path | None = None, frame: str = "") -> list[CandidatePath]:
    """All candidates of a file, in the order in which they first appear.

    Paths of a recording have to be in the frame; an empty one accepts any.
    """
    if is_bag(path):
        return read_bag_paths(path, topics, frame)
    return _FORMATS.get(path.suffix.lower(), _read_path_table)(path)


_DEGREES = {"lat", "latitude", "lon", "long", "lng", "longitude"}
_NO_DEGREES = "degrees are not accepted: project them, x and y are metres in the frame of the map"


def _read_path_table(path: Path) -> list[CandidatePath]:
    table = read_table(path)
    degrees = _DEGREES & {column.strip().lower() for column in table.columns}
    table.require(("x", "y"), _NO_DEGREES if degrees else "")
    points = np.stack((table.numbers("x", "m"), table.numbers("y", "m")), axis=1)
    optional = {name: _optional(table, name) for name in _OPTIONAL if name in table.columns}
    candidates = table.rows_by_candidate()
    return [_candidate(table, name, candidates[name], points, optional) for name in candidates]


def _optional(table: Table, name: str) -> Floats:
    """A column that may be left empty, NaN there; a cell that says NaN is refused."""
    values = table.numbers(name, _OPTIONAL[name], blank=np.nan)
    for index, cell in enumerate(table.text(name)):
        if np.isnan(values[index]) and cell.strip():
            raise table.error(index, name, f"expected a number [{_OPTIONAL[name]}], got {cell}")
        if name == "speed_limit" and values[index] < 0.0:
            raise table.error(index, name, f"expected a speed >= 0 [m/s], got {cell}")
    return values


def _candidate(
    table: Table, name: str, rows: list[int], points: Floats, optional: dict[str, Floats]
) -> CandidatePath:
    if len(rows) < 2:
        expected = f"expected at least 2 points, got 1 (row {table.rows[rows[0]]})"
        raise fault(table.source, f"candidate {name}", expected)
    given: dict[str, Floats | None] = {}
    for column, values in optional.items():
        given[column] = table.all_or_none(column, values, rows, name, _OPTIONAL[column])
    with faults_of(table.source, f"candidate {name}, "):
        return CandidatePath(name, points[rows], given.get("speed_limit"), given.get("yaw"))


def check_paths_on_map(
    paths: Sequence[CandidatePath], extent: Extent, source: str, map_source: str
) -> None:
    """Raise InputError if a candidate does not begin within the extent of the cell centres [m]."""
    x_min, x_max, y_min, y_max = extent
    for path in paths:
        x, y = path.points[0].tolist()
        if x_min <= x <= x_max and y_min <= y <= y_max:
            continue
        expected = f"expected a point on the map {map_source} ({describe_extent(extent)})"
        got = f"got x {x:.10g}, y {y:.10g}"
        if np.all(np.abs(path.points) <= (180.0, 90.0)) and max(map(abs, extent)) > 180.0:
            got += "; that looks like degrees, map coordinates are in metres"
        elif x_min <= y <= x_max and y_min <= x <= y_max:
            got += "; are x and y in each other's column?"
        raise fault(source, f"candidate {path.name}, point 1", f"{expected}, {got}")


def write_paths_csv(paths: Sequence[CandidatePath], path: Path) -> None:
    """Write candidates so that reading them gives the same ones; all or nothing."""
    names = [candidate.name for candidate in paths for _ in candidate.points]
    points = np.concatenate([candidate.points for candidate in paths] or [np.empty((0, 2))])
    columns: dict[str, Sequence[str] | Floats] = {
        "x": points[:, 0],
        "y": points[:, 1],
        "candidate": names,
    }
    for column in _OPTIONAL:
        values = [(getattr(candidate, column), len(candidate.points)) for candidate in paths]
        if any(given is not None for given, _ in values):
            columns[column] = [
                cell
                for given, count in values
                for cell in ([""] * count if given is None else map(repr, given.tolist()))
            ]
    write_csv(columns, path)
