"""Elevation maps as .npz: `elevation`, `resolution`, `origin`, and optional arrays.

Optional are `known`, `terrain_class` and `height_std`: the error of heights relative to each other
[m], a number, or one per cell of which that of most cells is used.

`terrain_class` holds whole numbers (0 is the base surface) or names of surfaces; with numbers, an
optional `terrain_names` names them. Other arrays are ignored. Each array is checked by its header
before it is read.
"""

from __future__ import annotations

import contextlib
import math
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Bools, Ints
from slopewise.models.surface_names import MAX_CLASSES, number_names
from slopewise.services.io import height_error, no_data
from slopewise.services.io.decode import unknown
from slopewise.services.io.files import check_file, fault, reason
from slopewise.services.io.map_grid import MAX_CELLS, MapInfo, MapLayers
from slopewise.services.io.no_data import NoData

_REQUIRED = ("elevation", "resolution", "origin")
_OPTIONAL = (
    "known",
    "terrain_class",
    "terrain_names",
    "height_std",
    "height_std_is_assumed",
    "correlation_length",
)


def read_info(path: Path, _: Path | None = None) -> MapInfo:
    """Grid of a map; reads two small arrays and the header of `elevation`."""
    with _Archive(path) as archive:
        return archive.info()


def read_layers(
    path: Path, rows: slice, columns: slice, _: Path | None, nodata: NoData
) -> MapLayers:
    """Some cells of a map; markers of missing data are detected in the whole of it."""
    raw = read_raw(path)
    heights, markers = no_data.known_heights(raw.heights, nodata)
    classes = raw.classes
    part = None if classes is None else classes[rows, columns]
    return raw._replace(
        heights=heights[rows, columns], assumed=no_data.describe(markers), classes=part
    )


def read_raw(path: Path) -> MapLayers:
    """All cells of a map, with NaN where ``known`` is false."""
    with _Archive(path) as archive:
        info = archive.info()
        shape = (info.rows, info.columns)
        heights = archive.array("elevation", shape, "iuf", "numbers [m]").astype(np.float64)
        if "known" in archive.names:
            known = archive.array("known", shape, "biu", "true or false")
            if known.dtype.kind != "b" and not np.isin(known, (0, 1)).all():
                raise fault(path, "known", "expected true or false, got other whole numbers")
            heights[known == 0] = np.nan
        std = _height_std(archive, path, np.isfinite(heights))
        assumed = archive.flag("height_std_is_assumed") or std is None
        std = height_error.assumed(info.resolution) if std is None else std
        classes, names = _classes(archive, path, shape)
        length = archive.length("correlation_length")
        return MapLayers(heights, std, (), classes, names, assumed, length)


def _height_std(archive: _Archive, path: Path, known: Bools) -> float | None:
    if "height_std" not in archive.names:
        return None
    std = archive.array("height_std", None, "iuf", "a length or one a cell [m]").astype(np.float64)
    if std.shape not in ((), (1,), known.shape):
        expected = f"expected a number or shape {known.shape} of elevation, got {std.shape}"
        raise fault(path, "height_std", expected)
    used = std[known] if std.shape == known.shape else std
    if not np.all(used >= 0.0) or np.isinf(used).any():
        raise fault(path, "height_std", "expected lengths >= 0 [m], got others")
    return height_error.one_for_all(used)


def _classes(
    archive: _Archive, path: Path, shape: tuple[int, int]
) -> tuple[Ints | None, tuple[str, ...]]:
    if "terrain_class" not in archive.names:
        return None, ("",)
    classes = archive.array("terrain_class", shape, "iuUS", "whole numbers or names")
    if classes.dtype.kind in "US":
        return _classes_of_names(path, classes)
    names = None
    if "terrain_names" in archive.names:
        given = archive.array("terrain_names", None, "US", "names, one for each class")
        names = _checked_names(path, "terrain_names", _text(path, "terrain_names", given))
    highest = (len(names) if names else MAX_CLASSES) - 1
    if (wrong := (classes < 0) | (classes > highest)).any():
        cell = [int(i) for i in np.argwhere(wrong)[0]]
        expected = f"expected 0 … {highest}, got {classes[wrong].flat[0]}"
        raise fault(path, f"terrain_class{cell}", expected)
    return classes.astype(np.int64), names or number_names(int(classes.max()))


def _classes_of_names(path: Path, cells: NDArray[Any]) -> tuple[Ints, tuple[str, ...]]:
    unique, index = np.unique(cells, return_inverse=True)
    given = _checked_names(path, "terrain_class", _text(path, "terrain_class", unique), reserved=1)
    names = ("", *(name for name in given if name))
    position = np.array([names.index(name) for name in given], np.int64)
    return position[index.reshape(cells.shape)], names


def _checked_names(
    path: Path, field: str, names: tuple[str, ...], reserved: int = 0
) -> tuple[str, ...]:
    if not 1 <= len(names) <= MAX_CLASSES - reserved:
        expected = f"expected 1 … {MAX_CLASSES - reserved} names, got {len(names)}"
        raise fault(path, field, expected)
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


@contextlib.contextmanager
def _intact(path: Path, field: str, noun: str) -> Iterator[None]:
    """Report damaged bytes in one line."""
    try:
        yield
    except Exception as error:  # noqa: BLE001  of zipfile, zlib or numpy's reader of headers
        got = reason(error)[:120] if field else "something else"
        raise fault(path, field, f"expected {noun}, got{':' * bool(field)} {got}") from None


class _Archive:
    """An open .npz map; use it in a `with` statement."""

    def __init__(self, path: Path) -> None:
        check_file(path)
        self._path = path
        with _intact(path, "", "an .npz file"):
            self._zip = zipfile.ZipFile(path)
        self.names = {name.removesuffix(".npy") for name in self._zip.namelist()}

    def __enter__(self) -> _Archive:
        for name in _REQUIRED:
            if name not in self.names:
                there = ", ".join(sorted(self.names)) or "no arrays"
                raise fault(self._path, name, f"missing array, expected it besides {there}")
        for name in sorted(self.names - {*_REQUIRED, *_OPTIONAL}):
            # A misspelt `known` must not make unknown ground known.
            if "did you mean" in (message := unknown(name, _REQUIRED + _OPTIONAL)):
                raise fault(self._path, name, message)
        return self

    def __exit__(self, *_: object) -> None:
        self._zip.close()

    def flag(self, name: str) -> bool:
        """One true or false, false where it is missing."""
        if name not in self.names:
            return False
        value = self.array(name, None, "b", "true or false")
        if value.size != 1:
            raise fault(self._path, name, f"expected true or false, got shape {value.shape}")
        return bool(value.item())

    def length(self, name: str) -> float:
        """One length [m], 0 where it is missing."""
        if name not in self.names:
            return 0.0
        value = self.array(name, None, "iuf", "a length [m]").astype(np.float64)
        if value.size != 1 or not (np.isfinite(value).all() and value.item() >= 0.0):
            raise fault(self._path, name, f"expected a length >= 0 [m], got {value.ravel()[:4]}")
        return float(value.item())

    def info(self) -> MapInfo:
        """The grid, from two small arrays and the header of `elevation`."""
        shape, _ = self._header("elevation")
        if len(shape) != 2 or math.prod(shape) == 0:
            expected = f"expected cells (rows, columns), got shape {shape}"
            raise fault(self._path, "elevation", expected)
        resolution = self.array("resolution", None, "iuf", "a number [m]")
        if resolution.size != 1 or not (np.isfinite(resolution).all() and resolution.item() > 0):
            got = resolution.ravel().tolist()[:4]
            raise fault(self._path, "resolution", f"expected a cell edge > 0 [m], got {got}")
        origin = self.array("origin", None, "iuf", "two numbers [m]")
        if origin.shape != (2,) or not np.isfinite(origin).all():
            got = origin.ravel().tolist()[:4]
            raise fault(self._path, "origin", f"expected two finite numbers x, y [m], got {got}")
        x, y = origin.tolist()
        return MapInfo(shape[0], shape[1], float(resolution.item()), (float(x), float(y)))

    def array(
        self, name: str, shape: tuple[int, ...] | None, kinds: str, noun: str
    ) -> NDArray[Any]:
        """An array of a kind of type and shape, if one is required; never a pickled one."""
        given, dtype = self._header(name)
        if dtype.kind not in kinds:
            raise fault(self._path, name, f"expected {noun}, got an array of {dtype}")
        if shape is not None and given != shape:
            raise fault(self._path, name, f"expected shape {shape} of elevation, got {given}")
        if math.prod(given) > MAX_CELLS:
            raise fault(self._path, name, f"expected at most {MAX_CELLS} cells, got shape {given}")
        with _intact(self._path, name, "an intact array"), self._zip.open(f"{name}.npy") as file:
            array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
        return array

    def _header(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
        npy = np.lib.format
        with _intact(self._path, name, "an intact array"), self._zip.open(f"{name}.npy") as file:
            first = npy.read_magic(file) == (1, 0)
            read = npy.read_array_header_1_0 if first else npy.read_array_header_2_0
            shape, _, dtype = read(file)
        return shape, dtype
