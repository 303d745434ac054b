"""Shares of the planner's benchmarks: cycles are counted, smoothed plans are near the optimum."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from benchmarks.common.campaign import BenchmarkRequest, no_progress
from benchmarks.common.profile_quality import smooth_excess, stations_of, travel_time
from benchmarks.planner import cycle_time, optimality
from benchmarks.planner.cycle_time import CANDIDATES, STATIONS, HorizonDrive
from slopewise.planner.horizon.answer import FULL_STOP, CycleAnswer, Ranked
from slopewise.planner.plan import Status
from slopewise.planner.profile.reference import JerkLimitedReference


def test_cycles_are_driven_and_those_that_smooth_fewer_are_counted() -> None:
    # The first cycle may have to compile the kernels, for minutes on a busy machine.
    drive = HorizonDrive(cycles_per_fan=5, budget=600.0)
    answers = [drive.step()[2] for _ in range(60)]
    assert drive.metres > 5.0
    fan = drive.draw_fan()
    assert fan.x.shape == (STATIONS, CANDIDATES)
    np.testing.assert_allclose(np.hypot(np.diff(fan.x, axis=0), np.diff(fan.y, axis=0)), 0.25)
    assert all(len(answer.ranking) == CANDIDATES for answer in answers)
    # Where the ground of a new fan is slower than the vehicle, it brakes harder and reports it.
    assert {a.status for a in answers} <= {Status.OK, Status.BLOCKED, Status.DEGRADED}
    assert sum(a.status is Status.DEGRADED for a in answers) < 0.2 * len(answers)

    complete, tally = answers[0], cycle_time.TimingTally()
    late = replace(complete.plans[1], status=Status.DEGRADED, reason="not smoothed within 20 ms")
    fewer = replace(complete, plans=complete.plans[:2])
    degraded = replace(complete, plans=(complete.plans[0], late, *complete.plans[2:]))
    no_path = (Ranked("a", np.inf, False, ""),)
    stopped = CycleAnswer(Status.DEGRADED, "", None, FULL_STOP, ranking=no_path)
    for answer, count in ((complete, 0), (fewer, 1), (degraded, 2), (stopped, 2)):
        tally.add(len(tally.seconds) + 1.0, 0.5, answer)
        assert tally.fewer == count
    result = tally.result("x", 1.0)
    assert (result["p50"], result["max"], result["cycles"]) == (2.5, 4.0, 4)


def test_drive_and_memory_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cycle_time, "_WARM_UP", 10)
    result = cycle_time.timed_drive("short", 20, lambda _: None)
    assert 0.0 < result["p50"] <= result["p99"] <= result["max"]
    memory = cycle_time.memory(20, lambda _: None)
    assert memory["resident"] > 1e7
    # A cycle that kept its arrays would hold hundreds of kilobytes more each time.
    assert memory["traced_growth"] < 20 * 100e3


@pytest.fixture(scope="module")
def result() -> dict[str, Any]:
    return optimality.run(BenchmarkRequest(quick=True), no_progress)


def test_smoothed_plans_are_fast_and_within_a_percent_of_the_optimum(
    result: dict[str, Any],
) -> None:
    assert result["instances"] == optimality.QUICK_INSTANCES
    assert not result["unsolved"]
    assert len(result["above"]) <= 3
    # A crest makes a dip of one station in the bounds, which a limit of jerk has to round.
    assert result["excess"]["most"] < 0.02
    # Faster than the optimum only within the tolerance of IPOPT.
    assert result["breach"] < 1e-3
    assert result["excess"]["least"] > -1e-4
    assert result["ratio"]["median"] > 10.0
    missed = {"name": "a hill", "excess": 0.02, "reason": "a reason"}
    screen = Console(record=True, width=120)
    optimality.show({**result, "above": [missed], "unsolved": [missed]}, screen)
    text = screen.export_text()
    assert "2.00% above the optimum: a hill" in text
    assert "not solved: a hill: a reason" in text


def test_problems_are_the_same_for_a_seed_and_of_many_kinds() -> None:
    first, again = (list(islice(optimality.instances(12), 12)) for _ in range(2))
    assert [i.name for i in first] == [i.name for i in again]
    assert len({i.name for i in first}) == 12
    assert {i.problem.start_accel is None for i in first} == {True, False}
    assert any(i.problem.speed_sq_max[-2] <= 0.0 for i in first), "some stop before their end"
    assert any(i.problem.speed_sq_max[0] > 0.0 for i in first), "some move at their start"


def test_slower_profile_needs_more_time() -> None:
    """The measure itself: a profile at 80 % of the optimal speed takes a quarter longer."""
    problem = next(optimality.instances(1)).problem
    optimum = JerkLimitedReference(len(problem.speed_sq_max)).solve(problem)
    assert optimum.speed_sq is not None
    assert smooth_excess(problem, optimum.speed_sq) < 1e-3
    slower = travel_time(stations_of(problem), 0.64 * optimum.speed_sq)
    assert slower / optimum.travel_time == pytest.approx(1.25)
