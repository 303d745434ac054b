"""Numbers of a plan for its page, and the sentence on all plans."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.planner.limiting import Limiting
from slopewise.planner.plan import Status
from slopewise.services.report.plan_summary import best_plan, summarise, verdict
from tests.services.report.page_fixtures import plan_of


def test_numbers_of_a_plan() -> None:
    plan = plan_of(limiting=np.r_[np.full(30, 7), np.full(10, 0)])
    summary = summarise(plan, 3)
    assert summary.rank == 3
    assert summary.progress == pytest.approx(plan.progress)
    assert summary.mean_speed == pytest.approx(plan.progress / plan.travel_time)
    assert summary.max_speed == pytest.approx(plan.speed.max())
    assert summary.margin == pytest.approx(plan.least_margin)
    assert summary.rear_load == pytest.approx(0.7)
    assert summary.longest_limit is Limiting.ACCEL
    assert summary.limits_share == pytest.approx(30 / 39)


def test_loads_beyond_the_stop_are_ignored() -> None:
    speed = np.where(np.arange(40) < 20, 1.0, 0.0)
    loads = np.where(np.arange(40) > 25, 0.1, 0.6)
    assert summarise(plan_of(speed=speed, rear_load=loads), 1).rear_load == 0.6


@pytest.mark.parametrize(
    ("statuses", "sentence"),
    [
        ("", "There was no candidate to plan."),
        ("o", "The candidate reaches the end of its path."),
        ("bb", "All 2 candidates stop short of the end of their paths."),
        ("ob", "Of 2 candidates, 1 reaches the end of its path and 1 stops short of it."),
        (
            "oobddi",
            "Of 6 candidates, 2 reach the end of their paths, 1 stops short of it, "
            "2 need a fallback and 1 is infeasible.",
        ),
    ],
)
def test_verdict(statuses: str, sentence: str) -> None:
    status_of = {status.value[0]: status for status in Status}
    assert verdict([plan_of(status=status_of[letter]) for letter in statuses]) == sentence


def test_best_plan_is_the_first_that_may_be_driven() -> None:
    infeasible, blocked = plan_of(status=Status.INFEASIBLE), plan_of(status=Status.BLOCKED)
    assert best_plan([infeasible, blocked, blocked]) == 1
    assert best_plan([infeasible]) is None
