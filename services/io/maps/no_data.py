"""Heights that mark missing data although the map does not declare them.

Unknown are, whoever wrote the map: heights beyond 100 km, the usual markers of mapping tools, and a
value that stands apart from all other heights, repeated exactly. Real ground is continuous: between
a plateau and the ground below lie heights of its flanks, so that no gap wider than everything else
on the map is left. A map of one to three heights tells no marker from terraces, and keeps all.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal, TypeAlias

import numpy as np

from models.arrays import Floats
from models.errors import InputError

NoData: TypeAlias = float | Literal["none"] | None
"""A height that is unknown ground [m]; "none": the map has no marker but those that it declares;
None: markers are looked for."""

HIGHEST = 1e5
"""From here on no number is a height of ground [m]: float32's lowest, 1e20, 1e30, -999999."""

UNSCALED = (-99999.0, -32768.0, -32767.0, -9999.0)
"""Markers of GDAL, ESRI, SRTM and GEBCO [m]: below all land, also as a raw value before scaling."""

USUAL = (*UNSCALED, 9999.0, 32767.0, 65535.0, 99999.0)
"""Those above all land as well [m], with the highest numbers of 16 bits."""

_LEAST = min(abs(value) for value in USUAL)

_APART = (-999.0,)
"""Markers that ground may have, on other planets [m]: markers only where nothing is near."""

_MIN_GAP = 100.0
"""Gap to the next height from which a value stands apart [m]. Higher sheer faces, without one cell
of their flank on the map, are rarer than forgotten markers."""

_MIN_COUNT = 4
"""Cells of that value, and of other ones: 2 x 2 are the least that a path can lie on. Fewer are a
spike or a hole, whose sides nothing climbs."""


def nodata_of(text: str | None) -> NoData:
    """The value of `--nodata`: a number of metres or "none".

    Raises:
        InputError: it is neither.
    """
    if text is None or text.strip().lower() == "none":
        return None if text is None else "none"
    try:
        return float(text)
    except ValueError:
        raise InputError("--nodata", "", f"expected a height [m] or none, got {text}") from None


def known_heights(
    heights: Floats, nodata: NoData = None, others: Sequence[Floats] = ()
) -> tuple[Floats, tuple[float, ...]]:
    """Heights with NaN where unknown, and the values that were found to be undeclared markers.

    Args:
        heights: any shape [m]; NaN where unknown.
        nodata: what the user says of them.
        others: heights of the same map beside these, markers taken out, any shape [m].
    """
    known, found = without_usual(heights, nodata)
    if nodata != "none":
        for marker in _standing_apart([known, *others]):
            if (cells := known == marker).any():
                known[cells] = np.nan
                found.add(marker)
    return known, tuple(sorted(found))


def without_usual(heights: Floats, nodata: NoData) -> tuple[Floats, set[float]]:
    """The same, of what marks missing data on any map."""
    known = _without(heights, nodata)
    far = np.abs(known) >= (HIGHEST if nodata == "none" else _LEAST)
    if not far.any():
        return known, set()
    values = known[far]
    beyond = np.abs(values) >= HIGHEST
    usual = np.isin(values, () if nodata == "none" else USUAL)
    known[far] = np.where(beyond | usual, np.nan, values)
    found = {*values[beyond & np.isfinite(values)][:1].tolist(), *values[usual].tolist()}
    return known, found


def known_raw(raw: Floats, nodata: NoData, dtype: str) -> tuple[Floats, set[float]]:
    """Numbers of a file that are scaled to heights later, with NaN for :data:`UNSCALED`, and them.

    Args:
        raw: any shape; NaN where unknown. nodata: what the user says of them.
        dtype: of the file. Its ends, of 16 bits and more, are markers, too, but for 0.
    """
    known, kind = _without(raw, nodata), np.dtype(dtype)
    markers = set(UNSCALED)
    if kind.kind in "iu" and kind.itemsize > 1:
        markers |= {float(np.iinfo(kind).max), float(np.iinfo(kind).min)} - {0.0}
    found = set() if nodata == "none" else {value for value in markers if (known == value).any()}
    known[np.isin(known, list(found))] = np.nan
    return known, found


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
    # Two of each inner one: with them there is ground beside the lowest and the highest.
    counts = [
        min(_count(parts, ends[0]), _MIN_COUNT),
        2,
        2,
        min(_count(parts, ends[3]), _MIN_COUNT),
    ]
    heights: Floats = np.repeat(ends, counts)
    return heights[np.isfinite(heights)]


def _standing_apart(parts: Sequence[Floats]) -> list[float]:
    """The lowest and the highest of all heights, where they are apart as only markers are."""
    parts = [part for part in parts if np.isfinite(part).any()]
    if not parts:
        return []
    low, high = _span(parts)
    if high - low <= _MIN_GAP:
        return []
    low, above, below, high = _ends(parts, low, high)
    found, known = [], sum(int(np.count_nonzero(np.isfinite(part))) for part in parts)
    for value, gap, span in ((low, above - low, high - above), (high, high - below, below - low)):
        count = _count(parts, value)
        # Of two or three heights each may be a terrace.
        alone = above < below and gap > span and min(count, known - count) >= _MIN_COUNT
        if gap > _MIN_GAP and (alone or value in _APART):
            found.append(value)
    return found


def _span(parts: Sequence[Floats]) -> tuple[float, float]:
    return (
        min(float(np.nanmin(part)) for part in parts),
        max(float(np.nanmax(part)) for part in parts),
    )


def _ends(parts: Sequence[Floats], low: float, high: float) -> tuple[float, float, float, float]:
    """The lowest height, the next, the last but one and the highest; infinite if there is none."""
    above = min(float(np.min(part, where=part > low, initial=np.inf)) for part in parts)
    below = max(float(np.max(part, where=part < high, initial=-np.inf)) for part in parts)
    return low, above, below, high


def _count(parts: Sequence[Floats], value: float) -> int:
    return sum(int(np.count_nonzero(part == value)) for part in parts)


REMEDY = "; --nodata none takes them as heights"


def in_words(markers: Iterable[float], remedy: str = REMEDY) -> tuple[str, ...]:
    """A sentence about undeclared markers; none where there are none."""
    values = ", ".join(f"{value:.6g}" for value in sorted(markers))
    words = f"cells of {values} m are unknown ground: no height, but an undeclared no-data value"
    return (words + remedy,) if values else ()
