"""Relief of an elevation map for pages: a shaded picture, its contours and outlines of surfaces."""

from __future__ import annotations

import base64
import io
import math
from typing import Any

import numpy as np
from contourpy import LineType, contour_generator
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from PIL import Image

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.services.scene.shading import shade

MAX_CELLS = 900
"""Longest edge of the picture in cells; larger maps are averaged."""

_CONTOURS = 14
"""Contours between the lowest and the highest ground, about."""
_TENTHS = 10.0
"""A path has integer coordinates in tenths of a cell."""


def relief(elevation_map: ElevationMap, max_cells: int = MAX_CELLS) -> tuple[str, dict[str, Any]]:
    """Picture of the map as data URI of a PNG, north on top; and where it and its lines lie.

    The bounds of the picture and the origin of the lines are relative to the centre of cell
    [0, 0] [m].
    """
    heights, factor = coarsen(elevation_map.elevation, max_cells)
    cell = elevation_map.resolution * factor
    rows, columns = heights.shape
    # Centre of the first block, from the centre of the first cell.
    first = 0.5 * (cell - elevation_map.resolution)
    low = first - 0.5 * cell
    step = contour_interval(heights)
    even = smoothed(heights)
    lines = ((float(at), contour_path(even, float(at))) for at in contour_levels(even, step))
    return png_uri(shade(heights, cell)), {
        "origin": list(elevation_map.origin),
        "bounds": [low, low + columns * cell, low, low + rows * cell],
        "first": first,
        "cell": cell,
        "interval": step,
        "contours": [
            {"strong": round(level / step) % 5 == 0, "path": path} for level, path in lines if path
        ],
        "surfaces": _surface_outlines(elevation_map, factor),
    }


def _surface_outlines(elevation_map: ElevationMap, factor: int) -> list[dict[str, str]]:
    classes = elevation_map.terrain_class
    if classes is None:
        return []
    classes = classes[::factor, ::factor]
    outlines = (
        (name, outline_path(classes == index))
        for index, name in enumerate(elevation_map.class_names)
        if index > 0
    )
    return [{"name": name, "path": path} for name, path in outlines if path]


def png_uri(pixels: NDArray[np.uint8]) -> str:
    """Data URI of a PNG. pixels: (rows, cols, 2) grey and alpha, row 0 on top."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", compress_level=6)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def coarsen(elevation: Floats, max_cells: int) -> tuple[Floats, int]:
    """Average over square blocks of cells, so that no edge has more than ``max_cells``.

    Returns heights, NaN where more than half a block is unknown, and the cells along the edge of a
    block. Blocks begin at row and column 0; the last ones may be cut by the edge of the map.
    """
    factor = -(-max(elevation.shape) // max_cells)
    if factor <= 1:
        return elevation, 1
    rows, columns = (np.arange(0, count, factor) for count in elevation.shape)
    known = np.isfinite(elevation)
    total, count, cells = (
        np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)
        for values in (np.where(known, elevation, 0.0), known * 1.0, np.ones_like(elevation))
    )
    mostly_known = (2.0 * count >= cells) & (count > 0.0)
    return np.divide(total, count, out=np.full(count.shape, np.nan), where=mostly_known), factor


def contour_interval(elevation: Floats) -> float:
    """Height between about a dozen contours: 1, 2 or 5 times a power of ten [m]."""
    known = elevation[np.isfinite(elevation)]
    if known.size == 0:
        return 1.0
    low, high = np.percentile(known, (1.0, 99.0))
    rough = max(float(high - low) / _CONTOURS, 0.01)
    power = 10.0 ** math.floor(math.log10(rough))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= rough * 0.999)


def contour_levels(elevation: Floats, step: float) -> Floats:
    """Multiples of the interval between the lowest and the highest known height [m]."""
    known = elevation[np.isfinite(elevation)]
    if known.size == 0:
        return np.empty(0)
    first, last = math.ceil(known.min() / step), math.floor(known.max() / step)
    if last - first > 20 * _CONTOURS:  # spikes in the data
        return np.empty(0)
    return step * np.arange(first, last + 1)


def smoothed(elevation: Floats) -> Floats:
    """Means over 3 x 3 cells, which smooth contours; unknown stays unknown."""
    known = np.isfinite(elevation)
    heights, weight = (np.pad(a, 1) for a in (np.where(known, elevation, 0.0), known.astype(float)))
    total, count = (sliding_window_view(a, (3, 3)).sum(axis=(2, 3)) for a in (heights, weight))
    mean: Floats = np.divide(total, count, out=np.full(known.shape, np.nan), where=known)
    return mean


def contour_path(elevation: Floats, level: float, shift: float = 0.0) -> str:
    """SVG path data of the contour at a height, in tenths of a cell, x and y as columns and rows.

    Lines end where the elevation is not finite; `shift`: cells added to columns and rows.
    """
    known = np.ma.masked_invalid(elevation)
    contours = contour_generator(z=known, corner_mask=False, line_type=LineType.Separate)
    parts = []
    for line in contours.lines(level):
        points = np.rint(_TENTHS * (np.asarray(line) + shift)).astype(np.int64)
        steps = np.diff(points, axis=0)
        steps = steps[steps.any(axis=1)]
        if len(steps):
            moves = " ".join(f"{a} {b}" for a, b in steps)
            parts.append(f"M{points[0, 0]} {points[0, 1]}l{moves}")
    return "".join(parts)


def outline_path(mask: NDArray[np.bool_]) -> str:
    """Edge of a region of cells as closed SVG paths, like :func:`contour_path`."""
    return contour_path(np.pad(mask.astype(np.float64), 1), 0.5, shift=-1.0)
