from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest
import zenoh

from slopewise.services.client import PlanClient
from slopewise.services.io.model_file import find_model, model_sha256, read_model
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.plan_messages import Path as Candidate
from slopewise.services.wire.plan_messages import PlanReply, PlanRequest, ServiceStatus
from tests.services.service_process import Running, fan, flat, running

LARGEST = 10**8


@pytest.fixture
def client(service: Running, session: zenoh.Session) -> Iterator[PlanClient]:
    with PlanClient(session, namespace=service.namespace, timeout=5.0) as asking:
        yield asking


def send_map(session: zenoh.Session, service: Running, update: object) -> None:
    payload = codec.encode(update, Format.MESSAGEPACK)  # type: ignore[arg-type]
    encoding = codec.encoding_of(type(update), Format.MESSAGEPACK)  # type: ignore[arg-type]
    session.put(service.key("map"), payload, encoding=encoding)


def ask(
    session: zenoh.Session, service: Running, payload: bytes, encoding: str, query: str = ""
) -> PlanReply:
    replies = list(
        session.get(service.key("plan") + query, payload=payload, encoding=encoding, timeout=5.0)
    )
    (reply,) = replies
    assert reply.ok is not None
    encoding = str(reply.ok.encoding)
    return codec.decode(PlanReply, reply.ok.payload, encoding, "reply", LARGEST)


def counters(session: zenoh.Session, service: Running) -> ServiceStatus:
    received: list[zenoh.Sample] = []
    with session.declare_subscriber(service.key("status"), received.append):
        until = time.monotonic() + 5.0
        while len(received) < 2 and time.monotonic() < until:
            time.sleep(0.02)
    last = received[-1]
    return codec.decode(ServiceStatus, last.payload, str(last.encoding), "status", LARGEST)


def mapped(client: PlanClient, session: zenoh.Session, service: Running, **changes: object) -> int:
    """Put a whole map in, as a new sender; the version that it became."""
    before = client.plan(0.0, []).reply
    assert before is not None
    send_map(session, service, flat(source=f"test-{time.monotonic_ns()}", **changes))
    until = time.monotonic() + 5.0
    while time.monotonic() < until:
        after = client.plan(0.0, []).reply
        assert after is not None
        if after.map_version > before.map_version:
            return after.map_version
        time.sleep(0.01)
    raise AssertionError("the map did not arrive")


def test_many_candidates_in_one_question(
    client: PlanClient, session: zenoh.Session, service: Running
) -> None:
    version = mapped(client, session, service)
    reply = client.plan(1.0, fan(20), clear=20.0).reply
    assert reply is not None
    assert reply.status == "blocked"
    assert len(reply.plans) == len(reply.ranking) == 20
    assert reply.map_version == version
    assert reply.parameters is not None
    assert reply.parameters.model_hash == model_sha256(read_model(find_model("atv")))
    assert reply.map_id.startswith("test-")
    assert reply.map_id.endswith("#1")
    assert re.fullmatch("[0-9a-f]{64}", reply.map_hash)
    assert {"queued", "decode", "planner"} <= set(reply.seconds)
    for plan in reply.plans:
        speed, station = plan.column("speed"), plan.column("station")
        assert speed[0] == 1.0
        assert speed.max() > 2.0
        moving = speed > 0.0
        stops = station + plan.column("stop_distance")
        assert np.all(stops[moving] <= plan.clear_distance + 1e-9)
        assert plan.limits[0].first == 0
        assert plan.least_margin is not None


def test_a_named_client_drives_on_what_it_drives(
    client: PlanClient, session: zenoh.Session, service: Running
) -> None:
    mapped(client, session, service)
    with PlanClient(session, namespace=service.namespace, name="robot", timeout=5.0) as robot:
        first = robot.plan(1.0, fan(3), pose=(0.0, 0.0, 0.0)).reply
        assert first is not None
        assert first.command is not None
        assert not first.command.stop
        period = 0.1
        moved = 1.0 * period + 0.5 * first.command.accel * period**2
        along = np.linspace(moved, 25.0, 100)
        later = [Candidate(name=p.name, points=p.points) for p in fan(3)]
        second = robot.plan(first.command.speed, later, pose=(float(along[0]), 0.0, 0.0)).reply
        assert second is not None
        assert second.chosen == first.chosen
        moved_off = robot.plan(1.0, fan(3), pose=(0.0, 4.0, 0.0)).reply
    assert moved_off is not None
    assert {c.usable for c in moved_off.ranking} == {False}
    assert "beside the vehicle" in moved_off.ranking[0].reason
    assert moved_off.command is not None
    assert moved_off.command.stop


def test_people_are_answered_in_json(
    client: PlanClient, session: zenoh.Session, service: Running
) -> None:
    mapped(client, session, service)
    payload = {"speed": 1, "paths": [{"name": "a", "points": [[0, 0], [5, 0], [10, 0]]}]}
    raw = list(
        session.get(
            service.key("plan"),
            payload=json.dumps(payload).encode(),
            encoding="application/json",
            timeout=5.0,
        )
    )
    assert raw[0].ok is not None
    assert str(raw[0].ok.encoding) == "application/json;slopewise.plan_reply.v1"
    reply = json.loads(raw[0].ok.payload.to_bytes())
    assert reply["status"] == "ok"
    assert reply["plans"][0]["values"][8 - 1][0] == 1.0


@pytest.mark.parametrize(
    ("payload", "part"),
    [
        (b"", "expected slopewise.plan_request.v1"),
        (b"\xff" * 100, "expected object"),
        (b"\0" * 4_000_001, "at most 4000000 bytes"),
        (msgspec.msgpack.encode({"speed": float("nan"), "paths": []}), "speed"),
        (msgspec.msgpack.encode({"speed": -1.0, "paths": []}), "speed"),
        (msgspec.msgpack.encode({"speed": 1.0, "paths": [], "client": "a"}), "pose"),
        (msgspec.msgpack.encode({"speed": 1.0, "paths": [], "x": 1}), "x: unknown field"),
    ],
    ids=["empty", "noise", "oversize", "nan", "backwards", "nowhere", "unknown"],
)
def test_bad_questions_are_answered_with_a_reason(
    session: zenoh.Session, service: Running, payload: bytes, part: str
) -> None:
    encoding = codec.encoding_of(PlanRequest, Format.MESSAGEPACK)
    before = counters(session, service).counters.get("refused", 0)
    reply = ask(session, service, payload, encoding)
    assert reply.status == "error"
    assert part in reply.reason
    assert reply.plans == []
    assert reply.command is None
    assert counters(session, service).counters["refused"] == before + 1


def test_bad_and_old_maps_are_counted_and_change_nothing(
    client: PlanClient, session: zenoh.Session, service: Running
) -> None:
    mapped(client, session, service)
    send_map(session, service, flat(source="s", sequence=5))
    before = counters(session, service)
    for sequence in (5, 4, 1):
        send_map(session, service, flat(source="s", sequence=sequence))
    send_map(session, service, flat(source="bad", elevation=np.full((3, 3), np.nan)))
    send_map(session, service, flat(source="bad", elevation=np.zeros(9)))
    send_map(session, service, flat(source="bad", origin=(float("nan"), 0.0)))
    send_map(session, service, flat(source="bad", patch=True, origin=(1e6, 0.0)))
    session.put(service.key("map"), b"\xff", encoding="nonsense")
    after = counters(session, service)
    assert after.map_version == before.map_version
    gained = {k: after.counters.get(k, 0) - before.counters.get(k, 0) for k in after.counters}
    assert gained["map_updates_ignored"] == 3
    assert gained["map_updates_refused"] == 5


def test_busy_is_sent_before_the_deadline_and_the_service_recovers(tmp_path: Path) -> None:
    settings = "workers = 1\nqueue = 2"
    with (
        running(tmp_path, planning=settings) as started,
        started.session() as opened,
        PlanClient(opened, namespace=started.namespace, timeout=5.0) as asking,
    ):
        mapped(asking, opened, started)
        request = PlanRequest(speed=1.0, paths=fan(200))
        payload = codec.encode(request, Format.MESSAGEPACK)
        encoding = codec.encoding_of(PlanRequest, Format.MESSAGEPACK)
        deadline = 0.3
        begun = time.monotonic()
        open_queries = [
            opened.get(
                f"{started.key('plan')}?deadline={deadline}",
                payload=payload,
                encoding=encoding,
                timeout=5.0,
            )
            for _ in range(30)
        ]
        statuses = []
        for query in open_queries:
            (reply,) = list(query)
            assert reply.ok is not None
            reply_encoding = str(reply.ok.encoding)
            got = codec.decode(PlanReply, reply.ok.payload, reply_encoding, "reply", LARGEST)
            statuses.append(got.status)
        took = time.monotonic() - begun
        assert statuses.count("busy") >= 20
        assert took < 3.0
        assert asking.plan(1.0, fan(2)).reply is not None
        status = counters(opened, started)
        assert status.counters["busy"] == statuses.count("busy")


def test_alive_while_it_lives(tmp_path: Path) -> None:
    with running(tmp_path) as started, started.peer() as opened:
        key = started.key("alive/*")
        gone: list[zenoh.Sample] = []
        (token,) = opened.liveliness().get(key, timeout=2.0)
        assert token.ok is not None
        assert str(token.ok.key_expr) == started.key("alive/planner")
        with opened.liveliness().declare_subscriber(key, gone.append):
            started.process.kill()
            started.process.wait()
            until = time.monotonic() + 3.0
            while not gone and time.monotonic() < until:
                time.sleep(0.01)
        assert [s.kind for s in gone] == [zenoh.SampleKind.DELETE]
