"""A screen around candidates knows there what the whole screen knows, and clears nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.swept.around import Around, around
from slopewise.planner.swept.screen import Judged, Screen, screen_of
from slopewise.planner.swept.sizes import SweptSizes, swept_sizes
from slopewise.planner.swept.verdicts import BODY, UNSEEN
from tests.world.hazards import MODELS, rough_ground

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
