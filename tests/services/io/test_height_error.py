"""Height error of maps: reported ones by format, and the assumed one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio

from slopewise.services.io import height_error
from slopewise.services.io.geotiff import opened
from slopewise.services.io.map_file import read_map
from tests.services.faults import fault_in
from tests.services.io.test_map_file import HEIGHTS, UTM, geotiff, npz

RNG = np.random.default_rng(5)
STDS = RNG.uniform(0.01, 0.09, HEIGHTS.shape).astype(np.float32)
EXPECTED = float(np.quantile(STDS.astype(np.float64), 0.95))


def with_errors(path: Path, errors: np.ndarray, description: str | None, **profile: Any) -> Path:
    geotiff(path, np.stack((HEIGHTS, errors)), **profile)
    with rasterio.open(path, "r+") as dataset:
        dataset.set_band_description(2, description)
    return path


def test_what_is_assumed_grows_with_the_cell() -> None:
    assert height_error.assumed(0.1) == pytest.approx(0.025)
    assert height_error.assumed(1.0, surveyed=True) == pytest.approx(0.06)
    assert height_error.assumed(0.2) > height_error.assumed(0.1) > 0.0


def test_std_is_the_quantile_of_the_cells() -> None:
    stds = np.array([0.01] * 18 + [0.05, 0.3, np.nan, np.inf, -1.0])
    assert 0.01 < (height_error.one_for_all(stds) or 0.0) < 0.3
    assert height_error.one_for_all(np.array([np.nan])) is None


@pytest.mark.parametrize(("crs", "expected"), [(UTM, 0.05), (None, 0.045)])
def test_geotiff_without_errors(tmp_path: Path, crs: str | None, expected: float) -> None:
    assert read_map(geotiff(tmp_path / "m.tif", crs=crs)).height_std == pytest.approx(expected)
    unnamed = with_errors(tmp_path / "n.tif", STDS, None, crs=crs)
    assert read_map(unnamed).height_std == pytest.approx(expected)
    unnamed = with_errors(tmp_path / "o.tif", STDS, "slope", crs=crs)
    assert read_map(unnamed).height_std == pytest.approx(expected)


@pytest.mark.parametrize(
    "message", ["Std", "standard deviation [m]", "Uncertainty", "height error"]
)
def test_a_named_band_of_a_geotiff(tmp_path: Path, message: str) -> None:
    ground = read_map(with_errors(tmp_path / "m.tif", STDS, message))
    assert ground.height_std == pytest.approx(EXPECTED)
    np.testing.assert_array_equal(ground.elevation, HEIGHTS[::-1])


def test_a_variance_is_squared_metres(tmp_path: Path) -> None:
    path = with_errors(tmp_path / "m.tif", STDS**2, "Variance", nodata=-9.0)
    assert read_map(path).height_std == pytest.approx(EXPECTED, rel=1e-5)
    nothing = with_errors(tmp_path / "n.tif", np.full_like(STDS, -9.0), "variance", nodata=-9.0)
    assert read_map(nothing).height_std == pytest.approx(0.05)


def test_windows_of_a_file_have_one_error(tmp_path: Path) -> None:
    path = with_errors(tmp_path / "m.tif", STDS, "std")
    part = read_map(path, around=(1001.0, 1003.0, 1996.0, 1998.0))
    with opened(path) as ground:
        assert part.height_std == ground.height_std == read_map(path).height_std


def test_npz(tmp_path: Path) -> None:
    assert read_map(npz(tmp_path / "m.npz")).height_std == pytest.approx(0.045)
    for given in (0.0, 0.03, [0.03]):
        assert read_map(npz(tmp_path / "m.npz", height_std=given)).height_std == np.max(given)
    known = RNG.random(HEIGHTS.shape) > 0.3
    stds = np.where(known, STDS, np.nan)
    ground = read_map(npz(tmp_path / "m.npz", height_std=stds, known=known))
    assert ground.height_std == pytest.approx(float(np.quantile(STDS[known].astype(float), 0.95)))


def test_npz_says_whether_an_error_is_stated_and_how_far_it_is_shared(tmp_path: Path) -> None:
    path = tmp_path / "m.npz"
    assert read_map(npz(path)).height_std_is_assumed
    stated = read_map(npz(path, height_std=0.03, correlation_length=0.3))
    assert not stated.height_std_is_assumed
    assert stated.correlation_length == 0.3
    assert read_map(npz(path, height_std=0.03, height_std_is_assumed=True)).height_std_is_assumed
    for name, given in (("correlation_length", -1.0), ("height_std_is_assumed", [True, False])):
        with fault_in(path, name, "expected"):
            read_map(npz(path, **{name: given}))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (-0.1, "expected lengths >= 0 [m]"),
        (np.inf, "expected lengths >= 0 [m]"),
        (np.nan, "expected lengths >= 0 [m]"),
        (np.where(HEIGHTS[1, 2] == HEIGHTS, np.nan, 0.1), "expected lengths >= 0 [m]"),
        ([0.1, 0.2], "a number or shape (12, 17) of elevation, got (2,)"),
        ("3 cm", "a length or one a cell [m], got an array of"),
    ],
)
def test_npz_with_an_error_that_is_none(tmp_path: Path, given: Any, message: str) -> None:
    with fault_in(tmp_path / "m.npz", "height_std", message):
        read_map(npz(tmp_path / "m.npz", height_std=given))


def test_a_misspelt_error_is_named(tmp_path: Path) -> None:
    with fault_in(tmp_path / "m.npz", "height_sdt", "did you mean height_std?"):
        read_map(npz(tmp_path / "m.npz", height_sdt=0.1))
