"""The swept footprint of one batch: along the lines, and from the actual pose to them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import InputErrors
from slopewise.models.parameters import Model
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.terrain_profile import BodyRows, TerrainProfile
from slopewise.planner.swept.convergence import Convergence, Departure, convergence
from slopewise.planner.swept.sentences import departure_sentence
from slopewise.planner.swept.sizes import SweptSizes

_CELL_SHARE = 0.5
"""Bands of one map are rounded up to this share of a cell [1], so that its broad phase serves all
candidates of a cycle and of the next ones."""

_CACHED = 4
"""Broad phases that are cached [1], those used last."""

_WIDER = 0.25
"""By how much wider a band a broad phase may be for it to serve another one [m]: it then clears
fewer poses, and those that it does not clear are checked exactly."""

_MARGIN = 0.1
"""Share of the extent of all candidates by which more is covered of a map that stays: later ones
are farther along."""


class BandWidth(NamedTuple):
    """How far a vehicle may be off its line, for the broad phase.

    Attributes:
        widest: by how much the reference point may be off, at most [m].
        turned: sine of the heading error.
        body_offset: distance from the reference point ahead to mid-wheelbase [m].
    """

    widest: float
    turned: float
    body_offset: float


_SWEPT_ROWS = (
    *("x", "y", "station", "heading_x", "heading_y"),
    *("curvature", "sin_roll", "known", "twist"),
)

_Key = tuple[ElevationMap, SweptSizes, BandWidth | None]
_recent: tuple[tuple[_Key, core.BroadPhase], ...] = ()
"""Replaced as a whole, never changed: threads need no lock."""


@dataclass(frozen=True, slots=True)
class SweptPoses:
    """Bars of M candidates of up to N stations, up to the first of each.

    Attributes:
        code, found: of stations (N, M) and lanes (M, 4), see `BroadPhase.sweep` of the core.
        body: (N, M) poses that were swept.
        departures: (M,) sentences on where the vehicle comes from, where that decided.
        searched: poses that the screen of the map did not clear.
        speed: highest speeds of the turns back to the lines, (N, M) [m/s]; None without any.
    """

    code: Ints
    found: Floats
    body: BodyRows
    departures: tuple[str, ...]
    searched: int
    speed: Floats | None = None


@dataclass(frozen=True, slots=True)
class Sweeper:
    """Sweeps the body over one map.

    Attributes:
        elevation_map, model: ground and vehicle.
        sizes: vehicle sizes on this map.
        errors: of tracking, at the quantile of the plan.
        blocks: as `BroadPhase.sweep` of the core has them.
        spacing: largest distance between two stations [m].
    """

    elevation_map: ElevationMap
    model: Model
    sizes: SweptSizes
    errors: InputErrors
    blocks: Ints
    spacing: float

    def sweep(self, profile: TerrainProfile, converging: Convergence | None = None) -> SweptPoses:
        """Bars along the lines, or on the way to them."""
        sizes, body, added_band = self.sizes, profile.body, None
        if converging is not None:
            body, added_band, longer = converging.body, converging.across, converging.longer
            sizes = sizes._replace(front=sizes.front + longer, rear=sizes.rear + longer)
        stations, candidates = body.x.shape
        code, found = np.empty((stations, candidates), np.int64), np.zeros((candidates, 4))
        searched, leads_away = 0, np.zeros(candidates, bool)
        if profile.follower_offset is not None:
            leads_away = profile.follower_offset[:stations].max(axis=0) > 0.0
        # The line of one candidate has nothing to do with what was given for another.
        for lanes in (np.flatnonzero(~leads_away), np.flatnonzero(leads_away)):
            if len(lanes) == 0:
                continue
            added = None if added_band is None else added_band[:, lanes]
            if profile.follower_offset is not None and leads_away[lanes[0]]:
                offset = profile.follower_offset[:stations, lanes]
                added = offset if added is None else added + offset
            poses = BodyRows(*_columns(body, lanes))
            code[:, lanes], found[lanes], count = self._swept(
                sizes, _only(profile, lanes), poses, added
            )
            searched += count
        return SweptPoses(code, found, body, ("",) * candidates, searched)

    def _swept(
        self, sizes: SweptSizes, profile: TerrainProfile, body: BodyRows, added_band: Floats | None
    ) -> tuple[Ints, Floats, int]:
        """Codes (N, M) of what blocks poses, findings (M, 4), and how many poses were searched.

        Args:
            sizes: vehicle sizes on this map.
            profile: M candidates of at least as many stations as poses. body: N poses of each.
            added_band: to that of tracking errors, (N, M) [m].
        """
        elevation_map, x, y = self.elevation_map, body.x, body.y
        across, band = None, None
        ahead, turned = self.model.steering_geometry.body_offset, math.sin(self.errors.heading)
        if added_band is not None or self.errors.has_band:
            across = self.errors.across(profile.curvature[: len(x)])
        if across is not None and added_band is not None:
            across = across + added_band
            band = BandWidth(float(across.max()), turned, ahead)
            grid = broad_phase_for(elevation_map, self.sizes, None, x, y, any_band=True)
            grid = grid.widened(sizes, band)
            if not grid.covers(x, y):
                grid = broad_phase_for(elevation_map, sizes, band, x, y)
        else:
            if across is not None:
                step = _CELL_SHARE * elevation_map.resolution
                band = BandWidth(step * math.ceil(float(across.max()) / step), turned, ahead)
            grid = broad_phase_for(elevation_map, sizes, band, x, y)
        return grid.sweep(body, profile, self.spacing, across, self.blocks)

    def with_convergence(
        self, swept: SweptPoses, profile: TerrainProfile, departure: Departure, lanes: Ints
    ) -> SweptPoses:
        """The same with the way of the vehicle to some lines, by their indices: what is met first.

        Args:
            swept: what was found before.
            profile: M candidates. departure: vehicle pose relative to them.
            lanes: indices, in any order, of candidates that the vehicle is off and to which no way
                was swept before.
        """
        if len(lanes) == 0:
            return swept
        lanes = np.sort(lanes)
        part = _only(profile, lanes)
        late = self.errors.latency + departure.age
        converging = convergence(part, departure.only(lanes), self.model, late)
        way = self.sweep(part, converging)
        code, found, body = swept.code.copy(), swept.found.copy(), [a.copy() for a in swept.body]
        departures, n = list(swept.departures), len(way.code)
        for i in np.flatnonzero(way.code.any(axis=0)):
            j, k = lanes[i], int(np.argmax(way.code[:, i] > 0))
            if code[: k + 1, j].any():
                continue
            code[:, j] = 0
            code[:n, j], found[j] = way.code[:, i], way.found[i]
            for rows, moved in zip(body, way.body, strict=True):
                rows[:n, j] = moved[:, i]
            departures[j] = departure_sentence(departure.offset[j], float(converging.turned[i]))
        speed = np.full(profile.x.shape, np.inf) if swept.speed is None else swept.speed.copy()
        speed[:n, lanes] = converging.speed
        searched = swept.searched + way.searched
        return SweptPoses(code, found, BodyRows(*body), tuple(departures), searched, speed)


def _only(profile: TerrainProfile, lanes: Ints) -> TerrainProfile:
    """Some candidates, by their ascending indices, with what is swept."""
    if len(lanes) == len(profile.count):
        return profile
    offset = profile.follower_offset
    rows = _columns((getattr(profile, name) for name in _SWEPT_ROWS), lanes)
    return replace(
        profile,
        count=profile.count[lanes],
        body=BodyRows(*_columns(profile.body, lanes)),
        follower_offset=None if offset is None else offset[:, lanes],
        **dict(zip(_SWEPT_ROWS, rows, strict=True)),
    )


def _columns(rows: Iterable[Any], lanes: Ints) -> list[Any]:
    """Columns of arrays (N, M), ascending, each contiguous; unchanged where all are asked for."""
    return [
        row if len(lanes) == row.shape[1] else np.ascontiguousarray(row[:, lanes]) for row in rows
    ]


def broad_phase_for(
    elevation_map: ElevationMap,
    sizes: SweptSizes,
    band: BandWidth | None,
    x: Floats,
    y: Floats,
    *,
    any_band: bool = False,
) -> core.BroadPhase:
    """The broad phase of the part of a map, which never changes, around positions.

    Args:
        elevation_map: ground.
        sizes: vehicle sizes on it.
        band: how far the vehicle may be off its line, None if it is exactly on it.
        x, y: (N, M) middles of the wheelbase [m]; those beyond the map are taken as on its edge.
        any_band: one for another band will do as well.
    """
    global _recent
    key, margin = (elevation_map, sizes, band), 0.0
    for entry in _recent:
        (ground, vehicle, swept_band), grid = entry
        if ground is elevation_map and vehicle == sizes and (any_band or _serves(swept_band, band)):
            if grid.covers(x, y):
                _recent = (entry, *(e for e in _recent if e is not entry))
                return grid
            margin = _MARGIN
    heights, resolution = elevation_map.elevation, elevation_map.resolution
    grid = core.BroadPhase(heights, *elevation_map.origin, resolution, sizes, band, x, y, margin)
    _recent = ((key, grid), *_recent[: _CACHED - 1])
    return grid


def _serves(swept: BandWidth | None, band: BandWidth | None) -> bool:
    """Return True if a broad phase for one band is sound for another that is not much narrower."""
    if swept is None or band is None:
        return swept is band
    return swept[1:] == band[1:] and 0.0 <= swept[0] - band[0] <= _WIDER
