"""Requests and candidates that are rejected, and the remaining ones that are planned."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from slopewise.models.errors import InputError
from slopewise.planner.followed_line import LineLimits
from slopewise.planner.path import resample
from slopewise.planner.path_deviation import GivenPolyline
from slopewise.planner.pipeline import candidates
from slopewise.services.planning import request_validation
from slopewise.services.planning.deadline_check import CostEstimator, DeadlineError
from slopewise.services.planning.request_validation import (
    resample_all,
    validate_candidates,
    validate_request,
)
from slopewise.services.settings.service_settings import SizeLimits
from slopewise.services.wire.plan_messages import Path, PlanRequest
from tests.services.planning.plan_requests import answer, plan_service, straight
from tests.services.service_process import fan

SIZES = SizeLimits(candidates=3, points=50, stations=200)
POSE = (0.0, 0.0, 0.0)


def requested(*paths: Path, **fields: Any) -> PlanRequest:
    return PlanRequest(**{"speed": 1.0, "paths": list(paths) or [straight("a", 10.0)], **fields})


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"paths": [straight(name, 1.0) for name in "abcd"]}, "paths"),
        ({"client": "robot"}, "pose"),
        ({"client": "robot", "pose": (0.0, 1e10, 0.0)}, "pose"),
        ({"client": "robot", "pose": (0.0, 0.0, float("nan"))}, "pose"),
        ({"speed": 1e4}, "speed"),
        ({"speed": float("nan")}, "speed"),
        ({"speed": -0.1}, "speed"),
    ],
)
def test_an_invalid_request_is_an_error_that_names_key_and_field(
    fields: dict[str, Any], field: str
) -> None:
    with pytest.raises(InputError) as caught:
        validate_request(requested(**fields), SIZES, "plan")
    assert (caught.value.source, caught.value.field) == ("plan", field)


def test_a_named_client_may_roll_backwards() -> None:
    validate_request(requested(client="robot", pose=POSE, speed=-0.1), SIZES, "plan")


def test_all_candidates_together_have_a_largest_size() -> None:
    request = requested(*(straight(name, 20.0) for name in "abc"))
    valid = validate_candidates(request, SIZES, 1.0, "plan")
    assert [c.path.name for c in valid.candidates] == ["a", "b", "c"]
    assert valid.rejected == []
    with pytest.raises(InputError, match="at most 200 stations in all, got 249"):
        validate_candidates(request, SIZES, 0.25, "plan")


def test_a_malformed_path_does_not_affect_its_neighbours() -> None:
    """Lengths are computed together."""
    paths = [straight("a", 20.0), straight("far", 1e10), straight("b", 30.0)]
    paths[0].points[7] = paths[0].points[6]
    valid = validate_candidates(requested(*paths), SIZES, 1.0, "plan")
    assert [c.path.name for c in valid.candidates] == ["b"]
    reasons = {c.name: c.reason for c in valid.rejected}
    assert list(reasons) == ["a", "far"]
    assert reasons["a"].startswith("points[7]: expected a point that differs")
    assert reasons["far"] == "points: expected finite coordinates of at most 1e+09 m"


def test_the_clear_distance_of_a_candidate_precedes_that_of_the_request() -> None:
    paths = straight("separate", 10.0, clear=3.0), straight("shared", 10.0)
    for clear, expected in ((7.0, [3.0, 7.0]), (None, [3.0, np.inf])):
        valid = validate_candidates(requested(*paths, clear=clear), SIZES, 1.0, "plan")
        assert [c.clear for c in valid.candidates] == expected


def test_a_path_ends_where_it_turns_round_and_the_remaining_ones_are_resampled() -> None:
    cusp = Path(name="cusp", points=np.array([[0.0, 0.0], [5.0, 0.0], [0.5, 0.01]]))
    valid = validate_candidates(requested(cusp, straight("a", 10.0)), SIZES, 0.5, "plan")
    assert valid.rejected == []
    even = resample_all(valid.candidates, 0.5, LineLimits(0.3))
    assert [c.path.name for c in even.candidates] == ["cusp", "a"]
    np.testing.assert_array_equal(even.candidates[0].path.points[-1], (5.0, 0.0))
    assert even.rejected == []


def test_a_path_that_its_line_would_leave_is_rejected_and_the_remaining_ones_are_resampled() -> (
    None
):
    request = requested(straight("a", 10.0), straight("b", 10.0))
    valid = validate_candidates(request, SIZES, 0.5, "plan")
    far = resample(valid.candidates[1].path, 0.5)
    far = replace(far, given=GivenPolyline(far.points, 0.4))
    even_and_far = [valid.candidates[0], replace(valid.candidates[1], path=far)]
    even = resample_all(even_and_far, 0.5, LineLimits(0.3))
    assert [c.path.name for c in even.candidates] == ["a"]
    assert [c.name for c in even.rejected] == ["b"]
    assert "max_path_deviation" in even.rejected[0].reason


def test_one_bad_candidate_is_refused_and_the_others_planned() -> None:
    points = fan(1)[0].points
    nan = points.copy()
    nan[5, 1] = np.nan
    faults = {
        "nan": (nan, "finite"),
        "inf": (np.where(np.isnan(nan), np.inf, nan), "finite"),
        "few": (points[:2], "points"),
        "none": (np.empty((0, 2)), "points"),
        "flat": (points.ravel(), "shape"),
        "wide": (np.hstack([points, points]), "shape"),
        "same": (points[[0, 1, 1, 2]], "differs"),
        "huge": (points * 1e200, "finite"),
        "long": (points * 1e5, "at most"),
    }
    paths = [Path(name=name, points=points) for name, (points, _) in faults.items()]
    paths.append(Path(name="limit", points=points, speed_limit=np.full(len(points), -1.0)))
    paths.append(Path(name="clear", points=points, clear=float("nan")))
    reply = answer(plan_service(), *paths, *[Path(name="good", points=points)] * 2)
    assert reply.status == "ok"
    assert [plan.candidate for plan in reply.plans] == ["good"]
    reasons = {c.name: c.reason for c in reply.ranking if not c.usable}
    assert set(reasons) == {*faults, "limit", "clear", "good"}
    for name, (_, part) in faults.items():
        assert part in reasons[name], (name, reasons[name])


def test_without_ground_or_candidate_it_brakes() -> None:
    unusable = Path(name="a", points=np.full((3, 2), np.nan))
    no_map = plan_service().answer(requested(*fan()), None, "plan")
    assert no_map.flags == ["no map"]
    for reply in (no_map, answer(plan_service(), unusable)):
        assert (reply.status, reply.plans) == ("degraded", [])
        assert reply.command.stop


def test_a_request_with_more_work_than_time_is_rejected() -> None:
    costs = CostEstimator()
    costs.record(100, 0.5, named=False)
    costs.check(100, 0.4, named=False)
    with pytest.raises(DeadlineError, match=r"200 candidates take about 0.7 s, 0.6 s are left"):
        costs.check(200, 0.6, named=False)
    with pytest.raises(DeadlineError, match="0 s are left"):
        costs.check(100, -1.0, named=False)


def test_unknown_costs_reject_no_request() -> None:
    """Few candidates, kinds of requests without a time yet, and a service that just began."""
    costs = CostEstimator()
    costs.check(1000, 1e-6, named=True)
    costs.record(19, 60.0, named=True)
    costs.check(1000, 1e-6, named=True)
    costs.record(100, 60.0, named=True)
    costs.check(1000, 1e-6, named=False)
    costs.check(19, 1e-6, named=True)


def test_the_quickest_recent_time_is_used() -> None:
    costs = CostEstimator()
    costs.record(100, 0.1, named=False)
    for _ in range(7):
        costs.record(100, 10.0, named=False)
        assert costs.expected(100, named=False) == pytest.approx(0.07)
    costs.record(100, 10.0, named=False)
    assert costs.expected(100, named=False) == pytest.approx(7.0)


def test_candidates_with_different_clear_distances_are_one_batch(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    batches: list[int] = []
    resampled: list[str] = []
    solve, resample = candidates.time_optimal_batch, request_validation.resample
    monkeypatch.setattr(
        candidates,
        "time_optimal_batch",
        lambda ground, paths, *args, **more: (
            batches.append(len(paths.names)) or solve(ground, paths, *args, **more)
        ),
    )
    monkeypatch.setattr(
        request_validation,
        "resample",
        lambda path, *args: resampled.append(path.name) or resample(path, *args),
    )
    paths = [
        Path(name=path.name, points=path.points, clear=clear)
        for path, clear in zip(fan(3, length=18.0), (9.0, None, 6.0), strict=True)
    ]
    service = plan_service()
    together = answer(service, *paths)
    assert batches == [3]
    assert sorted(resampled) == ["c0", "c1", "c2"]
    for path in paths:
        (alone,) = answer(service, path).plans
        plan = next(plan for plan in together.plans if plan.candidate == path.name)
        assert (plan.status, plan.reason) == (alone.status, alone.reason)
        np.testing.assert_allclose(plan.values, alone.values, rtol=0.0, atol=1e-12)


def test_a_reply_without_a_usable_path_has_the_reason() -> None:
    short = Path(name="short", points=np.zeros((1, 2)))
    reason = answer(plan_service(), short).reason
    assert reason.startswith("no candidate is usable: ")
    assert "points" in reason
    assert answer(plan_service()).reason == "no candidate is usable: paths is empty: full braking"
