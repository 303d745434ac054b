"""`slopewise plan` and `check`: files, explanation, page, quantile, solvers, independent check."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slopewise.models.parameters import Model
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.limiting import Limiting
from slopewise.planner.settings import PlannerSettings
from slopewise.services.io.model_file import find_model, read_model, write_model
from slopewise.services.io.plan_file import read_external_plans
from slopewise.services.jobs import plan as job
from slopewise.services.jobs.plan_summary import summarise
from tests.services.command_line import here

PLAN = ("plan", "map.npz", "paths.csv", "-m", "atv", "--json")


def plan_json(*arguments: str, status: int = 0) -> dict[str, Any]:
    done = here(*PLAN, *arguments)
    assert done.returncode == status, done.stderr
    return json.loads(done.stdout)  # type: ignore[no-any-return]


def plan_files_of(files: Path, **options: Any) -> job.PlanResult:
    defaults = {"start_speed": 1.0, "clear": 12.0, "uncertainty": Uncertainty(quantile=0.999)}
    return job.plan(files / "map.npz", files / "paths.csv", "atv", **{**defaults, **options})


@pytest.fixture(scope="module")
def explained(files: Path) -> job.PlanResult:
    return plan_files_of(files, explains=True)


def test_plans_are_ranked_and_written(world: Path) -> None:
    data = plan_json("--speed", "1.5", "--out", "plan.csv")
    assert data["admissible"] is True
    assert {plan["status"] for plan in data["plans"]} <= {"ok", "blocked", "degraded"}
    columns = data["plans"][0]["columns"]
    assert len(columns["station"]) == len(columns["speed"]) == len(columns["limiting"])
    assert columns["speed"][0] == pytest.approx(1.5)
    names = [plan.name for plan in read_external_plans(world / "plan.csv")]
    assert names == [p["candidate"] for p in data["plans"]]
    assert here("check", "plan.csv", "--map", "map.npz", "-m", "atv").returncode == 0


def test_no_admissible_candidate_is_status_3(world: Path) -> None:
    result = here(*PLAN[:-1], "--speed", "4", "--clear", "1")
    assert result.returncode == 3
    assert "beyond the clear distance" in " ".join(result.stdout.split())


def test_the_json_has_digests_of_map_and_model(files: Path, explained: job.PlanResult) -> None:
    made_from = summarise(explained).made_from
    assert made_from is not None
    map_hash, model_hash = (
        hashlib.sha256(file.read_bytes()).hexdigest()
        for file in (files / "map.npz", find_model("atv"))
    )
    assert (made_from.map_id, made_from.map_hash) == ("map.npz", map_hash)
    assert (made_from.model_id, made_from.model_hash) == ("atv.toml", model_hash)
    assert 0.0 <= made_from.map_age < 3600.0
    assert summarise(replace(explained, files=None)).made_from is None


@pytest.mark.parametrize("solver", ["osqp", "ipopt"])
def test_plans_of_another_solver_differ_little(
    files: Path, explained: job.PlanResult, solver: str
) -> None:
    settings = PlannerSettings(smooth=True, solver=solver)
    result = plan_files_of(files, settings=settings)
    expected = {plan.candidate: plan for plan in explained.plans}
    for plan in result.plans:
        assert plan.status is expected[plan.candidate].status
        assert plan.travel_time == pytest.approx(expected[plan.candidate].travel_time, rel=0.02)


def test_the_best_candidate_is_explained(explained: job.PlanResult) -> None:
    explanation, best = explained.explanation, explained.plans[0]
    np.testing.assert_allclose(explanation.plan.speed, best.speed, atol=1e-9)
    summary = summarise(explained).explain
    assert summary.candidate == best.candidate
    assert {cost.limiting for cost in summary.costs} == {bound.label for bound in Limiting}
    spent = sum(stretch.seconds for stretch in summary.stretches)
    assert spent == pytest.approx(best.travel_time)
    assert summary.measurements[0].name == "clear_distance"
    assert summary.measurements[0].reach > 10.0


def test_table_and_page_show_active_bounds_and_measurements(world: Path) -> None:
    arguments = ("--speed", "1", "--clear", "12", "--report", "page.html")
    shown = here(*PLAN[:-1], *arguments, "--explain").stdout
    for part in ("is not faster", "accel", "known to be free"):
        assert part in shown
    assert "wheel speed" not in shown
    assert "gained without it" in (world / "page.html").read_text()
    here(*PLAN, *arguments)
    assert "gained without it" not in (world / "page.html").read_text()


def test_a_model_without_scatter_gets_a_note(world: Path) -> None:
    arguments = ("plan", "map.npz", "paths.csv", "-m", "husky")
    assert "states no covariance or scatter" in here(*arguments).stdout


def test_planning_time_excludes_reading(files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def slow_read(read: Callable[..., Any]) -> Callable[..., Any]:
        def reader(*arguments: Any, **options: Any) -> Any:
            time.sleep(0.3)
            return read(*arguments, **options)

        return reader

    monkeypatch.setattr(job, "read_ground", slow_read(job.read_ground))
    begin = time.perf_counter()
    seconds = plan_files_of(files).seconds
    assert 0.0 < seconds <= time.perf_counter() - begin - 0.3


def test_check_reports_violations_by_kind(world: Path) -> None:
    done = here("check", "fast.csv", "--map", "level.npz", "-m", "quad.toml", "--json")
    assert done.returncode == 3
    report = json.loads(done.stdout)
    assert {v["kind"] for v in report["violations"]} >= {"speed_limit", "decel", "accel"}
    for violation in report["violations"]:
        assert violation["size"] > 0.0
        assert violation["candidate"] == "fast"
        assert violation["unit"] == report["tolerances"][violation["kind"]]["unit"]
        assert violation["sentence"]
    assert sum(report["plans"][0]["kinds"].values()) == len(report["violations"])


def test_check_reads_many_plans_and_the_clear_distance(world: Path) -> None:
    rows = (world / "fast.csv").read_text().splitlines()[1:]
    (world / "two.csv").write_text((world / "good.csv").read_text() + "\n".join(rows))
    arguments = ("--map", "level.npz", "-m", "quad.toml", "--json")
    plans = json.loads(here("check", "two.csv", *arguments).stdout)["plans"]
    assert [(p["candidate"], p["valid"]) for p in plans] == [("good", True), ("fast", False)]
    done = here("check", "good.csv", *arguments, "--clear", "10")
    assert done.returncode == 3
    assert {v["kind"] for v in json.loads(done.stdout)["violations"]} == {"stopping_path"}


def test_stops_shorter_than_by_the_file_are_reported_by_params_diff(world: Path) -> None:
    base: Model = read_model(world / "atv.toml")
    write_model(replace(base, braking=replace(base.braking, b_b=0.5)), world / "b.toml")
    data = json.loads(here("params", "diff", "atv.toml", "b.toml", "--json").stdout)
    assert data["keys"] == {"braking.b_b": {"before": 0.40, "after": 0.50}}
    assert data["stops"][0]["surface"] == "base"
    assert data["stops"][0]["least"] < data["stops"][0]["most"] < 0.0
    assert "plans get faster" in here("params", "diff", "atv.toml", "b.toml").stdout
    assert "no difference" in here("params", "diff", "atv.toml", "atv.toml").stdout
    for weaker in ({"level": 0.5}, {"sliding_friction": 0.25}):
        write_model(replace(base, braking=replace(base.braking, **weaker)), world / "b.toml")
        assert "stops on base: +" in here("params", "diff", "atv.toml", "b.toml").stdout
