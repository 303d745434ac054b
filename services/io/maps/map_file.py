"""Elevation maps from GeoTIFF, .npz or ROS 2 recordings, whole or only around where needed."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from models.arrays import Floats, Ints
from models.errors import ParameterError
from planner.ground.elevation_map import ElevationMap
from services.io.access import fault, write_atomic
from services.io.bags.recording import is_bag
from services.io.maps import geotiff_file, height_error, npz_map_file
from services.io.maps.grid import MAX_CELLS, Around, MapInfo, check_physical, in_words

__all__ = ["MapInfo", "frame_of", "known_heights", "map_info", "read_map", "write_map_npz"]

_GEOTIFF = (".tif", ".tiff", ".gtiff")
_HIGHEST = 1e5  # [m] beyond that it is a marker for missing data that nobody declared


def map_info(path: Path, topics: Path | None = None) -> MapInfo:
    """Grid of a map file; heights are read of a recording only.

    Raises:
        InputError: not a map in metres, or none of this earth.
    """
    if is_bag(path):
        ground = _recorded(path, topics)
        rows, columns = ground.elevation.shape
        info = MapInfo(rows, columns, ground.resolution, ground.origin)
    else:
        info = _reader(path)(path)
    try:
        check_physical(info.resolution, info.origin, (info.rows, info.columns))
    except ParameterError as error:
        raise fault(path, error.field, f"expected {error.expected}") from None
    return info


def read_map(
    path: Path, *, around: Around | None = None, topics: Path | None = None
) -> ElevationMap:
    """An elevation map, or the part of it that holds all heights within ``around``.

    Args:
        path: GeoTIFF or .npz file, or a recording with grid maps.
        around: (x_min, x_max, y_min, y_max) [m] with the margin that the caller needs, such as the
            vehicle's footprint. Of a GeoTIFF only that part is read.
        topics: topic mapping of a recording.

    Raises:
        InputError: not a map in metres, ``around`` is off the map, or no cell is known.
    """
    info = map_info(path, topics)
    cells: tuple[slice, slice] | None = slice(0, info.rows), slice(0, info.columns)
    if around is not None:
        cells = info.cells_around(around)
    if cells is None:
        assert around is not None
        found = f"the map at {in_words(info.extent)}"
        raise fault(path, "extent", f"expected ground at {in_words(around)}, got {found}")
    part = info.part(*cells)
    if part.rows * part.columns > MAX_CELLS:
        size = f"{part.rows} x {part.columns}"
        raise fault(path, "", f"expected at most {MAX_CELLS} cells at once, got {size}")
    classes: Ints | None = None
    names: tuple[str, ...] = ("",)
    if is_bag(path):
        recorded = _recorded(path, topics)
        heights, std = recorded.elevation[cells], recorded.height_std
    elif _is_geotiff(path):
        with geotiff_file.opened(path) as ground:
            heights, std = ground.read(*cells), ground.height_std
    else:
        heights, classes, names, told = npz_map_file.read_layers(path)
        heights = heights[cells]
        classes = None if classes is None else classes[cells]
        std = height_error.assumed(info.resolution) if told is None else told
    heights = known_heights(heights)
    if not np.isfinite(heights).any():
        where = "" if around is None else f" at {in_words(around)}"
        raise fault(path, "elevation", f"expected a known cell{where}, got unknown ones only")
    try:
        return ElevationMap(
            elevation=heights,
            resolution=part.resolution,
            origin=part.origin,
            terrain_class=classes,
            class_names=names,
            height_std=std,
        )
    except ParameterError as error:
        raise fault(path, error.field, f"expected {error.expected}") from None


def write_map_npz(elevation_map: ElevationMap, path: Path) -> None:
    """Write a map so that reading it gives the same one; all or nothing."""
    arrays: dict[str, Any] = {
        "elevation": elevation_map.elevation,
        "resolution": np.float64(elevation_map.resolution),
        "origin": np.asarray(elevation_map.origin, np.float64),
        "height_std": np.float64(elevation_map.height_std),
    }
    if elevation_map.terrain_class is not None:
        arrays["terrain_class"] = elevation_map.terrain_class
        arrays["terrain_names"] = np.asarray(elevation_map.class_names, np.str_)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    write_atomic(path, buffer.getvalue())


def assumptions(path: Path) -> tuple[str, ...]:
    """What a map file leaves open, and what it is taken for instead, in sentences."""
    if is_bag(path) or not _is_geotiff(path) or geotiff_file.names_its_coordinates(path):
        return ()
    return ("the map names no coordinate system: its grid is taken to be in metres",)


def known_heights(heights: Floats) -> Floats:
    """Heights with NaN where they can only be markers for missing data."""
    return np.where(np.abs(heights) <= _HIGHEST, heights, np.nan)


def frame_of(path: Path, topics: Path | None = None) -> str:
    """The frame that a recorded map is in; empty for other maps, and where it says none."""
    if not is_bag(path):
        return ""
    from services.io.maps.bag_map import map_and_frame

    return map_and_frame(path, topics)[1]


def _recorded(path: Path, topics: Path | None) -> ElevationMap:
    from services.io.maps.bag_map import read_bag_map

    return read_bag_map(path, topics)


def _is_geotiff(path: Path) -> bool:
    return path.suffix.lower() in _GEOTIFF


def _reader(path: Path) -> Callable[[Path], MapInfo]:
    if _is_geotiff(path):
        return geotiff_file.read_info
    if path.suffix.lower() == ".npz":
        return npz_map_file.read_info
    found = "a directory" if path.is_dir() else f"the name {path.name!r}"
    raise fault(path, "", f"expected a GeoTIFF (.tif), .npz or ROS 2 recording, got {found}")
