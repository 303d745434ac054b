"""Contact heights: against their definition, and what wheels bridge, climb and follow."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.height_grid import height_grid, tyre_footprint
from slopewise.planner.ground.terrain_profile import terrain_profile
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import Status
from slopewise.services.io.model_file import read_model, shipped_models
from tests.planner.ground.reference_contact import HEADINGS, contact_height, wheel_height
from tests.world.ground import ground_map, straight
from tests.world.plans import plan_one
from tests.world.stages import profile_of
from tests.world.vehicles import ATV, BASE

ATV_RADIUS = BASE.vehicle.wheel_radius


def holed_ground(seed: int, resolution: float, size: int = 44) -> ElevationMap:
    """Slopes, noise, blocks and unknown cells."""
    rng = np.random.default_rng(seed)
    i, j = np.mgrid[0:size, 0:size] * resolution
    z = 100.0 + rng.uniform(-0.3, 0.3) * i + rng.uniform(-0.3, 0.3) * j
    z += rng.choice([0.0, 0.01, 0.05]) * rng.standard_normal(z.shape)
    for _ in range(4):
        row, column, height = *rng.integers(0, size, 2), rng.uniform(-0.5, 0.5)
        z[row : row + 5, column : column + 3] += height
    z[rng.random(z.shape) < 0.02] = np.nan
    return ElevationMap(elevation=z, resolution=resolution, origin=(-2.0, 3.0), height_std=0.0)


def vehicle_with(radius: float = ATV_RADIUS, **changes: float) -> Model:
    return replace(BASE, vehicle=replace(BASE.vehicle, wheel_radius=radius, **changes))


@pytest.mark.parametrize(
    "seed", [*(pytest.param(seed, marks=pytest.mark.nightly) for seed in (0, 1, 4)), 2, 3, 5]
)
def test_contact_heights_are_as_defined(seed: int) -> None:
    resolution, radius = (0.1, 0.05, 0.25)[seed % 3], (0.28, 0.13)[seed // 3]
    resolution = min(resolution, radius)
    ground, vehicle = holed_ground(seed, resolution), vehicle_with(radius).vehicle
    grid, tyre = height_grid(ground, vehicle), tyre_footprint(vehicle, resolution)
    rng = np.random.default_rng(seed)
    lifts = [grid.tyre_lifts(heading) for heading in range(HEADINGS)]
    for _ in range(60):
        heading, i, j = rng.integers(0, (HEADINGS, 44, 44))
        expected = contact_height(ground, tyre, int(heading), int(i), int(j))
        computed = ground.elevation[i, j] + lifts[heading][i, j]
        np.testing.assert_allclose(computed, expected, atol=1e-5, rtol=0.0)


@pytest.mark.parametrize("seed", range(4))
def test_slopes_and_heights_are_those_of_the_contacts(seed: int) -> None:
    ground, vehicle = holed_ground(seed, 0.1, size=60), BASE.vehicle
    tyre, rng = tyre_footprint(vehicle, 0.1), np.random.default_rng(seed)
    yaw = rng.uniform(-np.pi, np.pi)
    ahead, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    middle = np.array(ground.origin) + 2.95
    s = np.linspace(-1.0, 1.0, 9)[:, None]
    x, y = (np.ascontiguousarray(middle[k] + s * ahead[k]) for k in (0, 1))
    profile = terrain_profile(ground, x, y, np.array([9]), vehicle)
    half_length, half_width = 0.5 * vehicle.wheelbase, 0.5 * vehicle.track_width
    for k in range(9):
        at = np.array([x[k, 0], y[k, 0]])
        corners = [(a * half_length, b * half_width) for a in (1, -1) for b in (1, -1)]
        places = [at + a * ahead + b * left for a, b in corners]
        fl, fr, rl, rr = (wheel_height(ground, tyre, tuple(p), yaw) for p in places)
        z = wheel_height(ground, tyre, tuple(at), yaw)
        assert profile.known[k, 0] == np.isfinite(fl + fr + rl + rr + z)
        if profile.known[k, 0]:
            rise = (fl + fr - rl - rr) / (4.0 * half_length)
            cross = (fl + rl - fr - rr) / (4.0 * half_width)
            assert profile.grade[k, 0] == pytest.approx(np.arctan(rise), abs=1e-6)
            tilt = np.arctan(cross * np.cos(np.arctan(rise)))
            assert profile.roll[k, 0] == pytest.approx(tilt, abs=1e-6)
            assert profile.z[k, 0] == pytest.approx(z, abs=1e-5)


@pytest.mark.parametrize("candidates", [1, 63, 64, 65, 130])
def test_candidates_do_not_depend_on_each_other_or_on_threads(candidates: int) -> None:
    ground = holed_ground(3, 0.1, size=100)
    rng = np.random.default_rng(0)
    yaw = rng.uniform(-np.pi, np.pi, candidates)
    s = np.linspace(-2.0, 2.0, 20)[:, None]
    x, y = 3.0 + s * np.cos(yaw), 8.0 + s * np.sin(yaw)
    count = rng.integers(3, 21, candidates)
    together = terrain_profile(ground, x, y, count, BASE.vehicle)
    fresh = replace(ground)

    def alone(j: int) -> None:
        lane_slice = slice(j, j + 1)
        lane = [np.ascontiguousarray(a[:, lane_slice]) for a in (x, y)]
        profile = terrain_profile(fresh, *lane, count[lane_slice], BASE.vehicle)
        for name in ("z", "station", "grade", "sin_roll", "vertical_curvature", "known"):
            np.testing.assert_array_equal(
                getattr(profile, name)[:, 0], getattr(together, name)[:, j]
            )

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(alone, range(candidates)))


def test_memory_of_contact_heights_is_limited() -> None:
    heights = np.zeros((2400, 2400))
    grid = core.HeightGrid(heights, 0.0, 0.0, 0.1, 0.2, 0.05, 0.28)
    max_memory = 0
    for heading in range(HEADINGS):
        assert not grid.tyre_lifts(heading).any()
        max_memory = max(max_memory, grid.memory)
    assert 2e8 < max_memory <= 256 * 2**20
    assert grid.memory < max_memory


@pytest.mark.parametrize("yaw", [0.0, 0.3, np.pi / 4])
@pytest.mark.parametrize("width", [0.05, 0.1, 0.15])
def test_a_crack_that_wheels_bridge_is_no_slope(width: float, yaw: float) -> None:
    def crack(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where(np.abs((x - 9.0) * np.cos(yaw) + y * np.sin(yaw)) < 0.49 * width, -0.5, 0.0)

    ground = ground_map(crack, resolution=0.05, x=(-3.0, 25.0))
    profile = profile_of(BASE, ground, straight(18.0), spacing=0.05)
    assert np.abs(np.degrees(profile.grade)).max() < 1.0 + 0.5 * (width > 0.1)
    assert np.abs(np.degrees(profile.roll)).max() < 1.0 + 0.5 * (width > 0.1)
    assert profile.station[-1, 0] - profile.station[0, 0] < 18.02
    assert plan_one(ATV, replace(ground, height_std=0.0), straight(18.0)).status is Status.OK


@pytest.mark.parametrize("turn", [0.1, 0.2, -0.2])
def test_a_kink_is_as_sharp_on_coarse_cells_as_on_fine_ones(turn: float) -> None:
    curvature = {}
    for resolution in (0.05, 0.25):
        ground = ground_map(
            lambda x, y: np.tan(turn) * np.maximum(x - 9.0, 0.0),
            resolution=resolution,
            x=(-3.0, 25.0),
        )
        profile = profile_of(BASE, ground, straight(18.0), spacing=0.05)
        # Over a crest the facet of its cell is level: the wheel leaves it half a cell late.
        assert profile.grade.min() > min(turn, 0.0) - 0.018
        assert profile.grade.max() < max(turn, 0.0) + 1e-3
        curvature[resolution] = np.sort(profile.vertical_curvature[:, 0])
    for end in (0, -1):
        fine, coarse = curvature[0.05][end], curvature[0.25][end]
        assert coarse == pytest.approx(fine, rel=0.35, abs=0.02)


@pytest.mark.parametrize("name", ["atv", "husky", "ugv"])
@pytest.mark.parametrize("share", [0.5, 0.8])
def test_a_log_below_the_step_limit_is_driven_over(name: str, share: float) -> None:
    model = read_model(shipped_models()[name])
    height = share * model.vehicle.shape.max_step

    def log(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        radius = 0.5 * height
        under = np.abs(x - 9.0) < radius
        return np.where(under, radius + np.sqrt(np.maximum(radius**2 - (x - 9.0) ** 2, 0.0)), 0.0)

    for resolution in (0.05, 0.1):
        ground = replace(ground_map(log, resolution=resolution, x=(-3.0, 25.0)), height_std=0.0)
        (plan,) = CandidatePlanner(model).plan(ground, [straight(18.0)])
        assert plan.status is Status.OK, plan.reason


def test_on_planes_all_wheels_have_the_same_lift() -> None:
    """Slopes are exact to rounding in double precision, though lifts are in single."""
    ground = ground_map(lambda x, y: 250.0 + 0.2 * x - 0.1 * y, resolution=0.1, x=(-3.0, 25.0))
    profile = profile_of(BASE, ground, straight(18.0, heading=0.2), spacing=0.1)
    rise = 0.2 * np.cos(0.2) - 0.1 * np.sin(0.2)
    np.testing.assert_allclose(profile.grade, np.arctan(rise), atol=1e-7)
    np.testing.assert_allclose(profile.vertical_curvature, 0.0, atol=1e-6)
