"""Forces and bounds in the core: codes and fields that Python shares, and random problems."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

from slopewise.planner.bounds.speed_bounds import speed_bounds
from slopewise.planner.limiting import Limiting
from tests.world.compilers import CORE
from tests.world.ground import ground_map, plane, straight
from tests.world.stages import bounds_of
from tests.world.vehicles import BASE, model_of, tables_with


def test_codes_of_bounds_are_those_of_python() -> None:
    codes = re.findall(r"Label (\w+) = (\d+);", (CORE / "bounds" / "limiting.hpp").read_text())
    assert len(codes) > 10
    assert {name.upper(): int(code) for name, code in codes}.items() <= {
        label.name: label.value for label in Limiting
    }.items()


def test_a_batch_is_bounded_as_its_candidates_are_alone() -> None:
    model = model_of(tables_with(braking={"sliding_friction": 0.5}))
    hills = ground_map(lambda x, y: 0.3 * np.sin(x / 2.0) + 0.1 * np.cos(y + x))
    lines = [straight(length) for length in np.linspace(4.0, 18.0, 70)]
    _, _, together = bounds_of(model, hills, *lines)
    for j in (0, 1, 63, 64, 69):
        profile, _, alone = bounds_of(model, hills, lines[j])
        n = profile.count[0]
        np.testing.assert_allclose(
            together.speed_sq_max[:n, j], alone.speed_sq_max[:n, 0], rtol=1e-12
        )
        np.testing.assert_array_equal(together.limiting[:n, j], alone.limiting[:n, 0])
        assert together.clear_distance[j] == alone.clear_distance[0]


def test_arrays_that_do_not_fit_are_named() -> None:
    profile, ground, _ = bounds_of(BASE, plane(0.0))
    with pytest.raises(ValueError, match="clear: expected 1 along axis 0, got 2"):
        speed_bounds(profile, ground, BASE, np.ones(2))
    short = dataclasses.replace(ground, fastest=ground.fastest[:-1])
    with pytest.raises(ValueError, match=r"fastest: expected \d+ along axis 0"):
        speed_bounds(profile, short, BASE, np.ones(1))
    strided = dataclasses.replace(profile, grade=np.repeat(profile.grade, 2, axis=1)[:, ::2])
    with pytest.raises(TypeError, match="grade: expected a contiguous"):
        speed_bounds(strided, ground, BASE, np.ones(1))
