"""`grid_map_msgs/GridMap` to an elevation map.

A layer is a matrix whose rows run towards -x and whose columns run towards -y, from the corner of
highest x and y, written column by column. It is a circular buffer: the first row is that of
``outer_start_index``, the first column that of ``inner_start_index``. Layers of a variance or of
bounds tell how far the heights are off (:mod:`slopewise.services.io.maps.height_error`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.services.io.maps import height_error, no_data
from slopewise.services.io.maps.no_data import NoData

HEIGHTS = ("elevation", "height")
"""Layers that are taken for heights where nobody names one, in this order."""

_MOST_CELLS = 100_000_000
_TILT = 1e-6


def elevation_map_of(message: Any, layer: str = "", nodata: NoData = None) -> ElevationMap:
    """The heights of a grid map; NaN where any of its basic layers has none.

    Args:
        message: with the fields of a GridMap.
        layer: of the heights [m]; empty: the first of :data:`HEIGHTS` that is there.
        nodata: what the user says of markers of missing data.

    Raises:
        ParameterError: names the field of the message and what was expected.
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
    rows, columns = _size(info)
    wanted = [_height_layer(layers, layer), *message.basic_layers]
    matrices = [_layer(message, layers, name, rows, columns) for name in wanted]
    heights, markers = no_data.known_heights(matrices[0], nodata)
    for basic in matrices[1:]:
        heights[~np.isfinite(basic)] = np.nan
    position = info.pose.position
    x = position.x - 0.5 * info.length_x + 0.5 * info.resolution
    y = position.y - 0.5 * info.length_y + 0.5 * info.resolution
    edge = float(info.resolution)
    std = height_error.of_layers(
        layers, lambda name: _layer(message, layers, name, rows, columns), heights, edge
    )
    # From (towards -x, towards -y) to rows of constant y that grow with x and y.
    return ElevationMap(
        elevation=heights[::-1, ::-1].T,
        resolution=edge,
        origin=(x, y),
        height_std=height_error.assumed(edge) if std is None else std,
        assumed=no_data.describe(markers),
    )


def _check_pose(pose: Any) -> None:
    position, q = pose.position, pose.orientation
    if not np.isfinite([position.x, position.y]).all():
        raise ParameterError("info.pose.position", "finite coordinates [m]")
    # An orientation that nobody filled in is (0, 0, 0, 0).
    if not (abs(q.x) < _TILT and abs(q.y) < _TILT and abs(q.z) < _TILT):
        words = f"a grid along the axes of its frame, got a turned one ({q.x}, {q.y}, {q.z}, {q.w})"
        raise ParameterError("info.pose.orientation", words)


def _size(info: Any) -> tuple[int, int]:
    rows, columns = (round(length / info.resolution) for length in (info.length_x, info.length_y))
    for name, count, length in (("x", rows, info.length_x), ("y", columns, info.length_y)):
        if abs(count * info.resolution - length) > 0.01 * info.resolution:
            words = f"whole cells of {info.resolution:g} m, got {length:g} m"
            raise ParameterError(f"info.length_{name}", words)
    if not 4 <= rows * columns <= _MOST_CELLS:
        words = f"4 … {_MOST_CELLS} cells, got {rows} x {columns}"
        raise ParameterError("info.length_x", words)
    return rows, columns


def _height_layer(layers: Sequence[str], layer: str) -> str:
    found = [name for name in ((layer,) if layer else HEIGHTS) if name in layers]
    if not found:
        words = f"one called {layer or ' or '.join(HEIGHTS)}, got {', '.join(layers) or 'none'}"
        raise ParameterError("layers", words)
    return found[0]


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
        found = f"{sizes['row_index']} x {sizes['column_index']}"
        raise ParameterError(f"{field}.layout.dim", f"{rows} x {columns} cells, got {found}")
    by_column = dims[0].label == "column_index"
    matrix = data.reshape((columns, rows)).T if by_column else data.reshape((rows, columns))
    starts = message.outer_start_index, message.inner_start_index
    for index, start, count in (("outer", starts[0], rows), ("inner", starts[1], columns)):
        if not 0 <= start < count:
            raise ParameterError(f"{index}_start_index", f"0 … {count - 1}, got {start}")
    unwrapped: Floats = np.roll(matrix, (-starts[0], -starts[1]), axis=(0, 1))
    return unwrapped
