"""The arrays of an .npz map, each checked by its header before it is read."""

from __future__ import annotations

import math
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.services.io.access import check_file, fault, reason
from slopewise.services.io.decode import unknown
from slopewise.services.io.maps.grid import MAX_CELLS, MapInfo

_REQUIRED = ("elevation", "resolution", "origin")
_OPTIONAL = ("known", "terrain_class", "terrain_names", "height_std")
_BROKEN = (
    OSError,
    ValueError,
    KeyError,
    EOFError,
    RuntimeError,
    MemoryError,
    SyntaxError,
    zipfile.BadZipFile,
    zlib.error,
)


class Archive:
    """An open .npz map; use it in a `with` statement."""

    def __init__(self, path: Path) -> None:
        check_file(path)
        self._path = path
        try:
            self._zip = zipfile.ZipFile(path)
        except _BROKEN:
            raise fault(path, "", "expected an .npz file, got something else") from None
        self.names = {name.removesuffix(".npy") for name in self._zip.namelist()}

    def __enter__(self) -> Archive:
        for name in _REQUIRED:
            if name not in self.names:
                found = ", ".join(sorted(self.names)) or "no arrays"
                raise fault(self._path, name, f"missing array, expected it beside {found}")
        for name in sorted(self.names - {*_REQUIRED, *_OPTIONAL}):
            # A misspelt `known` must not make unknown ground known.
            if "did you mean" in (message := unknown(name, _REQUIRED + _OPTIONAL)):
                raise fault(self._path, name, message)
        return self

    def __exit__(self, *_: object) -> None:
        self._zip.close()

    def info(self) -> MapInfo:
        """The grid, out of two small arrays and the header of `elevation`."""
        shape, _ = self._header("elevation")
        if len(shape) != 2 or math.prod(shape) == 0:
            words = f"expected cells (rows, columns), got shape {shape}"
            raise fault(self._path, "elevation", words)
        resolution = self.array("resolution", None, "iuf", "a number [m]")
        if resolution.size != 1 or not (np.isfinite(resolution).all() and resolution.item() > 0):
            found = resolution.ravel().tolist()[:4]
            raise fault(self._path, "resolution", f"expected a cell edge > 0 [m], got {found}")
        origin = self.array("origin", None, "iuf", "two numbers [m]")
        if origin.shape != (2,) or not np.isfinite(origin).all():
            found = origin.ravel().tolist()[:4]
            raise fault(self._path, "origin", f"expected two finite numbers x, y [m], got {found}")
        x, y = origin.tolist()
        return MapInfo(shape[0], shape[1], float(resolution.item()), (float(x), float(y)))

    def array(
        self, name: str, shape: tuple[int, ...] | None, kinds: str, words: str
    ) -> NDArray[Any]:
        """An array whose shape and kind of type are as wanted; never a pickled one.

        Args:
            name: of the array.
            shape: wanted; None if any will do.
            kinds: numpy's letters of the types that will do.
            words: the same for people.
        """
        found, dtype = self._header(name)
        if dtype.kind not in kinds:
            raise fault(self._path, name, f"expected {words}, got an array of {dtype}")
        if shape is not None and found != shape:
            raise fault(self._path, name, f"expected shape {shape} of elevation, got {found}")
        if math.prod(found) > MAX_CELLS:
            raise fault(self._path, name, f"expected at most {MAX_CELLS} cells, got shape {found}")
        try:
            with self._zip.open(f"{name}.npy") as file:
                array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
        except _BROKEN as error:
            raise self._broken(name, error) from None
        return array

    def _header(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
        try:
            with self._zip.open(f"{name}.npy") as file:
                first = np.lib.format.read_magic(file) == (1, 0)
                npy = np.lib.format
                read = npy.read_array_header_1_0 if first else npy.read_array_header_2_0
                shape, _, dtype = read(file)
        except _BROKEN as error:
            raise self._broken(name, error) from None
        return shape, dtype

    def _broken(self, name: str, error: BaseException) -> Exception:
        return fault(self._path, name, f"expected an intact array, got: {reason(error)[:120]}")
