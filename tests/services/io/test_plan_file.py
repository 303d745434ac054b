from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.services.io.plan_file import COLUMNS, TEXT, read_external_plans, write_plan_csv
from slopewise.services.io.table import read_csv

RNG = np.random.default_rng(3)
ORDER = (
    "candidate,station,x,y,z,grade,roll,curvature,speed,accel,time,speed_bound,limiting,"
    "stop_distance,clear_distance,rear_load,status,reason"
)


def plan(count: int = 50) -> dict[str, Any]:
    rows: dict[str, Any] = {name: abs(RNG.normal(size=count)) for name in reversed(COLUMNS)}
    rows |= {name: [f"{name}, {i}" for i in range(count)] for name in TEXT}
    return rows | {"candidate": ["a"] * count}


def test_columns_are_ordered_and_further_ones_follow(tmp_path: Path) -> None:
    path = tmp_path / "plan.csv"
    write_plan_csv({"extra": np.arange(50)} | plan(), path)
    assert path.read_text().splitlines()[0] == f"{ORDER},extra"


def test_a_written_plan_reads_back_equal(tmp_path: Path) -> None:
    rows = plan()
    rows["reason"][5] = 'unknown ground\nat 3 m, "there"'
    write_plan_csv(rows, tmp_path / "plan.csv")
    table = read_csv(tmp_path / "plan.csv")
    for name in TEXT:
        assert table.text(name) == rows[name]
    for name in set(COLUMNS) - set(TEXT):
        np.testing.assert_array_equal(table.numbers(name, ""), rows[name])
    (read,) = read_external_plans(tmp_path / "plan.csv")
    assert (read.name, read.status) == ("a", "status, 0")
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
