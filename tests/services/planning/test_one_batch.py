"""Candidates of one question: resampled once, planned in one batch, whatever is known free."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.planner.pipeline import candidates
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.parameters.in_use import ParametersInUse
from slopewise.services.planning import plan_questions
from slopewise.services.planning.map_store import KnownGround, MapStore
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.settings.service_settings import Planning, ServiceConfig
from slopewise.services.wire.messages import Path, PlanReply, PlanRequest
from tests.services.service_process import fan, flat


def asked(service: PlanService, *paths: Path) -> PlanReply:
    store = MapStore()
    store.take(flat(), "map")
    ground = store.ground
    assert isinstance(ground, KnownGround)
    return service.answer(PlanRequest(speed=1.0, paths=list(paths)), ground, "plan")


def service_with(**planning: float) -> PlanService:
    config = ServiceConfig(model="atv", planning=Planning(**planning))  # type: ignore[arg-type]
    return PlanService(config, ParametersInUse(read_model(find_model("atv"))))


def with_clear(*clear: float | None) -> list[Path]:
    return [
        Path(name=path.name, points=path.points, clear=free)
        for path, free in zip(fan(len(clear), length=18.0), clear, strict=True)
    ]


def test_different_clear_distances_are_one_batch_and_answered_as_if_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    batches: list[int] = []
    resampled: list[str] = []
    solve, resample = candidates.time_optimal_batch, plan_questions.resample
    monkeypatch.setattr(
        candidates,
        "time_optimal_batch",
        lambda ground, paths, *args, **more: (
            batches.append(len(paths.names)) or solve(ground, paths, *args, **more)
        ),
    )
    monkeypatch.setattr(
        plan_questions,
        "resample",
        lambda path, *args: resampled.append(path.name) or resample(path, *args),
    )
    paths = with_clear(9.0, None, 6.0)
    service = service_with()
    together = asked(service, *paths)
    assert batches == [3]
    assert sorted(resampled) == ["c0", "c1", "c2"]
    for path in paths:
        (alone,) = asked(service, path).plans
        plan = next(one for one in together.plans if one.candidate == path.name)
        assert (plan.status, plan.reason) == (alone.status, alone.reason)
        np.testing.assert_allclose(plan.values, alone.values, rtol=0.0, atol=1e-12)


def test_the_weight_of_the_margin_reaches_the_ranking() -> None:
    """The longer path has stations a little farther apart, so more is left behind its last stop."""
    along = np.linspace(0.0, 1.0, 30)[:, None] * [1.0, 0.0]
    short, wide = (
        Path(name=name, points=along * length) for name, length in (("short", 11.9), ("wide", 12.0))
    )
    assert asked(service_with(), short, wide).chosen == "short"
    dear = asked(service_with(margin_weight=100.0), short, wide)
    assert dear.chosen == "wide"
    assert [one.name for one in dear.ranking] == ["wide", "short"]
    (plan,) = (one for one in dear.plans if one.candidate == "wide")
    assert plan.least_margin is not None
    missed = plan.column("station")[-1] - plan.progress
    cost = plan.travel_time + 2.0 * missed - 100.0 * plan.least_margin
    assert dear.ranking[0].cost == pytest.approx(cost)
