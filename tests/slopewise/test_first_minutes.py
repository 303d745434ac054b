"""Python and the service on an installation where nothing is compiled yet."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from examples import mock_navigation
from slopewise import PlanClient
from tests.services.service_process import running

FIRST = """
import numpy as np
import slopewise
from slopewise.services.jobs import cold_start

ground = slopewise.ElevationMap(elevation=np.zeros((40, 100)), resolution=0.5, origin=(0, 0))
path = slopewise.CandidatePath("straight", np.array([[5.0, 10.0], [30.0, 10.0]]))
model = slopewise.read_model("atv")
(plan,) = slopewise.plan(model, ground, [path])
assert slopewise.check_plan(plan, model, ground).valid
state = slopewise.PlanarState(x=5, y=10, heading=0, speed=0)
answer = slopewise.Horizon(model).step(state, [path], ground)
print(plan.status.value, answer.status.value, cold_start._compiler.pid)
"""


def test_the_first_plan_from_python_waits_for_no_compiler(tmp_path: Path) -> None:
    begun = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", FIRST],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
    )
    took = time.monotonic() - begun
    *statuses, compiler = done.stdout.split()
    os.killpg(int(compiler), signal.SIGKILL)
    assert statuses[0] == "ok"
    # A cycle has no time left to smooth its plan.
    assert statuses[1] in ("ok", "degraded")
    assert re.fullmatch(r"slopewise: compiling, once .* in Python, .*\n", done.stderr), done.stderr
    # The kernels of one plan alone take a core 60 s to compile; in Python they take 2 s.
    assert took < 40.0


@pytest.mark.nightly
def test_all_first_questions_are_answered_after_a_warm_up(tmp_path: Path) -> None:
    """Of a robot that drives over hills."""
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    command = [sys.executable, "-m", "slopewise", "warm-up"]
    subprocess.run(command, env=os.environ | cache, check=True, capture_output=True)
    robot = mock_navigation.Robot(mock_navigation.hills(), mock_navigation.Loop.ellipse())
    with (
        running(tmp_path, environment=cache) as started,
        started.session() as session,
        PlanClient(session, namespace=started.namespace, name="mock", timeout=1.0) as client,
    ):
        done = mock_navigation.drive_around(robot, client, 0.1, 120)
    assert done.stops == 0
    assert robot.driven > 10.0
