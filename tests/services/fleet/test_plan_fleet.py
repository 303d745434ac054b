from __future__ import annotations

import json
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pyarrow.parquet as pq
import pytest

from benchmarks.fleet.local_cluster import cluster, workers_of
from slopewise.models.errors import InputError
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.settings import PlannerSettings
from slopewise.services.fleet import map_windows, plan_fleet, plan_part
from slopewise.services.io.map_file import map_info, read_map
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.path_file import read_paths
from tests.services.fleet_inputs import RESOLUTION, paths_file, slow_part, tiled_map


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path]]:
    folder = tmp_path_factory.mktemp("fleet")
    files = [paths_file(folder / "a.csv", 30, 1), paths_file(folder / "b.parquet", 24, 2)]
    return tiled_map(folder / "map.tif"), files


@pytest.fixture(autouse=True)
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan_part, "PART", 9)


REQUEST = plan_part.FleetPlanRequest(
    Path(), [], "atv", Path(), 0.0, np.inf, PlannerSettings(), Uncertainty(), workers=0
)


def run(
    inputs: tuple[Path, list[Path]], out: Path, **changes: object
) -> plan_fleet.FleetPlanSummary:
    request = replace(REQUEST, map_file=inputs[0], path_files=inputs[1], out=out, **changes)
    return plan_fleet.plan_fleet(request)


def content(folder: Path) -> dict[str, bytes]:
    files = sorted(folder.glob("*/*.parquet"))
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}


@pytest.fixture(scope="module")
def local(inputs: tuple[Path, list[Path]], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("local")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan_part, "PART", 9)
        result = run(inputs, folder)
    assert result.planned == 54
    assert result.resumed == 0
    assert set(result.statuses) <= {"ok", "blocked", "degraded", "infeasible"}
    assert 0 < result.driven < 54
    return folder


def test_fleet_plans_equal_those_on_the_complete_map(
    inputs: tuple[Path, list[Path]], local: Path
) -> None:
    ground = read_map(inputs[0])
    model = read_model(find_model("atv"))
    plans = pq.read_table(local / "plans")
    names = np.array(plans["candidate"].to_pylist())
    speed, station = plans["speed"].to_numpy(), plans["station"].to_numpy()
    assert not np.isnan(station).any()
    for path in read_paths(inputs[1][0]):
        (plan,) = CandidatePlanner(model, uncertainty=Uncertainty()).plan(ground, [path])
        rows = names == path.name
        n = int(rows.sum())
        assert n > 0
        np.testing.assert_allclose(station[rows], plan.station[:n], atol=1e-6)
        # Solvers that start elsewhere end within their tolerance.
        np.testing.assert_allclose(speed[rows], plan.speed[:n], atol=0.02)


def test_candidates_have_one_row_each_in_order(
    inputs: tuple[Path, list[Path]], local: Path
) -> None:
    rows = pq.read_table(local / "candidates")
    paths = [path for file in inputs[1] for path in read_paths(file)]
    assert sorted(rows["candidate"].to_pylist()) == sorted(path.name for path in paths)
    first = pq.read_table(min((local / "candidates").glob("a-*")))
    assert first["candidate"].to_pylist() == [f"a.{i}" for i in range(9)]
    assert set(rows["source"].to_pylist()) == {"a.csv", "b.parquet"}
    # Unknown ground all around is a status.
    unknown = {path.name for path in paths if (path.points.min(axis=0) > 175.0).all()}
    lost = [row for row in rows.to_pylist() if row["candidate"] in unknown]
    assert len(lost) == len(unknown) > 0
    assert not any(row["admissible"] for row in lost)


def test_windows_hold_the_margin_and_are_bounded(
    inputs: tuple[Path, list[Path]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(map_windows, "SHARED_CELLS", 20_000)
    paths, info = read_paths(inputs[1][0]), map_info(inputs[0])
    cut = list(map_windows.map_windows(paths, info, 3.0))
    assert sorted(i for members, _ in cut for i in members) == list(range(len(paths)))
    assert 1 < len(cut) < len(paths)
    for members, cells in cut:
        assert cells is not None
        rows, columns = cells
        assert (rows.stop - rows.start) * (columns.stop - columns.start) <= 20_000
        for i in members:
            low, high = paths[i].points.min(axis=0) - 3.0, paths[i].points.max(axis=0) + 3.0
            assert columns.start * RESOLUTION <= max(low[0], 0.0)
            assert rows.start * RESOLUTION <= max(low[1], 0.0)
            assert (columns.stop - 1) * RESOLUTION >= min(high[0], 255.5)
            assert (rows.stop - 1) * RESOLUTION >= min(high[1], 255.5)
    monkeypatch.setattr(map_windows, "MAX_CELLS", 1000)
    assert [cells for _, cells in map_windows.map_windows(paths[:1], info, 3.0)] == [None]


def test_a_second_run_plans_nothing_again(
    inputs: tuple[Path, list[Path]], tmp_path: Path, local: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    planned = []
    plan = plan_part.plan_part

    def dies_after_two(task: plan_part.PlanTask) -> int:
        if len(planned) == 2:
            raise KeyboardInterrupt
        planned.append(task.name.file)
        return plan(task)

    monkeypatch.setattr(plan_fleet, "plan_part", dies_after_two)
    with pytest.raises(KeyboardInterrupt):
        run(inputs, tmp_path)
    monkeypatch.setattr(plan_fleet, "plan_part", plan)
    result = run(inputs, tmp_path)
    assert (result.resumed, result.planned) == (18, 36)
    assert content(tmp_path) == content(local)
    partial = tmp_path / "plans" / ".a-0000000.parquet.0651ea1329ee.tmp"
    partial.write_bytes(b"half")  # of a worker that was killed
    again = run(inputs, tmp_path)
    assert (again.resumed, again.planned, again.unexpected) == (54, 0, 0)
    assert not partial.exists()
    # A part that lacks half of its results is planned again.
    min((tmp_path / "plans").iterdir()).unlink()
    assert run(inputs, tmp_path).planned == 9
    assert content(tmp_path) == content(local)
    for part in (min((tmp_path / "candidates").iterdir()), max((tmp_path / "plans").iterdir())):
        part.write_bytes(part.read_bytes()[:1000])
        with pytest.raises(InputError, match=f"{part.parent.name}/.*expected an intact part"):
            run(inputs, tmp_path)
        part.unlink()


def test_another_request_needs_another_folder(
    inputs: tuple[Path, list[Path]], tmp_path: Path, local: Path
) -> None:
    before = content(local)
    for change in ({"start_speed": 1.0}, {"clear": 10.0}):
        with pytest.raises(InputError, match="results of others"):
            run(inputs, local, **change)
    with pytest.raises(InputError, match="results of others"):
        run(inputs, local, model_file="husky")
    assert content(local) == before


def test_errors_are_reported_before_anything_is_planned(
    inputs: tuple[Path, list[Path]], tmp_path: Path
) -> None:
    broken = tmp_path / "bad.csv"
    broken.write_text("x,y\n40,40\n41,nan\n")
    with pytest.raises(InputError, match=r"bad\.csv.*row 3, column y"):
        run((inputs[0], [*inputs[1], broken]), tmp_path / "out")
    assert content(tmp_path / "out") == {}
    with pytest.raises(InputError, match="unique file name"):
        run((inputs[0], [inputs[1][0]] * 2), tmp_path / "out")
    with pytest.raises(InputError, match="--scheduler"):
        run(inputs, tmp_path / "out", scheduler="nonsense://")


def test_an_invalid_path_does_not_stop_the_run(
    inputs: tuple[Path, list[Path]], tmp_path: Path
) -> None:
    file = tmp_path / "some.csv"
    file.write_text(
        "x,y,candidate\n"
        + "".join(f"{40 + i},40,good\n" for i in range(15))
        + "40,50,back\n40,50.0002,back\n"
    )
    result = run((inputs[0], [file]), tmp_path / "out")
    assert result.statuses == {"ok": 1, "refused": 1}
    refused = pq.read_table(tmp_path / "out" / "candidates").to_pylist()[1]
    assert refused["candidate"] == "back"
    assert "expected" in refused["reason"]


def test_a_scheduler_and_workers_one_of_them_killed_give_the_same_bytes(
    inputs: tuple[Path, list[Path]], tmp_path: Path, local: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plan_fleet, "plan_part", slow_part)
    killed: list[int] = []

    with cluster(2) as (address, nannies):

        def kill_one_at_work() -> None:
            until = time.monotonic() + 60.0
            while not killed and time.monotonic() < until:
                for worker in workers_of(nannies) if len(content(tmp_path)) >= 2 else ():
                    if "rasterio" in " ".join(m.path for m in worker.memory_maps()):
                        worker.kill()
                        killed.append(worker.pid)
                        return
                time.sleep(0.01)

        thread = threading.Thread(target=kill_one_at_work)
        thread.start()
        result = run(inputs, tmp_path, workers=None, scheduler=address)
        thread.join()
    assert len(killed) == 1
    assert not psutil.pid_exists(killed[0])
    assert result.planned == 54
    assert content(tmp_path) == content(local)
    assert not list(tmp_path.glob("**/*.tmp"))
    assert json.loads((tmp_path / "fleet.json").read_text())["question"]
