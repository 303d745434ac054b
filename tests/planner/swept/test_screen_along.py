"""A screen along paths knows there what the whole screen knows, and clears nothing elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from planner.swept.screen import screen_of
from planner.swept.screen_along import blocks_around, screen_along
from planner.swept.sizes import swept_sizes
from planner.swept.verdicts import BODY, UNSEEN
from tests.planner.swept.test_screen import MODELS, rough_ground


@pytest.mark.parametrize("seed", range(12))
def test_it_judges_the_ground_along_the_path_and_nothing_else(seed: int) -> None:
    vehicle = MODELS[seed % 2].vehicle
    scene = rough_ground(seed, 0.1, vehicle.wheel_radius)
    sizes = swept_sizes(vehicle, 0.1)
    rows, columns = scene.elevation.shape
    window = (0, rows, 0, columns)
    x, y = np.linspace(2.0, 9.0, 40), np.linspace(1.5, 1.5 + seed / 6.0, 40)

    whole = screen_of(scene, sizes, window)
    along, judged = screen_along(scene, sizes, window, x, y)

    assert np.all(judged[blocks_around(along, sizes, x, y)])
    for name in ("bits", "relief", "lift", "east", "north", "seen"):
        ours, theirs = getattr(along, name)[judged], getattr(whole, name)[judged]
        np.testing.assert_array_equal(ours, theirs, err_msg=name)
    assert np.all(along.bits[~judged] == UNSEEN | BODY)
    assert np.all(np.isinf(along.relief[~judged]) & np.isinf(along.lift[~judged]))
    assert not np.any(along.seen[~judged])
    assert not judged.all()
