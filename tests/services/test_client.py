from __future__ import annotations

import signal
import time
from pathlib import Path

import numpy as np
import pytest
import zenoh

from slopewise.models.errors import ParameterError
from slopewise.services.client import ClientAnswer, PlanClient
from slopewise.services.settings.service_settings import ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from tests.services.service_process import Running, fan, flat, free_port, running, suspend


def is_safe(outcome: ClientAnswer, speed: float) -> None:
    """An own stop: never faster than now, and at rest in the end."""
    assert outcome.reply is None
    stop = outcome.stop
    assert stop.speed[0] == speed
    assert stop.speed.max() == speed
    assert stop.speed[-1] == 0.0
    assert np.all(np.diff(stop.speed) <= 0.0)
    assert stop.distance == pytest.approx(np.trapezoid(stop.speed, stop.time), rel=1e-12)


def test_kill_minus_nine_and_the_client_stops_by_itself(tmp_path: Path) -> None:
    with (
        running(tmp_path) as started,
        started.session() as opened,
        PlanClient(opened, namespace=started.namespace, timeout=0.3) as client,
    ):
        client.put_map(flat())
        until = time.monotonic() + 10.0
        outcome = client.plan(2.0, fan())
        while time.monotonic() < until and not (outcome.reply and outcome.reply.plans):
            outcome = client.plan(2.0, fan())
        assert outcome.reply is not None
        assert outcome.stop is None
        started.process.kill()
        for _ in range(5):
            begun = time.monotonic()
            outcome = client.plan(2.0, fan())
            assert time.monotonic() - begun < 2.0
        is_safe(outcome, 2.0)


def test_a_hung_service_is_one_that_does_not_answer(tmp_path: Path) -> None:
    with (
        running(tmp_path) as hung,
        hung.session() as opened,
        PlanClient(opened, namespace=hung.namespace, timeout=0.3) as client,
    ):
        suspend(hung.process.pid)
        begun = time.monotonic()
        outcome = client.plan(1.5, fan())
        took = time.monotonic() - begun
        hung.process.send_signal(signal.SIGCONT)
    is_safe(outcome, 1.5)
    assert 0.25 < took < 2.0
    assert outcome.stop.reason == "no service answers"


def test_what_is_no_plan_is_no_answer(service: Running) -> None:
    with (
        service.session() as opened,
        PlanClient(opened, namespace=service.namespace, timeout=2.0, name="a") as client,
    ):
        outcome = client.plan(1.0, fan())
    is_safe(outcome, 1.0)
    assert outcome.stop.reason.startswith("error")
    assert "pose" in outcome.stop.reason


def test_nobody_there() -> None:
    port = free_port()
    settings = ZenohSettings(listen=(f"tcp/127.0.0.1:{port}",))
    with (
        zenoh.open(zenoh_config(settings)) as opened,
        PlanClient(opened, namespace="nobody/here", timeout=0.2) as client,
    ):
        is_safe(client.plan(1.0, fan()), 1.0)
        for value in (float("nan"), float("inf"), -1.0):
            assert client.safe_stop(value, "").speed.max() == 0.0
        with pytest.raises(ParameterError, match="timeout"):
            PlanClient(opened, timeout=0.0)
