"""Faults around a service that learns: planning continues, is flagged, and is never faster.

One bad message, one lost file: the service answers, flags it, and plans no faster.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest
import zenoh

from slopewise.services.daemon.daemon import Service
from slopewise.services.parameters import replies
from slopewise.services.parameters.learner import Learner
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.planning.plan_endpoint import PlanEndpoint
from slopewise.services.settings.service_settings import Planning, ServiceConfig, ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from tests.services.parameter_client import Robot, robot_on_ground, send_ground, speeds_of
from tests.services.service_process import Running, free_port, running, until
from tests.services.warm_process import WarmProcess

G = 9.80665
STORE = '[store]\npath = "p.sqlite"\nretry = 0.2\n'


def flagged(robot: Robot, text: str) -> bool:
    return any(text in flag for flag in robot.plan()["flags"])


TOKEN = """
import json, sys, time, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
config.insert_json5("scouting/multicast/enabled", "false")
session = zenoh.open(config)
token = session.liveliness().declare_token(sys.argv[2])
print("alive", flush=True)
time.sleep(600)
"""


def estimator(service: Running, name: str) -> subprocess.Popen[str]:
    arguments = [sys.executable, "-c", TOKEN, service.endpoint, service.key(f"alive/{name}")]
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "alive\n"
    return process


def test_without_its_estimator_plans_are_slower_with_a_reason(tmp_path: Path) -> None:
    learning = 'budget = 5.0\n[learning]\nestimators = ["camera"]\ndegraded_speed = 0.8'
    with robot_on_ground(tmp_path, planning=learning) as robot:
        missing = "degraded: estimator camera is not alive"
        assert flagged(robot, missing)
        assert robot.top_speed(20.0) <= 0.8
        camera = estimator(robot.service, "camera")
        until(lambda: not flagged(robot, missing))
        free = robot.top_speed(20.0)
        assert free > 2.0
        assert robot.status()["degraded"] == []
        # A robot that drives faster than the tighter cap is braked down to it, not stood still.
        pose, at = (0.0, 0.0, 0.0), {"client": "driver"}
        fast = robot.plan(2.0, pose=pose, **at)
        assert fast["status"] == "ok"
        camera.send_signal(signal.SIGKILL)
        camera.wait()
        begun = time.monotonic()
        until(lambda: flagged(robot, missing))
        assert time.monotonic() - begun < 2.0
        assert robot.top_speed(20.0) <= 0.8
        slower = robot.plan(2.0, pose=pose, **at)
        assert slower["plans"], slower["reason"]
        speeds = speeds_of(slower["plans"][0])
        assert speeds[0] == 2.0
        assert speeds[len(speeds) // 2] <= 0.8 + 1e-6
        assert robot.status()["degraded"] == ["estimator camera is not alive"]
        again = estimator(robot.service, "camera")
        until(lambda: not flagged(robot, missing))
        assert robot.top_speed(20.0) == pytest.approx(free)
        again.kill()
        again.wait()


def test_a_disk_that_is_full_stops_nothing_and_is_flagged(tmp_path: Path) -> None:
    with robot_on_ground(tmp_path, planning=STORE) as robot:
        assert robot.stop(0.42 * G)["durable"]
        free = robot.top_speed()
        # From here on no file of that process may grow, as on a full disk.
        pid = robot.service.process.pid
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
        receipts = [robot.stop(0.12 * G) for _ in range(3)]
        assert [r["status"] for r in receipts] == ["taken"] * 3
        assert not receipts[-1]["durable"]
        assert flagged(robot, "parameters are not kept")
        assert robot.top_speed() < 0.95 * free, "slower plans do not wait for the disk"
        assert robot.plan()["parameters"]["version"] == receipts[-1]["version"]
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
        until(lambda: not flagged(robot, "parameters are not kept"))
        values, version = robot.group()["values"], robot.group()["version"]
    with running(tmp_path, planning=STORE) as service, service.session() as session:
        robot = Robot(service, session)
        assert robot.group()["version"] == version
        assert robot.group()["values"] == pytest.approx(values, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "warning"),
    [
        ("planner", "another service has this id"),
        ("other", 'another service, "planner", answers requests in this namespace'),
    ],
)
def test_two_services_on_the_same_keys_flag_each_other_and_one_keeps(
    tmp_path: Path, name: str, warning: str
) -> None:
    port = free_port()
    with running(tmp_path, planning=STORE, port=port) as first:
        shared = tmp_path / "second"
        shared.mkdir()
        second = shared / "service.toml"
        port_of_second = free_port()
        text = (tmp_path / f"service-{port}.toml").read_text()
        text = text.replace(first.endpoint, f"tcp/127.0.0.1:{port_of_second}")
        text = text.replace("[zenoh]\n", f'[zenoh]\nconnect = ["{first.endpoint}"]\n')
        text = text.replace('"p.sqlite"', '"../p.sqlite"')
        second.write_text(f'id = "{name}"\n{text}')
        duplicate = WarmProcess(["serve", "--config", str(second)], os.environ)
        try:
            assert "answers" in duplicate.stdout.readline()
            with first.session() as session:
                robot = Robot(first, session)
                statuses: dict[str, dict] = {}

                def receive(sample: zenoh.Sample) -> None:
                    status = json.loads(sample.payload.to_bytes())
                    statuses[status["instance"]] = status

                with session.declare_subscriber(first.key("status"), receive):
                    warnings = {warning, warning.replace('"planner"', '"other"')}
                    until(
                        lambda: sum(bool(warnings & {*s["flags"]}) for s in statuses.values()) == 2
                    )
                stored = [any("not kept" in f for f in s["flags"]) for s in statuses.values()]
                assert sorted(stored) == [False, True], "only one of them may write"
                reply = robot.plan()
                assert warnings & {*reply["flags"]}
                assert reply["status"] == "degraded"
                assert reply["command"]["stop"], "there is no map yet"
        finally:
            duplicate.kill()
            duplicate.wait()


def test_clocks_that_are_set_change_nothing(tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: the clock of the day cannot be set for one process")
    library, offset = tmp_path / "shim.so", tmp_path / "offset"
    source = Path(__file__).with_name("clock_shim.c")
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True)
    offset.write_text("0")
    environment = {"LD_PRELOAD": str(library), "CLOCK_OFFSET_FILE": str(offset)}
    learning = f"[learning]\nrefresh = 0.1\n{STORE}"
    with (
        running(tmp_path, planning=learning, environment=environment) as service,
        service.session() as session,
    ):
        robot = Robot(service, session)
        send_ground(robot)
        for _ in range(3):
            robot.stop(0.3 * G)
        speed, values = robot.top_speed(), robot.group()["values"]
        for jump in (3600, -3600):
            offset.write_text(str(jump))
            seen = robot.parameters(history=1)["history"][0]["at"]
            time.sleep(0.3)
            assert robot.top_speed() <= speed * (1.0 + 1e-6)
            assert robot.top_speed() == pytest.approx(speed, rel=1e-3)
            assert robot.group()["values"] == pytest.approx(values, rel=1e-3)
            assert robot.group()["age"] < 60.0
            receipt = robot.stop(0.3 * G)
            assert receipt["durable"]
            values, speed = robot.group()["values"], robot.top_speed()
            at = robot.parameters(history=1)["history"][0]["at"]
            assert abs(at - time.time() - jump) < 30.0, "the clock was set"
            assert abs(at - seen) > 1000.0


def test_plans_are_slower_while_learning_does_not_respond(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from slopewise.services.daemon import daemon
    from slopewise.services.settings.service_settings import read_config

    port = free_port()
    file = tmp_path / "service.toml"
    file.write_text(
        f'model = "atv"\nnamespace = "test/hang"\n[zenoh]\nlisten = ["tcp/127.0.0.1:{port}"]\n'
        "[status]\nperiod = 0.05\n[learning]\ndegraded_speed = 0.7\nrefresh = 0.2\n"
        "[planning]\ndeadline = 5.0\n"
    )
    monkeypatch.setattr(daemon, "_LEARNING_TIMEOUT", 1.0)
    hang = {"for": 0.0}
    tick = ParameterService.tick

    def slow(self: ParameterService) -> None:
        time.sleep(hang["for"])
        tick(self)

    monkeypatch.setattr(ParameterService, "tick", slow)
    settings = ZenohSettings(mode="client", connect=(f"tcp/127.0.0.1:{port}",))
    with daemon.Service(read_config(file)), zenoh.open(zenoh_config(settings)) as session:
        here = Running(None, f"tcp/127.0.0.1:{port}", "test/hang")  # type: ignore[arg-type]
        robot = Robot(here, session)
        send_ground(robot)
        until(lambda: robot.top_speed(20.0) > 0.7)
        free = robot.top_speed(20.0)
        hang["for"] = 2.5
        until(lambda: flagged(robot, "degraded: learning hangs"))
        assert robot.top_speed(20.0) <= 0.7 < free
        hang["for"] = 0.0
        # A tick that began before may still hang, also between two plans.
        until(lambda: not flagged(robot, "degraded: learning hangs"), 15.0)
        until(lambda: robot.top_speed(20.0) == pytest.approx(free), 15.0)


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
    until = time.monotonic() + 5.0  # callbacks of a closed session end a little later
    while (left := set(threading.enumerate()) - before) and time.monotonic() < until:
        time.sleep(0.01)
    assert [thread.name for thread in left] == []


def test_killed_and_its_store_emptied_it_is_flagged_and_no_faster(tmp_path: Path) -> None:
    store, port = tmp_path / "p.sqlite", free_port()
    with running(tmp_path, planning=STORE, port=port) as service, service.peer() as session:
        robot = Robot(service, session)
        send_ground(robot)
        for _ in range(4):
            assert robot.stop(0.12 * G)["durable"]
        slow = robot.top_speed()
        time.sleep(1.5)
        service.process.send_signal(signal.SIGKILL)
        service.process.wait(5.0)
    store.write_bytes(b"")
    with robot_on_ground(tmp_path, planning=STORE, port=port) as robot:
        flags = robot.plan()["flags"]
        assert any("p.sqlite.corrupt-1" in flag for flag in flags), flags
        assert robot.top_speed() == pytest.approx(slow, rel=0.02), "by the second copy"
        log = store.with_name("p.sqlite.corrupt-1-wal")
        assert log.stat().st_size > 0, "the log of the database is not deleted"
