from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.errors import InputError
from slopewise.services.fleet.calibrate_fleet import FleetCalibrateResult, calibrate_fleet
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.table import write_csv
from slopewise.services.jobs.log_input import LogInput
from slopewise.services.jobs.summary import to_json
from tests.models.calibration.plant import FREE_ROLLING, Plant, drive


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Three vehicles, the last of which never stops."""
    folder = tmp_path_factory.mktemp("logs")
    files = []
    for i, stops in enumerate((30, 6, 1)):
        columns, _, _ = drive(Plant(b_b=0.38 + 0.04 * i), stops, i, terrain="")
        files.append(folder / f"robot-{i}.csv")
        texts = ("run", "terrain")
        write_csv({n: c.tolist() if n in texts else c for n, c in columns.items()}, files[-1])
    return files


def run(logs: list[Path], out: Path, **changes: object) -> FleetCalibrateResult:
    return calibrate_fleet(LogInput(logs), "atv", out, **{"workers": 0, **changes})  # type: ignore[arg-type]


def test_each_vehicle_gets_a_model_file_that_can_be_read(logs: list[Path], tmp_path: Path) -> None:
    result = run(logs, tmp_path)
    models = [read_model(tmp_path / f"robot-{i}.toml") for i in range(3)]
    assert [model.name for model in models] == ["robot-0", "robot-1", "robot-2"]
    first, thin, none = (model.braking for model in models)
    assert thin.level_force(2.5) - first.level_force(2.5) == pytest.approx(0.04, abs=0.015)
    assert "at least 2 usable stops" in result.vehicles[2].note
    assert none.force_std > first.force_std
    assert models[0].vehicle == read_model(find_model("atv")).vehicle
    summary = json.loads(to_json(result.summary))
    assert summary["vehicles"]["robot-1"]["stops"] == 6
    assert np.sqrt(summary["surfaces"][""]["spread"][3][3]) > 0.005


def test_unusable_logs_and_impossible_fits_are_their_vehicles_alone(
    logs: list[Path], tmp_path: Path
) -> None:
    cut, weak, out = tmp_path / "cut.csv", tmp_path / "weak.csv", tmp_path / "out"
    cut.write_text(logs[0].read_text()[:5000].rpartition(",")[0])
    columns, _, _ = drive(FREE_ROLLING, 8, 7, terrain="")
    write_csv({n: c.tolist() if n in ("run", "terrain") else c for n, c in columns.items()}, weak)
    out.mkdir()
    (out / "cut.toml").write_text("# of an earlier run\n")
    result = run([*logs, cut, weak], out)
    assert sorted(file.stem for file in out.iterdir()) == ["cut", "robot-0", "robot-1", "robot-2"]
    assert result.written == ["robot-0", "robot-1", "robot-2"]
    vehicles = json.loads(to_json(result.summary))["vehicles"]
    assert vehicles["cut"]["objections"][-1].startswith(f"no model file: {cut}: row ")
    assert vehicles["cut"]["objections"][-1].endswith(f"cut.toml in {out} is of an earlier run")
    assert "no model file: braking.b_b: expected" in vehicles["weak"]["objections"][-1]
    with pytest.raises(InputError, match=r"2 vehicles, got 1; .*cut\.csv: row "):
        run([logs[0], cut], out)


@pytest.mark.nightly  # by day with plans, test_plan_fleet.py
def test_two_processes_give_the_same_files(logs: list[Path], tmp_path: Path) -> None:
    run(logs, tmp_path / "here")
    run(logs, tmp_path / "there", workers=2)
    for i in range(3):
        name = f"robot-{i}.toml"
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "there" / name).read_bytes()


def test_vehicles_are_files_or_folders(logs: list[Path], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="by-folder"):
        run([logs[0], logs[0]], tmp_path)
    with pytest.raises(InputError, match="2 vehicles"):
        run(logs[:2], tmp_path, by_folder=True)
    with pytest.raises(InputError, match="--coverage"):
        run(logs, tmp_path, coverage=2.0)
