"""The cycle benchmark drives, counts and measures memory."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from multiprocessing import active_children

import numpy as np
import pytest

from benchmarks.common import timing
from benchmarks.planner import cycle_time
from benchmarks.planner.horizon_drive import CANDIDATES, STATIONS, HorizonDrive
from slopewise.planner.horizon.answer import FULL_STOP, CycleAnswer, Ranked
from slopewise.planner.plan import Status

LINUX = pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="no affinity here")


@pytest.fixture(scope="module")
def answers() -> list[CycleAnswer]:
    # The first cycle may have to compile the kernels, for minutes on a busy machine.
    drive = HorizonDrive(cycles_per_fan=5, budget=600.0)
    steps = [drive.step() for _ in range(60)]
    assert drive.metres > 5.0
    assert all(seconds > 0.0 and processor > 0.0 for seconds, processor, _ in steps)
    fan = drive.draw_fan()
    assert fan.x.shape == (STATIONS, CANDIDATES)
    np.testing.assert_allclose(np.hypot(np.diff(fan.x, axis=0), np.diff(fan.y, axis=0)), 0.25)
    return [answer for _, _, answer in steps]


def test_vehicle_follows_its_candidates(answers: list[CycleAnswer]) -> None:
    assert all(len(answer.ranking) == CANDIDATES for answer in answers)
    # Where the ground of a new fan is slower than the vehicle, it brakes harder and reports it.
    assert {a.status for a in answers} <= {Status.OK, Status.BLOCKED, Status.DEGRADED}
    assert sum(a.status is Status.DEGRADED for a in answers) < 0.2 * len(answers)


def test_cycles_that_smooth_fewer_are_counted(answers: list[CycleAnswer]) -> None:
    complete, tally = answers[0], cycle_time.TimingTally()
    late = replace(complete.plans[1], status=Status.DEGRADED, reason="not smoothed within 20 ms")
    fewer = replace(complete, plans=complete.plans[:2])
    degraded = replace(complete, plans=(complete.plans[0], late, *complete.plans[2:]))
    no_path = (Ranked("a", np.inf, False, ""),)
    stopped = CycleAnswer(Status.DEGRADED, "", None, FULL_STOP, ranking=no_path)
    for seconds, answer, count in (
        (1.0, complete, 0),
        (2.0, fewer, 1),
        (3.0, degraded, 2),
        (4.0, stopped, 2),
    ):
        tally.add(seconds, 0.5, answer)
        assert tally.fewer == count
    result = tally.result("x", 1.0)
    assert (result["p50"], result["max"], result["cycles"]) == (2.5, 4.0, 4)


def test_drive_and_memory_are_measured() -> None:
    counts: list[int] = []
    result = cycle_time.timed_drive("short", 20, counts.append)
    assert sum(counts) == result["cycles"] == 20
    assert 0.0 < result["p50"] <= result["p99"] <= result["max"]
    assert sum(result["stages"].values()) == pytest.approx(result["p50"], rel=2.0)
    memory = cycle_time.memory(40, counts.append)
    assert memory["resident"] > 1e7
    # A cycle that kept its arrays would hold hundreds of kilobytes more each time.
    assert memory["traced_growth"] < 40 * 100e3


@LINUX
def test_background_load_works_and_ends_and_cores_are_restored() -> None:
    before = os.sched_getaffinity(0)
    with timing.on_one_core() as core:
        assert os.sched_getaffinity(0) == {core}
    assert os.sched_getaffinity(0) == before
    with timing.background_load([set(before)]):
        (process,) = active_children()
        until = time.monotonic() + 30.0
        ticks = 0
        while time.monotonic() < until and process.is_alive() and ticks <= 20:
            with open(f"/proc/{process.pid}/stat") as file:
                ticks = int(file.read().rsplit(")", 1)[1].split()[11])
            time.sleep(0.05)
        assert ticks > 20
    assert not active_children()
