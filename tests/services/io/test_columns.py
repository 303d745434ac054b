"""Columns with other names and units, and every sentence for one that cannot be read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slopewise.services.io.columns import in_own_units, parse_names
from slopewise.services.io.drive_log import DriveLog, read_drive_log, read_logs
from tests.services.faults import fault_in

LOG = """stamp,segment,speed,told,slope,left,ground
1000,007,36,36,-5.7295779513,2,sand
1500,007,18,0,11.459155903,1,
"""


def read(folder: Path, names: str, text: str = LOG) -> DriveLog:
    path = folder / "log.csv"
    path.write_text(text)
    return read_drive_log([path], parse_names(names))


def test_names_units_signs_and_factors(tmp_path: Path) -> None:
    log = read(
        tmp_path,
        "time=stamp:ms,run=segment,speed=speed:km/h,command=told:km/h,grade=slope:deg,"
        "v_left=left:0.165,roll=-slope:deg,terrain=ground",
    )
    assert log.columns["run"].tolist() == ["007", "007"]
    assert log.columns["terrain"].tolist() == ["sand", ""]
    for name, expected in {
        "t": (1.0, 1.5),
        "v": (10.0, 5.0),
        "v_cmd": (10.0, 0.0),
        "pitch": (0.1, -0.2),
        "roll": (0.1, -0.2),
        "v_left": (0.33, 0.165),
    }.items():
        np.testing.assert_allclose(log.columns[name], expected, err_msg=name)
    # What was taken under another name is no candidate explanation as well.
    assert log.further == ()


def test_either_way_round_where_the_file_is_unambiguous(tmp_path: Path) -> None:
    text = (
        LOG.replace("stamp,segment,speed,told,slope", "t,run,{},v_cmd,pitch")
        .replace("-5.7295779513", "0")
        .replace("11.459155903", "0")
    )
    for names, header in (
        ("speed=v:km/h", "v"),
        ("v=speed:km/h", "speed"),
        ("speed=v:km/h", "speed"),
        ("v=v:km/h", "v"),
        ("speed=speed:km/h", "speed"),
        ("v=speed:km/h", "v"),
    ):
        log = read(tmp_path, names, text.replace("{}", header))
        np.testing.assert_allclose(log.columns["v"], (10.0, 5.0), err_msg=f"{names} of {header}")


def test_per_cent_of_a_slope_are_its_tangent(tmp_path: Path) -> None:
    log = read(tmp_path, "pitch=p:%", "t,v,v_cmd,p\n0,1,1,100\n1,1,1,-10\n")
    np.testing.assert_allclose(log.columns["pitch"], (np.pi / 4, -np.arctan(0.1)))


def test_a_file_without_runs_is_one(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,v,v_cmd,pitch\n0,1,1,0\n1,1,0,0\n")
    (tmp_path / "b.csv").write_text("t,v,v_cmd,pitch\n0,1,1,0\n1,1,0,0\n")
    log = read_drive_log([tmp_path / "a.csv", tmp_path / "b.csv"])
    assert log.runs == (slice(0, 2), slice(2, 4))
    assert log.columns["run"].tolist() == ["a", "a", "b", "b"]


BASE = "time=stamp:ms,run=segment,speed=speed:km/h,command=told:km/h"


@pytest.mark.parametrize(
    ("names", "field", "message"),
    [
        ("speed", "speed", "expected NAME=COLUMN or NAME=COLUMN:UNIT, such as speed=v:km/h"),
        ("speed=:km/h", "speed=:km/h", "expected NAME=COLUMN"),
        ("velocity=speed:km/h", "velocity=speed:km/h", "expected one of t, v, v_cmd, pitch, roll"),
        (f"{BASE},grade=slope:gon", "grade=slope:gon", "expected one of rad, mrad, deg"),
        (f"{BASE},grade=slope:-1", "grade=slope:-1", "or a factor > 0, got -1"),
        (f"{BASE},v=speed", "v=speed", "expected each column once, got v twice"),
        ("run=segment:s", "run=segment:s", "expected no unit, run is text"),
    ],
)
def test_entries_that_cannot_be_read(tmp_path: Path, names: str, field: str, message: str) -> None:
    with fault_in("--columns", field, message):
        read(tmp_path, names)


def test_a_column_that_is_not_there_is_named_with_its_entry(tmp_path: Path) -> None:
    with fault_in(
        tmp_path / "log.csv",
        "column slop",
        "missing column of --columns grade=slop:deg, got the header stamp,segment,speed",
        "; is it slope?",
    ):
        read(tmp_path, f"{BASE},grade=slop:deg")


def test_two_meanings_are_no_guess(tmp_path: Path) -> None:
    text = "t,v,v_cmd,pitch,speed\n0,1,1,0,3.6\n"
    message = "a file with columns v and speed: write v=speed or v=v"
    with fault_in("--columns", "speed=v:km/h", message):
        read(tmp_path, "speed=v:km/h", text)
    assert read(tmp_path, "v=speed:km/h", text).columns["v"][0] == pytest.approx(1.0)
    assert read(tmp_path, "v=v:km/h", text).columns["v"][0] == pytest.approx(1.0 / 3.6)


def test_cells_are_named_as_the_file_has_them(tmp_path: Path) -> None:
    with fault_in(tmp_path / "log.csv", "row 3, column speed", "finite number [km/h], got 'fast'"):
        read(tmp_path, f"{BASE},grade=slope:deg", LOG.replace(",18,", ",fast,"))


def test_all_missing_columns_at_once(tmp_path: Path) -> None:
    fields = "column v, column v_cmd, column pitch"
    message = "missing columns, got the header t,speed,Pitch; is pitch Pitch?"
    stop = "a stop is where v_cmd goes to 0 while the vehicle rolls; coast-downs, without a command"
    option = "; other names and units: --columns 't=time,v=speed:km/h'; "
    with fault_in(tmp_path / "log.csv", fields, message, option, stop):
        read(tmp_path, "", "t,speed,Pitch\n0,1,0\n")


def test_recordings_have_topics(tmp_path: Path) -> None:
    bag = tmp_path / "drive.mcap"
    bag.write_bytes(b"")
    with fault_in("--columns", "", "expected tables, recordings have a topic mapping: --topics"):
        read_logs([bag], names="speed=v:km/h")


def test_constants_means_quotients_and_sessions(tmp_path: Path) -> None:
    text = "t,left,right,v_cmd,bar,day\n0,3.6,7.2,1,40,mon\n1,7.2,7.2,1,80,tue\n"
    names = "v=mean(left,right):km/h,pitch=2:deg,brake=bar:1/80,session=day,terrain=sand"
    columns = read(tmp_path, names, text).columns
    np.testing.assert_allclose(columns["v"], (1.5, 2.0))
    np.testing.assert_allclose(columns["pitch"], np.deg2rad(2.0))
    np.testing.assert_allclose(columns["brake"], (0.5, 1.0))
    assert columns["session"].tolist() == ["mon", "tue"]
    assert columns["terrain"].tolist() == ["sand", "sand"]
    with fault_in(tmp_path / "log.csv", "column rihgt", "is it right?"):
        read(tmp_path, "v=mean(left,rihgt),pitch=0", text)
    with fault_in(tmp_path / "log.csv", "row 2, column brake", "--columns brake=brake:1/120"):
        read(tmp_path, "v=left,pitch=0", text.replace("bar", "brake").replace("40", "120"))


def test_a_sentence_in_the_units_of_the_file() -> None:
    names = parse_names("speed=v:km/h,t=stamp:ms,yaw_rate=r:deg/s,x=x:0.5")
    sentence = "first at 2.50 s: 1.50 m/s, at 1.00 m/s² and -0.10 rad/s"
    expected = "first at 2500 ms: 5.4 km/h, at 1.00 m/s² and -5.72958 deg/s"
    assert in_own_units(sentence, names) == expected


def test_speed_of_wheels_or_positions_where_there_is_no_column_for_it(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    t = np.arange(0.0, 6.0, 0.05)
    v = -np.clip(2.0 - 1.5 * (t - 2.0), 0.0, 2.0)  # backwards, and a stop
    path = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * 0.05)))
    rows = zip(t, 0.8 * path, 0.6 * path, *(rng.normal(0.0, 0.002, (2, len(t)))), strict=True)
    lines = [
        f"{a:.2f},{x + e:.5f},{y + f:.5f},{np.arctan2(0.6, 0.8)},0,0" for a, x, y, e, f in rows
    ]
    log = read(tmp_path, "", "\n".join(["t,x,y,yaw,v_cmd,pitch", *lines]))
    assert log.notes == ("v is the change of x and y",)
    assert np.max(np.abs(log.columns["v"] - v)) < 0.25  # at the onset
    assert np.sqrt(np.mean((log.columns["v"] - v) ** 2)) < 0.05
    wheels = "t,v_left,v_right,v_cmd,pitch\n0,1,2,1,0\n1,1,1,1,0\n"
    log = read(tmp_path, "", wheels)
    assert log.columns["v"].tolist() == [1.5, 1.0]
    assert log.notes == ("v is the mean of v_left and v_right",)


def test_brakes_stand_for_commands(tmp_path: Path) -> None:
    log = read(tmp_path, "", "t,v,brake,pitch\n0,1,0,0\n1,0.5,1,0\n")
    assert np.isnan(log.columns["v_cmd"]).all()
    assert log.notes == ("no column v_cmd: a stop begins where the brakes are applied",)
