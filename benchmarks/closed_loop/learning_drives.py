"""Drives to learn from: even slopes of every steepness and hills, stops from every speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slopewise.planner.ground.terrain_profile import terrain_profile

from .course import Course
from .drive import run_drive
from .policies import Blind
from .quad import LIMITS, QUAD
from .route import draw_route
from .scenes import LEARNED, dem_folder
from .stop_sample import MappedGround, StopSample, samples_of
from .terrain import SURFACES, PhysicsGround, crop, hills, slope

_SLOPES = 0.5  # share of drives on even slopes
_REAL = 0.7  # share of the others on public elevation models, where there are any
_STEEPEST = np.deg2rad(22.5)
_SIGHT = (20.0, 21.0)  # [m] the way is free


def stops_of_drive(seed: int, exact: bool, surface: int | None = None) -> list[StopSample]:
    """Stops of one drive on ground that no test ever sees.

    Args:
        seed: of everything.
        exact: sensors and map without noise.
        surface: index into `SURFACES`, drawn if left out.
    """
    rng = np.random.default_rng((77, seed))
    route = None
    while route is None:
        terrain = _terrain(rng, surface)
        route = draw_route(terrain, rng, QUAD, steepest=_STEEPEST)
    course = Course(route, rng, only_forced=True, sight=_SIGHT)
    policy = Blind(rng, LIMITS.accel, LIMITS.speed + 0.3)
    policy.exact = exact
    drive = run_drive(terrain, route, course, policy, seed)
    told = terrain.elevation_map(terrain.told(None if exact else rng))
    x, y = (np.ascontiguousarray(c[::2, None]) for c in (route.x, route.y))
    ground = terrain_profile(told, x, y, np.array([len(x)]), QUAD.wheelbase, QUAD.track_width)
    return samples_of(
        drive,
        MappedGround(
            ground.station[:, 0], ground.grade[:, 0], ground.roll[:, 0], ground.surfaces[:, 0]
        ),
    )


def _terrain(rng: np.random.Generator, surface: int | None) -> PhysicsGround:
    """One surface throughout: a stop across two teaches neither."""
    if rng.random() < _SLOPES:
        ground = slope(rng.uniform(0.0, 2.0 * np.pi), _STEEPEST * rng.uniform() ** 0.4, rng)
    elif (dem := dem_folder()) is not None and rng.random() < _REAL:
        ground = crop(dem, rng, LEARNED)
    else:
        ground = hills(rng)
    drawn = int(rng.integers(len(SURFACES)))
    on = drawn if surface is None else surface
    return replace(ground, surface=np.full_like(ground.surface, on))
