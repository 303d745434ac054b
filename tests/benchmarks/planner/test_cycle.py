"""The cycle benchmark drives, counts and looks at memory as it says."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from multiprocessing import active_children

import numpy as np
import pytest

from benchmarks.common import load
from benchmarks.planner import cycle
from benchmarks.planner.driving import CANDIDATES, STATIONS, EndlessDrive
from slopewise.planner.horizon.answer import FULL_STOP, CycleAnswer, Ranked
from slopewise.planner.plan import Status


def test_the_vehicle_drives_and_fans_begin_at_it() -> None:
    # The first cycle may have to compile the kernels, for minutes on a busy machine.
    drive = EndlessDrive(cycles_a_fan=5, budget=600.0)
    answers = []
    for _ in range(60):
        seconds, worked, answer = drive.step()
        assert seconds > 0.0
        assert worked > 0.0
        assert len(answer.ranking) == CANDIDATES
        answers.append(answer)
    assert drive.metres > 5.0
    # Where the ground of a new fan is slower than the vehicle, it brakes harder and says so.
    assert {answer.status for answer in answers} <= {Status.OK, Status.BLOCKED, Status.DEGRADED}
    assert sum(answer.status is Status.DEGRADED for answer in answers) < 0.2 * len(answers)


def test_arcs_are_as_long_as_they_should_be() -> None:
    fan = EndlessDrive()._draw()
    assert fan.x.shape == (STATIONS, CANDIDATES)
    steps = np.hypot(np.diff(fan.x, axis=0), np.diff(fan.y, axis=0))
    np.testing.assert_allclose(steps, 0.25)


def test_cycles_that_smooth_fewer_are_counted() -> None:
    drive = EndlessDrive(budget=600.0)
    _, _, whole = drive.step()
    tally = cycle.Tally()
    tally.add(1.0, 0.5, whole)
    assert tally.fewer == 0
    tally.add(2.0, 0.5, replace(whole, plans=whole.plans[:2]))
    assert tally.fewer == 1
    late = replace(whole.plans[1], status=Status.DEGRADED, reason="not smoothed within 20 ms")
    tally.add(3.0, 0.5, replace(whole, plans=(whole.plans[0], late, *whole.plans[2:])))
    assert tally.fewer == 2
    alone = CycleAnswer(
        Status.DEGRADED, "", None, FULL_STOP, ranking=(Ranked("a", np.inf, False, ""),)
    )
    tally.add(4.0, 0.5, alone)
    assert tally.fewer == 2, "where nothing can be smoothed nothing is missing"
    found = tally.result("x", 1.0)
    assert (found["p50"], found["max"], found["cycles"]) == (2.5, 4.0, 4)


def test_a_drive_and_its_memory_are_measured() -> None:
    counted: list[int] = []
    found = cycle.timed_drive("short", 20, counted.append)
    assert sum(counted) == found["cycles"] == 20
    assert 0.0 < found["p50"] <= found["p99"] <= found["max"]
    assert 0.0 < found["processor_p50"] <= found["processor_p99"]
    stages = sum(found["stages"].values())
    assert stages == pytest.approx(found["p50"], rel=2.0)
    held = cycle.memory(40)
    assert held["resident"] > 1e7
    # A cycle that kept its arrays would hold hundreds of kilobytes more each time.
    assert held["traced_growth"] < 40 * 100e3


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="no affinity on this system")
def test_one_core_is_given_back() -> None:
    before = os.sched_getaffinity(0)
    with load.on_one_core() as own:
        assert os.sched_getaffinity(0) == {own}
    assert os.sched_getaffinity(0) == before


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="no affinity on this system")
def test_working_processes_work_and_end() -> None:
    with load.working([set(os.sched_getaffinity(0))]):
        (process,) = active_children()
        until = time.monotonic() + 30.0
        while time.monotonic() < until and process.is_alive():
            with open(f"/proc/{process.pid}/stat") as file:
                ticks = int(file.read().rsplit(")", 1)[1].split()[11])
            if ticks > 20:
                break
            time.sleep(0.05)
        assert ticks > 20
    assert not active_children()
