"""Elevation maps as .npz: `elevation`, `resolution`, `origin`, and what is optional.

Optional are `known`, `terrain_class` and `height_std`: how far heights are off against each other
[m], a number, or one a cell of which that of most cells counts.

`terrain_class` holds whole numbers (0 is the base surface) or names of surfaces; with numbers, an
optional `terrain_names` names them. Other arrays are left alone.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.surface_names import MAX_CLASSES, number_names
from slopewise.services.io.access import fault
from slopewise.services.io.maps import height_error
from slopewise.services.io.maps.grid import MapInfo
from slopewise.services.io.maps.npz_archive import Archive


def read_info(path: Path) -> MapInfo:
    """Grid of a map; reads two small arrays and the header of `elevation`."""
    with Archive(path) as archive:
        return archive.info()


def read_layers(path: Path) -> tuple[Floats, Ints | None, tuple[str, ...], float | None]:
    """(rows, columns) heights [m] with NaN where unknown, classes, their names, error of heights.

    The error [m] is that of heights against each other, None if the file does not tell it.
    """
    with Archive(path) as archive:
        info = archive.info()
        shape = (info.rows, info.columns)
        heights = archive.array("elevation", shape, "iuf", "numbers [m]").astype(np.float64)
        if "known" in archive.names:
            known = archive.array("known", shape, "biu", "true or false")
            if known.dtype.kind != "b" and not np.isin(known, (0, 1)).all():
                raise fault(path, "known", "expected true or false, got other whole numbers")
            heights[known == 0] = np.nan
        std = _height_std(archive, path, np.isfinite(heights))
        if "terrain_class" not in archive.names:
            return heights, None, ("",), std
        classes = archive.array("terrain_class", shape, "iuUS", "whole numbers or names")
        if classes.dtype.kind in "US":
            return heights, *_classes_of_names(path, classes), std
        names = None
        if "terrain_names" in archive.names:
            given = archive.array("terrain_names", None, "US", "names, one for each class")
            names = _checked_names(path, "terrain_names", _text(path, "terrain_names", given))
        return heights, *_numbered(path, classes, names), std


def _height_std(archive: Archive, path: Path, known: Bools) -> float | None:
    if "height_std" not in archive.names:
        return None
    told = archive.array("height_std", None, "iuf", "a length or one a cell [m]").astype(np.float64)
    if told.shape not in ((), (1,), known.shape):
        words = f"expected a number or shape {known.shape} of elevation, got {told.shape}"
        raise fault(path, "height_std", words)
    counted = told[known] if told.shape == known.shape else told
    if not np.all(counted >= 0.0) or np.isinf(counted).any():
        raise fault(path, "height_std", "expected lengths >= 0 [m], got others")
    return height_error.one_for_all(counted)


def _numbered(
    path: Path, classes: NDArray[Any], names: tuple[str, ...] | None
) -> tuple[Ints, tuple[str, ...]]:
    highest = (len(names) if names else MAX_CLASSES) - 1
    if bad := _first(wrong := (classes < 0) | (classes > highest)):
        words = f"expected 0 … {highest}, got {classes[wrong].flat[0]}"
        raise fault(path, f"terrain_class{bad}", words)
    if names is None:
        names = number_names(int(classes.max()))
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
