"""Elevation maps from `grid_map_msgs/GridMap`, live or recorded.

A layer is a matrix whose rows run towards -x and whose columns run towards -y, from the corner of
highest x and y, written column by column. It is a circular buffer: the first row is that of
``outer_start_index``, the first column that of ``inner_start_index``. Layers of a variance or of
bounds report the error of the heights (:mod:`slopewise.services.io.height_error`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.services.io import height_error, no_data
from slopewise.services.io.bags import GRID_MAP, Bag, opened, state_of
from slopewise.services.io.files import fault, faults_of
from slopewise.services.io.map_grid import MAX_CELLS, MapInfo, MapLayers
from slopewise.services.io.no_data import NoData
from slopewise.services.io.topics import MapSource, read_sources

HEIGHTS = ("elevation", "height")
"""Layers that are taken for heights where the mapping names no layer, in this order."""

_MIN_CELLS = 4  # 2 x 2 cells, the fewest with ground between them
_MAX_TILT = 1e-6  # Largest x, y or z of an orientation that is still rounding [1]


def read_info(path: Path, topics: Path | None) -> MapInfo:
    """Grid of a recorded map; its heights are decoded as well."""
    ground = map_and_frame(path, topics)[0]
    rows, columns = ground.elevation.shape
    return MapInfo(rows, columns, ground.resolution, ground.origin)


def read_layers(
    path: Path, rows: slice, columns: slice, topics: Path | None, nodata: NoData
) -> MapLayers:
    """Some cells of a recorded map."""
    ground = map_and_frame(path, topics, nodata)[0]
    return MapLayers(
        ground.elevation[rows, columns],
        ground.height_std,
        ground.assumed,
        std_is_assumed=ground.height_std_is_assumed,
    )


def map_and_frame(
    path: Path, topics: Path | None, nodata: NoData = None
) -> tuple[ElevationMap, str]:
    """The last map of a recording, or the one that a mapping names, and the frame that it is in.

    It is decoded once as long as the recording is the same. Without a mapping, the only topic of
    grid maps is taken.
    """
    source, _ = read_sources(topics)
    return _decoded(path, source, nodata, state_of(path))


@lru_cache(maxsize=2)
def _decoded(
    path: Path, source: MapSource, nodata: NoData, state: object
) -> tuple[ElevationMap, str]:
    with opened(path) as bag:
        topic = source.topic or _only_topic(bag)
        recorded = bag.messages_of([topic], GRID_MAP, last=source.message == -1)
    try:
        message = recorded[source.message][1]
    except IndexError:
        expected = f"expected message {source.message} of {len(recorded)}"
        raise fault(path, f"topic {topic}", expected) from None
    with faults_of(path, f"topic {topic}, "):
        ground = elevation_map_of(message, source.layer, nodata)
    return ground, message.header.frame_id


def _only_topic(bag: Bag) -> str:
    topics = bag.topics_of(GRID_MAP)
    if len(topics) > 1:
        names = ", ".join(topics)
        expected = f"expected one topic of grid maps, or --topics that names one: {names}"
        raise fault(bag.path, "topics", expected)
    return topics[0]


def elevation_map_of(message: Any, layer: str = "", nodata: NoData = None) -> ElevationMap:
    """The heights of a grid map; NaN where any of its basic layers has none.

    Without ``layer`` they are those of the first of :data:`HEIGHTS` in the message.
    """
    info = message.info
    for name in ("resolution", "length_x", "length_y"):
        value = getattr(info, name)
        if not (np.isfinite(value) and value > 0.0):
            raise ParameterError(f"info.{name}", f"a length > 0 [m], got {value}")
    _check_pose(info.pose)
    layers = list(message.layers)
    if len(message.data) != len(layers):
        raise ParameterError("data", f"{len(layers)} layers as named, got {len(message.data)}")
    shape = _size(info)
    names = [_height_layer(layers, layer), *message.basic_layers]
    matrices = [_layer(message, layers, name, *shape) for name in names]
    heights, markers = no_data.known_heights(matrices[0], nodata)
    for basic in matrices[1:]:
        heights[~np.isfinite(basic)] = np.nan
    position = info.pose.position
    x = position.x - 0.5 * info.length_x + 0.5 * info.resolution
    y = position.y - 0.5 * info.length_y + 0.5 * info.resolution
    edge = float(info.resolution)
    std = height_error.of_layers(
        layers, lambda name: _layer(message, layers, name, *shape), heights, edge
    )
    # From (towards -x, towards -y) to rows of constant y that grow with x and y.
    return ElevationMap(
        elevation=heights[::-1, ::-1].T,
        resolution=edge,
        origin=(x, y),
        height_std=height_error.assumed(edge) if std is None else std,
        height_std_is_assumed=std is None,
        assumed=no_data.describe(markers),
    )


def _check_pose(pose: Any) -> None:
    position, q = pose.position, pose.orientation
    if not np.isfinite([position.x, position.y]).all():
        raise ParameterError("info.pose.position", "finite coordinates [m]")
    # An orientation that was never filled in is (0, 0, 0, 0).
    if not (abs(q.x) < _MAX_TILT and abs(q.y) < _MAX_TILT and abs(q.z) < _MAX_TILT):
        got = f"a turned one ({q.x}, {q.y}, {q.z}, {q.w})"
        raise ParameterError(
            "info.pose.orientation", f"a grid along the axes of its frame, got {got}"
        )


def _size(info: Any) -> tuple[int, int]:
    rows, columns = (round(length / info.resolution) for length in (info.length_x, info.length_y))
    for name, count, length in (("x", rows, info.length_x), ("y", columns, info.length_y)):
        if abs(count * info.resolution - length) > 0.01 * info.resolution:
            expected = f"whole cells of {info.resolution:g} m, got {length:g} m"
            raise ParameterError(f"info.length_{name}", expected)
    if not _MIN_CELLS <= rows * columns <= MAX_CELLS:
        expected = f"{_MIN_CELLS} … {MAX_CELLS} cells, got {rows} x {columns}"
        raise ParameterError("info.length_x", expected)
    return rows, columns


def _height_layer(layers: Sequence[str], layer: str) -> str:
    present = [name for name in ((layer,) if layer else HEIGHTS) if name in layers]
    if not present:
        got = ", ".join(layers) or "none"
        raise ParameterError("layers", f"one called {layer or ' or '.join(HEIGHTS)}, got {got}")
    return present[0]


def _layer(message: Any, layers: list[str], name: str, rows: int, columns: int) -> Floats:
    """(rows, columns) of a layer, unwrapped: row 0 at the highest x, column 0 at the highest y."""
    if name not in layers:
        raise ParameterError("basic_layers", f"names among the layers, got {name}")
    field = f"data[{layers.index(name)}]"
    array = message.data[layers.index(name)]
    data = np.asarray(array.data)
    dims = array.layout.dim
    if data.shape != (rows * columns,) or array.layout.data_offset != 0:
        raise ParameterError(field, f"{rows} x {columns} cells, got {data.size}")
    if len(dims) != 2 or {dim.label for dim in dims} != {"column_index", "row_index"}:
        labels = ", ".join(dim.label for dim in dims) or "none"
        raise ParameterError(f"{field}.layout.dim", f"column_index and row_index, got {labels}")
    sizes = {dim.label: dim.size for dim in dims}
    if sizes != {"row_index": rows, "column_index": columns}:
        got = f"{sizes['row_index']} x {sizes['column_index']}"
        raise ParameterError(f"{field}.layout.dim", f"{rows} x {columns} cells, got {got}")
    by_column = dims[0].label == "column_index"
    matrix = data.reshape((columns, rows)).T if by_column else data.reshape((rows, columns))
    starts = message.outer_start_index, message.inner_start_index
    for index, start, count in (("outer", starts[0], rows), ("inner", starts[1], columns)):
        if not 0 <= start < count:
            raise ParameterError(f"{index}_start_index", f"0 … {count - 1}, got {start}")
    unwrapped: Floats = np.roll(matrix, (-starts[0], -starts[1]), axis=(0, 1))
    return unwrapped
