"""Undeclared no-data values: unknown in every reader, reported, and real ground unchanged."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from affine import Affine
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.errors import InputError
from slopewise.models.vehicle import Vehicle
from slopewise.services.fleet import map_windows
from slopewise.services.io.map_file import read_map
from slopewise.services.io.map_grid import footprint_margin
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.no_data import known_heights, nodata_of
from slopewise.services.planning.map_store import MapStore
from slopewise.services.wire.plan_messages import MapUpdate
from tests.services.command_line import here, one_line_of
from tests.services.faults import real_data
from tests.services.io.test_map_file import geotiff, npz

RNG = np.random.default_rng(3)
ROUGH = RNG.normal(420.0, 2.0, (40, 60))
LARGEST = float(np.finfo(np.float32).max)
MARKERS = (
    -9999.0,
    -99999.0,
    -32768.0,
    -32767.0,
    -LARGEST,
    LARGEST,
    -1e20,
    1e20,
    1e30,
    1e5,
    -999999.0,
    9999.0,
    32767.0,
    65535.0,
    -999.0,
    -500.0,
    0.0,
    1234.5,
)


def holed(marker: float, ground: np.ndarray = ROUGH) -> np.ndarray:
    """Ground with a block of a marker that is large enough to drive on."""
    heights = ground.copy()
    heights[5:25, 10:50] = marker
    return heights


@pytest.mark.parametrize("marker", MARKERS)
def test_a_marker_is_unknown_and_reported_and_the_ground_stays(marker: float) -> None:
    heights = holed(marker)
    known, detected = known_heights(heights)
    np.testing.assert_array_equal(np.isnan(known), heights == marker)
    np.testing.assert_array_equal(known[heights != marker], heights[heights != marker])
    assert detected == (marker,)


def plateau(step: float) -> np.ndarray:
    """An exactly flat top next to rough ground, a sheer face between them."""
    heights = ROUGH.copy()
    heights[:, 30:] = ROUGH.max() + step
    return heights


def spiked(ground: np.ndarray, *spikes: float) -> np.ndarray:
    heights = ground.copy()
    heights[3, 3 : 3 + len(spikes)] = spikes
    return heights


FLAT = np.full((40, 60), 7.0)
TERRACES = np.where(np.arange(60) < 20, 0.0, 150.0) + np.zeros((40, 1))
REAL_GROUND = {
    "rough": ROUGH,
    "flat": FLAT,
    "zero": np.zeros((9, 9)),
    "two terraces": TERRACES,
    "three terraces": TERRACES + np.where(np.arange(60) < 40, 0.0, 300.0),
    "a plateau above a cliff": plateau(90.0),
    "a plateau no higher than the relief": plateau(150.0) + np.linspace(0.0, 200.0, 40)[:, None],
    "one cell on flat ground": spiked(FLAT, 500.0),
    "two cells on flat ground": spiked(FLAT, 500.0, 520.0),
    "three equal cells in rough ground": spiked(ROUGH, -500.0, -500.0, -500.0),
    "whole metres": np.round(ROUGH),
    "a lake": np.maximum(np.linspace(0.0, 900.0, 2400).reshape(40, 60), 120.0),
    "the Dead Sea": np.full((9, 9), -430.5),
    "the deepest trench": np.full((9, 9), -10935.0) + RNG.normal(0.0, 1.0, (9, 9)),
    "through -999": np.round(np.linspace(-1100.0, -900.0, 2400)).reshape(40, 60),
}


@pytest.mark.parametrize("name", REAL_GROUND)
def test_ground_loses_no_cell(name: str) -> None:
    known, detected = known_heights(REAL_GROUND[name])
    np.testing.assert_array_equal(known, REAL_GROUND[name])
    assert detected == ()


@given(
    ground=arrays(np.float64, (12, 12), elements=st.floats(-60.0, 60.0, width=32), unique=True),
    above=st.floats(-9000.0, 8000.0, width=32),
    marker=st.sampled_from(MARKERS),
)
@pytest.mark.parametrize("_", ["by day", pytest.param("by night", marks=pytest.mark.nightly)])
def test_whatever_the_ground_a_marker_far_from_it_is_never_ground(
    ground: np.ndarray, above: float, marker: float, _: str
) -> None:
    heights = ground + above
    heights[3:7, 3:7] = marker
    rest = np.delete(heights.ravel(), np.flatnonzero(heights.ravel() == marker))
    gap = np.min(np.abs(rest - marker))
    if gap <= max(100.0, np.ptp(rest)):
        return
    known, detected = known_heights(heights)
    assert np.isnan(known[3:7, 3:7]).all()
    assert np.isfinite(known).sum() == 144 - 16
    assert detected == (marker,)


def test_real_maps_lose_no_cell(data: Path) -> None:
    import rasterio

    for name in ("giswqs_dem.tif", "TM1_564_146.tif"):
        ground = read_map(real_data(f"dem/{name}"))
        with rasterio.open(data / "dem" / name) as dataset:
            declared = dataset.read(1, masked=True)
        assert np.isfinite(ground.elevation).sum() == np.ma.count(declared)
        assert not any("no-data" in message for message in ground.assumed)
    table = np.loadtxt(data / "dem/ColmenarRocks_Nominal_10cmDEM.csv")
    known, detected = known_heights(table)
    np.testing.assert_array_equal(known, table)
    assert detected == ()


def test_what_the_user_declares_is_unknown_and_not_reported() -> None:
    heights = ROUGH.astype(np.float32).astype(np.float64)
    heights[:5] = np.float32(421.37)
    known, detected = known_heights(heights, 421.37)
    assert np.isnan(known[:5]).all()
    assert np.isfinite(known[5:]).all()
    assert detected == ()


def test_with_none_only_what_is_no_height_at_all_is_unknown() -> None:
    for marker in (-9999.0, -500.0, -999.0):
        known, detected = known_heights(holed(marker), "none")
        np.testing.assert_array_equal(known, holed(marker))
        assert detected == ()
    known, detected = known_heights(holed(-LARGEST), "none")
    assert np.isnan(known).any()
    assert detected == (-LARGEST,)


def test_values_of_the_option() -> None:
    assert nodata_of("None") == "none"
    assert nodata_of("-9999") == -9999.0
    with pytest.raises(InputError, match=r"--nodata: expected a height \[m\] or none, got rocks"):
        nodata_of("rocks")


@pytest.mark.parametrize(
    ("dtype", "marker", "profile"),
    [
        ("float32", -9999.0, {}),
        ("float32", -LARGEST, {}),
        ("float32", -500.0, {}),
        ("float32", -9999.0, {"nodata": -32768.0}),
        ("int16", -32768, {}),
        ("uint16", 65535, {}),
        ("uint16", 0, {}),
        ("int16", -32768, {"scale": (0.01, 420.0)}),
        ("int16", 32767, {"scale": (0.01, 420.0)}),
        ("uint16", 65535, {"scale": (0.01, 100.0)}),
        ("int32", -9999, {"scale": (0.001, 420.0)}),
    ],
)
def test_geotiff(tmp_path: Path, dtype: str, marker: float, profile: dict[str, Any]) -> None:
    scale, offset = profile.get("scale", (1.0, 0.0))
    raw = np.round((ROUGH - offset) / scale)
    raw[5:25, 10:50] = marker
    path = geotiff(tmp_path / "m.tif", raw.astype(dtype), **profile)
    ground = read_map(path)
    np.testing.assert_array_equal(np.isnan(ground.elevation[::-1]), raw == marker)
    (message,) = (w for w in ground.assumed if "no-data" in w)
    assert f"{float(marker):.6g}" in message
    assert ("--nodata none" in message) is (abs(marker) < 1e5)
    if dtype == "int16":
        assert np.isfinite(read_map(path, nodata="none").elevation).all()


def test_a_declared_value_stays_unknown_whatever_the_user_says(tmp_path: Path) -> None:
    path = geotiff(tmp_path / "m.tif", holed(-9999.0).astype(np.float32), nodata=-9999.0)
    for nodata in (None, -7.0, "none"):
        ground = read_map(path, nodata=nodata)  # type: ignore[arg-type]
        assert np.isnan(ground.elevation).sum() == 800
        assert not any("no-data" in message for message in ground.assumed)


def test_a_window_of_markers_alone_is_detected_by_the_rest_of_the_file(tmp_path: Path) -> None:
    heights = np.tile(ROUGH, (60, 40)).astype(np.float32)  # 2400 x 2400 cells
    heights[1000:1400, 800:1500] = -500.0
    path = geotiff(tmp_path / "m.tif", heights)
    x, y = 1000.0 + 0.5 * 1000.0, 2000.0 - 0.5 * 1200.0
    with pytest.raises(InputError, match="unknown ones only; cells of -500 m"):
        read_map(path, around=(x, x + 20.0, y, y + 20.0))
    part = read_map(path, around=(x, x + 20.0, y, y + 120.0))
    assert np.isnan(part.elevation).any()
    with map_windows.opened(path) as ground:
        assert any("-500" in message for message in ground.assumed)  # before any window was read
        vehicle: Vehicle = read_model(find_model("atv")).vehicle
        line = np.stack([np.linspace(x, x + 20.0, 30), np.full(30, y)], axis=1)
        ((_, cells),) = map_windows.map_windows(
            [CandidatePath("a", line)], ground.info, footprint_margin(vehicle, ground.info)
        )
        assert cells is not None
        assert np.isnan(map_windows.ground_in(ground, cells).elevation).all()


@pytest.mark.parametrize("marker", [-9999.0, -500.0, 65535.0])
def test_npz(tmp_path: Path, marker: float) -> None:
    path = npz(tmp_path / "m.npz", elevation=holed(marker))
    ground = read_map(path)
    np.testing.assert_array_equal(np.isnan(ground.elevation), holed(marker) == marker)
    assert len(ground.assumed) == 1
    around = (3.0 + 0.5 * 15, 3.0 + 0.5 * 40, 4.0 + 0.5 * 8, 4.0 + 0.5 * 20)
    with pytest.raises(InputError, match="unknown ones only"):
        read_map(path, around=around)
    np.testing.assert_array_equal(read_map(path, nodata="none").elevation, holed(marker))


def test_a_grid_map_in_a_recording(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="the ros extra is not installed")
    from slopewise.services.io.bags import GRID_MAP
    from tests.services import grid_maps
    from tests.services.io.test_grid_map import bag

    path = bag(tmp_path / "b", ("/map", GRID_MAP, grid_maps.grid_map(holed(-9999.0))))
    ground = read_map(path)
    assert np.isnan(ground.elevation).sum() == 800
    assert any("-9999" in message for message in ground.assumed)
    assert np.isfinite(read_map(path, nodata="none").elevation).all()


def update(heights: np.ndarray, sequence: int, **more: Any) -> MapUpdate:
    return MapUpdate(
        source="mapper",
        sequence=sequence,
        elevation=heights,
        resolution=0.5,
        origin=(0.0, 0.0),
        **more,
    )


@pytest.mark.parametrize("marker", [-9999.0, -500.0])
def test_service_and_guard_know_the_same_of_whole_maps_and_patches(marker: float) -> None:
    store = MapStore()
    full, patch = update(holed(marker), 1), update(np.full((6, 6), marker), 2, patch=True)
    assert store.apply(full, "map")
    elevation = store.snapshot.elevation_map.elevation
    np.testing.assert_array_equal(np.isnan(elevation), holed(marker) == marker)
    (flag,) = store.snapshot.warnings.active()
    assert f"{marker:g}" in flag
    assert store.apply(patch, "map")
    assert np.isnan(store.snapshot.elevation_map.elevation[:6, :6]).all()


def test_a_patch_of_ground_is_taken() -> None:
    store = MapStore()
    store.apply(update(ROUGH, 1), "map")
    store.apply(update(np.full((6, 6), 421.0), 2, patch=True), "map")
    assert np.all(store.snapshot.elevation_map.elevation[:6, :6] == 421.0)
    assert store.snapshot.warnings.active() == []


def planned(tmp_path: Path, *options: str, marker: float = -9999.0) -> Any:
    heights = np.full((60, 120), 100.0, np.float32) + RNG.normal(0.0, 0.01, (60, 120))
    heights[:, 40:] = marker
    path = geotiff(
        tmp_path / "m.tif", heights.astype(np.float32), transform=Affine(0.5, 0, 0, 0, -0.5, 30)
    )
    (tmp_path / "p.csv").write_text("x,y\n4,15\n10,15\n50,15\n")
    (tmp_path / "on.csv").write_text("x,y\n30,15\n40,15\n50,15\n")
    paths = next((o for o in options if o.endswith(".csv")), str(tmp_path / "p.csv"))
    rest = [o for o in options if not o.endswith(".csv")]
    return here("plan", path, paths, "--model", "atv", "--json", *rest)


def test_plan_stops_before_a_marker_and_reports_it(tmp_path: Path) -> None:
    result = planned(tmp_path)
    assert result.returncode == 0, result.stderr
    reply = json.loads(result.stdout)
    (plan,) = reply["plans"]
    assert plan["status"] == "blocked"
    assert max(plan["columns"]["z"]) < 101.0
    driven = np.array(plan["columns"]["speed"]) > 0.0
    assert np.array(plan["columns"]["x"])[driven].max() < 20.0
    assert any("cells of -9999 m are unknown ground" in note for note in reply["notes"])


def test_nothing_is_planned_on_markers_alone(tmp_path: Path) -> None:
    planned(tmp_path)
    for marker, options in ((-9999.0, ()), (-500.0, ()), (3.5, ("--nodata", "3.5"))):
        result = planned(tmp_path, str(tmp_path / "on.csv"), *options, marker=marker)
        one_line_of(result, "unknown ones only")


def test_check_reads_the_same_ground(tmp_path: Path) -> None:
    planned(tmp_path, "--nodata", "none", "--out", str(tmp_path / "speeds.CSV"))
    arguments = ["check", str(tmp_path / "speeds.CSV"), "--map", str(tmp_path / "m.tif")]
    result = here(*arguments, "--model", "atv", "--json")
    reply = json.loads(result.stdout)
    assert any("-9999" in note for note in reply["notes"])
