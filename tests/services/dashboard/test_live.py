"""The live page, health and metrics: true to the service, and nothing but to be read."""

from __future__ import annotations

import json
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from prometheus_client.parser import text_string_to_metric_families

from slopewise.models.elevation_map import ElevationMap
from slopewise.services.client import PlanClient
from slopewise.services.dashboard.board import Board, GroundSeen, GroupSeen, StopSeen
from slopewise.services.dashboard.server import PageServer, own_names
from slopewise.services.dashboard.site import Site, Source
from slopewise.services.planning.map_store import MapSnapshot
from slopewise.services.settings.service_settings import PageSettings
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.observations import ObservationAck, StopObservation
from slopewise.services.wire.plan_messages import Parameters, ServiceStatus
from slopewise.services.wire.plan_messages import Path as Candidate
from tests.services import browser
from tests.services.service_process import Running, fan, flat, free_port, running

EVIL = "<img src=x onerror=alert(1)>"


def get(url: str, **headers: str) -> tuple[int, str]:
    request = urllib.request.Request(url, headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=5.0) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def rows_of_stops(page: str) -> int:
    return page.partition('id="stops"')[2].count("<tr>") - 1


def shows_a_plan(url: str) -> bool:
    plan = json.loads(get(f"{url}/state")[1])["plan"]
    return plan is not None and plan["chosen"] is not None


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Running, str]]:
    port = free_port()
    with running(tmp_path_factory.mktemp("live"), page=f"enabled = true\nport = {port}") as started:
        yield started, f"http://127.0.0.1:{port}"


@pytest.fixture(scope="module")
def asked(pages: tuple[Running, str]) -> str:
    """The page after a client sent a map and asked for plans."""
    service, url = pages
    assert get(f"{url}/health")[0] == 503
    assert "robots are commanded to brake" in browser.text_of(url)
    odd = Candidate(name=EVIL, points=fan(1)[0].points)
    with (
        service.session() as session,
        PlanClient(session, namespace=service.namespace, timeout=5.0, name="robot") as client,
    ):
        client.put_map(flat())
        until = time.monotonic() + 5.0
        while time.monotonic() < until:
            reply = client.plan(1.0, [odd, *fan(4)], pose=(0.0, 0.0, 0.0), clear=20.0).reply
            assert reply is not None
            # The page learns of an answer after it was given.
            if reply.plans and shows_a_plan(url):
                return url
            time.sleep(0.02)
    raise AssertionError("no plan in time")


def test_health_says_whether_plans_can_be_made(asked: str) -> None:
    status, body = get(f"{asked}/health")
    assert status == 200
    assert json.loads(body)["able"]


def test_state_is_what_was_answered(asked: str) -> None:
    state = json.loads(get(f"{asked}/state")[1])
    chosen = state["plan"]["chosen"]
    assert state["plan"]["client"] == "robot"
    assert state["plan"]["candidates"] == 5
    assert chosen["speed"][0] == 1.0
    assert max(chosen["speed"]) > 2.0
    assert len(chosen["limiting"]) == len(chosen["x"]) == len(chosen["speed_bound"])
    assert set(chosen["limiting"]) & {"speed_limit", "stopping_path", "accel"}
    assert all(v <= b + 1e-3 for v, b in zip(chosen["speed"], chosen["speed_bound"], strict=True))


def test_map_has_its_picture(asked: str) -> None:
    answer = json.loads(get(f"{asked}/map")[1])
    assert answer["version"] >= 1
    assert answer["cell"] == 0.25
    assert answer["picture"].startswith("data:image/png;base64,")
    left, right, bottom, top = answer["bounds"]
    assert (right - left, top - bottom) == (193 * 0.25, 49 * 0.25)


def test_metrics_are_read_by_prometheus(asked: str) -> None:
    status, text = get(f"{asked}/metrics")
    assert status == 200
    samples = {
        (sample.name, *sample.labels.values()): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }
    answered = samples["slopewise_events_total", "answered"]
    assert answered >= 1.0
    assert samples["slopewise_events_total", "queries"] >= answered
    assert 0.0 < samples["slopewise_answer_seconds", "0.5"] < 5.0
    assert samples["slopewise_map_version",] >= 1.0
    assert samples["process_resident_memory_bytes",] > 1e7


def test_nothing_can_be_changed(asked: str) -> None:
    for method in ("POST", "PUT", "DELETE"):
        request = urllib.request.Request(f"{asked}/state", data=b"{}", method=method)
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(request, timeout=5.0)
        assert refused.value.code == 405
    assert get(f"{asked}/../../etc/passwd")[0] == 404


def test_pages_of_others_cannot_ask_through_a_browser(asked: str) -> None:
    assert get(f"{asked}/state", Host="evil.example:8177")[0] == 403
    assert get(f"{asked}/state", Host="localhost:8177")[0] == 200


def test_the_page_shows_the_plan(asked: str) -> None:
    shown = browser.text_of(asked)
    assert "Answers plan requests." in shown
    assert "asked by robot" in shown
    assert "limited now by" in shown
    assert "version 1 of" in shown


def test_a_page_that_cannot_be_served_stops_nobody(
    pages: tuple[Running, str], tmp_path: Path
) -> None:
    taken = pages[1].rpartition(":")[2]
    with (
        running(tmp_path, page=f"enabled = true\nport = {taken}") as started,
        started.session() as session,
        PlanClient(session, namespace=started.namespace, timeout=5.0) as client,
    ):
        assert client.plan(1.0, fan(1)).reply is not None


def learned(url: str) -> dict[str, Any]:
    return json.loads(get(f"{url}/learned")[1])


def braking(url: str, version: int) -> dict[str, Any]:
    """The group once it is of that version."""
    until = time.monotonic() + 10.0
    while time.monotonic() < until:
        for group in learned(url)["groups"]:
            if group["group"] == "braking" and group["version"] >= version:
                return group
        time.sleep(0.05)
    raise AssertionError(learned(url))


def test_stops_are_shown_and_their_parameters_survive_a_restart(tmp_path: Path) -> None:
    port = free_port()
    url, page = f"http://127.0.0.1:{port}", f"enabled = true\nport = {port}"
    store = '[store]\npath = "parameters.db"\n'
    with running(tmp_path, settings=store, page=page) as started, started.session() as session:
        for k in range(1, 5):
            stop = StopObservation(
                source="s",
                sequence=k,
                time=time.monotonic(),
                speed=2.0,
                grade=0.0,
                deceleration=2.5,
                deceleration_std=0.05,
                distance=1.4,
            )
            (reply,) = session.get(
                started.key("obs/stop"),
                payload=codec.encode(stop, Format.MESSAGEPACK),
                encoding=codec.encoding_of(StopObservation, Format.MESSAGEPACK),
                timeout=5.0,
            )
        assert reply.ok is not None
        told = str(reply.ok.encoding)
        version = codec.decode(ObservationAck, reply.ok.payload, told, "receipt", 10**6).version
        before = braking(url, version)
        stops = learned(url)["stops"]
        shown = browser.text_of(url)
    assert len(stops) == 4
    assert stops[0]["actual"] == 1.4
    assert stops[0]["predicted"] > 0.0
    assert rows_of_stops(shown) == 4
    again = free_port()
    page, url = f"enabled = true\nport = {again}", f"http://127.0.0.1:{again}"
    with running(tmp_path, settings=store, page=page):
        after = braking(url, version)
    assert after["version"] == before["version"]
    assert after["value"][-1][:4] == before["value"][-1][:4]
    assert len(before["value"]) > 2
    assert before["value"][-2][0] in [row[0] for row in after["value"]]


@pytest.fixture
def board() -> Board:
    live = Board()
    for k in range(30):
        live.learned(
            GroupSeen(
                group="braking sand",
                names=["m_m", EVIL],
                value=[-0.03 + 0.001 * k, 0.4],
                std=[0.05 / (1 + k), None],
                valid=k > 5,
                version=k + 1,
                cause=f"stop {k}",
                at=1e9 + k,
            )
        )
        live.stopped(
            StopSeen(
                speed=2.0,
                grade=0.05,
                predicted=2.0 + 0.02 * k,
                actual=1.8 + 0.03 * k,
                surface="sand",
                outcome="accepted",
                version=k,
                at=1e9 + k,
            )
        )
    live.classified(GroundSeen(name="sand", probability=0.93, at=1e9))
    return live


def test_what_was_learned_is_shown(board: Board) -> None:
    status = ServiceStatus(
        service=EVIL,
        uptime=1.0,
        map_version=1,
        map_age=0.5,
        flags=[EVIL],
        counters={},
        parameters=Parameters(version=30, name="atv", fingerprint="f", age=1.0),
        seconds={"median": 0.0, "p99": 0.0},
    )
    ground = ElevationMap(elevation=np.zeros((8, 9)), resolution=0.5, origin=(0.0, 0.0))
    site = Site(
        Source(
            status=lambda: status,
            ground=lambda: MapSnapshot(ground, 1, time.monotonic()),
            board=board,
        ),
        own_names("127.0.0.1"),
    )
    port = free_port()
    server = PageServer(PageSettings(enabled=True, port=port), site)
    try:
        shown = browser.text_of(f"http://127.0.0.1:{port}")
    finally:
        server.close()
    assert "braking sand" in shown
    assert "version 30, stop 29" in shown
    assert "-0.0010 ± 0.0017".replace("-", "−") in shown
    assert rows_of_stops(shown) == 30
    assert "Ground: <b>sand</b> 93%" in shown
    assert EVIL not in shown
    assert EVIL.replace("<", "&lt;").replace(">", "&gt;") in shown


def test_the_board_does_not_grow_without_end(board: Board) -> None:
    for k in range(2000):
        board.stopped(StopSeen(speed=1.0, grade=0.0, predicted=1.0, actual=1.0))
        board.learned(
            GroupSeen(
                group=f"g{k}", names=["a"], value=[1.0], std=[None], valid=True, version=k, cause=""
            )
        )
    assert len(board.stops()) == 400
    assert len(board.groups()) == 64
