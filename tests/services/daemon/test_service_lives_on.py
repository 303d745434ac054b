"""One bad message, one lost file: the service answers, flags it, and plans no faster."""

from __future__ import annotations

import signal
import threading
import time
from pathlib import Path
from typing import Any

import pytest
import zenoh

from slopewise.services.daemon.daemon import Service
from slopewise.services.parameters import replies
from slopewise.services.parameters.learner import Learner
from slopewise.services.planning.plan_endpoint import PlanEndpoint
from slopewise.services.settings.service_settings import Planning, ServiceConfig, ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from tests.services.parameter_client import Robot, robot_on_ground, send_ground
from tests.services.service_process import Running, free_port, running

G = 9.80665
STORE = '[store]\npath = "p.sqlite"\nretry = 0.2\n'


def test_an_observation_that_breaks_learning_is_answered_counted_and_flagged_for_a_while(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    port = free_port()
    config = ServiceConfig(
        model="atv",
        namespace="test/breaks",
        planning=Planning(deadline=5.0),
        zenoh=ZenohSettings(listen=(f"tcp/127.0.0.1:{port}",)),
    )
    learn, read = Learner.observe, replies.read

    def breaks(self: Learner, message: Any, *rest: Any) -> Any:
        if message.source == "evil":
            raise ZeroDivisionError("an unknown fault")
        return learn(self, message, *rest)

    def breaks_too(service: Any, question: Any) -> Any:
        if question.group == "evil":
            raise ZeroDivisionError("another")
        return read(service, question)

    monkeypatch.setattr(Learner, "observe", breaks)
    monkeypatch.setattr(replies, "read", breaks_too)
    settings = ZenohSettings(mode="client", connect=(f"tcp/127.0.0.1:{port}",))
    with Service(config) as service, zenoh.open(zenoh_config(settings)) as session:
        here = Running(None, "", "test/breaks")  # type: ignore[arg-type]
        robot, evil = Robot(here, session), Robot(here, session, "evil")
        send_ground(robot)
        free = robot.top_speed()
        receipt = evil.stop(0.42 * G)
        assert receipt["status"] == "error"
        assert receipt["reason"] == "stop 1 of evil could not be treated: fault of the service"
        assert evil.query("params/evil", None, "")["status"] == "error"  # type: ignore[index]
        assert robot.top_speed() == pytest.approx(free)
        status = robot.status()
        assert status["degraded"] == []
        assert status["counters"]["faults"] == 2
        assert any(flag.startswith("stop 1 of evil") for flag in status["flags"])
        assert robot.stop(0.42 * G)["status"] == "taken"
        service.parameters.notices._duration = 0.0
        assert not any("evil" in flag for flag in robot.status()["flags"])


def test_a_start_that_fails_ends_all_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(self: PlanEndpoint, session: zenoh.Session) -> None:
        raise zenoh.ZError("no declaration")

    monkeypatch.setattr(PlanEndpoint, "declare", fail)
    before = set(threading.enumerate())
    endpoints = (f"tcp/127.0.0.1:{free_port()}",)
    config = ServiceConfig(model="atv", zenoh=ZenohSettings(listen=endpoints))
    with pytest.raises(zenoh.ZError), Service(config):
        pass
    assert [thread.name for thread in set(threading.enumerate()) - before] == []


@pytest.mark.parametrize("copy", ["whole", "empty"])
def test_killed_and_its_store_emptied_it_is_flagged_and_no_faster(
    tmp_path: Path, copy: str
) -> None:
    store, port = tmp_path / "p.sqlite", free_port()
    with running(tmp_path, planning=STORE, port=port) as service, service.peer() as session:
        robot = Robot(service, session)
        send_ground(robot)
        by_file = robot.top_speed()
        for _ in range(4):
            assert robot.stop(0.12 * G)["durable"]
        slow = robot.top_speed()
        time.sleep(1.5)
        service.process.send_signal(signal.SIGKILL)
        service.process.wait(5.0)
    store.write_bytes(b"")
    if copy == "empty":
        store.with_name("p.sqlite-last").write_bytes(b"")
    with robot_on_ground(tmp_path, planning=STORE, port=port) as robot:
        flags = robot.plan()["flags"]
        assert any("p.sqlite.corrupt-1" in flag for flag in flags), flags
        if copy == "whole":
            assert robot.top_speed() == pytest.approx(slow, rel=0.02)
        else:
            assert any("what was learned is lost" in flag for flag in flags), flags
            assert robot.top_speed() < 0.95 * by_file
        log = store.with_name("p.sqlite.corrupt-1-wal")
        assert log.stat().st_size > 0, "the log of the database is not deleted"
        for _ in range(6):
            robot.stop(0.42 * G)
        assert not any("lost" in flag for flag in robot.plan()["flags"])
