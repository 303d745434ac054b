"""Drives to learn from: uniform slopes of every steepness and hills, stops from every speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slopewise.planner.ground.terrain_profile import terrain_profile

from .course import Course
from .drive_loop import run_drive
from .loop_terrain import SURFACES, PhysicsGround, crop, hills, slope
from .policies import ScriptedSpeed
from .quad import LIMITS, QUAD
from .route import draw_route
from .scenes import LEARNED, dem_folder
from .stop_sample import MappedGround, StopSample, samples_of

_SLOPES = 0.5  # share of drives on uniform slopes [1]
_REAL = 0.7  # share of the others on public elevation models, if available [1]
_MAX_GRADE = np.deg2rad(22.5)  # steeper than any test, so that no plan extrapolates
_SIGHT = (20.0, 21.0)  # [m], longer than any stop
_OVERSPEED = 0.3  # [m/s] above the speed limit, so that no plan extrapolates


def stops_of_drive(seed: int, exact: bool, surface: int | None = None) -> list[StopSample]:
    """Stops of one drive on ground that no test uses.

    Args:
        seed: determines everything.
        exact: sensors and map without noise.
        surface: index into `SURFACES`, default: drawn.
    """
    rng = np.random.default_rng((77, seed))
    route = None
    while route is None:
        terrain = _terrain(rng, surface)
        route = draw_route(terrain, rng, QUAD, max_grade=_MAX_GRADE)
    course = Course(route, rng, only_forced=True, sight=_SIGHT)
    policy = ScriptedSpeed(rng, LIMITS.accel, LIMITS.speed + _OVERSPEED, exact=exact)
    drive = run_drive(terrain, route, course, policy, seed)
    known_map = terrain.elevation_map(terrain.mapped_heights(None if exact else rng))
    x, y = (np.ascontiguousarray(c[::2, None]) for c in (route.x, route.y))
    profile = terrain_profile(known_map, x, y, np.array([len(x)]), QUAD.wheelbase, QUAD.track_width)
    p = profile
    ground = MappedGround(p.station[:, 0], p.grade[:, 0], p.roll[:, 0], p.surfaces[:, 0])
    return samples_of(drive, ground)


def _terrain(rng: np.random.Generator, surface: int | None) -> PhysicsGround:
    """Draw ground of a single surface: a stop across two fits neither."""
    if rng.random() < _SLOPES:
        ground = slope(rng.uniform(0.0, 2.0 * np.pi), _MAX_GRADE * rng.uniform() ** 0.4, rng)
    elif (dem := dem_folder()) is not None and rng.random() < _REAL:
        ground = crop(dem, rng, LEARNED)
    else:
        ground = hills(rng)
    index = int(rng.integers(len(SURFACES)))
    return replace(
        ground, surface=np.full_like(ground.surface, index if surface is None else surface)
    )
