"""Heights on a grid."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.planner.ground.terrain_profile import terrain_profile
from tests.world.vehicles import BASE


def height(ground: ElevationMap, x: float, y: float) -> float:
    """Height at a point, from which a path leads to the middle of the map."""
    x_min, x_max, y_min, y_max = ground.extent
    share = 1e-9 * np.arange(3.0)[:, None]
    middle = 0.5 * (x_min + x_max), 0.5 * (y_min + y_max)
    path = [start + share * (end - start) for start, end in zip((x, y), middle, strict=True)]
    return float(terrain_profile(ground, *path, np.array([3]), BASE.vehicle).z[0, 0])


def test_row_0_is_at_minimum_y_and_column_0_at_minimum_x() -> None:
    elevation = np.array([[1.0, 2.0, 3.0], [10.0, 20.0, 30.0]])
    ground = ElevationMap(elevation=elevation, resolution=0.5, origin=(100.0, 50.0))
    assert ground.extent == (100.0, 101.0, 50.0, 50.5)
    assert height(ground, 100.0, 50.0) == pytest.approx(1.0)
    assert height(ground, 101.0, 50.0) == pytest.approx(3.0)
    assert height(ground, 100.0, 50.5) == pytest.approx(10.0)
    assert height(ground, 101.0, 50.5) == pytest.approx(30.0)
    assert height(ground, 100.25, 50.25) == pytest.approx((1.0 + 2.0 + 10.0 + 20.0) / 4.0)


def test_maps_cannot_be_changed_afterwards() -> None:
    ground = ElevationMap(elevation=np.ones((3, 3)), resolution=1.0, origin=(0.0, 0.0))
    with pytest.raises(ValueError, match="read-only"):
        ground.elevation[0, 0] = 2.0


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"elevation": np.ones(4)}, "elevation"),
        ({"elevation": np.ones((1, 4))}, "elevation"),
        ({"elevation": np.full((3, 3), np.nan)}, "elevation"),
        ({"elevation": np.full((3, 3), np.inf)}, "elevation"),
        ({"elevation": np.array([[1.0, 2.0], [3.0, -1e300]])}, "elevation[1, 1]"),
        ({"height_std": 1e300}, "height_std"),
        ({"resolution": 1e300}, "resolution"),
        ({"origin": (0.0, 1e300)}, "origin"),
        ({"resolution": 0.0}, "resolution"),
        ({"resolution": -1.0}, "resolution"),
        ({"resolution": np.nan}, "resolution"),
        ({"origin": (0.0, np.inf)}, "origin"),
        ({"terrain_class": np.zeros((2, 3), int)}, "terrain_class"),
        ({"terrain_class": np.full((3, 3), 1)}, "terrain_class"),
        ({"terrain_class": np.full((3, 3), -1)}, "terrain_class"),
        ({"class_names": ("",) * 64}, "class_names"),
    ],
)
def test_malformed_maps_name_what_is_wrong(changes: dict[str, Any], field: str) -> None:
    values = {"elevation": np.ones((3, 3)), "resolution": 1.0, "origin": (0.0, 0.0)} | changes
    with pytest.raises(ParameterError) as caught:
        ElevationMap(**values)
    assert caught.value.field == field
