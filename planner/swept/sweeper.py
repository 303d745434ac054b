"""The swept footprint of one batch: along the lines, and from the actual pose to them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import InputErrors
from slopewise.models.parameters import Model
from slopewise.planner.ground.body_pose import BodyRows
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.swept.broad_phase import broad_phase_for
from slopewise.planner.swept.convergence import Convergence, Departure, convergence
from slopewise.planner.swept.sentences import departure_sentence
from slopewise.planner.swept.sizes import SweptSizes
from slopewise.planner.swept.tube import COARSE, tube_of


@dataclass(frozen=True, slots=True)
class SweptPoses:
    """Bars of M candidates of up to N stations, up to the first of each.

    Attributes:
        code, found: as `BroadPhase.sweep` of the core has them.
        body: (N, M) poses that were swept.
        departures: (M,) sentences on where the vehicle comes from, where that decided.
        searched: poses that the screen of the map did not clear.
        speed: highest speeds of the turn back to the lines, (K, M) [m/s]; None on them.
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
        sizes, body, added_band = self.sizes, profile.body_rows, None
        if converging is not None:
            body, added_band = converging.body, converging.across
            # In steps, so that the broad phase serves the next poses as well.
            longer = COARSE * math.ceil(converging.longer / COARSE)
            sizes = sizes._replace(front=sizes.front + longer, rear=sizes.rear + longer)
        stations, candidates = body.x.shape
        code, found = np.empty((stations, candidates), np.int64), np.zeros((candidates, 4))
        swept = SweptPoses(code, found, body, ("",) * candidates, 0)
        if profile.follower_offset is None:
            return self._swept(sizes, profile, swept, added_band)
        # The line of one candidate has nothing to do with what was given for another.
        offset = profile.follower_offset[:stations]
        leads_away = offset.max(axis=0) > 0.0
        for lanes in (np.flatnonzero(~leads_away), np.flatnonzero(leads_away)):
            if len(lanes) == 0:
                continue
            part = SweptPoses(
                np.empty((stations, len(lanes)), np.int64),
                np.zeros((len(lanes), 4)),
                BodyRows(*_columns(body, lanes)),
                ("",) * len(lanes),
                0,
            )
            added = None if added_band is None else added_band[:, lanes]
            if leads_away[lanes[0]]:
                added = offset[:, lanes] if added is None else added + offset[:, lanes]
            part = self._swept(sizes, _only(profile, lanes), part, added)
            code[:, lanes], found[lanes] = part.code, part.found
            swept = replace(swept, searched=swept.searched + part.searched)
        return swept

    def _swept(
        self,
        sizes: SweptSizes,
        profile: TerrainProfile,
        poses: SweptPoses,
        added_band: Floats | None,
    ) -> SweptPoses:
        """Poses, with what blocks them.

        Args:
            sizes: vehicle sizes on this map.
            profile: M candidates of at least as many stations as poses.
            poses: of them, nothing noted yet. added_band: to that of tracking errors, (N, M) [m].
        """
        stations, ground = len(poses.code), self.elevation_map
        tube = tube_of(
            self.errors,
            profile.curvature[:stations],
            self.model.steering_geometry.body_offset,
            ground.resolution,
            added_band,
        )
        across, band = (None, None) if tube is None else tube
        body = poses.body
        searched = broad_phase_for(ground, sizes, band, body.x, body.y).sweep(
            body,
            profile,
            self.spacing,
            across,
            self.blocks,
            poses.code,
            poses.found,
        )
        return replace(poses, searched=searched)

    def with_convergence(
        self, line: SweptPoses, profile: TerrainProfile, departure: Departure
    ) -> SweptPoses:
        """The first obstacle of each line, and of the vehicle before it has converged to it."""
        late = self.errors.latency + departure.age
        converging = convergence(profile, departure, self.model, late)
        if converging is None:
            return line
        way = self.sweep(profile, converging)
        departures, body = list(line.departures), [rows.copy() for rows in line.body]
        n = len(way.code)
        for j in np.flatnonzero(way.code.any(axis=0)):
            k = int(np.argmax(way.code[:, j] > 0))
            if line.code[: k + 1, j].any():
                continue
            line.code[:, j] = 0
            line.code[:n, j], line.found[j] = way.code[:, j], way.found[j]
            for rows, moved in zip(body, way.body, strict=True):
                rows[:n, j] = moved[:, j]
            departures[j] = departure_sentence(
                float(converging.offset[j]), float(converging.turned[j])
            )
        body_rows = BodyRows(*body)
        return replace(
            line,
            body=body_rows,
            departures=tuple(departures),
            searched=line.searched + way.searched,
            speed=converging.speed,
        )


def _only(profile: TerrainProfile, lanes: Ints) -> TerrainProfile:
    """Some candidates, by their indices, with what is swept."""
    station, known, twist, curvature = _columns(
        (profile.station, profile.known, profile.twist, profile.curvature), lanes
    )
    return replace(
        profile,
        count=profile.count[lanes],
        station=station,
        known=known,
        twist=twist,
        curvature=curvature,
    )


def _columns(rows: Iterable[Any], lanes: Ints) -> list[Any]:
    """Columns of arrays (N, M), each of them contiguous."""
    return [np.ascontiguousarray(row[:, lanes]) for row in rows]
