"""The edge, a service and an emulated robot, each in a separate process, over a router."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh
from zenoh.ext import CacheConfig, declare_advanced_publisher

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from slopewise.services.io.bags import GRID_MAP
from slopewise.services.ros.edge import RosEdge
from slopewise.services.ros.inbox import decoded
from slopewise.services.ros.node import Node
from slopewise.services.ros.settings import EdgeSettings, RosSettings, ServiceEndpoint, Timing
from slopewise.services.settings.service_settings import ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from tests.services.ros import ros_peer
from tests.services.service_process import Running, free_port, running, until
from tests.services.warm_process import WarmProcess

PEER = Path(__file__).with_name("ros_peer.py")
TOKEN = re.compile(
    r"@ros2_lv/0/(?P<session>[0-9a-f]+)/0/(?P<entity>\d+)/(?P<kind>NN|MP|MS)/%/%/slopewise"
    r"(/%(?P<topic>[\w%]+)/(?P<type>\w+::msg::dds_::\w+_)/RIHS01_[0-9a-f]{64}/::,10:,:,:,,)?"
)


@contextlib.contextmanager
def router() -> Iterator[str]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    settings = ZenohSettings(mode="router", listen=(endpoint,))
    with zenoh.open(zenoh_config(settings)):
        yield endpoint


@contextlib.contextmanager
def edge(folder: Path, settings: str = "") -> Iterator[tuple[str, WarmProcess]]:
    """Router, service and edge; gives the router's endpoint, and the process of the edge."""
    with router() as endpoint, running(folder, planning="budget = 0.008\n") as service:
        file = folder / "ros.toml"
        file.write_text(
            f'[ros]\nconnect = ["{endpoint}"]\n[service]\nconnect = "{service.endpoint}"\n'
            f'namespace = "{service.namespace}"\ntimeout = 0.5\n{settings}'
        )
        process = WarmProcess(["ros", "--config", str(file)], os.environ)
        try:
            line = process.stdout.readline()
            assert endpoint in line, (line, process.stderr.read())
            yield endpoint, process
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
            process.wait(10.0)


def robot(endpoint: str, *options: str) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, str(PEER), endpoint, *options], capture_output=True, text=True, timeout=90
    )
    assert done.returncode == 0, done.stderr
    report: dict[str, Any] = json.loads(done.stdout)
    return report


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The router of an edge that does not wait long for paths; it ends on a signal."""
    folder = tmp_path_factory.mktemp("edge")
    with edge(folder, "[timing]\npath_age = 0.5\n") as (where, process):
        yield where
        process.send_signal(signal.SIGTERM)
        assert process.wait(10.0) == 0


def test_paths_and_map_become_limits(endpoint: str) -> None:
    report = robot(endpoint, "--seconds", "3")
    shown = [TOKEN.fullmatch(token) for token in report["tokens"]]
    assert all(shown), report["tokens"]
    seen = {(token["kind"], token["topic"], token["type"]) for token in shown if token}
    assert seen == {
        ("NN", None, None),
        ("MS", "plan", "nav_msgs::msg::dds_::Path_"),
        ("MS", "elevation_map", "grid_map_msgs::msg::dds_::GridMap_"),
        ("MS", "odom", "nav_msgs::msg::dds_::Odometry_"),
        ("MS", "tf", "tf2_msgs::msg::dds_::TFMessage_"),
        ("MS", "tf_static", "tf2_msgs::msg::dds_::TFMessage_"),
        ("MP", "speed_limit", "nav2_msgs::msg::dds_::SpeedLimit_"),
        ("MP", "speed_stop", "std_msgs::msg::dds_::Bool_"),
        ("MP", "speed_plan", "nav_msgs::msg::dds_::Path_"),
        ("MP", "diagnostics", "diagnostic_msgs::msg::dds_::DiagnosticArray_"),
    }
    entities = [token["entity"] for token in shown if token]
    assert len(set(entities)) == len(entities)
    # Not faster than the model may: 4 m/s; faster than the robot is, on level ground that is known.
    assert all(0.0 < limit <= 4.0 for limit in report["limits"])
    assert max(report["limits"]) > 1.0
    assert not report["last_stop"]
    numbers = [struct.unpack("<qqB16s", bytes.fromhex(data)) for data in report["attachments"]]
    assert {number[2] for number in numbers} == {16}
    assert len({number[3] for number in numbers}) == 1
    assert np.all(np.diff([number[0] for number in numbers]) == 1)
    assert np.all(np.diff([number[1] for number in numbers]) >= 0)
    stamps, x = np.array(report["profile"]).T
    assert np.all(np.diff(stamps) > 0.0)
    assert np.all(np.diff(x) > 0.0)
    # A metre a second and faster, but not faster than 4 m/s.
    assert 0.2 < (stamps[-1] - stamps[0]) / (x[-1] - x[0]) < 1.5
    # A second without a path: a stop, published without the 0.0 that would lift the limit.
    assert report["after"] == [0.01, 0.01, 0.01]
    assert report["stop_after"]
    assert report["diagnosis"]["level"] == 2
    assert (
        "no path" in report["diagnosis"]["message"] or "odometry" in report["diagnosis"]["message"]
    )


def test_unusable_paths_are_refused(endpoint: str) -> None:
    report = robot(endpoint, "--seconds", "2", "--bad")
    assert max(report["limits"]) > 0.1
    assert report["stop_after"]
    assert report["after"][-1] == 0.01
    reasons = {"cut": "cut off", "tail": "1 bytes after it", "hash": "as defined by RIHS01_"}
    count = 0
    for defect, (refused, reason) in report["refused"].items():
        assert refused >= count + 5
        assert reasons.pop(defect) in reason
        count = refused
    assert not reasons


@contextlib.contextmanager
def edge_here(
    endpoint: str, service: Running, clock: Callable[[], float] = time.monotonic
) -> Iterator[ros_peer.Peer]:
    """An edge in this process, and a robot on its router."""
    settings = EdgeSettings(
        ros=RosSettings(connect=(endpoint,)),
        service=ServiceEndpoint(namespace=service.namespace, timeout=1.0),
    )
    client = zenoh_config(ZenohSettings(mode="client", connect=(endpoint,)))
    with (
        zenoh.open(client) as ours,
        service.session() as asked,
        RosEdge(settings, ours, asked, clock),
    ):
        peer = ros_peer.Peer(endpoint)
        yield peer
        peer.session.close()


def drive_until(peer: ros_peer.Peer, *, stops: bool, seconds: int = 15) -> float:
    """Send paths until the edge says so; the limit. On a busy machine single paths are late."""
    crawl = Timing().crawl
    for _ in range(seconds):
        begin = len(peer.limits), len(peer.stops)
        peer.drive(1.0, 10.0, 1.0, 30.0)
        limits = [limit for _, limit in peer.limits[begin[0] :]]
        is_reached = limits[-1:] == [crawl] if stops else max(limits, default=0.0) > crawl
        if is_reached and stops in peer.stops[begin[1] :]:
            return limits[-1] if stops else max(limits)
    raise AssertionError((peer.limits[-3:], peer.stops[-3:]))


@pytest.mark.nightly
def test_limits_resume_when_the_router_is_restarted(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    listening = zenoh_config(ZenohSettings(mode="router", listen=(endpoint,)))
    first = zenoh.open(listening)
    with running(tmp_path) as service, edge_here(endpoint, service) as peer:
        drive_until(peer, stops=False)
        first.close()
        time.sleep(2.0)
        with zenoh.open(listening):
            time.sleep(3.0)
            drive_until(peer, stops=False)
            assert len([token for token in peer.tokens() if "/slopewise" in token]) == 10


def test_map_that_was_published_once_before_the_edge_is_received() -> None:
    with router() as endpoint:
        client = zenoh_config(ZenohSettings(mode="client", connect=(endpoint,)))
        with_clock = zenoh_config(ZenohSettings(mode="client", connect=(endpoint,)))
        with_clock.insert_json5("timestamping/enabled", "true")  # as rmw_zenoh's own settings
        with zenoh.open(with_clock) as robot_session, zenoh.open(client) as ours:
            publisher = declare_advanced_publisher(
                robot_session,
                ros_peer.key("elevation_map", GRID_MAP),
                cache=CacheConfig(max_samples=1),
                publisher_detection=True,
            )
            publisher.put(bytes(ros_peer.STORE.serialize_cdr(ros_peer.ground(), GRID_MAP)))
            time.sleep(0.3)
            with Node(ours, 0, "/", "late") as node:
                topic = node.subscribe("elevation_map", GRID_MAP, latched=True)
                received = node.inbox.take((topic,), time.monotonic() + 5.0)[topic]
                message = decoded(node.inbox, topic, received[-1], GRID_MAP)
            publisher.undeclare()
    assert message.info.resolution == 0.25


@pytest.mark.nightly
def test_limits_within_20_ms(tmp_path: Path) -> None:
    """20 Hz for a minute; needs two free cores."""
    with edge(tmp_path) as (endpoint, _):
        report = robot(endpoint, "--seconds", "60")
    took = np.array(report["took"][40:])
    assert np.percentile(took, 99) < 0.020, np.percentile(took, [50, 90, 99, 100])


def test_a_silent_hour_makes_the_limit_expire(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All clocks are put forward by an hour without messages; then paths come again."""
    ahead, crawl = [0.0], Timing().crawl
    monkeypatch.setattr(ros_peer, "AHEAD", ahead)
    with (
        router() as endpoint,
        running(tmp_path) as service,
        edge_here(endpoint, service, lambda: time.monotonic() + ahead[0]) as peer,
    ):
        assert drive_until(peer, stops=False) > 0.1
        # A message in transit while the clocks are put forward is an hour late, and so are all
        # after it.
        until(lambda: peer.stops[-1])
        ahead[0] = 3600.0
        put_forward = time.monotonic()

        def latest() -> list[float]:
            return [limit for at, limit in peer.limits if at > put_forward][-5:]

        # Limits and messages sent before may arrive later.
        until(lambda: latest() == [crawl] * 5 and peer.stops[-1])
        assert drive_until(peer, stops=False) > 0.1
        # And when the service dies, its plan does not live on.
        service.process.kill()
        service.process.wait(5.0)
        assert drive_until(peer, stops=True, seconds=3) == crawl
