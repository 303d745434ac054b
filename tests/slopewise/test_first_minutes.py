"""Python and the service right after the installation, without anything that was kept."""

from __future__ import annotations

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

ground = slopewise.ElevationMap(elevation=np.zeros((40, 100)), resolution=0.5, origin=(0, 0))
path = slopewise.CandidatePath("straight", np.array([[5.0, 10.0], [30.0, 10.0]]))
model = slopewise.read_model("atv")
(plan,) = slopewise.plan(model, ground, [path])
assert slopewise.check_plan(plan, model, ground).valid
state = slopewise.PlanarState(x=5, y=10, heading=0, speed=0)
answer = slopewise.Horizon(model).step(state, [path], ground)
print(plan.status.value, answer.status.value)
"""


def test_the_first_plan_from_python_needs_no_preparation() -> None:
    begun = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", FIRST], capture_output=True, text=True, timeout=120, check=True
    )
    seconds = time.monotonic() - begun
    assert done.stdout.split() == ["ok", "ok"]
    assert not done.stderr
    # Mostly imports: 1 s on an idle machine.
    assert seconds < 15.0


@pytest.mark.nightly
def test_all_first_questions_are_answered(tmp_path: Path) -> None:
    """Of a robot that drives over hills."""
    robot = mock_navigation.Robot(mock_navigation.hills(), mock_navigation.Loop.ellipse())
    with (
        running(tmp_path, fresh=True) as started,
        started.session() as session,
        PlanClient(session, namespace=started.namespace, name="mock", timeout=1.0) as client,
    ):
        done = mock_navigation.drive_around(robot, client, 0.1, 120)
    assert done.stops == 0
    assert robot.driven > 10.0
