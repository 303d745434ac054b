"""Heights on a grid, and their means over a wheel."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from slopewise.models.arrays import Floats
from slopewise.models.averaging_windows import averaging_windows
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.planner.ground.averaged_map import averaged_map
from slopewise.planner.ground.terrain_profile import terrain_profile
from slopewise.services.check.averaged_heights import averaged
from tests.world.vehicles import BASE

RADIUS = 0.28


def map_of(
    elevation: Floats, std: float = 0.02, cell: float = 0.1, length: float = 0.0
) -> ElevationMap:
    return ElevationMap(
        elevation=elevation,
        resolution=cell,
        origin=(5e5, 5e6),
        height_std=std,
        correlation_length=length,
    )


def relief(rng: np.random.Generator, rows: int, columns: int) -> Floats:
    """Noise on a slope with a step, a part of it unknown."""
    i, j = np.mgrid[:rows, :columns]
    z: Floats = rng.normal(0.0, 0.02, (rows, columns)) + 0.01 * j + 0.15 * (i > 0.4 * rows)
    z[rng.random(z.shape) < rng.choice([0.0, 0.05, 0.2, 0.5])] = np.nan
    z[0, 0] = 0.0
    return z


@pytest.mark.parametrize(
    "seed", [*range(6), *(pytest.param(n, marks=pytest.mark.nightly) for n in range(6, 100))]
)
def test_checker_has_the_same_heights(seed: int) -> None:
    rng = np.random.default_rng(seed)
    z = relief(rng, *(rng.integers(2, 7, 2) if seed % 3 == 0 else rng.integers(20, 50, 2)))
    z = np.round(z, 2) if seed % 5 == 0 else z + rng.choice([0.0, 2000.0])
    cell = float(rng.choice([0.01, 0.05, 0.1, 0.25]))
    given = map_of(z, float(rng.choice([0.005, 0.02, 1.0])), cell, float(rng.choice([0.0, 0.2])))
    heights = averaged_map(given, RADIUS).elevation
    np.testing.assert_array_equal(np.isnan(heights), np.isnan(z))
    np.testing.assert_allclose(averaged(given, RADIUS).elevation, heights, rtol=0.0, atol=1e-6)


def test_rows_of_known_cells_have_no_plane() -> None:
    """The checker ended with a singular matrix."""
    z = np.full((30, 30), np.nan)
    z[15] = np.random.default_rng(8).normal(0.0, 0.02, 30)
    for elevation in (z, z.T):
        given = map_of(elevation)
        heights = averaged_map(given, RADIUS).elevation
        np.testing.assert_allclose(averaged(given, RADIUS).elevation, heights, atol=1e-6)


@pytest.mark.parametrize("cell", [0.05, 0.1, 0.25])
@pytest.mark.parametrize("slope", [0.3, 1.0])
def test_plane_stays_a_plane_to_its_corners(cell: float, slope: float) -> None:
    """A corner knows a quarter of a disc: without its slope it was up to 5 cm off."""
    i, j = np.mgrid[:40, :50]
    z = 2000.0 + slope * cell * j - 0.2 * cell * i
    z[10:13, 20] = np.nan
    heights = averaged_map(map_of(z, cell=cell), RADIUS).elevation
    np.testing.assert_allclose(heights, z, rtol=0.0, atol=1e-5)


@pytest.mark.parametrize(("cell", "length"), [(0.05, 0.0), (0.1, 0.0), (0.25, 0.0), (0.1, 0.2)])
def test_noise_is_reduced_as_the_window_says(cell: float, length: float) -> None:
    from scipy import ndimage

    z = np.random.default_rng(1).standard_normal((400, 400))
    if length > 0.0:
        z = ndimage.gaussian_filter(z, length / cell / np.sqrt(2.0), mode="wrap")
    heights = averaged_map(map_of(0.02 * z / z.std(), cell=cell, length=length), RADIUS).elevation
    variance = averaging_windows(cell, RADIUS, length).variance[-1]
    assert np.std(heights[20:-20, 20:-20]) == pytest.approx(0.02 * np.sqrt(variance), rel=0.1)


@pytest.mark.parametrize("std", [0.01, 0.02])
def test_step_of_ten_std_keeps_its_height(std: float) -> None:
    z = np.random.default_rng(2).normal(0.0, std, (60, 60))
    z[:, 30:] += 10.0 * std
    heights = averaged_map(map_of(z, std), RADIUS).elevation
    rise = heights[5:-5, 30] - heights[5:-5, 29]
    assert np.mean(rise) == pytest.approx(10.0 * std, rel=0.1)
    assert np.std(rise) < np.sqrt(2.0) * std


@pytest.mark.parametrize("share", [0.0, 0.05, 0.2])
@pytest.mark.parametrize("cell", [0.05, 0.1, 0.25])
def test_post_keeps_its_height(cell: float, share: float) -> None:
    """A cell alone is little scatter in a large disc, which once hid it; next to holes as well."""
    rng = np.random.default_rng(3)
    z = rng.normal(0.0, 0.02, (80, 80))
    z[rng.random(z.shape) < share] = np.nan
    z[8:-8:9, 8:-8:9] = 0.2
    heights = averaged_map(map_of(z, cell=cell), RADIUS).elevation
    np.testing.assert_allclose(heights[8:-8:9, 8:-8:9], 0.2, rtol=0.0, atol=1e-6)


def test_exact_maps_and_coarse_ones_are_the_same_objects() -> None:
    z = np.random.default_rng(4).normal(0.0, 0.02, (30, 30))
    for given in (map_of(z, std=0.0), map_of(z, std=1e-3), map_of(z, cell=0.3)):
        assert averaged_map(given, RADIUS) is given


def test_result_is_reused_and_not_averaged_again() -> None:
    given = map_of(np.random.default_rng(5).normal(0.0, 0.02, (30, 30)))
    heights = averaged_map(given, RADIUS)
    assert averaged_map(given, RADIUS) is heights
    assert averaged_map(heights, RADIUS) is heights
    assert averaged_map(given, 0.4) is not heights


def test_threads_get_the_map_they_ask_for() -> None:
    rng = np.random.default_rng(6)
    maps = [map_of(rng.normal(n, 0.02, (20, 20))) for n in range(12)]

    def level(n: int) -> float:
        return float(np.mean(averaged_map(maps[n], RADIUS).elevation))

    with ThreadPoolExecutor(4) as pool:
        asked = [n % 12 for n in range(240)]
        np.testing.assert_allclose(list(pool.map(level, asked)), asked, atol=0.05)


@pytest.mark.parametrize(
    ("cells", "cell", "length", "unknown"),
    [(400, 0.05, 0.0, 0.1), (300, 0.005, 0.0, 0.0), (200, 0.02, 1.0, 0.0), (60, 0.1, 1e6, 0.0)],
)
def test_time_is_bounded(cells: int, cell: float, length: float, unknown: float) -> None:
    """Sparse maps and tiny cells once took a minute; a stated length had no limit."""
    rng = np.random.default_rng(7)
    z = rng.normal(0.0, 0.02, (cells, cells))
    z[rng.random(z.shape) < unknown] = np.nan
    start = time.process_time()
    averaged_map(map_of(z, cell=cell, length=length), RADIUS)
    assert time.process_time() - start < 4.0


@pytest.mark.parametrize(
    "seed", [*range(3), *(pytest.param(n, marks=pytest.mark.nightly) for n in range(3, 8))]
)
def test_a_patch_is_averaged_as_on_a_new_map(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cell, length = float(rng.choice([0.02, 0.05, 0.1])), float(rng.choice([0.0, 0.15]))
    before = relief(rng, *rng.integers(60, 160, 2))
    after = before.copy()
    row, column = rng.integers(0, 60, 2)
    part = after[row : row + 12, column : column + 9]
    part[:] = np.where(rng.random(part.shape) < 0.2, np.nan, 1.0 - part)
    averaged_map(map_of(before, cell=cell, length=length), RADIUS)
    patched = averaged_map(map_of(after, cell=cell, length=length), RADIUS).elevation
    averaged_map(map_of(np.zeros((3, 3))), RADIUS)
    new = averaged_map(map_of(after, cell=cell, length=length), RADIUS).elevation
    np.testing.assert_allclose(patched, new, rtol=0.0, atol=1e-6)


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
