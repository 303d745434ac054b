"""The broad phase never clears a pose that an exact check blocks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import InputErrors
from slopewise.models.parameters import Model
from slopewise.models.vehicle import Vehicle
from slopewise.planner.compiled_core import core
from slopewise.planner.swept import hazards, sweeper
from slopewise.planner.swept.hazards import swept_hazards
from slopewise.planner.swept.sizes import SweptSizes, swept_sizes
from slopewise.planner.swept.sweeper import BandWidth, broad_phase_for
from tests.world.hazards import MODELS, Met, ground, met_by, rough_ground
from tests.world.stages import profile_of


def all_suspect(
    scene: ElevationMap, sizes: SweptSizes, band: BandWidth | None, x: np.ndarray, y: np.ndarray
) -> core.BroadPhase:
    """A broad phase that clears nothing."""
    at = scene.elevation, *scene.origin, scene.resolution
    grid = core.BroadPhase(*at, sizes, band, x, y, 0.0)
    grid.suspect_all()
    return grid


def widened(
    scene: ElevationMap, sizes: SweptSizes, band: BandWidth, x: np.ndarray, y: np.ndarray
) -> core.BroadPhase:
    """A broad phase of a shorter vehicle closer to its line, or exactly on it, for another one."""
    at = scene.elevation, *scene.origin, scene.resolution
    shorter = sizes._replace(front=sizes.front - 0.1, rear=sizes.rear - 0.1)
    narrower = None if x.shape[0] % 2 else band._replace(widest=0.5 * band.widest)
    return core.BroadPhase(*at, shorter, narrower, x, y, 0.2).widened(sizes, band)


BAND = InputErrors(cross_track=0.2, heading=0.03)


# A wheel off the middle of its block lifts two wheels together, by 0.2 mm above the travel.
@example(seed=9488, small=True, resolution=0.08, errors=InputErrors())
@given(
    seed=st.integers(0, 2**32 - 1),
    small=st.booleans(),
    resolution=st.sampled_from([0.05, 0.08, 0.1, 0.2, 0.5]),
    errors=st.sampled_from([InputErrors(), BAND]),
)
def test_it_clears_no_blocked_station(
    seed: int, small: bool, resolution: float, errors: InputErrors
) -> None:
    model = MODELS[small]
    rng = np.random.default_rng(seed)
    scene = rough_ground(seed, resolution, model.vehicle.wheel_radius)
    start, end = rng.uniform((1.0, 1.2), (3.0, 4.8)), rng.uniform((9.0, 1.2), (11.0, 4.8))
    middle = 0.5 * (start + end) + rng.uniform(-0.5, 0.5, 2)
    path = CandidatePath("drawn", np.array([start, middle, end]))
    profile = profile_of(model, scene, path, spacing=resolution)
    screened = Met(swept_hazards(scene, profile, model, errors=errors), profile)
    searched = searched_everywhere(scene, screened, model, errors, swept_sizes)
    beyond = searched_everywhere(scene, screened, model, errors, _only_what_is_not_cleared)
    wider = screened
    if errors is BAND:
        wider = searched_everywhere(scene, screened, model, errors, swept_sizes, widened)
    for met in (screened, wider):
        assert first_blocked(searched) <= first_blocked(met) <= first_blocked(beyond), met.reason
    if first_blocked(screened) == first_blocked(searched):
        assert screened.hazards.searched <= searched.hazards.searched


def _only_what_is_not_cleared(vehicle: Vehicle, resolution: float) -> SweptSizes:
    sizes = swept_sizes(vehicle, resolution)
    slope_margin = core.SLOPE_MARGIN * sizes.chord
    return sizes._replace(steepest=max(sizes.steepest, sizes.cleared + slope_margin))


def searched_everywhere(
    scene: ElevationMap,
    met: Met,
    model: Model,
    errors: InputErrors,
    sizes: object,
    broad_phase: object = all_suspect,
) -> Met:
    """Hazards without a broad phase, or with this one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sweeper, "broad_phase_for", broad_phase)
        patch.setattr(hazards, "swept_sizes", sizes)
        return Met(swept_hazards(scene, met.profile, model, errors=errors), met.profile)


@pytest.mark.parametrize("resolution", [0.05, 0.1, 0.2])
def test_wheels_that_travel_little_hang_where_an_exact_check_says(resolution: float) -> None:
    def sizes(vehicle: Vehicle, resolution: float) -> SweptSizes:
        """Nothing but wheels that hang blocks."""
        ample = {"steepest": 9.0, "cleared": 8.0, "clearance": 9.0}
        return swept_sizes(vehicle, resolution)._replace(wheel_travel=0.03, **ample)

    hanging = cleared = 0
    for seed in range(40):
        model, errors = MODELS[seed % 2], InputErrors()
        scene = rough_ground(seed, resolution, model.vehicle.wheel_radius)
        path = CandidatePath("drawn", np.array([[1.5, 2.0], [6.0, 3.3], [10.0, 3.0]]))
        profile = profile_of(model, scene, path, spacing=resolution)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(hazards, "swept_sizes", sizes)
            bounded = Met(swept_hazards(scene, profile, model, errors=errors), profile)
        exact = searched_everywhere(scene, bounded, model, errors, sizes)
        assert (bounded.station, bounded.reason) == (exact.station, exact.reason)
        hanging += exact.bar > 0
        cleared += exact.hazards.searched - bounded.hazards.searched
    assert hanging > 10
    assert cleared > 100


@pytest.mark.parametrize("resolution", [0.1, 0.2])
def test_what_a_candidate_meets_does_not_depend_on_the_others(resolution: float) -> None:
    turns = np.linspace(-1.6, 1.6, 11)
    paths = [
        CandidatePath(str(end), np.array([[1.5, 3.0], [5.0, 3.0], [8.0 + 0.13 * end, 3.0 + end]]))
        for end in turns
    ]
    blocked = slowed = 0
    for seed in range(12):
        model, errors = MODELS[0], BAND if seed % 3 else InputErrors()
        scene = rough_ground(seed, resolution, model.vehicle.wheel_radius)
        profile = profile_of(model, scene, *paths)
        together = swept_hazards(scene, profile, model, errors=errors)
        for j, path in enumerate(paths):
            line = profile_of(model, scene, path)
            alone, n = swept_hazards(scene, line, model, errors=errors), len(line.x)
            np.testing.assert_array_equal(together.code[:n, j], alone.code[:, 0])
            rough = alone.rough_speed[:, 0]
            np.testing.assert_array_equal(together.rough_speed[:n, j], rough)
            k = int(np.argmax(alone.code[:, 0] > 0))
            assert together.obstacle(j, k) == alone.obstacle(0, k)
            blocked, slowed = blocked + (k > 0), slowed + bool(np.isfinite(rough).any())
    assert blocked > 20
    assert slowed > 20


def first_blocked(met: Met) -> int:
    return met.station if met.station >= 0 else len(met.profile.x)


def test_smooth_ground_needs_no_exact_check() -> None:
    hills = ground(lambda x, y: 0.18 * np.sin(0.5 * x) + 0.12 * np.cos(0.6 * y))
    path = CandidatePath("straight", np.array([[0.0, 0.0], [20.0, 0.5]]))
    assert met_by(hills, path, MODELS[0]).hazards.searched == 0


def test_a_screen_is_made_once_for_a_map_and_a_vehicle() -> None:
    scene, vehicle = ground(lambda x, y: 0.0 * x), MODELS[0].vehicle
    sizes, x = swept_sizes(vehicle, scene.resolution), np.zeros((3, 2))
    first = broad_phase_for(scene, sizes, None, x, x)
    same = swept_sizes(replace(vehicle), scene.resolution)
    assert broad_phase_for(scene, same, None, x, x) is first
    low_vehicle: Vehicle = replace(vehicle, ground_clearance=0.1)
    low = swept_sizes(low_vehicle, scene.resolution)
    assert broad_phase_for(scene, low, None, x, x) is not first
    assert broad_phase_for(scene, sizes, BandWidth(0.1, 0.0, 0.0), x, x) is not first


def test_a_large_map_is_screened_around_the_candidates() -> None:
    scene = ElevationMap(elevation=np.zeros((600, 600)), resolution=0.1, origin=(0.0, 0.0))
    vehicle = MODELS[0].vehicle
    sizes = swept_sizes(vehicle, scene.resolution)
    x, y = np.array([[20.0], [30.0]]), np.array([[20.0], [25.0]])
    screen = broad_phase_for(scene, sizes, None, x, y)
    assert broad_phase_for(scene, sizes, None, x[:1] + 0.01, y[:1]) is screen
    further = broad_phase_for(scene, sizes, None, x + 15.0, y)
    assert further is not screen
    assert broad_phase_for(scene, sizes, None, x + 15.3, y + 0.2) is further
