"""Bounds of a candidate on the ground of both sides of its lateral band.

A vehicle that is off its line stands on other ground: what its loads, friction, trained slopes and
brakes allow there bounds the plan of the line as well. Each side is a line parallel to the
candidate, as far off as the band at the plan's quantile; its bends and stations are those of the
candidate. Only candidates that are finished pay for it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import InputErrors
from slopewise.models.parameters import Model
from slopewise.planner.bounds.speed_bounds import speed_bounds
from slopewise.planner.ground.braking_ground import GroundConditions, ground_along
from slopewise.planner.ground.terrain_profile import TerrainProfile, terrain_profile
from slopewise.planner.ground.uncertainty import Uncertainty

_SIDES = (1.0, -1.0)  # left, right


class SideBounds(NamedTuple):
    """Bounds of both sides of L candidates: lowest v² and which bound it is, (N, L) [m²/s²].

    And the clear distance, (L,), inf where ground at the sides does not shorten it [m].
    """

    speed_sq: Floats
    limiting: Ints
    clear: Floats

    def of(self, i: int, count: int) -> tuple[Floats, Ints, float]:
        """Bounds of candidate i, with its number of stations."""
        return self.speed_sq[:count, i], self.limiting[:count, i], float(self.clear[i])


class BandGround(NamedTuple):
    """Ground on and next to candidates, and what plans on it are made with."""

    elevation_map: ElevationMap
    errors: InputErrors
    conditions: GroundConditions | None = None
    uncertainty: Uncertainty | None = None

    @property
    def has_band(self) -> bool:
        """The reference point may be off the line."""
        return max(self.errors.cross_track, self.errors.cross_track_per_curvature) > 0.0

    def bounds(
        self, profile: TerrainProfile, model: Model, lanes: Ints, clear: Floats
    ) -> SideBounds:
        """Bounds of candidates with ground on both sides.

        Args:
            profile: a batch. model: that of its plans. lanes: (L,) indices of the candidates.
            clear: (L,) station before which each stops [m].
        """
        counts, sides = profile.count[lanes], len(_SIDES)
        n = int(counts.max())

        def twice(rows: Floats) -> Floats:
            return np.repeat(rows[:n, lanes], sides, axis=1)

        curvature = twice(profile.curvature)
        left = self.errors.across(curvature) * np.tile(_SIDES, len(lanes))
        # The offset varies along a bend: the body stays parallel to that on the planned line.
        heading = twice(profile.body.heading_x), twice(profile.body.heading_y)
        lateral = terrain_profile(
            self.elevation_map,
            twice(profile.x) - left * heading[1],
            twice(profile.y) + left * heading[0],
            np.repeat(counts, sides),
            model.vehicle,
            model.steering_geometry,
            heading,
        )
        lateral = replace(
            lateral,
            station=twice(profile.station),
            curvature=curvature,
            heading_x=twice(profile.heading_x),
            heading_y=twice(profile.heading_y),
        )
        ground = ground_along(
            lateral, model, self.elevation_map.class_names, self.conditions, self.uncertainty
        )
        bounds = speed_bounds(lateral, ground, model, np.repeat(clear, sides))
        pairs = (n, len(lanes), sides)
        speed_sq, limiting = bounds.speed_sq_max.reshape(pairs), bounds.limiting.reshape(pairs)
        lowest = speed_sq.argmin(axis=2)[:, :, None]
        free = bounds.clear_distance.reshape(pairs[1:]).min(axis=1)
        return SideBounds(
            np.take_along_axis(speed_sq, lowest, axis=2)[:, :, 0],
            np.take_along_axis(limiting, lowest, axis=2)[:, :, 0],
            np.where(free < clear, free, np.inf),
        )
