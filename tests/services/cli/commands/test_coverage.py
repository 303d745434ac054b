"""`slopewise coverage` from outside, and what `calibrate` leaves behind where it refuses."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.errors import InputError
from slopewise.services.cli.arguments.files import CalibrateOptions
from slopewise.services.cli.commands import calibrate, coverage
from slopewise.services.io.model_file import read_model
from slopewise.services.io.table import write_csv
from tests.models.calibration.plant import Plant, drive
from tests.services.command_line import slopewise


def written(plant: Plant, stops: int, seed: int, path: Path) -> Path:
    log = drive(plant, stops, seed)[0]
    write_csv({n: list(v) if v.dtype.kind == "U" else v for n, v in log.items()}, path)
    return path


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("covered")
    log = written(Plant(), 30, 0, folder / "log.csv")
    result = calibrate.run(CalibrateOptions([log], "atv"), quiet=True)
    calibrate.write_learned_model(result, folder / "mine.toml")
    return folder / "mine.toml"


def test_the_model_file_has_scatter_and_no_more(learned: Path) -> None:
    b = read_model(learned).braking
    assert max(b.force_std, b.force_scatter) > 0.0
    assert b.distance_offset < 0.1
    assert (b.dead_band, b.saturation) == (0.0, 1.0)


def test_status_0_if_covered_and_3_if_not(learned: Path, tmp_path: Path) -> None:
    same = written(Plant(), 20, 1, tmp_path / "same.csv")
    result = slopewise("coverage", same, "--model", learned, "--json")
    assert result.returncode == 0, result.stderr
    told = json.loads(result.stdout)
    assert told["stops"] == told["found"] == 20
    assert told["beyond"] == 0
    assert told["share_beyond"] == 0.0
    assert told["mean_excess_m"] > 0.0
    assert [sum(p["stops"] for p in told[k]) for k in ("by_speed", "by_grade", "by_session")] == [
        20,
        20,
        20,
    ]
    weak = written(replace(Plant(), b_b=0.30), 20, 1, tmp_path / "weak.csv")
    result = slopewise("coverage", weak, "--model", learned)
    assert result.returncode == 3
    assert "does not cover" in result.stdout


def test_wrong_words_are_named(learned: Path, tmp_path: Path) -> None:
    log = written(Plant(), 2, 2, tmp_path / "two.csv")
    job = coverage.CoverageJob([log], str(learned), None, None, 1.0)
    with pytest.raises(InputError, match="--quantile"):
        coverage.run(job, quiet=True)
    words = {"settled_speed": 0.4, "least_speed": 0.3}
    with pytest.raises(InputError, match="--settled-speed"):
        calibrate.run(CalibrateOptions([log], "atv", **words), quiet=True)
    for name, value in {
        "longest": np.nan,
        "least_speed": 0.0,
        "turn_rate": -1.0,
        "ramp": np.inf,
        "step": 1.5,
        "full_brake": -0.1,
        "fewest": 1,
    }.items():
        with pytest.raises(InputError, match=f"--{name.replace('_', '-')}: expected"):
            calibrate.run(CalibrateOptions([log], "atv", **{name: value}), quiet=True)


def test_a_refused_log_leaves_its_stops_with_reasons(tmp_path: Path) -> None:
    log = written(Plant(), 5, 3, tmp_path / "five.csv")
    stops, page = tmp_path / "stops.csv", tmp_path / "page.html"
    files = ("--stops", stops, "--report", page)
    result = slopewise("calibrate", log, "--model", "atv", *files)
    assert result.returncode == 2
    assert "at least 8 usable stops, got 5 of 5 found" in result.stderr
    with stops.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["verdict"] for row in rows] == ["usable"] * 5
    assert "at least 8 usable stops, got 5 of 5 found" in page.read_text()
    assert ">Refused: " in page.read_text()
    result = slopewise("calibrate", log, "--model", "atv", *files, "--least-speed", "9")
    assert result.returncode == 2
    assert "got 0 of 5 found; 5 slow" in result.stderr
    with stops.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["verdict"] for row in rows] == ["slow"] * 5
    for told in (page.read_text(), rows[0]["reason"]):
        assert "below the least speed of 9 m/s" in told


def test_one_run_that_stands_while_its_positions_wander_is_left_out(tmp_path: Path) -> None:
    """Speeds noisier than the way between positions look like another unit, in that run."""
    log = drive(Plant(), 12, 4, out_and_back=True)[0]
    t = np.arange(0.0, 60.0, 0.1)
    still = {
        "run": np.full(len(t), "still"),
        "t": float(log["t"][-1]) + 10.0 + t,
        "v": np.full(len(t), 0.36),
        "v_cmd": np.zeros(len(t)),
        "pitch": np.zeros(len(t)),
        "x": 0.1 * t,
        "y": np.zeros(len(t)),
        "yaw": np.zeros(len(t)),
    }
    both = {name: np.concatenate((log[name], still[name])) for name in log}
    path = tmp_path / "log.csv"
    write_csv({n: list(v) if v.dtype.kind == "U" else v for n, v in both.items()}, path)
    result = calibrate.run(CalibrateOptions([path], "atv"), quiet=True)
    assert result.calibration.verdicts["usable"] == 12
    assert any("looks like km/h" in s.reason for s in result.calibration.suspects)
    alone = {name: values[log["run"] == "0"] for name, values in log.items()}
    one = {name: np.concatenate((alone[name], still[name])) for name in log}
    write_csv({n: list(v) if v.dtype.kind == "U" else v for n, v in one.items()}, path)
    stops = tmp_path / "stops.csv"
    with pytest.raises(InputError, match="looks like km/h"):
        calibrate.run(CalibrateOptions([path], "atv", stops=stops), quiet=True)
    assert stops.is_file()
