"""Elevation maps as .npz: `elevation`, `resolution`, `origin`, optional `known`, `terrain_class`.

`terrain_class` holds whole numbers (0 is the base surface) or names of surfaces; with numbers, an
optional `terrain_names` names them. Other arrays are left alone.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import Bools, Floats, Ints
from planner.ground.elevation_map import ElevationMap
from planner.ground.surface_bits import MAX_CLASSES
from services.io.access import fault, write_atomic
from services.io.maps.grid import MapInfo
from services.io.maps.npz_archive import Archive


def read_info(path: Path) -> MapInfo:
    """Grid of a map; reads two small arrays and the header of `elevation`."""
    with Archive(path) as archive:
        return archive.info()


def read_layers(path: Path) -> tuple[Floats, Ints | None, tuple[str, ...]]:
    """(rows, columns) heights [m] with NaN where unknown, classes and their names."""
    with Archive(path) as archive:
        info = archive.info()
        shape = (info.rows, info.columns)
        heights = archive.array("elevation", shape, "iuf", "numbers [m]").astype(np.float64)
        if "known" in archive.names:
            known = archive.array("known", shape, "biu", "true or false")
            if known.dtype.kind != "b" and not np.isin(known, (0, 1)).all():
                raise fault(path, "known", "expected true or false, got other whole numbers")
            heights[known == 0] = np.nan
        if "terrain_class" not in archive.names:
            return heights, None, ("",)
        classes = archive.array("terrain_class", shape, "iuUS", "whole numbers or names")
        if classes.dtype.kind in "US":
            return heights, *_classes_of_names(path, classes)
        names = None
        if "terrain_names" in archive.names:
            given = archive.array("terrain_names", None, "US", "names, one for each class")
            names = _checked_names(path, "terrain_names", _text(path, "terrain_names", given))
        return heights, *_numbered(path, classes, names)


def write_map_npz(elevation_map: ElevationMap, path: Path) -> None:
    """Write a map so that reading it gives the same one; all or nothing."""
    arrays: dict[str, Any] = {
        "elevation": elevation_map.elevation,
        "resolution": np.float64(elevation_map.resolution),
        "origin": np.asarray(elevation_map.origin, np.float64),
    }
    if elevation_map.terrain_class is not None:
        arrays["terrain_class"] = elevation_map.terrain_class
        arrays["terrain_names"] = np.asarray(elevation_map.class_names, np.str_)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    write_atomic(path, buffer.getvalue())


def _numbered(
    path: Path, classes: NDArray[Any], names: tuple[str, ...] | None
) -> tuple[Ints, tuple[str, ...]]:
    highest = (len(names) if names else MAX_CLASSES) - 1
    if bad := _first(wrong := (classes < 0) | (classes > highest)):
        words = f"expected 0 … {highest}, got {classes[wrong].flat[0]}"
        raise fault(path, f"terrain_class{bad}", words)
    if names is None:
        names = ("", *(f"#{number}" for number in range(1, int(classes.max()) + 1)))
    return classes.astype(np.int64), names


def _classes_of_names(path: Path, cells: NDArray[Any]) -> tuple[Ints, tuple[str, ...]]:
    unique, index = np.unique(cells, return_inverse=True)
    found = _checked_names(path, "terrain_class", _text(path, "terrain_class", unique), reserved=1)
    names = ("", *(name for name in found if name))
    position = np.array([names.index(name) for name in found], np.int64)
    return position[index.reshape(cells.shape)], names


def _checked_names(
    path: Path, field: str, names: tuple[str, ...], reserved: int = 0
) -> tuple[str, ...]:
    if not 1 <= len(names) <= MAX_CLASSES - reserved:
        words = f"expected 1 … {MAX_CLASSES - reserved} names, got {len(names)}"
        raise fault(path, field, words)
    for name in names:
        if name.startswith("#") and not (name[1:].isascii() and name[1:].isdigit()):
            raise fault(path, field, f"expected # only before a number, got {name!r}")
    return names


def _text(path: Path, field: str, names: NDArray[Any]) -> tuple[str, ...]:
    if names.dtype.kind == "U":
        return tuple(str(name) for name in names.ravel())
    try:
        return tuple(name.decode() for name in names.ravel())
    except UnicodeDecodeError:
        raise fault(path, field, "expected UTF-8 names, got other bytes") from None


def _first(wrong: Bools) -> list[int] | None:
    """Index of the first true cell, None if there is none."""
    return [int(i) for i in np.argwhere(wrong)[0]] if wrong.any() else None
