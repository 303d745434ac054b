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
from tests.planner.swept.test_screen import MODELS, rough_ground

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
def test_all_blocks_under_poses_are_screened(seed: int, small: bool) -> None:
    """Middles, wheels, and everything of the body."""
    rng = np.random.default_rng(seed)
    vehicle = MODELS[small].vehicle
    resolution = float(rng.choice([0.05, 0.1, 0.25, 1.0]))
    scene = ElevationMap(
        elevation=np.zeros(rng.integers(5, 400, 2)),
        resolution=resolution,
        origin=(float(rng.uniform(-50.0, 50.0)), 3.0),
    )
    sizes = swept_sizes(vehicle, resolution)
    n, m = rng.integers(1, 30), rng.integers(1, 5)
    extent = rng.uniform(-0.2, 1.2, (n, m, 2)) * scene.elevation.shape * resolution
    x, y = extent[..., 1] + scene.origin[0], extent[..., 0] + scene.origin[1]
    screened = screen_of(scene, sizes, around(scene, sizes, x, y))
    screen, blocks = screened.screen, screened_blocks(screened)
    for angle in np.linspace(0.0, 2.0 * np.pi, 12):
        for reach in (0.0, sizes.wheel_reach, sizes.reach):
            u = (x + reach * np.cos(angle) - screen.origin_x) * screen.per_metre
            v = (y + reach * np.sin(angle) - screen.origin_y) * screen.per_metre
            row = np.clip(v, 0.0, blocks.shape[0] - 1.0).astype(int)
            column = np.clip(u, 0.0, blocks.shape[1] - 1.0).astype(int)
            assert blocks[row, column].all()


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


@given(seed=st.integers(0, 2**32 - 1))
def test_one_part_holds_another_if_it_holds_each_of_its_blocks(seed: int) -> None:
    rng = np.random.default_rng(seed)

    def random_window() -> Around:
        top, left = rng.integers(0, 4, 2)
        rows, columns = rng.integers(1, 9, 2)
        first = rng.integers(0, columns, rows)
        ends = np.minimum(first + rng.integers(0, columns + 1, rows), columns)
        return Around((top, top + rows, left, left + columns), first, ends)

    def blocks(part: Around) -> set[tuple[int, int]]:
        top, _, left, _ = part.window
        spans = zip(part.first, part.ends, strict=True)
        return {(top + r, left + c) for r, (a, b) in enumerate(spans) for c in range(a, b)}

    outer, second = random_window(), random_window()
    window, inner = outer.window, second.window
    inside = window[0] <= inner[0] and inner[1] <= window[1]
    inside = inside and window[2] <= inner[2] and inner[3] <= window[3]
    assert outer.holds(second) == (inside and blocks(second) <= blocks(outer))
    shared = outer.within(second)
    assert blocks(shared) == blocks(outer) & blocks(second)
    assert np.all(shared.first >= second.first)
    assert np.all(shared.ends <= second.ends)
