from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.errors import InputError
from slopewise.services.io.map_file import map_info
from slopewise.services.io.path_file import check_paths_on_map, read_paths, write_paths_csv
from slopewise.services.io.plan_file import COLUMNS, TEXT, read_external_plans, write_plan_csv
from slopewise.services.io.table import read_csv
from tests.services.faults import fault_in, real_data

LINE = [[0.0, 1.0], [2.0, 3.0], [4.0, 5.5]]


def written(path: Path, content: str | bytes | dict[str, Any]) -> Path:
    if isinstance(content, dict):
        content = json.dumps(content)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def same(a: CandidatePath, b: CandidatePath) -> bool:
    def equal(p: Any, q: Any) -> bool:
        return (p is None) == (q is None) and (p is None or np.array_equal(p, q))

    pairs = ((a.points, b.points), (a.speed_limit, b.speed_limit), (a.yaw, b.yaw))
    return a.name == b.name and all(equal(*pair) for pair in pairs)


def test_one_candidate_is_called_as_the_file(tmp_path: Path) -> None:
    (path,) = read_paths(written(tmp_path / "north.csv", "x,y\n0,1\n2,3\n4,5.5\n\n"))
    assert path.name == "north"
    assert path.points.tolist() == LINE
    assert path.speed_limit is None
    assert path.yaw is None


def test_several_candidates_in_the_order_of_their_first_row(tmp_path: Path) -> None:
    text = (
        "\ufeff y ,x,note,candidate,speed_limit,yaw\r\n"
        '1,0,"a, b",right,,\r\n'
        "1,0,,left,2.5,0.1\r\n"
        "2,1,,right,,\r\n"
        "3,1,,left,0,0.2\r\n"
    )
    right, left = read_paths(written(tmp_path / "p.csv", text))
    assert (right.name, left.name) == ("right", "left")
    assert right.points.tolist() == [[0.0, 1.0], [1.0, 2.0]]
    assert right.speed_limit is None
    assert left.yaw is not None
    assert left.speed_limit.tolist() == [2.5, 0.0]
    assert left.yaw.tolist() == [0.1, 0.2]


def test_a_name_of_several_lines_makes_an_error_of_one(tmp_path: Path) -> None:
    path = written(tmp_path / "p.csv", 'x,y,candidate\n1,1,"a\nb"\n2,2,c\n')
    with fault_in(path, "candidate a\\nb", "got 1 (row 3)"):
        read_paths(path)


NUMBERS = st.floats(-1e9, 1e9, allow_nan=False, allow_infinity=False)
LIMITS = st.floats(0, 1e3, allow_nan=False, allow_infinity=False)


@st.composite
def candidates(draw: st.DrawFn) -> list[CandidatePath]:
    names = draw(st.lists(st.text(min_size=1, max_size=6), min_size=1, max_size=3, unique=True))
    paths = []
    for name in (name for name in names if name.strip()):
        count = draw(st.integers(2, 5))
        column = lambda cells, n=count: st.lists(cells, min_size=n, max_size=n)  # noqa: E731
        points = draw(column(st.tuples(NUMBERS, NUMBERS)))
        limit, yaw = draw(st.none() | column(LIMITS)), draw(st.none() | column(NUMBERS))
        arrays = [None if given is None else np.array(given) for given in (limit, yaw)]
        paths.append(CandidatePath(name, np.array(points), *arrays))
    return paths


@settings(deadline=None)
@given(paths=candidates().filter(bool))
def test_what_is_written_is_read_again(tmp_path_factory: Any, paths: list[CandidatePath]) -> None:
    path = tmp_path_factory.mktemp("paths") / "p.csv"
    write_paths_csv(paths, path)
    read = read_paths(path)
    assert len(read) == len(paths)
    assert all(same(a, b) for a, b in zip(read, paths, strict=True))


def feature(geometry: Any = None, **more: Any) -> dict[str, Any]:
    geometry = {"type": "LineString", "coordinates": LINE} if geometry is None else geometry
    return {"type": "Feature", "geometry": geometry, "properties": None} | more


def test_geojson_names_and_limits(tmp_path: Path) -> None:
    three_dimensional = {"type": "LineString", "coordinates": [[*p, 7.0] for p in LINE]}
    parts = {"type": "MultiLineString", "coordinates": [LINE, LINE[::-1]]}
    features = [
        feature(properties={"candidate": "a", "name": "b", "speed_limit": 2}),
        feature(properties={"name": "c"}),
        feature(three_dimensional, id=17),
        feature(),
        feature(parts, properties={"name": "d"}),
    ]
    data = {"type": "FeatureCollection", "features": features}
    paths = read_paths(written(tmp_path / "p.geojson", data))
    assert [path.name for path in paths] == ["a", "c", "17", "3", "d-1", "d-2"]
    assert paths[0].speed_limit.tolist() == [2.0] * 3
    assert paths[1].speed_limit is None
    assert all(path.points.tolist() == LINE for path in paths[:-1])
    assert paths[-1].points.tolist() == LINE[::-1]


def test_a_geojson_feature_or_geometry_alone(tmp_path: Path) -> None:
    for data in (feature(), feature()["geometry"]):
        (path,) = read_paths(written(tmp_path / "p.json", data))
        assert path.name == "0"
        assert path.points.tolist() == LINE


EXTENT = (429_252.8, 429_651.8, 5_150_485.9, 5_150_884.9)


def test_a_path_has_to_begin_on_the_map() -> None:
    on = CandidatePath("on", np.array([[429_300.0, 5_150_500.0], [0.0, 0.0]]))
    outside = CandidatePath("off", np.array([[429_300.0, 5_150_400.25], [429_300.0, 5_150_500.0]]))
    check_paths_on_map([on], EXTENT, "p.csv", "m.tif")
    with fault_in(
        "p.csv",
        "candidate off, point 1",
        "expected a point on the map m.tif (x 429252.8 … 429651.8, y 5150485.9 … 5150884.9 m)",
        "got x 429300, y 5150400.25",
    ):
        check_paths_on_map([on, outside], EXTENT, "p.csv", "m.tif")


def test_degrees_are_recognised() -> None:
    path = CandidatePath("a", np.array([[-93.92, 46.5], [-93.91, 46.5]]))
    with fault_in("p.csv", "candidate a, point 1", "that looks like degrees"):
        check_paths_on_map([path], EXTENT, "p.csv", "m.tif")
    with pytest.raises(InputError) as caught:
        check_paths_on_map([path], (0.0, 50.0, 0.0, 50.0), "p.csv", "m.npz")
    assert "degrees" not in str(caught.value)


def test_swapped_coordinates_are_asked_for() -> None:
    swapped = CandidatePath("a", np.array([[5150700.0, 429400.0], [5150700.0, 429410.0]]))
    with fault_in("p.csv", "candidate a, point 1", "; are x and y in each other's column?"):
        check_paths_on_map([swapped], EXTENT, "p.csv", "m.tif")


def test_a_path_off_a_real_map() -> None:
    source = real_data("dem/giswqs_dem.tif")
    info = map_info(source)
    x_min, x_max, y_min, y_max = info.extent
    inside = np.array([[x_min, y_max], [x_max, y_min]])
    check_paths_on_map([CandidatePath("a", inside)], info.extent, "p.csv", str(source))
    shifted = inside - np.array([1.0, 0.0])
    with fault_in("p.csv", "candidate b, point 1", str(source)):
        check_paths_on_map([CandidatePath("b", shifted)], info.extent, "p.csv", str(source))


RNG = np.random.default_rng(3)
ORDER = (
    "candidate,station,x,y,z,grade,roll,curvature,speed,accel,time,speed_bound,limiting,"
    "stop_distance,clear_distance,rear_load,status,reason"
)


def plan(count: int = 50) -> dict[str, Any]:
    rows: dict[str, Any] = {name: abs(RNG.normal(size=count)) for name in reversed(COLUMNS)}
    rows |= {name: [f"{name}, {i}" for i in range(count)] for name in TEXT}
    return rows | {"candidate": ["a"] * count, "status": ["ok"] * count}


def test_columns_are_ordered_and_further_ones_follow(tmp_path: Path) -> None:
    path = tmp_path / "plan.csv"
    write_plan_csv({"extra": np.arange(50)} | plan(), path)
    assert path.read_text().splitlines()[0] == f"{ORDER},extra"


def test_a_written_plan_reads_back_equal(tmp_path: Path) -> None:
    rows = plan()
    rows["reason"] = ['unknown ground\nat 3 m, "there"'] * len(rows["reason"])
    write_plan_csv(rows, tmp_path / "plan.csv")
    table = read_csv(tmp_path / "plan.csv")
    for name in TEXT:
        assert table.text(name) == rows[name]
    for name in set(COLUMNS) - set(TEXT):
        np.testing.assert_array_equal(table.numbers(name, ""), rows[name])
    (read,) = read_external_plans(tmp_path / "plan.csv")
    assert (read.name, read.status) == ("a", "ok")
    for name in ("x", "y", "z", "speed", "station", "stop_distance"):
        np.testing.assert_array_equal(getattr(read, name), rows[name])


@given(stop=st.floats(0, 1e4), clear=st.floats(0, 1e5))
def test_stops_stay_before_the_clear_distance_in_the_file(
    tmp_path_factory: pytest.TempPathFactory, stop: float, clear: float
) -> None:
    station = clear - stop
    while station + stop > clear:
        station = np.nextafter(station, -np.inf)
    rows = plan(1) | {
        "station": np.array([station]),
        "stop_distance": np.array([stop]),
        "clear_distance": np.array([clear]),
    }
    path = tmp_path_factory.mktemp("plan") / "plan.csv"
    write_plan_csv(rows, path)
    table = read_csv(path)
    station, stop, clear = (
        table.numbers(name, "m")[0] for name in ("station", "stop_distance", "clear_distance")
    )
    assert station + stop <= clear


def test_writing_a_plan_without_a_column_is_a_program_error(tmp_path: Path) -> None:
    rows = plan(2)
    del rows["speed"]
    with pytest.raises(ValueError, match="speed"):
        write_plan_csv(rows, tmp_path / "plan.csv")
    assert not list(tmp_path.iterdir())
