"""`slopewise coverage` from outside, and what `calibrate` leaves behind where it refuses."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models.errors import InputError
from services.cli.arguments.files import CalibrateOptions
from services.cli.commands import calibrate, coverage
from services.io.model_file import read_model
from services.io.table import write_csv
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
        20, 20, 20,
    ]  # fmt: skip
    weak = written(replace(Plant(), b_b=0.30), 20, 1, tmp_path / "weak.csv")
    result = slopewise("coverage", weak, "--model", learned)
    assert result.returncode == 3
    assert "does not cover" in result.stdout


def test_wrong_words_are_named(learned: Path, tmp_path: Path) -> None:
    log = written(Plant(), 2, 2, tmp_path / "two.csv")
    job = coverage.CoverageJob([log], str(learned), None, None, 1.0)
    with pytest.raises(InputError, match="--quantile"):
        coverage.run(job, quiet=True)
    with pytest.raises(InputError, match="--settled-speed"):
        calibrate.run(CalibrateOptions([log], "atv", settled_speed=0.4), quiet=True)
    with pytest.raises(InputError, match="--longest"):
        calibrate.run(CalibrateOptions([log], "atv", longest=np.nan), quiet=True)


def test_a_refused_log_leaves_its_stops_with_reasons(tmp_path: Path) -> None:
    log = written(Plant(), 5, 3, tmp_path / "five.csv")
    stops = tmp_path / "stops.csv"
    result = slopewise("calibrate", log, "--model", "atv", "--stops", stops)
    assert result.returncode == 2
    assert "at least 8 usable stops, got 5 of 5 found" in result.stderr
    with stops.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["verdict"] for row in rows] == ["usable"] * 5
    result = slopewise("calibrate", log, "--model", "atv", "--stops", stops, "--least-speed", "9")
    assert result.returncode == 2
    assert "got 0 of 0 found" in result.stderr
