"""`slopewise discrepancy` as a user runs it: files in, three files out, used by what comes next."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from examples.recordings import f1tenth, husky_drive
from slopewise.services.cli import app
from slopewise.services.io.model_file import read_model
from slopewise.services.io.table import write_csv
from tests.models.discrepancy.logs import log


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log with weaker brakes from run 25 on, looked at once."""
    place = tmp_path_factory.mktemp("discrepancy")
    columns, _ = log("step")
    table = {n: list(v) if v.dtype.kind in "UO" else v for n, v in columns.items()}
    write_csv(table, place / "drive.csv")
    arguments = ["discrepancy", str(place / "drive.csv"), "--model", "atv", "--out"]
    assert _status([*arguments, str(place / "out"), "--json"]) == 0
    return place


def _status(arguments: list[str]) -> int:
    with pytest.raises(SystemExit) as stopped:
        app.main(arguments)
    return int(stopped.value.code or 0)


def test_the_findings_have_all_fields(folder: Path) -> None:
    found = json.loads((folder / "out" / "discrepancy.json").read_text())
    assert found["verdict"] == "missing_effect"
    effect = found["effects"][0]
    assert effect["name"] == "step_change"
    assert set(effect) >= {"parameters", "confidence", "alternatives", "where"}
    for value in effect["parameters"].values():
        assert set(value) == {"value", "std", "unit"}
    assert set(found["located"][0]) >= {"axis", "range", "share_of_gap", "p_value"}
    for gap in (found["gap"], found["stop_distance"]):
        assert {"metric", "unit", "before", "after", "noise_floor", "closed", "ci95"} <= set(gap)
    assert found["next_experiment"]["text"]
    assert found["seconds"] > 0.0


def test_the_model_is_a_model_file_that_says_where_it_is_from(folder: Path) -> None:
    model = read_model(folder / "out" / "model.toml")
    assert [e.name for e in model.effect] == ["step_change"]
    with (folder / "out" / "model.toml").open("rb") as stream:
        effect = tomllib.load(stream)["effect"][0]
    assert "drive.csv" in effect["source"]
    assert "parent atv.toml" in effect["source"]
    assert np.array(effect["covariance"]).shape == (2, 2)


def test_the_next_plan_stops_later(folder: Path, tmp_path: Path) -> None:
    line = np.linspace(-20.0, 20.0, 41)
    write_csv({"x": line, "y": np.zeros_like(line)}, tmp_path / "path.csv")
    flat = np.zeros((60, 60))
    np.savez(tmp_path / "map.npz", elevation=flat, resolution=1.0, origin=np.array([-30.0, -30.0]))
    longest = []
    for model in ("atv", str(folder / "out" / "model.toml")):
        out = tmp_path / "plan.csv"
        arguments = [
            "plan",
            str(tmp_path / "map.npz"),
            str(tmp_path / "path.csv"),
            "--model",
            model,
            "--out",
            str(out),
            "--json",
        ]
        assert _status(arguments) == 0
        rows = np.genfromtxt(out, delimiter=",", names=True, dtype=None, encoding="utf-8")
        fast = rows["speed"] > 0.95 * rows["speed"].max()
        longest.append(float(np.max(rows["stop_distance"][fast] / rows["speed"][fast])))
    assert longest[1] > 1.05 * longest[0]


def test_the_page_tells_it_in_words(folder: Path) -> None:
    page = (folder / "out" / "report.html").read_text()
    assert "one lasting change during the log" in page
    assert "from the log&#x27;s run" in page
    assert page.count("data:image/svg+xml") >= 5
    assert "<script src" not in page


def test_bad_input_is_one_line_and_status_2(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    few = (folder / "drive.csv").read_text().splitlines()[:400]
    (tmp_path / "few.csv").write_text("\n".join(few) + "\n")
    base = ["discrepancy", str(tmp_path / "few.csv"), "--model", "atv", "--out", str(tmp_path)]
    assert _status(base) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "few.csv: stops: expected at least 12 usable stops" in error
    assert _status([*base, "--false-alarm", "2"]) == 2
    assert "--false-alarm" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("reader", "folder"), [(husky_drive, "drive_norlab"), (f1tenth, "f1tenth_frictionmaps")]
)
def test_recordings_of_other_vehicles_are_no_certain_effect(
    reader: object, folder: str, data: Path, tmp_path: Path
) -> None:
    # Nobody knows the truth here: a name without doubt would be invented.
    columns = reader.read(data / "stops" / folder)  # type: ignore[attr-defined]
    table = {n: list(v) if v.dtype.kind in "UO" else v for n, v in columns.items()}
    write_csv(table, tmp_path / "log.csv")
    arguments = ["discrepancy", str(tmp_path / "log.csv"), "--model", "husky", "--out"]
    assert _status([*arguments, str(tmp_path), "--json"]) == 0
    found = json.loads((tmp_path / "discrepancy.json").read_text())
    assert found["verdict"] != "missing_effect"
    assert found["notes"]
    assert found["stop_distance"]["after"] < found["stop_distance"]["before"]
