from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.services.io.plan_file import COLUMNS, TEXT, read_plan_csv, write_plan_csv
from tests.services.faults import fault_in

RNG = np.random.default_rng(3)
ORDER = (
    "candidate,station,x,y,z,grade,roll,curvature,speed,accel,time,speed_bound,limiting,"
    "stop_distance,clear_distance,rear_load,status,reason"
)


def plan(count: int = 50) -> dict[str, Any]:
    rows: dict[str, Any] = {name: RNG.normal(size=count) for name in reversed(COLUMNS)}
    rows |= {name: [f"{name}, {i}" for i in range(count)] for name in TEXT}
    return rows


def test_columns_in_their_order_and_further_ones_behind(tmp_path: Path) -> None:
    path = tmp_path / "plan.csv"
    write_plan_csv({"extra": np.arange(50)} | plan(), path)
    assert path.read_text().splitlines()[0] == f"{ORDER},extra"


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    rows = plan()
    rows["z"][3], rows["clear_distance"][4] = np.nan, np.inf
    rows["reason"][5] = 'unknown ground\nat 3 m, "there"'
    write_plan_csv(rows, tmp_path / "plan.csv")
    read = read_plan_csv(tmp_path / "plan.csv")
    assert list(read) == list(COLUMNS)
    for name in COLUMNS:
        np.testing.assert_array_equal(read[name], rows[name])


@given(stop=st.floats(0, 1e4), clear=st.floats(0, 1e5))
def test_the_stop_stays_before_the_clear_distance(
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
    read = read_plan_csv(path)
    assert read["station"] + read["stop_distance"] <= read["clear_distance"]


def test_plans_that_cannot_be_used(tmp_path: Path) -> None:
    path = tmp_path / "plan.csv"
    with fault_in(path, "", "expected an existing file"):
        read_plan_csv(path)
    write_plan_csv(plan(2), path)
    good = path.read_text()
    path.write_text(good.replace("speed_bound", "bound"))
    with fault_in(path, "column speed_bound", "missing column"):
        read_plan_csv(path)
    lines = good.splitlines()
    cells = lines[2].split('"')
    path.write_text("\n".join([*lines[:2], '"'.join([*cells[:2], ",far,0", *cells[3:]])]))
    with fault_in(path, "row 3"):
        read_plan_csv(path)
    rows = plan(2) | {"speed": ["1.0", "fast"]}
    write_plan_csv(rows, path)
    with fault_in(path, "row 3, column speed", "expected a number, got 'fast'"):
        read_plan_csv(path)


def test_a_plan_without_a_column_is_the_programs_fault(tmp_path: Path) -> None:
    rows = plan(2)
    del rows["speed"]
    with pytest.raises(ValueError, match="speed"):
        write_plan_csv(rows, tmp_path / "plan.csv")
    assert not list(tmp_path.iterdir())
