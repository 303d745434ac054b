"""One candidate planned again with something changed: a bound lifted, something known better.

Path and terrain are sampled once; each plan then costs a few milliseconds. What comes out went
through the same bounds, smoother and judge as any plan. Answers are for explanations only: a plan
with a lifted bound must not be driven.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.surface_names import resolve_class
from slopewise.planner.followed_line import line_limits
from slopewise.planner.ground.averaged_map import averaged_map
from slopewise.planner.ground.braking_ground import BrakingGround, ground_along
from slopewise.planner.ground.terrain_profile import terrain_profile
from slopewise.planner.ground.uncertainty import Uncertainty, survived_errors
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import EvenPath, batch, behind_the_front
from slopewise.planner.pipeline.candidates import finished
from slopewise.planner.pipeline.time_optimal_batch import solve
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.settings import PlannerSettings
from slopewise.planner.swept.hazards import swept_hazards

_AT_ONCE = 50.0
"""F_b/W of brakes that stop immediately: 4 m/s within 2 cm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Assumptions:
    """Assumptions that a candidate is planned with; the defaults change nothing.

    Attributes:
        model: its mean.
        uncertainty: what the plan has to survive, None for the mean alone.
        clear: station up to which the ground is known to be free [m].
        relax: applied to the model after uncertainty moved it to the cautious side.
        smooth: limit jerk.
        path_limits: the speed limits of the path count.
        ground_known: unknown ground counts as level and known.
        lifted: bounds of body and wheels that do not count.
        surfaces_known: surfaces that the model never learned count as the ground it learned on.
        ground_even: no crests and no dips.
        holds_anywhere: a vehicle at rest is held on any slope.
        stops_at_once: emergency stops take no distance; the loads they cause are unchanged.
    """

    model: Model
    uncertainty: Uncertainty | None
    clear: float
    relax: Callable[[Model], Model] | None = None
    smooth: bool = True
    path_limits: bool = True
    ground_known: bool = False
    lifted: tuple[Limiting, ...] = ()
    surfaces_known: bool = False
    stops_at_once: bool = False
    ground_even: bool = False
    holds_anywhere: bool = False


class WhatIf:
    """One path on one map, planned under any number of assumptions."""

    def __init__(
        self,
        elevation_map: ElevationMap,
        path: CandidatePath | EvenPath,
        model: Model,
        *,
        settings: PlannerSettings | None = None,
        start_speed: float = 0.0,
    ) -> None:
        """Sample the terrain.

        Args:
            elevation_map: ground.
            path: the candidate.
            model: gives the footprint, which no assumption changes.
            settings: of planning.
            start_speed: at the first station [m/s].

        Raises:
            ParameterError: the path is malformed.
        """
        self._settings = settings or PlannerSettings()
        vehicle = model.vehicle
        spacing = self._settings.spacing_on(elevation_map.resolution, vehicle)
        part = batch([path], spacing, line_limits(model))
        self._vehicle, self._name, self._limit = vehicle, path.name, part.speed_limit
        elevation_map = averaged_map(elevation_map, vehicle.wheel_radius)
        profile = terrain_profile(
            elevation_map, part.x, part.y, part.count, vehicle, model.steering_geometry
        )
        self._profile = replace(profile, follower_offset=part.follower_offset)
        self._map, self._classes = elevation_map, elevation_map.class_names
        self._start_speed = start_speed

    def plan(self, assumptions: Assumptions) -> SpeedPlan:
        """The plan under these assumptions."""
        model, uncertainty = assumptions.model, assumptions.uncertainty
        if uncertainty is not None:
            model = uncertainty.cautious(model)
        if assumptions.relax is not None:
            model = assumptions.relax(model)
        profile = self._profile
        lifted = assumptions.lifted
        if assumptions.ground_known:
            lifted = (*lifted, Limiting.UNKNOWN_TERRAIN)
            profile = replace(profile, known=np.ones_like(profile.known))
        if assumptions.ground_even:
            flat = np.zeros_like(profile.vertical_curvature)
            profile = replace(profile, vertical_curvature=flat)
        classes = self._classes
        if assumptions.surfaces_known:
            # What the class is certain to be, else the ground that the model learned on.
            classes = tuple(resolve_class(model.braking.terrain, name) or "" for name in classes)
        ground = ground_along(profile, model, classes, uncertainty=uncertainty)
        if assumptions.stops_at_once:
            ground = _stopping_at_once(ground)
        # Limits of the model may be lifted; the sizes of the vehicle stay.
        as_large = replace(model, vehicle=self._vehicle)
        solved = solve(
            profile,
            ground,
            model,
            start_speed=self._start_speed,
            clear=behind_the_front(assumptions.clear, as_large),
            speed_limit=self._limit if assumptions.path_limits else None,
            hazards=swept_hazards(
                self._map,
                profile,
                as_large,
                errors=survived_errors(model, uncertainty),
                lifted=lifted,
            ),
            holds_anywhere=assumptions.holds_anywhere,
            settings=self._settings,
        )
        return finished(solved, 0, self._name, smooth=self._settings.smooth and assumptions.smooth)


def _stopping_at_once(ground: BrakingGround) -> BrakingGround:
    """Ground on which stops take no distance.

    The upper bound of the force, which decides loads, is kept.
    """
    return replace(
        ground,
        lower_slope=np.zeros_like(ground.lower_slope),
        lower_intercept=np.full_like(ground.lower_intercept, _AT_ONCE),
        dead_time=np.zeros_like(ground.dead_time),
        shortest_dead_time=np.zeros_like(ground.dead_time),
        distance_offset=np.zeros_like(ground.distance_offset),
        errors=ground.errors._replace(along_track=0.0, latency=0.0),
    )
