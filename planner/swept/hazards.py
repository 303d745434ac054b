"""Hazards along candidates: where body or wheels must not be, and where rough ground slows."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.height_noise import noise_of
from slopewise.models.input_errors import InputErrors
from slopewise.models.parameters import Model
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.height_grid import height_grid
from slopewise.planner.ground.steering_limits import SteeringLimits, steering_limits
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.limiting import Limiting
from slopewise.planner.plan import Obstacle
from slopewise.planner.swept.sentences import LIMITING_OF_KIND, Kind, obstacle_of, too_tight
from slopewise.planner.swept.sizes import SweptSizes, swept_sizes
from slopewise.planner.swept.sweeper import Sweeper, SweptPoses

_LIMITING_OF_KIND = np.array([LIMITING_OF_KIND.get(kind, 0) for kind in Kind], np.int64)

_STEERING = int(Limiting.STEERING)

_NO_ERRORS = InputErrors()

_MIN_SPACING = 0.001
"""Of stations [m], however short a path is: ground behind it is checked in such steps."""


@dataclass(frozen=True, slots=True)
class Hazards:
    """Hazards of M candidates of up to N stations; by default ground is a plane under every pose.

    Attributes:
        code: (N, M) 0 where body and wheels may be, else what blocks the pose, as
            :class:`slopewise.planner.limiting.Limiting`; it holds for all poses from the station
            before on. None where nothing was searched for.
        rough_speed: (N, M) highest speed that the ground's roughness allows [m/s].
        steering_speed: (N, M) the same, that the steering can follow; None where it always can.
        obstacle: what blocks station k of candidate j, None where nothing does.
        searched: poses that the screen of the map did not clear.
    """

    code: Ints | None = None
    rough_speed: Floats | None = None
    steering_speed: Floats | None = None
    obstacle: Callable[[int, int], Obstacle | None] = lambda j, k: None
    searched: int = 0


@dataclass(frozen=True, slots=True)
class HazardSearch:
    """Hazards of lines; those of the way of a vehicle to some of them are searched for separately.

    Attributes:
        profile: M candidates of up to N stations.
        sweeper: of body and wheels. line: what it found along the candidates.
        steering: turns that cannot be made, None where the steering makes all.
        rough_speed: (N, M) highest speed that the ground's roughness allows [m/s].
    """

    profile: TerrainProfile
    sweeper: Sweeper
    line: SweptPoses
    steering: SteeringLimits | None
    rough_speed: Floats

    @classmethod
    def along(
        cls,
        elevation_map: ElevationMap,
        profile: TerrainProfile,
        model: Model,
        errors: InputErrors = _NO_ERRORS,
        lifted: Collection[Limiting] = (),
    ) -> HazardSearch:
        """Search the lines; arguments as of `swept_hazards`."""
        sizes = swept_sizes(model.vehicle, elevation_map.resolution)
        # The first station may be next to the second one, where a vehicle is on its previous plan.
        steps = np.hypot(np.diff(profile.x[:3], axis=0), np.diff(profile.y[:3], axis=0))
        spacing = np.maximum(steps.max(axis=0), _MIN_SPACING)
        blocks = np.where(np.isin(_LIMITING_OF_KIND, list(lifted)), 0, _LIMITING_OF_KIND)
        sweeper = Sweeper(elevation_map, model, sizes, errors, blocks, float(spacing.max()))
        return cls(
            profile,
            sweeper,
            sweeper.sweep(profile),
            steering_limits(profile, model.steering_geometry),
            rough_speeds(elevation_map, profile, model, sizes, spacing),
        )

    def hazards(self, swept: SweptPoses) -> Hazards:
        """Hazards by what is swept: the lines, and the way to some of them."""
        steering, code, speed = self.steering, swept.code, swept.speed
        if steering is not None:
            code = np.where(steering.blocked & (code == 0), _STEERING, code)
            speed = steering.speed if speed is None else np.minimum(steering.speed, speed)
        return Hazards(code, self.rough_speed, speed, self._obstacles(swept, code), swept.searched)

    def _obstacles(self, swept: SweptPoses, code: Ints) -> Callable[[int, int], Obstacle | None]:
        """Obstacles at stations of candidates, by the codes and findings of the sweep."""
        profile, steering, sizes = self.profile, self.steering, self.sweeper.sizes
        max_curvature = self.sweeper.model.steering_geometry.max_curvature

        def obstacle(j: int, k: int) -> Obstacle | None:
            if code[k, j] == 0:
                return None
            if code[k, j] == _STEERING and steering is not None:
                x, y = float(profile.x[k, j]), float(profile.y[k, j])
                curvature = max(abs(profile.curvature[k, j]), abs(steering.curvature[k, j]))
                message = too_tight(x, y, float(curvature), max_curvature)
                return Obstacle(Limiting.STEERING, x, y, 0.0, message)
            pose = tuple(float(row[k, j]) for row in swept.body)
            return obstacle_of(swept.found[j], pose, sizes, swept.departures[j])

        return obstacle


def swept_hazards(
    elevation_map: ElevationMap,
    profile: TerrainProfile,
    model: Model,
    *,
    errors: InputErrors = _NO_ERRORS,
    lifted: Collection[Limiting] = (),
) -> Hazards:
    """Hazards of wheels and body along candidates, and how fast rough ground may be driven.

    The first station is where the vehicle stands: only a step up that a wheel touches blocks it.
    Each candidate is checked up to its first blocked station.

    Args:
        elevation_map: ground.
        profile: M candidates of up to N stations on it.
        model: vehicle and limits.
        errors: of tracking, at the quantile of the plan.
        lifted: bounds that do not count, for what-if questions.
    """
    search = HazardSearch.along(elevation_map, profile, model, errors, lifted)
    return search.hazards(search.line)


def rough_speeds(
    elevation_map: ElevationMap,
    profile: TerrainProfile,
    model: Model,
    sizes: SweptSizes,
    spacing: Floats,
) -> Floats:
    """Highest speeds that keep the vertical acceleration within its limit, (N, M) [m/s].

    They are inf where roughness limits nothing. What lies behind the first station still moves the
    body there. On cells larger than a wheel's radius, which are not averaged, kinks that noise
    alone would make limit nothing. `planner/core/swept/roughness.hpp` and `quarter_car.hpp` have
    the equations.

    Args:
        spacing: (M,) distance between the stations of each candidate [m].
    """
    vehicle, limits = model.vehicle, model.limits
    noise = 0.0 if sizes.fine else noise_of(elevation_map)
    bounce = vehicle.ride_frequency, vehicle.ride_damping
    ride = *bounce, limits.vertical_accel, limits.speed, noise, elevation_map.resolution
    grid = height_grid(elevation_map, vehicle)
    return core.roughness_speeds(grid, profile, spacing, sizes, ride)
