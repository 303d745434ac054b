"""Hazards along candidates: where body or wheels must not be, and where rough ground slows."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import InputErrors
from slopewise.models.parameters import Model
from slopewise.planner.ground.steering_limits import SteeringLimits, steering_limits
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.limiting import Limiting
from slopewise.planner.plan import Obstacle
from slopewise.planner.swept.convergence import Departure
from slopewise.planner.swept.findings import LIMITING_OF_KIND, Finding, Kind, Pose
from slopewise.planner.swept.roughness import rough_speeds
from slopewise.planner.swept.sentences import cannot_see, obstacle_of, too_tight
from slopewise.planner.swept.sizes import SweptSizes, swept_sizes
from slopewise.planner.swept.sweeper import Sweeper, SweptPoses

_LIMITING_OF_KIND = np.array([LIMITING_OF_KIND.get(kind, 0) for kind in Kind], np.int64)

_STEERING = int(Limiting.STEERING)

_NO_ERRORS = InputErrors()

_MIN_SPACING = 0.001
"""Of stations [m], however short a path is: ground behind it is checked in such steps."""


class HazardRows(NamedTuple):
    """Arrays of :class:`Hazards` for the core; (N, M) each, or (0, 0) where there is nothing."""

    code: Ints
    rough_speed: Floats
    steering_speed: Floats


@dataclass(frozen=True, slots=True)
class Hazards:
    """Hazards of M candidates of up to N stations.

    Attributes:
        rows: ``code`` (N, M) is 0 where body and wheels may be, else what blocks the pose, as
            :class:`slopewise.planner.limiting.Limiting`; it holds for all poses from the station
            before on. ``rough_speed`` (N, M) is the highest speed that the ground's roughness
            allows [m/s]. ``steering_speed`` (N, M) likewise, that the steering can follow.
        unseen: what the map is too coarse to show, a sentence; empty where it shows all.
        obstacle: what blocks station k of candidate j, None where nothing does.
        searched: poses that the screen of the map did not clear.
    """

    rows: HazardRows
    unseen: str
    obstacle: Callable[[int, int], Obstacle | None]
    searched: int = 0


def _nothing_there(j: int, k: int) -> None:
    """Nothing was searched for."""


def no_hazards() -> Hazards:
    """Ground taken as a plane under every pose, for what-if questions and tests of other bounds."""
    none = np.empty((0, 0))
    return Hazards(HazardRows(none.astype(np.int64), none, none), "", _nothing_there)


def swept_hazards(
    elevation_map: ElevationMap,
    profile: TerrainProfile,
    model: Model,
    *,
    errors: InputErrors = _NO_ERRORS,
    lifted: Collection[Limiting] = (),
    departure: Departure | None = None,
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
        departure: vehicle pose relative to the candidates; None: it is on all of them.
    """
    vehicle, geometry = model.vehicle, model.steering_geometry
    sizes = swept_sizes(vehicle, elevation_map.resolution)
    # The first station may be next to the second one, where a vehicle is on its previous plan.
    steps = np.hypot(np.diff(profile.x[:3], axis=0), np.diff(profile.y[:3], axis=0))
    spacing = np.maximum(steps.max(axis=0), _MIN_SPACING)
    blocks = np.where(np.isin(_LIMITING_OF_KIND, list(lifted)), 0, _LIMITING_OF_KIND)
    sweeper = Sweeper(elevation_map, model, sizes, errors, blocks, float(spacing.max()))
    swept = sweeper.sweep(profile)
    if departure is not None:
        swept = sweeper.with_convergence(swept, profile, departure)
    rough = rough_speeds(elevation_map, profile, model, sizes, spacing)
    steering_speed = np.empty((0, 0))
    steering = steering_limits(profile, geometry)
    if steering is not None:
        swept.code[steering.blocked & (swept.code == 0)] = _STEERING
        steering_speed = steering.speed
    if swept.speed is not None:
        if steering_speed.size == 0:
            steering_speed = np.full(profile.x.shape, np.inf)
        part = steering_speed[: len(swept.speed)]
        np.minimum(part, swept.speed, out=part)
    return Hazards(
        HazardRows(swept.code, rough, steering_speed),
        cannot_see(sizes, elevation_map.resolution),
        _obstacles(profile, swept, sizes, steering, geometry.max_curvature),
        swept.searched,
    )


def _obstacles(
    profile: TerrainProfile,
    swept: SweptPoses,
    sizes: SweptSizes,
    steering: SteeringLimits | None,
    max_curvature: float,
) -> Callable[[int, int], Obstacle | None]:
    """Obstacles at stations of candidates, by the codes and findings of the sweep."""

    def obstacle(j: int, k: int) -> Obstacle | None:
        if swept.code[k, j] == 0:
            return None
        if swept.code[k, j] == _STEERING and steering is not None:
            x, y = float(profile.x[k, j]), float(profile.y[k, j])
            curvature = max(abs(profile.curvature[k, j]), abs(steering.curvature[k, j]))
            message = too_tight(x, y, float(curvature), max_curvature)
            return Obstacle(Limiting.STEERING, x, y, 0.0, message)
        kind, *where = swept.found[j]
        pose = Pose(*(float(row[k, j]) for row in swept.body))
        return obstacle_of(Finding(int(kind), *where), pose, sizes, swept.departures[j])

    return obstacle
