from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from slopewise.models.quantity import Matrix
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.planner.ground.hull_speed import lines
from tests.models.driven_hull import highest_speed
from tests.models.models_for_tests import BASE

HULL: Matrix = ((-0.26, 1.5), (-0.1, 3.0), (0.1, 4.0), (0.26, 3.5))


def with_hull(hull: Matrix | None, **further: object) -> Braking:
    return dataclasses.replace(BASE.braking, speed_by_grade=hull, **further)  # type: ignore[arg-type]


def test_the_lowest_of_the_lines_is_the_speed_between_the_corners() -> None:
    grade = np.linspace(-0.26, 0.26, 101)
    intercept, slope = lines(HULL).T
    lowest = np.min(intercept + slope * grade[:, None], axis=1)
    np.testing.assert_allclose(lowest, highest_speed(HULL, grade), atol=1e-12)


@pytest.mark.parametrize(
    ("hull", "message"),
    [
        (((0.0, 1.0),), "2 … 24 pairs"),
        (((0.0, 1.0, 2.0), (0.1, 1.0, 2.0)), "pairs of grade and speed"),
        (((0.0, 1.0), (0.0, 2.0)), "grades that increase"),
        (((0.0, np.nan), (0.1, 2.0)), "finite grades"),
        (((0.0, -1.0), (0.1, 2.0)), "speeds >= 0"),
        (((-0.1, 3.0), (0.0, 1.0), (0.1, 3.0)), "concave over the grade"),
    ],
)
def test_what_is_no_hull_is_refused(hull: Matrix, message: str) -> None:
    with pytest.raises(ParameterError, match=message) as caught:
        with_hull(hull)
    assert caught.value.field == "speed_by_grade"


def test_a_surface_with_ranges_of_its_own_has_no_hull_of_the_base() -> None:
    tables = {
        "ice": SurfaceBraking(speed_range=(0.5, 2.0)),
        "mud": SurfaceBraking(b_b=0.3),
        "sand": SurfaceBraking(speed_range=(0.5, 2.0), speed_by_grade=((-0.1, 1.0), (0.1, 2.0))),
    }
    braking = with_hull(HULL, terrain=tables)
    assert braking.on("ice").speed_by_grade is None
    assert braking.on("mud").speed_by_grade == HULL
    assert braking.on("sand").speed_by_grade == ((-0.1, 1.0), (0.1, 2.0))
