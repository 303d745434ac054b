"""Heights that mark missing data although the map does not declare them.

Unknown are, in maps of any format: heights beyond 100 km, the markers that mapping tools write, and
a value that stands apart from all other heights, repeated exactly. Real ground is continuous:
between a plateau and the ground below lie the heights of its flanks, which leave no gap wider than
everything else on the map. In a map of one to three heights each may be a terrace, and all are
kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import MAX_HEIGHT
from slopewise.models.errors import InputError

NoData: TypeAlias = float | Literal["none"] | None
"""A height that is unknown ground [m]; "none": the map has no marker but those that it declares;
None: markers are looked for."""

UNSCALED = (-99999.0, -32768.0, -32767.0, -9999.0)
"""Markers of GDAL, ESRI, SRTM and GEBCO [m]: below all land, also as a raw value before scaling."""

COMMON = (*UNSCALED, 9999.0, 32767.0, 65535.0, 99999.0)
"""The same and markers above all land [m], among them the highest numbers of 16 bits."""

_MIN_COMMON = min(abs(value) for value in COMMON)

_ISOLATED = (-999.0,)
"""Markers that ground may have, on other planets [m]: markers only where nothing is near."""

_MIN_GAP = 100.0
"""Gap to the next height from which a value stands apart [m]. Higher sheer faces, without one cell
of their flank on the map, are rarer than forgotten markers."""

_MIN_COUNT = 4
"""Cells of that value, and of other ones: 2 x 2 are the least that a path can lie on. Fewer are a
spike or a hole, whose sides nothing climbs."""


def nodata_of(text: str) -> NoData:
    """The value of `--nodata`: a height [m] or "none"."""
    if text.strip().lower() == "none":
        return "none"
    try:
        return float(text)
    except ValueError:
        raise InputError("--nodata", "", f"expected a height [m] or none, got {text}") from None


def known_heights(
    heights: Floats, nodata: NoData = None, around: Sequence[Floats] = ()
) -> tuple[Floats, tuple[float, ...]]:
    """Heights with NaN where unknown, and the values that were found to be undeclared markers.

    ``around`` are further heights of the same map, markers removed. Any shapes [m].
    """
    known, detected = without_common(heights, nodata)
    if nodata != "none":
        for marker in _isolated_ends([known, *around]):
            if (cells := known == marker).any():
                known[cells] = np.nan
                detected.add(marker)
    return known, tuple(sorted(detected))


def without_common(heights: Floats, nodata: NoData) -> tuple[Floats, set[float]]:
    """Heights with NaN for what marks missing data on any map, and the markers that were found."""
    known = _without(heights, nodata)
    far = np.abs(known) >= (MAX_HEIGHT if nodata == "none" else _MIN_COMMON)
    if not far.any():
        return known, set()
    values = known[far]
    beyond = np.abs(values) >= MAX_HEIGHT
    common = np.isin(values, () if nodata == "none" else COMMON)
    known[far] = np.where(beyond | common, np.nan, values)
    detected = {*values[beyond & np.isfinite(values)][:1].tolist(), *values[common].tolist()}
    return known, detected


def known_raw(raw: Floats, nodata: NoData, dtype: str) -> tuple[Floats, set[float]]:
    """Numbers before scaling, with NaN for those of :data:`UNSCALED`, and the markers found.

    The ends of a number type of 16 bits and more are markers too, except 0.
    """
    known, kind = _without(raw, nodata), np.dtype(dtype)
    markers = set(UNSCALED)
    if kind.kind in "iu" and kind.itemsize > 1:
        markers |= {float(np.iinfo(kind).max), float(np.iinfo(kind).min)} - {0.0}
    detected = {value for value in markers if nodata != "none" and (known == value).any()}
    known[np.isin(known, list(detected))] = np.nan
    return known, detected


def _without(heights: Floats, nodata: NoData) -> Floats:
    """A copy with NaN where there is the value that the user declares."""
    known = np.array(heights, np.float64)
    if isinstance(nodata, float | int):
        # float32 holds -9999.9 as another number than the one that the user types.
        known[(known == nodata) | (known == float(np.float32(nodata)))] = np.nan
    return known


def ends_of(parts: Sequence[Floats]) -> Floats:
    """A few heights (n,) that stand apart just as all of them do; any shapes, NaN where unknown."""
    parts = [part for part in parts if np.isfinite(part).any()]
    if not parts:
        return np.empty(0)
    ends = _ends(parts, *_span(parts))
    # Two of each inner one: with them there is ground apart from the lowest and the highest.
    low, high = (min(_count(parts, end), _MIN_COUNT) for end in (ends[0], ends[3]))
    heights: Floats = np.repeat(ends, [low, 2, 2, high])
    return heights[np.isfinite(heights)]


def _isolated_ends(parts: Sequence[Floats]) -> list[float]:
    """The lowest and the highest of all heights, where they are apart as only markers are."""
    parts = [part for part in parts if np.isfinite(part).any()]
    if not parts:
        return []
    low, high = _span(parts)
    if high - low <= _MIN_GAP:
        return []
    low, above, below, high = _ends(parts, low, high)
    isolated, known = [], sum(int(np.count_nonzero(np.isfinite(part))) for part in parts)
    for value, gap, span in ((low, above - low, high - above), (high, high - below, below - low)):
        count = _count(parts, value)
        # Of two or three heights each may be a terrace.
        alone = above < below and gap > span and min(count, known - count) >= _MIN_COUNT
        if gap > _MIN_GAP and (alone or value in _ISOLATED):
            isolated.append(value)
    return isolated


def _span(parts: Sequence[Floats]) -> tuple[float, float]:
    return (
        min(float(np.nanmin(part)) for part in parts),
        max(float(np.nanmax(part)) for part in parts),
    )


def _ends(parts: Sequence[Floats], low: float, high: float) -> tuple[float, float, float, float]:
    """The lowest height, the next, the last but one and the highest; infinite if missing."""
    above = min(float(np.min(part, where=part > low, initial=np.inf)) for part in parts)
    below = max(float(np.max(part, where=part < high, initial=-np.inf)) for part in parts)
    return low, above, below, high


def _count(parts: Sequence[Floats], value: float) -> int:
    return sum(int(np.count_nonzero(part == value)) for part in parts)


def describe(
    markers: Sequence[float], remedy: str = "; --nodata none takes them as heights"
) -> tuple[str, ...]:
    """A sentence about undeclared markers, with the option that keeps them; empty without any."""
    values = ", ".join(f"{value:.6g}" for value in sorted(markers))
    sentence = f"cells of {values} m are unknown ground: no height, but an undeclared no-data value"
    # No option makes ground of what is beyond all heights.
    if all(abs(value) >= MAX_HEIGHT for value in markers):
        remedy = ""
    return (sentence + remedy,) if values else ()
