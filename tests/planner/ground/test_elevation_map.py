"""Heights on a grid."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.planner.ground.bilinear import height_at
from tests.planner.scenes import ground_map

slopes = st.floats(-1.0, 1.0)


def height(ground: ElevationMap, x: float, y: float) -> float:
    column = (x - ground.origin[0]) / ground.resolution
    row = (y - ground.origin[1]) / ground.resolution
    return height_at(ground.elevation, column, row)


@given(
    p=slopes,
    q=slopes,
    twist=slopes,
    u=st.floats(0.0, 1.0),
    v=st.floats(0.0, 1.0),
    resolution=st.sampled_from([0.1, 0.25, 1.0]),
)
def test_planes_and_twists_come_back_exactly_up_to_the_edges(
    p: float, q: float, twist: float, u: float, v: float, resolution: float
) -> None:
    def z(x: Any, y: Any) -> Any:
        return 3.0 + p * x + q * y + twist * x * y

    ground = ground_map(z, x=(-2.0, 3.0), y=(10.0, 14.0), resolution=resolution)
    x_min, x_max, y_min, y_max = ground.extent
    # Half-way inside a cell a bilinear surface equals x y only up to nothing: it is bilinear.
    x, y = x_min + u * (x_max - x_min), y_min + v * (y_max - y_min)
    assert height(ground, x, y) == pytest.approx(z(x, y), abs=1e-9)


def test_row_0_is_at_minimum_y_and_column_0_at_minimum_x() -> None:
    elevation = np.array([[1.0, 2.0, 3.0], [10.0, 20.0, 30.0]])
    ground = ElevationMap(elevation=elevation, resolution=0.5, origin=(100.0, 50.0))
    assert ground.extent == (100.0, 101.0, 50.0, 50.5)
    assert height(ground, 100.0, 50.0) == 1.0
    assert height(ground, 101.0, 50.0) == 3.0
    assert height(ground, 100.0, 50.5) == 10.0
    assert height(ground, 101.0, 50.5) == 30.0
    assert height(ground, 100.25, 50.25) == pytest.approx((1.0 + 2.0 + 10.0 + 20.0) / 4.0)


@pytest.mark.parametrize(
    ("column", "row"), [(-1e-9, 1.0), (1.0, -1e-9), (3.0 + 1e-9, 1.0), (1.0, 2.0 + 1e-9)]
)
def test_off_the_map_nothing_is_known(column: float, row: float) -> None:
    assert np.isnan(height_at(np.ones((3, 4)), column, row))
    inside = height_at(np.ones((3, 4)), np.clip(column, 0.0, 3.0), np.clip(row, 0.0, 2.0))
    assert inside == 1.0


def test_nan_coordinates_are_nowhere() -> None:
    assert np.isnan(height_at(np.ones((3, 4)), np.nan, 1.0))


@pytest.mark.parametrize(("column", "row"), [(1.5, 1.5), (2.5, 1.5), (1.5, 2.5), (2.99, 2.99)])
def test_one_unknown_cell_makes_its_four_squares_unknown(column: float, row: float) -> None:
    elevation = np.ones((5, 5))
    elevation[2, 2] = np.nan
    assert np.isnan(height_at(elevation, column, row))


@pytest.mark.parametrize(("column", "row"), [(0.99, 1.5), (3.01, 1.5), (1.5, 0.99), (1.5, 3.01)])
def test_and_no_square_farther_away(column: float, row: float) -> None:
    elevation = np.ones((5, 5))
    elevation[2, 2] = np.nan
    assert height_at(elevation, column, row) == 1.0


def test_infinite_heights_are_unknown() -> None:
    elevation = np.ones((3, 3))
    elevation[1, 1] = -np.inf
    ground = ElevationMap(elevation=elevation, resolution=1.0, origin=(0.0, 0.0))
    assert np.isnan(ground.elevation[1, 1])


def test_points_on_the_grid_are_on_the_grid() -> None:
    ground = ElevationMap(elevation=np.ones((3, 4)), resolution=0.5, origin=(1.0, 2.0))
    x = np.array([1.0, 2.5, 0.99, 2.51, 1.5, 1.5])
    y = np.array([2.0, 3.0, 2.5, 2.5, 1.99, 3.01])
    np.testing.assert_array_equal(ground.contains(x, y), [True, True, False, False, False, False])


def test_maps_cannot_be_changed_afterwards() -> None:
    classes = np.zeros((3, 3), np.int64)
    ground = ElevationMap(
        elevation=np.ones((3, 3)), resolution=1.0, origin=(0.0, 0.0), terrain_class=classes
    )
    assert ground.terrain_class is not None
    for array in (ground.elevation, ground.terrain_class):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 2


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"elevation": np.ones(4)}, "elevation"),
        ({"elevation": np.ones((1, 4))}, "elevation"),
        ({"elevation": np.full((3, 3), np.nan)}, "elevation"),
        ({"elevation": np.full((3, 3), np.inf)}, "elevation"),
        ({"resolution": 0.0}, "resolution"),
        ({"resolution": -1.0}, "resolution"),
        ({"resolution": np.nan}, "resolution"),
        ({"origin": (0.0, np.inf)}, "origin"),
        ({"terrain_class": np.zeros((2, 3), int)}, "terrain_class"),
        ({"terrain_class": np.full((3, 3), 1)}, "terrain_class"),
        ({"terrain_class": np.full((3, 3), -1)}, "terrain_class"),
    ],
)
def test_malformed_maps_name_what_is_wrong(changes: dict[str, Any], field: str) -> None:
    values = {"elevation": np.ones((3, 3)), "resolution": 1.0, "origin": (0.0, 0.0)} | changes
    with pytest.raises(ParameterError) as caught:
        ElevationMap(**values)
    assert caught.value.field == field
