"""A screen around candidates knows there what the whole screen knows, and clears nothing else.

The screen of a map never clears a pose that a close look bars.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.vehicle import Vehicle
from slopewise.planner.swept import hazards
from slopewise.planner.swept.around import Around, around
from slopewise.planner.swept.screen import Judged, Screen, screen_of
from slopewise.planner.swept.screen_cache import screen_for
from slopewise.planner.swept.sizes import SweptSizes, swept_sizes
from slopewise.planner.swept.verdicts import BODY, UNSEEN
from slopewise.planner.swept.wheel_sweep import SLOPE_OPEN
from tests.world.hazards import MODELS, Met, ground, met_by, rough_ground

PARTS = ("bits", "relief", "lift", "east", "north", "seen")


def complete(scene: ElevationMap, sizes: SweptSizes) -> Judged:
    """A complete map."""
    x = np.array([[-1e3, 1e3]])
    everything = around(scene, sizes, x, x, beside=1.0)
    rows, columns = everything.window[1], everything.window[3]
    everything = Around((0, rows, 0, columns), np.zeros(rows, int), np.full(rows, columns))
    return screen_of(scene, sizes, everything)


def screened_blocks(screened: Judged) -> np.ndarray:
    column = np.arange(screened.screen.bits.shape[1])
    first, ends = (at[:, None] for at in (screened.around.first, screened.around.ends))
    return (first <= column) & (column < ends)


def like_the_whole(screened: Judged, all_of_it: Screen) -> None:
    top, end, left, right = screened.around.window
    blocks = screened_blocks(screened)
    for name in PARTS:
        ours, theirs = getattr(screened.screen, name), getattr(all_of_it, name)[top:end, left:right]
        np.testing.assert_allclose(ours[blocks], theirs[blocks], atol=2e-6, err_msg=name)


@pytest.mark.parametrize("resolution", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("seed", range(6))
def test_it_screens_the_ground_around_the_candidates_and_nothing_else(
    seed: int, resolution: float
) -> None:
    vehicle = MODELS[seed % 2].vehicle
    scene = rough_ground(seed, resolution, vehicle.wheel_radius)
    sizes = swept_sizes(vehicle, resolution)
    x = np.linspace(2.0, 9.0, 40)[:, None]
    y = 1.5 + np.linspace(0.0, 0.6, 40)[:, None] * np.array([0.0, seed])
    screened = screen_of(scene, sizes, around(scene, sizes, x, y))
    like_the_whole(screened, complete(scene, sizes).screen)
    blocks, screen = screened_blocks(screened), screened.screen
    assert np.all(screen.bits[~blocks] == UNSEEN | BODY)
    assert np.all(np.isinf(screen.relief[~blocks]) & np.isinf(screen.lift[~blocks]))
    assert not np.any(screen.seen[~blocks])
    assert not blocks.all()


@given(seed=st.integers(0, 2**32 - 1), small=st.booleans())
def test_what_is_known_already_is_taken_over_as_it_is(seed: int, small: bool) -> None:
    rng = np.random.default_rng(seed)
    vehicle = MODELS[small].vehicle
    resolution = float(rng.choice([0.05, 0.1, 0.2]))
    scene = rough_ground(seed % 5, resolution, vehicle.wheel_radius)
    sizes = swept_sizes(vehicle, resolution)
    known = None
    for _ in range(4):
        x = rng.uniform(-1.0, 13.0, 2)[:, None] + np.linspace(0.0, rng.uniform(0.0, 3.0), 9)
        y = rng.uniform(-1.0, 7.0, 2)[:, None] + np.linspace(0.0, rng.uniform(-3.0, 3.0), 9)
        expected = around(scene, sizes, x, y, float(rng.choice([0.0, 0.1])))
        known = screen_of(scene, sizes, expected, known)
        assert known.around.holds(around(scene, sizes, x[:, :4], y[:, :4]))
        like_the_whole(known, complete(scene, sizes).screen)


def all_suspect(screen: Screen) -> Screen:
    return screen._replace(
        bits=np.full_like(screen.bits, UNSEEN | BODY),
        relief=np.full_like(screen.relief, np.inf),
        lift=np.full_like(screen.lift, np.inf),
        seen=np.zeros_like(screen.seen),
    )


# A wheel off the middle of its block lifts two wheels together, by 0.2 mm above the travel.
@example(seed=9488, small=True, resolution=0.08)
@given(
    seed=st.integers(0, 2**32 - 1),
    small=st.booleans(),
    resolution=st.sampled_from([0.05, 0.08, 0.1, 0.2, 0.5]),
)
def test_it_clears_no_blocked_station(seed: int, small: bool, resolution: float) -> None:
    model = MODELS[small]
    rng = np.random.default_rng(seed)
    scene = rough_ground(seed, resolution, model.vehicle.wheel_radius)
    start, end = rng.uniform((1.0, 1.2), (3.0, 4.8)), rng.uniform((9.0, 1.2), (11.0, 4.8))
    middle = 0.5 * (start + end) + rng.uniform(-0.5, 0.5, 2)
    path = CandidatePath("drawn", np.array([start, middle, end]))
    screened = met_by(scene, path, model)
    searched = searched_everywhere(scene, path, model)
    beyond = searched_everywhere(scene, path, model, _only_what_is_not_cleared)
    assert first_blocked(searched) <= first_blocked(screened) <= first_blocked(beyond), (
        beyond.reason
    )
    if first_blocked(screened) == first_blocked(searched):
        assert screened.hazards.looked <= searched.hazards.looked


def _only_what_is_not_cleared(sizes: SweptSizes) -> SweptSizes:
    slope_margin = SLOPE_OPEN * sizes.chord
    return sizes._replace(steepest=max(sizes.steepest, sizes.cleared + slope_margin))


def searched_everywhere(
    scene: ElevationMap,
    path: CandidatePath,
    model: Model,
    changed: Callable[[SweptSizes], SweptSizes] = lambda sizes: sizes,
) -> Met:
    """Hazards without a broad phase."""
    with pytest.MonkeyPatch.context() as patch:
        screen = hazards.screen_for
        patch.setattr(hazards, "screen_for", lambda *args: all_suspect(screen(*args)))
        patch.setattr(hazards, "swept_sizes", lambda *args: changed(swept_sizes(*args)))
        return met_by(scene, path, model)


def first_blocked(met: Met) -> int:
    return met.station if met.station >= 0 else len(met.profile.x)


def test_smooth_ground_needs_no_exact_check() -> None:
    hills = ground(lambda x, y: 0.18 * np.sin(0.5 * x) + 0.12 * np.cos(0.6 * y))
    path = CandidatePath("straight", np.array([[0.0, 0.0], [20.0, 0.5]]))
    assert met_by(hills, path, MODELS[0]).hazards.looked == 0


def test_a_screen_is_made_once_for_a_map_and_a_vehicle() -> None:
    scene, vehicle = ground(lambda x, y: 0.0 * x), MODELS[0].vehicle
    sizes, x = swept_sizes(vehicle, scene.resolution), np.zeros((3, 2))
    first = screen_for(scene, sizes, x, x)
    assert screen_for(scene, swept_sizes(replace(vehicle), scene.resolution), x, x) is first
    low_vehicle: Vehicle = replace(vehicle, ground_clearance=0.1)
    assert screen_for(scene, swept_sizes(low_vehicle, scene.resolution), x, x) is not first


def test_a_large_map_is_screened_around_the_candidates() -> None:
    scene = ElevationMap(elevation=np.zeros((600, 600)), resolution=0.1, origin=(0.0, 0.0))
    vehicle = MODELS[0].vehicle
    sizes = swept_sizes(vehicle, scene.resolution)
    x, y = np.array([[20.0], [30.0]]), np.array([[20.0], [25.0]])
    screen = screen_for(scene, sizes, x, y)
    assert screen.bits.size < 0.1 * scene.elevation.size
    assert screen_for(scene, sizes, x[:1] + 0.01, y[:1]) is screen
    further = screen_for(scene, sizes, x + 15.0, y)
    assert further is not screen
    assert screen_for(scene, sizes, x + 15.3, y + 0.2) is further
