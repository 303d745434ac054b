from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.errors import InputError
from slopewise.services.fleet import investigate_fleet, vehicle_finding
from slopewise.services.fleet.fleet_page import write_fleet_page
from slopewise.services.fleet.fleet_summary import (
    FleetSummary,
    format_effects,
    sort_by_prediction_error,
    summarise_fleet,
)
from slopewise.services.fleet.vehicle_finding import DONE, REFUSED, Row, row_without_finding
from slopewise.services.io.model_file import find_model, read_model, write_model
from slopewise.services.io.table import write_csv
from slopewise.services.jobs.log_input import LogInput
from tests.world.logs import WORLDS
from tests.world.plant import drive
from tests.world.shared import once


def row(vehicle: str, verdict: str, *effects: Row, before: float = 0.1) -> Row:
    base = row_without_finding(vehicle, "", DONE, "")
    return base | {"verdict": verdict, "effects": list(effects), "stop_distance_before": before}


def lag(confidence: float, tau: float, *alternatives: str) -> Row:
    parameter = {"name": "tau", "value": tau, "std": 0.01, "unit": "s"}
    return {
        "name": "brake_lag",
        "confidence": confidence,
        "alternatives": list(alternatives),
        "parameters": [parameter],
    }


ROWS = [
    row("a", "missing_effect", lag(0.9, 0.2), before=0.2),
    row("b", "none"),
    row("c", "missing_effect", lag(0.6, 0.1), before=0.5),
    row("d", "ambiguous", lag(0.5, 0.4, "brake_fade"), before=0.3),
    row_without_finding("e", "", REFUSED, "too few stops"),
]


def summary_of(rows: list[Row]) -> FleetSummary:
    return summarise_fleet(rows, 0.02, resumed=0, unexpected=0, seconds=0.0)


def test_named_and_ambiguous_effects_are_counted_separately() -> None:
    summary = summary_of(ROWS)
    assert (summary.examined, summary.failed) == (4, {"e": "too few stops"})
    assert summary.verdicts == {"missing_effect": 2, "ambiguous": 1, "none": 1}
    assert summary.expected_false == pytest.approx(0.08)
    first, second = summary.effects
    assert (first.name, first.vehicles, first.ambiguous_in) == ("brake_lag", ("a", "c"), ("d",))
    assert first.confidence == pytest.approx((0.6, 0.75, 0.9))
    assert first.expected_true == pytest.approx(1.5)
    tau = first.parameters["tau"]  # where it is named
    assert (tau.unit, tau.minimum, tau.maximum) == ("s", 0.1, 0.2)
    assert tau.median == pytest.approx(0.15)
    assert (second.name, second.vehicles, second.ambiguous_in) == ("brake_fade", (), ("d",))
    assert second.confidence is None


def test_texts_of_effects_and_rows() -> None:
    first, second = summary_of(ROWS).effects
    numbers = "tau = 0.15 (0.1 … 0.2) s"
    assert first.cells(4) == ("2 of 4", "60% … 90%", "1.5", "1", numbers)
    assert second.cells(4) == ("", "", "", "1", "")
    assert [r["vehicle"] for r in sort_by_prediction_error(ROWS)] == ["c", "d", "a", "b"]
    assert format_effects(ROWS[3]) == "brake_lag 50% or brake_fade"
    confident = row("f", "missing_effect", lag(0.9999, 0.2))
    assert format_effects(confident) == "brake_lag more than 99%"


def test_only_some_failed_vehicles_are_listed() -> None:
    rows = [row_without_finding(f"r{i}", "", REFUSED, "no") for i in range(5)]
    summary = summary_of(rows)
    assert "no" in summary.list_failed(5)[4]
    lines = summary.list_failed(3)
    assert len(lines) == 4
    assert lines[3].startswith("2 more")


REQUEST = vehicle_finding.FleetDiscrepancyRequest(
    LogInput([]),
    "atv",
    Path(),
    by_folder=False,
    settings=DiscrepancySettings(resamples=20),
    workers=0,
)


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Brakes that lag, nothing missing, too few stops, and no log at all."""
    folder = tmp_path_factory.mktemp("logs")
    for seed, (name, stops) in enumerate((("lag", 16), ("clean", 14), ("few", 3))):
        columns, _ = drive(WORLDS["clean" if name == "few" else name], stops, seed)
        table = {n: list(v) if v.dtype.kind in "UO" else v for n, v in columns.items()}
        write_csv(table, folder / f"{name}.csv")
    (folder / "torn.csv").write_text("run,t,v\n0,0.0,oops\n")
    return [folder / f"{name}.csv" for name in ("lag", "torn", "clean", "few")]


def run(logs: list[Path], out: Path, **changes: object) -> FleetSummary:
    request = replace(REQUEST, logs=LogInput(logs), out=out, **changes)
    rows, summary = investigate_fleet.investigate_fleet(request)
    write_fleet_page(out / investigate_fleet.PAGE, rows, summary)
    return summary


def content(folder: Path) -> dict[str, bytes]:
    """Bytes of all files, without computing times."""
    contents = {}
    for file in sorted(path for path in folder.rglob("*") if path.is_file()):
        data = file.read_bytes()
        if file.name == "discrepancy.json":
            findings = json.loads(data)
            assert findings.pop("seconds") > 0.0
            data = json.dumps(findings).encode()
        contents[str(file.relative_to(folder))] = data
    return contents


@pytest.fixture(scope="module")
def local(logs: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Findings in the logs; do not write to the folder, all workers share it."""

    def investigated() -> Path:
        folder = tmp_path_factory.mktemp("local")
        run(logs, folder)
        return folder

    return once("fleet-findings", investigated)


def test_each_vehicle_has_a_row_a_line_and_its_files(local: Path) -> None:
    rows = {row["vehicle"]: row for row in pq.read_table(local / "findings").to_pylist()}
    assert {name: row["status"] for name, row in rows.items()} == {
        "lag": "done",
        "clean": "done",
        "few": "refused",
        "torn": "refused",
    }
    assert rows["lag"]["verdict"] == "missing_effect"
    (effect,) = rows["lag"]["effects"]
    assert effect["name"] == "brake_lag"
    (tau,) = effect["parameters"]
    assert tau["value"] == pytest.approx(0.2, abs=5.0 * tau["std"])
    assert rows["lag"]["stop_distance_after"] < 0.5 * rows["lag"]["stop_distance_before"]
    assert rows["clean"]["effects"] == []
    assert "12 usable stops" in rows["few"]["reason"]
    assert "torn.csv" in rows["torn"]["reason"]
    lines = [json.loads(line) for line in (local / "findings.jsonl").read_text().splitlines()]
    assert [line["vehicle"] for line in lines] == ["lag", "torn", "clean", "few"]
    findings = json.loads((local / "vehicles" / "lag" / "discrepancy.json").read_text())
    assert findings.pop("seconds") > 0.0
    assert lines[0] == {"vehicle": "lag", "status": "done", "reason": ""} | findings
    model = read_model(local / "vehicles" / "lag" / "model.toml")
    assert (model.name, [e.name for e in model.effect]) == ("lag", ["brake_lag"])
    assert not (local / "vehicles" / "few").exists()
    page = (local / "report.html").read_text()
    assert "brake lag in 1" in page
    assert "few is excluded: " in page
    for name in ("lag", "clean"):
        assert f'href="vehicles/{name}/report.html"' in page
        assert "data:image/svg+xml" in (local / "vehicles" / name / "report.html").read_text()


def test_a_second_run_examines_new_logs_only(
    logs: list[Path], local: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    shutil.copytree(local, out)
    examined: list[str] = []

    def breaks_off(task: vehicle_finding.VehicleTask) -> vehicle_finding.Row:
        examined.append(task.vehicle)
        raise np.linalg.LinAlgError("singular")

    monkeypatch.setattr(vehicle_finding, "_examine", breaks_off)
    assert run(logs, out).resumed == 4
    assert examined == []
    assert content(out) == content(local)
    # A log that grew is another log; findings of the old one are removed.
    moved = tmp_path / "logs"
    shutil.copytree(logs[0].parent, moved)
    (moved / "lag.csv").write_text((moved / "lag.csv").read_text() + "\n")
    new = [moved / log.name for log in logs]
    summary = run(new, out)
    assert (examined, summary.resumed) == (["lag"], 3)
    assert "LinAlgError: singular" in summary.failed["lag"]
    assert not (out / "vehicles" / "lag" / "model.toml").exists()
    assert (out / "vehicles" / "clean" / "model.toml").exists()
    # A fault is tried again, a log that cannot be read is not.
    run(new, out)
    assert examined == ["lag", "lag"]
    (out / "vehicles" / "clean" / "report.html").unlink()
    with pytest.raises(InputError, match="at least one vehicle"):
        run(new, out)
    assert examined[2:] == ["lag", "clean"]


def test_a_vehicle_that_ends_its_workers_is_reported_and_tried_again(
    local: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    shutil.copytree(local, out)
    row = next(r for r in pq.read_table(out / "findings").to_pylist() if r["vehicle"] == "lag")
    task = vehicle_finding.VehicleTask(
        "lag", LogInput([]), {}, "atv.toml", "", "", row["key"], REQUEST.settings, out
    )
    assert vehicle_finding.finished(task) == row
    vehicle_finding.write_failed_row(task)
    failed_row = vehicle_finding.read_row(task)
    assert failed_row["status"] == "failed"
    assert "more memory" in failed_row["reason"]
    assert vehicle_finding.finished(task) is None
    assert not any(file.exists() for file in task.files)
    # Half a file is as good as none.
    torn = out / "findings" / "clean.parquet"
    torn.write_bytes(torn.read_bytes()[:100])
    assert vehicle_finding.read_row(replace(task, vehicle="clean", key="any")) is None


def test_each_vehicle_may_have_a_separate_model(
    logs: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: dict[str, float] = {}

    def examined(task: vehicle_finding.VehicleTask) -> vehicle_finding.Row:
        asked[task.vehicle] = task.model["braking"]["b_b"]
        return vehicle_finding.row_without_finding(
            task.vehicle, task.key, vehicle_finding.REFUSED, "enough"
        )

    monkeypatch.setattr(vehicle_finding, "_examine", examined)
    base = read_model(find_model("atv"))
    models = tmp_path / "models"
    models.mkdir()
    for name, b_b in (("lag", 0.38), ("clean", 0.42)):
        write_model(replace(base, braking=replace(base.braking, b_b=b_b)), models / f"{name}.toml")
    with pytest.raises(InputError, match="got none; lag: enough"):
        run([logs[0], logs[2]], tmp_path / "out", models=str(models))
    assert asked == {"lag": 0.38, "clean": 0.42}
    with pytest.raises(InputError, match=r"torn\.toml.*expected a model file for each"):
        run(logs, tmp_path / "other", models=str(models))


def test_errors_are_reported_before_the_comparison(
    logs: list[Path], local: Path, tmp_path: Path
) -> None:
    before = content(local)
    with pytest.raises(InputError, match="results of others"):
        run(logs, local, settings=DiscrepancySettings(false_alarm=0.01))
    assert content(local) == before
    with pytest.raises(InputError, match=r"gone\.csv.*existing file"):
        run([*logs, tmp_path / "gone.csv"], tmp_path / "out")
    with pytest.raises(InputError, match="by-folder"):
        run([logs[0], logs[0]], tmp_path / "out")
    with pytest.raises(InputError, match="--scheduler"):
        run(logs, tmp_path / "out", workers=None, scheduler="nonsense://")
