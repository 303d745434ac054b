"""Elevation maps from GeoTIFF, .npz or ROS 2 recordings, whole or only around a region.

A further format is a module with the two functions of the others, and a row of :data:`_FORMATS`.
"""

from __future__ import annotations

import io
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.vehicle import Vehicle
from slopewise.services.io import geotiff, grid_map, npz_map
from slopewise.services.io.bags import is_bag
from slopewise.services.io.files import fault, faults_of, write_atomic
from slopewise.services.io.map_grid import (
    MAX_CELLS,
    Extent,
    MapInfo,
    MapLayers,
    check_physical,
    describe_extent,
    footprint_margin,
)
from slopewise.services.io.no_data import NoData

_FORMATS = {".tif": geotiff, ".tiff": geotiff, ".gtiff": geotiff, ".npz": npz_map}


def _format_of(path: Path) -> ModuleType:
    """The module that reads a file: its `read_info` and `read_layers`."""
    if is_bag(path):
        return grid_map
    if path.suffix.lower() in _FORMATS:
        return _FORMATS[path.suffix.lower()]
    got = "a directory" if path.is_dir() else f"the name {path.name!r}"
    raise fault(path, "", f"expected a GeoTIFF (.tif), .npz or ROS 2 recording, got {got}")


def map_info(path: Path, topics: Path | None = None) -> MapInfo:
    """Grid of a map file; heights are read only of a recording."""
    info: MapInfo = _format_of(path).read_info(path, topics)
    with faults_of(path):
        check_physical(info.resolution, info.origin, (info.rows, info.columns))
    return info


def read_map(
    path: Path, *, around: Extent | None = None, topics: Path | None = None, nodata: NoData = None
) -> ElevationMap:
    """An elevation map, or the part of it that holds all heights within ``around``.

    ``around`` is (x_min, x_max, y_min, y_max) [m] with the margin that the caller needs, such as
    the vehicle's footprint; of a GeoTIFF only that part is read.
    """
    info = map_info(path, topics)
    cells = slice(0, info.rows), slice(0, info.columns)
    if around is not None:
        if (inside := info.cells_around(around)) is None:
            got = f"the map at {describe_extent(info.extent)}"
            raise fault(path, "extent", f"expected ground at {describe_extent(around)}, got {got}")
        cells = inside
    part = info.part(*cells)
    if part.rows * part.columns > MAX_CELLS:
        size = f"{part.rows} x {part.columns}"
        raise fault(path, "", f"expected at most {MAX_CELLS} cells in one part, got {size}")
    layers: MapLayers = _format_of(path).read_layers(path, *cells, topics, nodata)
    if not np.isfinite(layers.heights).any():
        where = "" if around is None else f" at {describe_extent(around)}"
        got = "; ".join(("unknown ones only", *layers.assumed))
        raise fault(path, "elevation", f"expected a known cell{where}, got {got}")
    with faults_of(path):
        return layers.on(part)


def read_map_around(
    path: Path,
    points: Floats,
    vehicle: Vehicle,
    *,
    reach: float = 0.0,
    topics: Path | None = None,
    nodata: NoData = None,
) -> ElevationMap:
    """The part of a map around points (n, 2), as far as the vehicle and a further reach [m]."""
    margin = footprint_margin(vehicle, map_info(path, topics)) + reach
    (x_min, y_min), (x_max, y_max) = points.min(axis=0) - margin, points.max(axis=0) + margin
    around = float(x_min), float(x_max), float(y_min), float(y_max)
    return read_map(path, around=around, topics=topics, nodata=nodata)


def write_map_npz(elevation_map: ElevationMap, path: Path) -> None:
    """Write a map so that reading it gives the same one; all or nothing."""
    arrays: dict[str, Any] = {
        "elevation": elevation_map.elevation,
        "resolution": np.float64(elevation_map.resolution),
        "origin": np.asarray(elevation_map.origin, np.float64),
        "height_std": np.float64(elevation_map.height_std),
        "height_std_is_assumed": np.bool_(elevation_map.height_std_is_assumed),
        "correlation_length": np.float64(elevation_map.correlation_length),
    }
    if elevation_map.terrain_class is not None:
        arrays["terrain_class"] = elevation_map.terrain_class
        arrays["terrain_names"] = np.asarray(elevation_map.class_names, np.str_)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    write_atomic(path, buffer.getvalue())


def frame_of(path: Path, topics: Path | None = None) -> str:
    """The frame that a recorded map is in; empty for other maps, and for one without a frame."""
    return grid_map.map_and_frame(path, topics)[1] if is_bag(path) else ""
