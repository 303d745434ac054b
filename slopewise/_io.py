"""Maps, vehicles, paths and drive logs from files, by name or path."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Literal

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.typed_arguments import typed_arguments
from slopewise.services.io import map_file, model_file, path_file
from slopewise.services.io.drive_log import DriveLog, read_logs

File = str | PathLike[str]


@typed_arguments
def read_map(file: File, nodata: float | Literal["none"] | None = None) -> ElevationMap:
    """An elevation map from a GeoTIFF in metres, an .npz file or a ROS 2 recording.

    Args:
        file: of any of these kinds.
        nodata: a height that marks missing data [m]. By default undeclared ones are detected, and
            named in ``assumed`` of the map; "none": all heights are ground.

    Raises:
        InputError: not a map in metres, or no cell is known.
    """
    return map_file.read_map(Path(file), nodata=nodata)


@typed_arguments
def read_model(name_or_file: File) -> Model:
    """A vehicle on its ground: a model file (TOML), or a shipped one, such as ``"atv"``.

    Raises:
        InputError: names the file and the dotted key, or lists the shipped vehicles.
    """
    return model_file.read_model(model_file.find_model(str(name_or_file)))


@typed_arguments
def write_model(model: Model, file: File) -> None:
    """Write a model file, all or nothing; :func:`read_model` gives the same model again."""
    model_file.write_model(model, Path(file))


@typed_arguments
def read_paths(file: File) -> list[CandidatePath]:
    """All candidate paths of a CSV, Parquet or GeoJSON file, or of a ROS 2 recording.

    Raises:
        InputError: names the row and column, or the feature, that cannot be used.
    """
    return path_file.read_paths(Path(file))


@typed_arguments
def read_drive_log(*files: File, columns: str = "") -> DriveLog:
    """One drive log from tables (CSV, Parquet), or from ROS 2 recordings.

    Args:
        files: tables or recordings.
        columns: of tables that have other names or units, such as ``"speed=v:km/h"``.

    Raises:
        InputError: names file, row and column; also if tables and recordings are mixed.
    """
    return read_logs([Path(file) for file in files], names=columns)
