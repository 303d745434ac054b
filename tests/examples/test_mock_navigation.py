"""The example of a navigation stack around a lap; README runs it as a program."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import zenoh

from examples.mock_navigation import (
    CELL,
    COLUMNS,
    MIDDLE,
    RADII,
    ROWS,
    SIDEWAYS,
    Loop,
    Robot,
    drive_around,
    hills,
)
from slopewise import PlanClient
from slopewise.services.daemon.daemon import Service
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.settings.service_settings import Planning, ServiceConfig, ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from tests.services.service_process import free_port, running


@pytest.mark.parametrize("laps", [0.15, pytest.param(1.0, marks=pytest.mark.nightly)])
def test_it_stays_on_the_map_for_a_lap_and_obeys(laps: float) -> None:
    """As fast as answers come; speeds are compared with the limits of the model."""
    endpoint, period = (f"tcp/127.0.0.1:{free_port()}",), 0.1
    listening = ZenohSettings(listen=endpoint)
    patient = Planning(budget=10.0)  # plans are smoothed however busy the machine is
    config = ServiceConfig(model="atv", namespace="test/lap", zenoh=listening, planning=patient)
    robot = Robot(hills(), Loop.ellipse())
    end = laps * robot.loop.length
    with (
        Service(config),
        zenoh.open(zenoh_config(ZenohSettings(mode="client", connect=endpoint))) as session,
        PlanClient(session, namespace=config.namespace, name="lap", timeout=2.0) as client,
    ):
        for _ in range(4):
            done = drive_around(robot, client, period, 150, paced=False)
            assert done.stops <= 5
            check_track(np.array(done.track), period)
            if robot.driven > end:
                break
    assert robot.driven > end


@pytest.mark.nightly
def test_the_first_questions_to_a_new_service_are_answered(tmp_path: Path) -> None:
    robot = Robot(hills(), Loop.ellipse())
    with (
        running(tmp_path, fresh=True) as started,
        started.session() as session,
        PlanClient(session, namespace=started.namespace, name="mock", timeout=1.0) as client,
    ):
        done = drive_around(robot, client, 0.1, 120)
    assert done.stops == 0
    assert robot.driven > 10.0


def check_track(track: np.ndarray, period: float) -> None:
    """Where it was and how fast, compared with the ellipse's formula and the limits."""
    limits = read_model(find_model("atv")).limits
    (x, y), speed = track[:, :2].T, track[:, 2]
    assert np.all((x > 2.0) & (x < CELL * COLUMNS - 2.0))
    assert np.all((y > 2.0) & (y < CELL * ROWS - 2.0))
    outwards = np.hypot((x - MIDDLE[0]) / RADII[0], (y - MIDDLE[1]) / RADII[1])
    assert np.all(np.abs(outwards - 1.0) * min(RADII) < SIDEWAYS + 0.5)
    assert speed.max() <= limits.speed
    assert speed.max() > 1.5
    change = np.diff(speed) / period
    assert change.max() <= limits.accel + 0.05
    turn = np.arctan2((y - MIDDLE[1]) / RADII[1], (x - MIDDLE[0]) / RADII[0])
    a, b = RADII
    curvature = a * b / np.hypot(a * np.sin(turn), b * np.cos(turn)) ** 3
    assert np.max(speed**2 * curvature) < 1.25 * limits.lateral_accel


def test_the_loop_is_the_ellipse() -> None:
    loop = Loop.ellipse()
    a, b = RADII
    ratio = ((a - b) / (a + b)) ** 2
    ramanujan = np.pi * (a + b) * (1.0 + 3.0 * ratio / (10.0 + np.sqrt(4.0 - 3.0 * ratio)))
    assert loop.length == pytest.approx(ramanujan, rel=1e-4)
    index, left = loop.nearest(MIDDLE[0] + a - 1.0, MIDDLE[1])
    assert left == pytest.approx(1.0, abs=0.01)
    assert min(index, len(loop.points) - index) <= 1
