"""Elevation maps from GeoTIFF, .npz or ROS 2 recordings, whole or only around where needed."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.services.io.access import fault, write_atomic
from slopewise.services.io.bags.recording import is_bag
from slopewise.services.io.maps import geotiff_file, height_error, no_data, npz_map_file
from slopewise.services.io.maps.grid import MAX_CELLS, Around, MapInfo, check_physical, in_words
from slopewise.services.io.maps.no_data import NoData

__all__ = ["MapInfo", "NoData", "frame_of", "map_info", "read_map", "write_map_npz"]

_GEOTIFF = (".tif", ".tiff", ".gtiff")


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
    path: Path, *, around: Around | None = None, topics: Path | None = None, nodata: NoData = None
) -> ElevationMap:
    """An elevation map, or the part of it that holds all heights within ``around``.

    Args:
        path: GeoTIFF or .npz file, or a recording with grid maps.
        around: (x_min, x_max, y_min, y_max) [m] with the margin that the caller needs, such as the
            vehicle's footprint. Of a GeoTIFF only that part is read.
        topics: topic mapping of a recording.
        nodata: a height that marks missing data [m], beside those that are found and told; "none":
            there are no markers but those that the file declares.

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
    assumed: tuple[str, ...]
    if is_bag(path):
        recorded = _recorded(path, topics, nodata)
        heights, std, assumed = recorded.elevation[cells], recorded.height_std, recorded.assumed
    elif _is_geotiff(path):
        with geotiff_file.opened(path, nodata) as ground:
            heights, std, assumed = ground.read(*cells), ground.height_std, ground.assumed
    else:
        heights, classes, names, told = npz_map_file.read_layers(path)
        heights, markers = no_data.known_heights(heights, nodata)
        heights, assumed = heights[cells], no_data.describe(markers)
        classes = None if classes is None else classes[cells]
        std = height_error.assumed(info.resolution) if told is None else told
    if not np.isfinite(heights).any():
        where = "" if around is None else f" at {in_words(around)}"
        found = "; ".join(("unknown ones only", *assumed))
        raise fault(path, "elevation", f"expected a known cell{where}, got {found}")
    try:
        return ElevationMap(
            elevation=heights,
            resolution=part.resolution,
            origin=part.origin,
            terrain_class=classes,
            class_names=names,
            height_std=std,
            assumed=assumed,
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


def frame_of(path: Path, topics: Path | None = None) -> str:
    """The frame that a recorded map is in; empty for other maps, and where it says none."""
    if not is_bag(path):
        return ""
    from slopewise.services.io.maps.bag_map import map_and_frame

    return map_and_frame(path, topics)[1]


def _recorded(path: Path, topics: Path | None, nodata: NoData = None) -> ElevationMap:
    from slopewise.services.io.maps.bag_map import read_bag_map

    return read_bag_map(path, topics, nodata)


def _is_geotiff(path: Path) -> bool:
    return path.suffix.lower() in _GEOTIFF


def _reader(path: Path) -> Callable[[Path], MapInfo]:
    if _is_geotiff(path):
        return geotiff_file.read_info
    if path.suffix.lower() == ".npz":
        return npz_map_file.read_info
    found = "a directory" if path.is_dir() else f"the name {path.name!r}"
    raise fault(path, "", f"expected a GeoTIFF (.tif), .npz or ROS 2 recording, got {found}")
