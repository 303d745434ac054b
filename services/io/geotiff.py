"""Elevation from a GeoTIFF: metres on a square north-up grid. Nodata stays unknown.

Heights are those of the first band that is described as such, of band 1 if none is. Without a
coordinate system the grid is taken to be in metres, as robots' own maps are. Degrees, feet,
rotated or oblong cells are refused, and projections whose metres are not metres on the ground
there (:mod:`slopewise.services.io.map_projection`): slopes from them would be wrong.

A further band whose description speaks of a variance [m²], or of a standard deviation, an error or
an uncertainty [m], reports the error of the heights.
"""

from __future__ import annotations

import contextlib
import logging
import re
import warnings
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.services.io import height_error, map_projection, no_data
from slopewise.services.io.files import check_file, fault
from slopewise.services.io.map_grid import MapInfo, MapLayers
from slopewise.services.io.no_data import NoData

_SQUARE = 1e-6  # relative difference of edges, and share of shear, that is still rounding
_ERRORS = re.compile(r"variance|std|stdev|sigma|standard.deviation|error|uncertainty|rmse")
_HEIGHTS = re.compile(r"elev|height|altitude|\b(dem|dtm|dsm|dhm)\b")
_NO_HEIGHTS = re.compile(r"slope|aspect|shade|rough|curvature|intensity|density|count|mask|class")
_THINNED = 1024  # rows and columns of a band of errors that are read
_SPOTS, _SPOT = 8, 256
"""Spots in a row and in a column, and cells along the edge of each, that stand for all heights of a
file: maps of up to 2048 x 2048 cells are read whole, larger ones in about half a second."""


def read_info(path: Path, _: Path | None = None) -> MapInfo:
    """Grid of a GeoTIFF; raises InputError if it cannot be an elevation map in metres."""
    with opened(path) as ground:
        return ground.info


def read_layers(
    path: Path, rows: slice, columns: slice, _: Path | None, nodata: NoData
) -> MapLayers:
    """Some cells of a GeoTIFF; only these are read."""
    with opened(path, nodata) as ground:
        heights, assumed = ground.read(rows, columns), ground.stated_std is None
        return MapLayers(heights, ground.height_std, ground.assumed, std_is_assumed=assumed)


class GeotiffWindows:
    """An open elevation map that is read by windows."""

    def __init__(self, dataset: Any, path: Path, nodata: NoData = None) -> None:
        """Raise InputError if it cannot be an elevation map in metres."""
        self._dataset = dataset
        self._path = path
        self._nodata = nodata
        self.markers: set[float] = set()  # undeclared ones among the heights read so far
        self._band = _height_band(dataset, path)
        self.info = _checked(dataset, path, self._band - 1)

    @property
    def georeferenced(self) -> bool:
        """Return True if the file has a coordinate system."""
        return bool(self._dataset.crs)

    @property
    def assumed(self) -> tuple[str, ...]:
        """Assumptions made about the file, as sentences.

        Undeclared no-data values are those of cells all over the file, and of the windows read.
        """
        assert self._all_over is not None  # detects those of the file where no window was read
        in_metres = "the map names no coordinate system: its grid is taken to be in metres"
        undeclared = no_data.describe(tuple(self.markers))
        return undeclared if self.georeferenced else (in_metres, *undeclared)

    def read(self, rows: slice, columns: slice) -> Floats:
        """(rows, columns) heights [m], row 0 at minimum y, NaN where unknown; only these.

        No-data values are detected from heights of the whole file, so that all windows agree.
        """
        heights = self._read(rows, columns)
        known, markers = no_data.known_heights(heights, self._nodata, [self._all_over])
        self.markers.update(markers)
        return known

    @cached_property
    def _all_over(self) -> Floats:
        """Heights (n,) that represent those of the whole file [m]."""
        spots = []
        for rows in _spread(self.info.rows):
            for columns in _spread(self.info.columns):
                spot, markers = no_data.without_common(self._read(rows, columns), self._nodata)
                spots.append(spot)
                self.markers.update(markers)
        heights = no_data.ends_of(spots)
        self.markers.update(no_data.known_heights(heights, self._nodata)[1])
        return heights

    def _read(self, rows: slice, columns: slice) -> Floats:
        """(rows, columns) heights [m] with markers removed that scaling would hide."""
        from rasterio.windows import Window

        dataset = self._dataset
        flipped = dataset.transform.e < 0.0
        top = self.info.rows - rows.stop if flipped else rows.start
        window = Window(columns.start, top, columns.stop - columns.start, rows.stop - rows.start)
        with _in_one_line(self._path):
            band = dataset.read(self._band, window=window, masked=True, out_dtype="float64")
        raw: Floats = np.ma.filled(band, np.nan)
        index = self._band - 1
        scale, offset = dataset.scales[index], dataset.offsets[index]
        if (scale, offset) != (1.0, 0.0):
            raw, markers = no_data.known_raw(raw, self._nodata, dataset.dtypes[index])
            self.markers.update(markers)
        heights: Floats = raw * scale + offset
        return np.ascontiguousarray(heights[::-1] if flipped else heights)

    @property
    def height_std(self) -> float:
        """Error of heights relative to each other [m], of the whole file for any part of it."""
        if self.stated_std is not None:
            return self.stated_std
        return height_error.assumed(self.info.resolution, surveyed=self.georeferenced)

    @cached_property
    def stated_std(self) -> float | None:
        """The same where the file states it, else None."""
        for band, description in enumerate(self._dataset.descriptions, start=1):
            kind = _ERRORS.search((description or "").lower())
            if kind is None or band == self._band:
                continue
            if (std := self._std_of_band(band, kind[0] == "variance")) is not None:
                return std
        return None

    def _std_of_band(self, band: int, squared: bool) -> float | None:
        """Error of most cells by a band, from a thinned read of it."""
        dataset = self._dataset
        shape = min(dataset.height, _THINNED), min(dataset.width, _THINNED)
        with _in_one_line(self._path):
            read = dataset.read(band, out_shape=shape, masked=True, out_dtype="float64")
        errors = np.ma.filled(read, np.nan) * dataset.scales[band - 1] + dataset.offsets[band - 1]
        reported: Floats = errors[np.isfinite(errors) & (errors >= 0.0)]
        return height_error.one_for_all(np.sqrt(reported) if squared else reported)


@contextlib.contextmanager
def opened(path: Path, nodata: NoData = None) -> Iterator[GeotiffWindows]:
    """Open a map for many windows; ``nodata``: the user's setting for markers of missing data."""
    import rasterio

    check_file(path)
    with contextlib.ExitStack() as stack:
        with _in_one_line(path):
            dataset = stack.enter_context(rasterio.open(path, driver="GTiff"))
            ground = GeotiffWindows(dataset, path, nodata)
        yield ground


def _spread(count: int) -> Iterator[slice]:
    """Rows or columns of spots all over a map; all of them in a small one."""
    edge = min(_SPOT, -(-count // _SPOTS))
    for start in dict.fromkeys(np.linspace(0, count - edge, _SPOTS).astype(int).tolist()):
        yield slice(start, start + edge)


@contextlib.contextmanager
def _in_one_line(path: Path) -> Iterator[None]:
    from rasterio.errors import NotGeoreferencedWarning, RasterioError

    logger = logging.getLogger("rasterio")
    before = logger.level
    logger.setLevel(logging.CRITICAL)  # GDAL's messages about a broken file become one line below
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            yield
    except (RasterioError, OSError, MemoryError, ValueError) as error:
        got = "unreadable data inside" if "Read" in str(error) else "something else"
        raise fault(path, "", f"expected an intact GeoTIFF, got {got}") from None
    finally:
        logger.setLevel(before)


def _height_band(dataset: Any, path: Path) -> int:
    """Number of the band that holds the heights."""
    descriptions = [(text or "").lower() for text in dataset.descriptions]
    for band, text in enumerate(descriptions, start=1):
        if _HEIGHTS.search(text) and not _ERRORS.search(text) and not _NO_HEIGHTS.search(text):
            return band
    if _ERRORS.search(descriptions[0]) or _NO_HEIGHTS.search(descriptions[0]):
        raise fault(path, "band 1", f"expected elevation [m], got {dataset.descriptions[0]!r}")
    return 1


def _checked(dataset: Any, path: Path, band: int) -> MapInfo:
    from rasterio.enums import ColorInterp

    transform = dataset.transform
    if transform.is_identity:
        raise fault(path, "transform", "expected position and scale of the grid, got none")
    edge, shear = abs(transform.a), max(abs(transform.b), abs(transform.d))
    if shear > _SQUARE * edge or transform.a <= 0.0:
        raise fault(path, "transform", "expected a grid aligned with x and y, got a rotated one")
    map_projection.check(dataset, path)
    if not abs(edge - abs(transform.e)) <= _SQUARE * edge:
        got = f"{edge:g} x {abs(transform.e):g}"
        raise fault(path, "transform", f"expected square cells [m], got {got}")
    name = f"band {band + 1}"
    if dataset.colorinterp[band] in (ColorInterp.red, ColorInterp.palette):
        raise fault(path, name, "expected elevation [m], got a colour image")
    if np.dtype(dataset.dtypes[band]).kind not in "iuf":
        raise fault(path, name, f"expected real numbers [m], got {dataset.dtypes[band]}")
    if (dataset.units[band] or "").strip().lower() not in map_projection.METRES:
        raise fault(path, f"{name} unit", f"expected heights in metres, got {dataset.units[band]}")
    # The raster's own origin is a corner of its first row, which is the last one here.
    bottom = dataset.height - 0.5 if transform.e < 0.0 else 0.5
    origin = (transform.c + 0.5 * transform.a, transform.f + bottom * transform.e)
    return MapInfo(dataset.height, dataset.width, edge, origin)
