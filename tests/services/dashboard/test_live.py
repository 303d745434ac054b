"""The live page, health and metrics of a running service show what it replied and learned.

The page's server: token, host names, idle connections, files for Prometheus.
"""

from __future__ import annotations

import contextlib
import json
import re
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from prometheus_client.parser import text_string_to_metric_families

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError
from slopewise.services.client import PlanClient
from slopewise.services.dashboard.live_state import LiveState
from slopewise.services.dashboard.server import PageServer
from slopewise.services.dashboard.token import cookie, has_valid_token
from slopewise.services.parameters.stop_checks import LearnedStop
from slopewise.services.planning.map_store import MapSnapshot
from slopewise.services.settings.service_settings import PageSettings
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.observations import ObservationAck, StopObservation
from slopewise.services.wire.parameter_messages import HistoryEntry
from slopewise.services.wire.plan_messages import Path as Candidate
from tests.services import browser
from tests.services.dashboard.page_fixtures import HOSTILE, get, served
from tests.services.service_process import Running, fan, flat, free_port, running, until


def rows_of_stops(page: str) -> int:
    return page.partition('id="stops"')[2].count("<tr>") - 1


def shows_a_plan(url: str) -> bool:
    plan = json.loads(get(f"{url}/state")[2])["plan"]
    return plan is not None and plan["chosen"] is not None


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Running, str]]:
    port = free_port()
    with running(tmp_path_factory.mktemp("live"), page=f"enabled = true\nport = {port}") as started:
        yield started, f"http://127.0.0.1:{port}"


@pytest.fixture(scope="module")
def planned(pages: tuple[Running, str]) -> str:
    """The page after a map arrived and a plan was requested."""
    service, url = pages
    assert get(f"{url}/health")[0] == 503
    if browser.BROWSER is not None:
        assert "robots are commanded to brake" in browser.text_of(url)
    odd = Candidate(name=HOSTILE, points=fan(1)[0].points)
    with (
        service.session() as session,
        PlanClient(session, namespace=service.namespace, timeout=5.0, name="robot") as client,
    ):
        client.put_map(flat())

        def is_shown() -> bool:
            reply = client.plan(1.0, [odd, *fan(4)], pose=(0.0, 0.0, 0.0), clear=20.0).reply
            # The page is updated after the reply was sent.
            return bool(reply.plans) and shows_a_plan(url)

        until(is_shown)
    return url


def test_health_is_able_and_state_is_the_last_reply(planned: str) -> None:
    status, _, body = get(f"{planned}/health")
    assert status == 200
    assert json.loads(body)["able"]
    state = json.loads(get(f"{planned}/state")[2])
    chosen = state["plan"]["chosen"]
    assert state["plan"]["client"] == "robot"
    assert state["plan"]["candidates"] == 5
    assert chosen["speed"][0] == 1.0
    assert max(chosen["speed"]) > 2.0
    assert len(chosen["limiting"]) == len(chosen["x"]) == len(chosen["speed_bound"])
    assert set(chosen["limiting"]) & {"speed_limit", "stopping_path", "accel"}
    assert all(v <= b + 1e-3 for v, b in zip(chosen["speed"], chosen["speed_bound"], strict=True))


def test_the_map_has_a_picture(planned: str) -> None:
    relief = json.loads(get(f"{planned}/map")[2])
    assert relief["version"] >= 1
    assert relief["cell"] == 0.25
    assert relief["picture"].startswith("data:image/png;base64,")
    left, right, bottom, top = relief["bounds"]
    assert (right - left, top - bottom) == (193 * 0.25, 49 * 0.25)


def test_metrics_are_read_by_prometheus(planned: str) -> None:
    status, _, text = get(f"{planned}/metrics")
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


def test_the_page_shows_the_plan(planned: str) -> None:
    shown = browser.text_of(planned)
    for part in ("Answers plan requests.", "asked by robot", "limited now by", "version 1 of"):
        assert part in shown


def test_a_service_plans_without_a_page_that_cannot_be_served(
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
    return json.loads(get(f"{url}/learned")[2])


def braking(url: str, version: int) -> dict[str, Any]:
    """The group once it is of that version."""
    end = time.monotonic() + 10.0
    while time.monotonic() < end:
        for group in learned(url)["groups"]:
            if group["group"] == "braking" and group["version"] >= version:
                return group
        time.sleep(0.05)
    raise AssertionError(learned(url))


def test_stops_and_learned_parameters_are_shown_after_a_restart(tmp_path: Path) -> None:
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
        encoding = str(reply.ok.encoding)
        version = codec.decode(ObservationAck, reply.ok.payload, encoding, "receipt", 10**6).version
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
def page() -> LiveState:
    page = LiveState()
    for k in range(30):
        page.add_change(
            HistoryEntry(
                version=k + 1,
                group="braking sand",
                at=1e9 + k,
                cause=f"stop {k}",
                who="robot",
                values={"m_m": -0.03 + 0.001 * k, HOSTILE: 0.4},
                stds={"m_m": 0.05 / (1 + k)},
                valid=k > 5,
            )
        )
        page.add_stop(stop_of(2.0 + 0.02 * k, 1.8 + 0.03 * k), k)
    page.set_ground("sand", 0.93)
    return page


def stop_of(predicted: float, actual: float) -> LearnedStop:
    return LearnedStop("sand", 2.0, 0.05, predicted, actual, outcome="accepted")


def test_parameters_stops_and_terrain_are_shown(page: LiveState) -> None:
    ground = ElevationMap(elevation=np.zeros((8, 9)), resolution=0.5, origin=(0.0, 0.0))
    known = MapSnapshot(ground, 1, time.monotonic())
    with served(page, known, service=HOSTILE, flags=[HOSTILE], map_version=1, map_age=0.5) as url:
        shown = browser.text_of(url)
        stops = json.loads(get(f"{url}/learned")[2])["stops"]
    numbers = {"speed": 2.0, "grade": 0.05, "predicted": 2.06, "actual": 1.89}
    facts = {"surface": "sand", "outcome": "accepted", "version": 3}
    assert stops[3] == numbers | facts | {"at": stops[3]["at"]}
    parts = ("braking sand", "version 30, stop 29", "−0.0010 ± 0.0017", "Ground: <b>sand</b> 93%")
    for part in (*parts, HOSTILE.replace("<", "&lt;").replace(">", "&gt;")):
        assert part in shown
    assert HOSTILE not in shown
    assert rows_of_stops(shown) == 30


def test_memory_of_the_page_is_bounded(page: LiveState) -> None:
    entry = HistoryEntry(version=1, group="", at=0.0, cause="", who="", values={"a": 1.0})
    for k in range(2000):
        page.add_stop(stop_of(1.0, 1.0), k)
        page.add_change(msgspec.structs.replace(entry, group=f"g{k}"))
    assert len(page.stops) == 400
    assert len(page.groups) == 64


CONFIGS = Path(__file__).parents[3] / "configs" / "prometheus"


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    with served(LiveState()) as url:
        yield url


def test_writing_other_addresses_and_pages_of_other_sites_are_rejected(url: str) -> None:
    for method in ("POST", "PUT", "DELETE"):
        assert get(f"{url}/state", method)[0] == 405
    assert get(f"{url}/../../etc/passwd")[0] == 404
    assert get(f"{url}/state", Host="evil.example:8177")[0] == 403
    assert get(f"{url}/state", Host="localhost:8177")[0] == 200


def test_a_port_in_use_is_an_input_error(url: str) -> None:
    with pytest.raises(InputError, match="expected a free address"):
        PageServer(PageSettings(enabled=True, port=int(url.rpartition(":")[2])), None)


def test_half_open_connections_do_not_block_health(url: str) -> None:
    port, opened = int(url.rpartition(":")[2]), []
    for _ in range(250):
        with contextlib.suppress(OSError):
            connection = socket.create_connection(("127.0.0.1", port), timeout=1.0)
            connection.sendall(b"GET /health HT")
            opened.append(connection)
    assert len(opened) > 50
    status = 0
    for _ in range(4):
        with contextlib.suppress(OSError):
            status = status or get(f"{url}/health")[0]
    assert status == 503, "no map"
    for connection in opened:
        connection.close()


def test_without_its_token_a_page_shows_nothing() -> None:
    with served(LiveState(), token="let me in") as url:
        for path in ("/", "/metrics", "/health", "/state"):
            assert get(url + path)[0] == 401
            assert get(url + path, Authorization="Bearer other")[0] == 401
            assert get(url + path, Authorization="Bearer let me in")[0] in (200, 503)
        code, stored, _ = get(f"{url}/?token=let%20me%20in")
        assert code == 200
        assert "let" not in stored
        assert get(f"{url}/state", Cookie=stored.partition(";")[0])[0] == 200


@pytest.mark.parametrize("shown", ["", "wörd", "a" * 10_000])
def test_a_different_text_is_no_token(shown: str) -> None:
    assert not has_valid_token({"HTTP_AUTHORIZATION": f"Bearer {shown}"}, "right")
    assert not has_valid_token({"HTTP_COOKIE": f"slopewise={shown}"}, "right")
    assert has_valid_token({"HTTP_COOKIE": cookie("right").partition(";")[0]}, "right")


def test_a_server_that_is_awake_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    server = PageServer(PageSettings(enabled=True, port=free_port()), lambda *_: [])
    trigger = server._server.trigger
    pull = trigger._physical_pull

    def pull_late() -> None:
        pull()  # as a reply does that was just finished
        time.sleep(0.2)
        pull()

    monkeypatch.setattr(trigger, "_physical_pull", pull_late)
    server.close()


def test_files_for_prometheus_and_grafana_name_metrics_that_exist() -> None:
    with served(LiveState(), map_version=1, map_age=1.0, counters={"queries": 1}) as url:
        text = get(f"{url}/metrics")[2]
    names = set(re.findall(r"^# TYPE (\w+)", text, re.MULTILINE))
    for file in CONFIGS.iterdir():
        used = set(re.findall(r"(?:slopewise|process)_[a-z_]+", file.read_text()))
        used = {name for name in used if not name.startswith("slopewise_rules")}
        assert used <= names, (file.name, used - names)
    board = json.loads((CONFIGS / "slopewise.dashboard.json").read_text())
    assert len({panel["id"] for panel in board["panels"]}) == len(board["panels"])
    rules = (CONFIGS / "slopewise.rules.yml").read_text()
    assert rules.count("- alert:") == rules.count("summary:")
