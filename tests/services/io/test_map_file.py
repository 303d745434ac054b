from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError
from slopewise.models.parameters import Braking
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.models.surface_names import resolve_class
from slopewise.services.io.map_file import map_info, read_map, write_map_npz
from slopewise.services.io.map_grid import MapInfo
from tests.services.faults import fault_in, real_data

ROOT = Path(__file__).parents[3]
UTM = "EPSG:26915"
NORTH_UP = Affine(0.5, 0.0, 1000.0, 0.0, -0.5, 2000.0)
RNG = np.random.default_rng(7)
HEIGHTS = RNG.normal(100.0, 5.0, (12, 17)).astype(np.float32)


def geotiff(path: Path, heights: Any = HEIGHTS, **profile: Any) -> Path:
    heights = np.atleast_3d(np.asarray(heights).T).T  # (bands, rows, columns)
    units = profile.pop("unit", None)
    descriptions = profile.pop("descriptions", None)
    scales = profile.pop("scale", None)
    settings = {"crs": UTM, "transform": NORTH_UP, "dtype": heights.dtype, **profile}
    bands, rows, columns = heights.shape
    with rasterio.open(
        path, "w", driver="GTiff", count=bands, height=rows, width=columns, **settings
    ) as dataset:
        dataset.write(heights)
        if descriptions:
            dataset.descriptions = descriptions
        if units:
            dataset.units = [units] * bands
        if scales:
            dataset.scales, dataset.offsets = [scales[0]] * bands, [scales[1]] * bands
    return path


def npz(path: Path, **arrays: Any) -> Path:
    base: dict[str, Any] = {"elevation": HEIGHTS, "resolution": 0.5, "origin": [3.0, 4.0]}
    arrays = {name: value for name, value in (base | arrays).items() if value is not None}
    np.savez(path, **arrays)
    return path


def same(a: ElevationMap, b: ElevationMap) -> bool:
    return (
        np.array_equal(a.elevation, b.elevation, equal_nan=True)
        and a.resolution == b.resolution
        and a.origin == b.origin
        and a.class_names == b.class_names
        and a.height_std == b.height_std
        and a.height_std_is_assumed == b.height_std_is_assumed
        and a.correlation_length == b.correlation_length
        and (a.terrain_class is None) == (b.terrain_class is None)
        and (a.terrain_class is None or np.array_equal(a.terrain_class, b.terrain_class))
    )


@pytest.mark.parametrize("name", ["giswqs_dem.tif", "TM1_564_146.tif"])
def test_every_sampled_point_has_the_height_of_rasterio(name: str) -> None:
    path = real_data(f"dem/{name}")
    elevation_map = read_map(path)
    with rasterio.open(path) as dataset:
        centres = RNG.integers((0, 0), dataset.shape, (500, 2))
        points = [dataset.xy(row, column) for row, column in centres.tolist()]
        expected = np.array([value[0] for value in dataset.sample(points)], np.float64)
        nodata = dataset.nodata
    for (x, y), height in zip(points, expected.tolist(), strict=True):
        column = (x - elevation_map.origin[0]) / elevation_map.resolution
        row = (y - elevation_map.origin[1]) / elevation_map.resolution
        height_here = elevation_map.elevation[round(row), round(column)]
        assert height_here == height or (np.isnan(height_here) and height == nodata)


def test_a_part_of_a_real_map_is_the_whole_one_cut() -> None:
    path = real_data("dem/TM1_564_146.tif")
    complete = read_map(path)
    info = map_info(path)
    assert info.extent == complete.extent
    assert (info.rows, info.columns) == complete.elevation.shape
    x_min, x_max, y_min, y_max = complete.extent
    for _ in range(10):
        xs = np.sort(RNG.uniform(x_min - 20, x_max + 20, 2))
        ys = np.sort(RNG.uniform(y_min - 20, y_max + 20, 2))
        part = read_map(path, around=(xs[0], xs[1], ys[0], ys[1]))
        column = round((part.origin[0] - complete.origin[0]) / complete.resolution)
        row = round((part.origin[1] - complete.origin[1]) / complete.resolution)
        rows, columns = part.elevation.shape
        cut = complete.elevation[row : row + rows, column : column + columns]
        np.testing.assert_array_equal(part.elevation, cut)
        assert part.extent[0] <= max(xs[0], x_min)
        assert part.extent[1] >= min(xs[1], x_max)
        assert part.extent[2] <= max(ys[0], y_min)
        assert part.extent[3] >= min(ys[1], y_max)


def test_rows_and_origin(tmp_path: Path) -> None:
    elevation_map = read_map(geotiff(tmp_path / "m.tif"))
    np.testing.assert_array_equal(elevation_map.elevation, HEIGHTS[::-1])
    assert elevation_map.resolution == 0.5
    assert elevation_map.origin == (1000.25, 2000.0 - 12 * 0.5 + 0.25)
    south_up = Affine(0.5, 0.0, 1000.0, 0.0, 0.5, 1994.0)
    south_up_map = read_map(geotiff(tmp_path / "s.tif", HEIGHTS[::-1], transform=south_up))
    assert same(elevation_map, south_up_map)


def test_only_the_window_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "huge.tif"
    profile = {"dtype": "float32", "crs": UTM, "transform": Affine(1, 0, 0, 0, -1, 100_000)}
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        count=1,
        height=100_000,
        width=100_000,
        tiled=True,
        sparse_ok=True,
        compress="deflate",
        BIGTIFF="YES",
        **profile,
    ) as dataset:
        window = rasterio.windows.Window(500, 99_000, 20, 20)
        dataset.write(np.full((1, 20, 20), 7.0, np.float32), window=window)
    assert map_info(path) == MapInfo(100_000, 100_000, 1.0, (0.5, 0.5))
    part = read_map(path, around=(501.0, 518.0, 982.0, 998.0))
    assert max(part.elevation.shape) < 30
    assert np.all(part.elevation[2:-2, 2:-2] == 7.0)
    with fault_in(path, "", "at most 100000000 cells in one part, got 100000 x 100000"):
        read_map(path)


def test_around_off_the_map(tmp_path: Path) -> None:
    path = geotiff(tmp_path / "m.tif")
    for around in ((0.0, 10.0, 1995.0, 1999.0), (1001.0, 1002.0, 3000.0, 3001.0)):
        with fault_in(path, "extent", "expected ground at x", "got the map at x 1000.25 …"):
            read_map(path, around=around)


def test_nodata_nan_and_inf_are_unknown(tmp_path: Path) -> None:
    heights = HEIGHTS.copy()
    heights[0, :5] = (-9999.0, np.nan, np.inf, -np.inf, -3.4e38)
    elevation_map = read_map(geotiff(tmp_path / "m.tif", heights, nodata=-9999.0))
    assert np.isnan(elevation_map.elevation[-1, :5]).all()
    assert np.isfinite(elevation_map.elevation).sum() == HEIGHTS.size - 5


def test_a_mask_is_honoured(tmp_path: Path) -> None:
    path = geotiff(tmp_path / "m.tif")
    mask = np.full(HEIGHTS.shape, 255, np.uint8)
    mask[3, 4] = 0
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(path, "r+") as dataset:
        dataset.write_mask(mask)
    unknown = np.isnan(read_map(path).elevation)
    assert np.argwhere(unknown).tolist() == [[12 - 1 - 3, 4]]


def test_scale_and_offset_of_whole_numbers(tmp_path: Path) -> None:
    heights = np.full((4, 5), 1234, np.int16)
    heights[0, 0] = -1
    path = geotiff(tmp_path / "m.tif", heights, nodata=-1, scale=(0.1, 100.0))
    elevation_map = read_map(path)
    assert np.isnan(elevation_map.elevation[-1, 0])
    assert elevation_map.elevation[0, 0] == pytest.approx(223.4)


def test_an_empty_map(tmp_path: Path) -> None:
    path = geotiff(tmp_path / "m.tif", np.full((4, 5), -1.0), nodata=-1)
    with fault_in(path, "elevation", "expected a known cell, got unknown ones only"):
        read_map(path)
    with fault_in(path, "elevation", "expected a known cell at x 1001"):
        read_map(path, around=(1001, 1002, 1998, 1999))
    path = geotiff(tmp_path / "one.tif", HEIGHTS[:1])
    with fault_in(path, "elevation", "at least 2 x 2 cells"):
        read_map(path)


def test_the_first_of_many_bands_is_the_elevation(tmp_path: Path) -> None:
    path = geotiff(tmp_path / "m.tif", np.stack((HEIGHTS, 0 * HEIGHTS)))
    np.testing.assert_array_equal(read_map(path).elevation, HEIGHTS[::-1])


@pytest.mark.parametrize(
    ("crs", "message"),
    [
        ("EPSG:4326", "WGS 84 (degrees)"),
        ("EPSG:4979", "WGS 84 (degrees)"),
        ("EPSG:2263", "got US survey foot in NAD83 / New York Long Island (ftUS)"),
        ("EPSG:26915+6360", "got US survey foot in NAVD88 height (ftUS)"),
        ("EPSG:3857", "whose metres are not metres on the ground"),
        ("EPSG:4978", "GeodeticCRS"),
        ('LOCAL_CS["site",UNIT["foot",0.3048]]', "got foot in site"),
    ],
)
def test_coordinates_that_are_not_metres(tmp_path: Path, crs: str, message: str) -> None:
    path = geotiff(tmp_path / "m.tif", crs=crs)
    for read in (map_info, read_map):
        with fault_in(path, "crs", message):
            read(path)


@pytest.mark.parametrize(
    ("crs", "x", "y"),
    [
        pytest.param("EPSG:3395", 2.8e6, 8.36e6, id="World Mercator at 60°, scale 2"),
        pytest.param("+proj=merc +a=6378137 +b=6378137", 2.8e6, 8.4e6, id="Web Mercator spelt out"),
        pytest.param("EPSG:4087", 2.8e6, 6.7e6, id="Plate Carrée, north true, east doubled"),
        pytest.param("EPSG:6933", 2.4e6, 6.3e6, id="equal area"),
        pytest.param("EPSG:3408", 0.0, -4.4e6, id="azimuthal at 50°, 6 %"),
        pytest.param("EPSG:27700", -1e7, 3e7, id="outside of its country"),
    ],
)
def test_metres_that_are_none_on_the_ground(tmp_path: Path, crs: str, x: float, y: float) -> None:
    path = geotiff(tmp_path / "m.tif", crs=crs, transform=Affine(0.5, 0, x, 0, -0.5, y))
    with fault_in(path, "crs", "metres are not metres on the ground: there one is 0."):
        read_map(path)


@pytest.mark.parametrize(
    ("crs", "x", "y"),
    [
        pytest.param("EPSG:32632", 1.384e6, 6.75e6, id="UTM 16° from its meridian, 1.3 %"),
        pytest.param("EPSG:3035", 4.9e6, 4.1e6, id="LAEA"),
        pytest.param("EPSG:32761", 2e6, 2e6, id="the pole is a corner"),
        pytest.param("EPSG:2193", 1.75e6, 5.4e6, id="NZTM"),
        pytest.param("+proj=eqc +R=3396190", 1000.0, 1000.0, id="Mars"),
    ],
)
def test_metres_on_the_ground(tmp_path: Path, crs: str, x: float, y: float) -> None:
    path = geotiff(tmp_path / "m.tif", crs=crs, transform=Affine(0.5, 0, x, 0, -0.5, y))
    assert read_map(path).resolution == 0.5


def test_a_place_that_a_projection_does_not_have(tmp_path: Path) -> None:
    path = geotiff(tmp_path / "m.tif", transform=Affine(0.5, 0.0, 1.8e75, 0.0, -0.5, 2000.0))
    with fault_in(path, "crs", "which has no such place"):
        read_map(path)


def test_bands_by_their_descriptions(tmp_path: Path) -> None:
    bands = np.stack((0 * HEIGHTS, HEIGHTS))
    for names in (("slope", "elevation"), ("height error", "DTM"), ("height error", "Height")):
        path = geotiff(tmp_path / "m.tif", bands, descriptions=names)
        np.testing.assert_array_equal(read_map(path).elevation, HEIGHTS[::-1])
    path = geotiff(tmp_path / "m.tif", bands, descriptions=("slope", "roughness"))
    with fault_in(path, "band 1", "expected elevation [m], got 'slope'"):
        read_map(path)


@pytest.mark.parametrize("crs", [UTM, "EPSG:26915+5703", 'LOCAL_CS["site",UNIT["metre",1]]', None])
def test_coordinates_in_metres(tmp_path: Path, crs: str | None) -> None:
    path = geotiff(tmp_path / "m.tif", crs=crs)
    assert map_info(path).resolution == 0.5
    assumed = " ".join(read_map(path).assumed)
    assert "taken to be in metres" in assumed if crs is None else assumed == ""


@pytest.mark.parametrize(
    ("profile", "field", "message"),
    [
        (
            {"transform": Affine(0.49, 0.09, 1000, 0.09, -0.49, 2000)},
            "transform",
            "aligned with x and y",
        ),
        ({"transform": Affine(0.5, 0.04, 1000, 0, -0.5, 2000)}, "transform", "got a rotated one"),
        ({"transform": Affine(-0.5, 0, 1000, 0, -0.5, 2000)}, "transform", "got a rotated one"),
        (
            {"transform": Affine(0.5, 0, 1000, 0, -1, 2000)},
            "transform",
            "square cells [m], got 0.5 x 1",
        ),
        ({"transform": Affine(0.5, 0, 1000, 0, -0.500005, 2000)}, "transform", "square cells"),
        ({"transform": Affine.identity()}, "transform", "position and scale of the grid, got none"),
        (
            {"crs": None, "transform": Affine(1 / 3600, 0, -93, 0, -1 / 3600, 46)},
            "crs",
            "looks like degrees",
        ),
        ({"unit": "ft"}, "band 1 unit", "expected heights in metres, got ft"),
        ({"heights": np.zeros((3, 4, 5), np.uint8)}, "band 1", "got a colour image"),
        ({"heights": np.zeros((4, 5), np.complex64)}, "band 1", "got complex64"),
    ],
)
@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_grids_that_cannot_be_used(
    tmp_path: Path, profile: dict[str, Any], field: str, message: str
) -> None:
    path = geotiff(tmp_path / "m.tif", **profile)
    for read in (map_info, read_map):
        with fault_in(path, field, message):
            read(path)


def test_files_that_are_no_map(tmp_path: Path) -> None:
    for name in ("none.tif", "none.npz"):
        with fault_in(tmp_path / name, "", "expected an existing file"):
            read_map(tmp_path / name)
    for name, kind in (("m.tif", "intact GeoTIFF"), ("m.npz", ".npz file")):
        for content in (b"", b"garbage" * 100):
            (tmp_path / name).write_bytes(content)
            with fault_in(tmp_path / name, "", f"expected an {kind}, got something else"):
                read_map(tmp_path / name)
    (tmp_path / "m.csv").write_text("1 2 3")
    with fault_in(
        tmp_path / "m.csv", "", "GeoTIFF (.tif), .npz or ROS 2 recording, got the name 'm.csv'"
    ):
        read_map(tmp_path / "m.csv")
    with fault_in(tmp_path, "", "got a directory"):
        read_map(tmp_path)


def test_a_broken_geotiff_says_one_line_and_nothing_else(tmp_path: Path) -> None:
    content = geotiff(
        tmp_path / "m.tif", RNG.normal(size=(64, 64)), compress="deflate"
    ).read_bytes()
    script = (
        "import sys; from pathlib import Path\n"
        "from slopewise.services.io.map_file import read_map\n"
        "for path in sys.argv[1:]:\n"
        "    try: read_map(Path(path))\n"
        "    except Exception as e: print(type(e).__name__, e)"
    )
    broken = {"half": content[: len(content) // 2], "end": content[:-100], "begin": content[:10]}
    paths = [tmp_path / f"{name}.tif" for name in broken]
    for path, part in zip(paths, broken.values(), strict=True):
        path.write_bytes(part)
    done = subprocess.run(
        [sys.executable, "-c", script, *map(str, paths)], cwd=ROOT, capture_output=True, text=True
    )
    lines = done.stdout.splitlines()
    for path, line in zip(paths, lines, strict=True):
        assert line.startswith(f"InputError {path}: expected an intact GeoTIFF, got")
    assert done.stderr == ""


def test_any_damage_is_an_input_error(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    for path in (geotiff(tmp_path / "m.tif"), npz(tmp_path / "m.npz", known=HEIGHTS > 100)):
        content = path.read_bytes()
        for _ in range(150):
            broken = bytearray(content)
            for place in rng.integers(0, len(content), 3):
                broken[place] = rng.integers(0, 256)
            path.write_bytes(bytes(broken[: rng.integers(len(content) // 2, len(content) + 1)]))
            try:
                assert isinstance(read_map(path), ElevationMap)
            except InputError as error:
                assert str(error).isprintable()  # noqa: PT017  either outcome is right


# npz


def test_npz_as_the_format_says(tmp_path: Path) -> None:
    known = HEIGHTS > 95.0
    elevation_map = read_map(npz(tmp_path / "m.npz", known=known))
    assert elevation_map.origin == (3.0, 4.0)
    assert elevation_map.resolution == 0.5
    np.testing.assert_array_equal(np.isfinite(elevation_map.elevation), known)
    np.testing.assert_array_equal(elevation_map.elevation[known], HEIGHTS[known])
    assert elevation_map.terrain_class is None
    info = map_info(tmp_path / "m.npz")
    assert (info.rows, info.columns, info.extent) == (12, 17, elevation_map.extent)


def test_a_part_of_an_npz_map(tmp_path: Path) -> None:
    classes = RNG.integers(0, 3, HEIGHTS.shape)
    path = npz(tmp_path / "m.npz", terrain_class=classes)
    part = read_map(path, around=(5.2, 6.1, 6.6, 7.9))
    assert part.origin == (4.5, 6.0)
    np.testing.assert_array_equal(part.elevation, HEIGHTS[4:10, 3:9])
    np.testing.assert_array_equal(part.terrain_class, classes[4:10, 3:9])


def test_classes_by_number(tmp_path: Path) -> None:
    classes = np.zeros(HEIGHTS.shape, np.uint8)
    classes[1, 2] = 3
    elevation_map = read_map(npz(tmp_path / "m.npz", terrain_class=classes))
    assert elevation_map.class_names == ("", "#1", "#2", "#3")
    assert elevation_map.terrain_class[1, 2] == 3
    braking = Braking(
        m_m=0.0,
        b_m=0.0,
        m_b=0.0,
        b_b=0.4,
        dead_time=0.0,
        speed_range=(0.0, 1.0),
        grade_range=(-1.0, 1.0),
        terrain={name: SurfaceBraking() for name in ("gravel", "sand", "mud")},
    )
    assert resolve_class(braking.terrain, elevation_map.class_names[3]) == "mud"


def test_classes_by_number_with_names(tmp_path: Path) -> None:
    classes = RNG.integers(0, 2, HEIGHTS.shape)
    path = npz(tmp_path / "m.npz", terrain_class=classes, terrain_names=["", "wet grass"])
    assert read_map(path).class_names == ("", "wet grass")


@pytest.mark.parametrize("kind", ["U", "S"])
def test_classes_by_name(tmp_path: Path, kind: str) -> None:
    classes = np.full(HEIGHTS.shape, "sand", f"{kind}8")
    classes[0, 0], classes[1, 1] = "", "gravel"
    elevation_map = read_map(npz(tmp_path / "m.npz", terrain_class=classes))
    assert elevation_map.class_names == ("", "gravel", "sand")
    assert elevation_map.terrain_class[0, :2].tolist() == [0, 2]
    assert elevation_map.terrain_class[1, :2].tolist() == [2, 1]


def test_npz_round_trip(tmp_path: Path) -> None:
    heights = HEIGHTS.astype(np.float64)
    heights[2, 3] = np.nan
    plain = ElevationMap(elevation=heights, resolution=0.1, origin=(1.5, -2.5))
    classes = RNG.integers(0, 3, HEIGHTS.shape)
    classified = ElevationMap(
        elevation=heights,
        resolution=0.1,
        origin=(1.5, -2.5),
        terrain_class=classes,
        class_names=("", "sand", "#7"),
        height_std=0.03,
        height_std_is_assumed=True,
        correlation_length=0.4,
    )
    for elevation_map in (plain, classified):
        write_map_npz(elevation_map, tmp_path / "m.npz")
        assert same(read_map(tmp_path / "m.npz"), elevation_map)


WRONG_SHAPE = np.zeros((3, 3))
NEGATIVE = np.where(HEIGHTS[1, 2] == HEIGHTS, -1, 0)


@pytest.mark.parametrize(
    ("arrays", "field", "message"),
    [
        ({"elevation": None}, "elevation", "missing array, expected it besides origin, resolution"),
        ({"resolution": None}, "resolution", "missing array"),
        ({"origin": None}, "origin", "missing array"),
        ({"elevation": np.zeros(5)}, "elevation", "(rows, columns), got shape (5,)"),
        ({"elevation": np.zeros((0, 5))}, "elevation", "got shape (0, 5)"),
        ({"elevation": np.zeros((1, 5))}, "elevation", "at least 2 x 2 cells"),
        ({"elevation": HEIGHTS.astype(object)}, "elevation", "numbers [m], got an array of object"),
        ({"elevation": HEIGHTS.astype(str)}, "elevation", "numbers [m]"),
        ({"elevation": HEIGHTS.astype(complex)}, "elevation", "got an array of complex128"),
        ({"elevation": HEIGHTS * np.nan}, "elevation", "expected a known cell"),
        ({"elevation": HEIGHTS + np.inf}, "elevation", "expected a known cell"),
        ({"known": np.zeros(HEIGHTS.shape, bool)}, "elevation", "expected a known cell"),
        ({"known": WRONG_SHAPE == 0}, "known", "expected shape (12, 17) of elevation, got (3, 3)"),
        ({"known": HEIGHTS}, "known", "true or false, got an array of float32"),
        ({"known": np.full(HEIGHTS.shape, 2)}, "known", "got other whole numbers"),
        ({"knwon": HEIGHTS > 0}, "knwon", "unknown key, did you mean known?"),
        ({"resolution": 0.0}, "resolution", "a cell edge > 0 [m], got [0.0]"),
        ({"resolution": np.nan}, "resolution", "a cell edge > 0 [m]"),
        ({"resolution": [0.5, 0.5]}, "resolution", "got [0.5, 0.5]"),
        ({"resolution": "1 m"}, "resolution", "a number [m]"),
        ({"origin": [1.0]}, "origin", "two finite numbers x, y [m], got [1.0]"),
        ({"origin": [1.0, np.inf]}, "origin", "two finite numbers"),
        ({"terrain_class": WRONG_SHAPE.astype(int)}, "terrain_class", "shape (12, 17)"),
        ({"terrain_class": HEIGHTS}, "terrain_class", "whole numbers or names"),
        ({"terrain_class": NEGATIVE}, "terrain_class[1, 2]", "expected 0 … 61, got -1"),
        ({"terrain_class": NEGATIVE + 62}, "terrain_class[0, 0]", "expected 0 … 61, got 62"),
        (
            {"terrain_class": NEGATIVE + 1, "terrain_names": ["sand"]},
            "terrain_class[0, 0]",
            "expected 0 … 0, got 1",
        ),
        (
            {"terrain_class": NEGATIVE + 1, "terrain_names": ["a", "#b"]},
            "terrain_names",
            "# only before a number, got '#b'",
        ),
        (
            {"terrain_class": np.arange(HEIGHTS.size).reshape(HEIGHTS.shape).astype(str)},
            "terrain_class",
            "expected 1 … 61 names, got 204",
        ),
    ],
)
def test_npz_that_cannot_be_used(
    tmp_path: Path, arrays: dict[str, Any], field: str, message: str
) -> None:
    path = npz(tmp_path / "m.npz", **arrays)
    with fault_in(path, field, message):
        read_map(path)


def test_header_of_a_huge_array_is_refused(tmp_path: Path) -> None:
    path = npz(tmp_path / "m.npz", elevation=None)
    with zipfile.ZipFile(path, "a") as archive, archive.open("elevation.npy", "w") as file:
        header = {"descr": "<f8", "fortran_order": False, "shape": (10**6, 10**6)}
        np.lib.format.write_array_header_1_0(file, header)
    with fault_in(path, "", "at most 100000000 cells in one part, got 1000000 x 1000000"):
        read_map(path)
    path = npz(tmp_path / "m.npz", elevation=None)
    with zipfile.ZipFile(path, "a") as archive, archive.open("elevation.npy", "w") as file:
        np.lib.format.write_array_header_1_0(file, header | {"shape": (100, 100)})
    with fault_in(path, "elevation", "expected an intact array"):
        read_map(path)
