"""`slopewise simulate`: effects that need a run or a column of the log."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from slopewise.models.parameters import Effect
from slopewise.services.cli.commands import coverage, simulate
from slopewise.services.io.logs.unseen_channels import unseen_channels
from slopewise.services.io.model_file import write_model
from slopewise.services.io.table import write_csv
from tests.models.discrepancy.logs import log
from tests.models.models_for_tests import BASE


def written(tmp_path: Path, name: str, *effects: Effect) -> tuple[Path, Path]:
    columns, _ = log(name)
    model = tmp_path / "model.toml"
    write_model(replace(BASE, effect=effects), model)
    table = tmp_path / "log.csv"
    names = [f"{run}" for run in columns["run"]]
    write_csv({**columns, "run": names}, table)
    return table, model


def test_a_lasting_change_begins_at_its_run(tmp_path: Path) -> None:
    """Replayed on the log that it was found in, it acts in the runs behind it only."""
    change = Effect(name="step_change", parameters={"scale": 0.5, "run": 24.0})
    table, model = written(tmp_path, "clean", change)
    result = simulate.run([table], str(model), quiet=True)
    rms = np.array([r.rms for r in result.runs])
    assert np.all(rms[:24] < 0.1)
    assert np.median(rms[24:]) > 0.3


def test_simulate_and_coverage_say_which_column_is_missing(tmp_path: Path) -> None:
    wind = Effect(name="headwind", parameters={"c": 0.001, "wind": 1.0, "direction": 0.0})
    columns, _ = log("clean")
    table, model = written(tmp_path, "clean", wind)
    bare = {name: columns[name] for name in ("t", "v", "v_cmd", "pitch")}
    write_csv({"run": [f"{run}" for run in columns["run"]], **bare}, table)
    (note,) = simulate.run([table], str(model), quiet=True).notes
    found = coverage.run(coverage.CoverageJob([table], str(model), None, None, 0.999), quiet=True)
    assert found.notes == (note,)
    assert coverage.as_json(found)["notes"] == [note]


def test_an_effect_without_its_column_is_said(tmp_path: Path) -> None:
    wind = Effect(name="headwind", parameters={"c": 0.01, "wind": 5.0, "direction": 0.0})
    columns, _ = log("clean")
    columns = {name: values for name, values in columns.items() if name != "yaw"}
    (note,) = unseen_channels([wind], columns)
    assert "headwind needs yaw" in note
    gap = {**columns, "yaw": np.where(np.arange(len(columns["t"])) == 7, np.nan, 0.0)}
    (note,) = unseen_channels([wind], gap)
    assert "gaps" in note
    assert not unseen_channels([wind], {**columns, "yaw": np.zeros(len(columns["t"]))})
    assert not unseen_channels(BASE.effect, columns)
