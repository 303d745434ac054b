"""`slopewise plan --explain` and `--quantile`: on the screen, as JSON, on the page."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from slopewise.models.errors import InputError
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.limiting import Limiting
from slopewise.services.cli.commands import demo, explain_view, plan_view
from slopewise.services.cli.commands import plan as command
from slopewise.services.io.map_file import write_map_npz
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.path_file import write_paths_csv


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> command.PlanJob:
    folder = tmp_path_factory.mktemp("explain")
    write_map_npz(demo.hillside(), folder / "map.npz")
    write_paths_csv(demo.fan()[:4], folder / "paths.csv")
    return command.PlanJob(folder / "map.npz", folder / "paths.csv", "atv", 1.0, 12.0, explain=True)


@pytest.fixture(scope="module")
def result(job: command.PlanJob) -> command.PlanResult:
    return command.run(job, quiet=True)


def test_plans_say_what_they_were_made_from(
    job: command.PlanJob, result: command.PlanResult
) -> None:
    told = plan_view.as_json(result)["made_from"]
    for name, path in (("map", job.map_file), ("model", find_model("atv"))):
        assert told[f"{name}_id"] == path.name
        assert told[f"{name}_hash"] == hashlib.sha256(path.read_bytes()).hexdigest()
    assert 0.0 <= told["map_age"] < 600.0
    assert "made_from" not in plan_view.as_json(replace(result, made_from=None))


def test_the_time_of_planning_is_without_that_of_the_compiler(
    job: command.PlanJob, monkeypatch: pytest.MonkeyPatch
) -> None:
    def late(job: Callable[[], object], *_: object) -> object:
        time.sleep(1.0)
        return job()

    monkeypatch.setattr(command, "sooner", late)
    begin = time.perf_counter()
    seconds = command.run(replace(job, explain=False), quiet=True).seconds
    assert 0.0 < seconds <= time.perf_counter() - begin - 1.0


@pytest.mark.parametrize("solver", ["osqp", "ipopt"])
def test_plans_may_be_smoothed_by_another_solver(
    job: command.PlanJob, result: command.PlanResult, solver: str
) -> None:
    settings = command.settings_of(True, solver=solver)
    other = command.run(replace(job, settings=settings, explain=False), quiet=True)
    usual = {plan.candidate: plan for plan in result.plans}
    for plan in other.plans:
        assert plan.status is usual[plan.candidate].status
        assert plan.travel_time == pytest.approx(usual[plan.candidate].travel_time, rel=0.02)
    assert command.checked(other, None, 12.0, quiet=True).check.valid  # type: ignore[union-attr]


def test_a_solver_that_there_is_none_of_is_an_error_of_the_option() -> None:
    with pytest.raises(InputError, match="--solver") as error:
        command.settings_of(True, solver="simplex")
    assert "ipopt" in str(error.value)


def test_the_best_candidate_is_explained(result: command.PlanResult) -> None:
    found = result.explanation
    assert found is not None
    best = result.plans[0]
    assert found.plan.candidate == best.candidate
    np.testing.assert_allclose(found.plan.speed, best.speed, atol=1e-9)
    data = json.loads(json.dumps(plan_view.as_json(result)["explain"], allow_nan=False))
    assert data["candidate"] == best.candidate
    assert {c["limiting"] for c in data["costs"]} == {bound.label for bound in Limiting}
    spent = sum(s["seconds"] for s in data["stretches"])
    assert spent == pytest.approx(best.travel_time)
    assert data["measurements"][0]["name"] == "clear_distance"
    assert data["measurements"][0]["reach"] > 10.0


def test_the_screen_shows_bounds_that_bite_and_what_to_measure(
    result: command.PlanResult,
) -> None:
    assert result.explanation is not None
    text = StringIO()
    explain_view.show(result.explanation, Console(file=text, width=100))
    words = text.getvalue()
    assert "is not faster" in words
    assert "accel" in words
    assert "wheel speed" not in words
    assert "a way known to be free" in words


def test_the_page_holds_both_tables_and_none_without_an_explanation(
    job: command.PlanJob, result: command.PlanResult, tmp_path: Path
) -> None:
    plan_view.write_page(result, job, tmp_path / "with.html")
    page = (tmp_path / "with.html").read_text()
    assert "gained without it" in page
    assert "a way known to be free" in page
    plan_view.write_page(replace(result, explanation=None), job, tmp_path / "without.html")
    assert "gained without it" not in (tmp_path / "without.html").read_text()


def test_a_higher_quantile_is_never_faster(job: command.PlanJob) -> None:
    model = read_model(find_model("atv"))
    braking = replace(model.braking, force_std=0.05, dead_time_std=0.05)
    model, ground = replace(model, braking=braking), demo.hillside()
    times = []
    for quantile in (None, 0.5, 0.99, 0.9999):
        uncertain = replace(
            job,
            uncertainty=quantile and command.uncertainty_at(quantile),
            start_speed=0.0,
            explain=False,
        )
        found = command.plan_on(ground, demo.fan()[:1], model, uncertain, source="", quiet=True)
        times.append(found.plans[0].travel_time)
    assert times[1] == pytest.approx(times[0], rel=1e-6)
    assert times[1] < times[2] < times[3]


def test_a_model_that_states_no_scatter_says_so(job: command.PlanJob) -> None:
    quantile = Uncertainty(quantile=0.99)
    silent = replace(job, model_file="husky", uncertainty=quantile, explain=False)
    result = command.run(silent, quiet=True)
    text = StringIO()
    plan_view.show(result, Console(file=text, width=100))
    assert "states no covariance or scatter" in text.getvalue()


@pytest.mark.parametrize("quantile", [0.3, 2.0, float("nan")])
def test_a_quantile_that_is_none_is_refused(quantile: float) -> None:
    with pytest.raises(InputError, match="--quantile"):
        command.uncertainty_at(quantile)
