"""Another surface in one place, F_b/W += δ inside a circle on the map."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slopewise.models.arrays import Elementwise, Floats
from slopewise.models.effects.effect_law import (
    POSITIVE,
    EffectLaw,
    Enters,
    Parameter,
    Place,
    Search,
)
from slopewise.models.effects.stops_seen import MIN_STOP_COUNT, StopsSeen

_LATTICE = 9  # centres that the search tries along the longer side of the field
_HELD = 0.5  # share of a stop from which it counts: an edge that clips one explains only noise [1]
_RADII = (0.07, 0.14, 0.25)  # of the field


def force_term(
    place: Place, delta: Elementwise, x: Elementwise, y: Elementwise, radius: Elementwise
) -> Elementwise:
    """Term of F_b/W, δ inside the circle and 0 outside [1]."""
    return delta * (np.hypot(place.x - x, place.y - y) <= radius)


def share_inside(x: Floats, y: Floats, centre_x: float, centre_y: float, radius: float) -> Floats:
    """(S, M) share of the distance around each time that lies inside a circle.

    A time next to the edge has partial weight, so that it does not matter where the times lie.

    Args:
        x, y: (S, M) positions along each stop [m]. centre_x, centre_y, radius: [m].
    """
    away = np.sqrt((x - centre_x) ** 2 + (y - centre_y) ** 2)
    step = np.empty_like(away)
    step[:, 1:-1] = 0.5 * (away[:, 2:] - away[:, :-2])
    step[:, 0], step[:, -1] = away[:, 1] - away[:, 0], away[:, -1] - away[:, -2]
    inside: Floats = (radius - away) / np.maximum(np.abs(step), 1e-6)
    return np.clip(inside + 0.5, 0.0, 1.0, out=inside)


def holds_stops(inside: Floats) -> bool:
    """Whether a circle holds half or more of enough stops to be seen, and not all of all stops."""
    held = int((inside.mean(axis=1) >= _HELD).sum())
    return held >= MIN_STOP_COUNT and bool((inside < 1.0).any())


def _along(place: Place, delta: float, x: float, y: float, radius: float) -> Floats:
    return delta * share_inside(place.x, place.y, x, y, radius)


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    x, y = stops.x, stops.y
    size = float(max(np.ptp(x), np.ptp(y)))
    if size <= 0.0:
        return
    count_x = max(int(np.ceil(_LATTICE * np.ptp(x) / size)), 1)
    count_y = max(int(np.ceil(_LATTICE * np.ptp(y) / size)), 1)
    for cx in _middles(x, count_x):
        for cy in _middles(y, count_y):
            for share in _RADII:
                inside = share_inside(x, y, cx, cy, share * size)
                if holds_stops(inside):
                    yield {"x": float(cx), "y": float(cy), "radius": share * size}, inside


def _middles(values: Floats, count: int) -> Floats:
    low, high = float(values.min()), float(values.max())
    return low + (high - low) * (np.arange(count) + 0.5) / count


EFFECT = EffectLaw(
    missing="another surface in one place",
    enters=Enters.GROUND,
    law=force_term,
    parameters={
        "delta": Parameter(unit="1", plausible=(-1.5, 1.5), step=0.01),
        # Found by trying: at an edge only stops that cross it would pull, and empty the circle.
        "x": Parameter(unit="m", step=0.5, fitted=False),
        "y": Parameter(unit="m", step=0.5, fitted=False),
        "radius": Parameter(unit="m", bounds=POSITIVE, step=0.5, fitted=False),
    },
    depends_on=frozenset(("place",)),
    axis="place",
    experiment="stop outside the place of these stops",
    search=Search(columns=_columns, strength="delta", one_sided=False, placed=True),
    where=lambda p: f"within {p['radius']:.1f} m of ({p['x']:.1f}, {p['y']:.1f}) m",
    grown=lambda p, length: {**p, "radius": p["radius"] + length},
    along=_along,
    max_force=lambda _: {"delta": 1.0},
    may_add=lambda p: p["delta"] > 0.0,
)
