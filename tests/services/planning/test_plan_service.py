"""Plans and maps of a running service, by keys and payloads."""

from __future__ import annotations

import json
import re
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest
import zenoh

from slopewise.services.client import PlanClient
from slopewise.services.io.model_file import find_model, model_sha256, read_model
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.plan_messages import PlanReply, PlanRequest, ServiceStatus
from tests.services.service_process import Running, fan, flat, running, until

LARGEST = 10**8
ENCODING = codec.encoding_of(PlanRequest, Format.MESSAGEPACK)


def put_map(client: PlanClient, **changes: object) -> int:
    """Put a whole map in, as a new sender; the version that it became."""
    before = client.plan(0.0, []).reply
    assert before is not None
    client.put_map(flat(source=f"test-{time.monotonic_ns()}", **changes))
    until(lambda: client.plan(0.0, []).reply.map_version > before.map_version)
    return client.plan(0.0, []).reply.map_version


@pytest.fixture
def client(service: Running, session: zenoh.Session) -> Iterator[PlanClient]:
    """A client on level ground."""
    with PlanClient(session, namespace=service.namespace, timeout=5.0) as asking:
        put_map(asking)
        yield asking


def plan_reply(replies: Iterable[zenoh.Reply]) -> PlanReply:
    (reply,) = replies
    return codec.decode(PlanReply, reply.ok.payload, str(reply.ok.encoding), "reply", LARGEST)


def status_of(session: zenoh.Session, service: Running) -> ServiceStatus:
    received: list[zenoh.Sample] = []
    with session.declare_subscriber(service.key("status"), received.append):
        until(lambda: len(received) > 1)
    last = received[-1]
    return codec.decode(ServiceStatus, last.payload, str(last.encoding), "status", LARGEST)


def test_many_candidates_in_one_question(client: PlanClient) -> None:
    version = put_map(client)
    reply = client.plan(1.0, fan(20), clear=20.0).reply
    assert reply.status == "blocked"
    assert len(reply.plans) == len(reply.ranking) == 20
    assert reply.map_version == version
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


@pytest.mark.usefixtures("client")
def test_a_named_client_drives_on_what_it_drives(service: Running, session: zenoh.Session) -> None:
    with PlanClient(session, namespace=service.namespace, name="robot", timeout=5.0) as robot:
        first = robot.plan(1.0, fan(3), pose=(0.0, 0.0, 0.0)).reply
        assert not first.command.stop
        period = 0.1
        moved = 1.0 * period + 0.5 * first.command.accel * period**2
        second = robot.plan(first.command.speed, fan(3), pose=(moved, 0.0, 0.0)).reply
        assert second.chosen == first.chosen
        moved_off = robot.plan(1.0, fan(3), pose=(0.0, 4.0, 0.0)).reply
    assert {c.usable for c in moved_off.ranking} == {False}
    assert "beside the vehicle" in moved_off.ranking[0].reason
    assert moved_off.command.stop


@pytest.mark.usefixtures("client")
def test_people_are_answered_in_json(service: Running, session: zenoh.Session) -> None:
    fields = {"speed": 1, "paths": [{"name": "a", "points": [[0, 0], [5, 0], [10, 0]]}]}
    payload, key = json.dumps(fields).encode(), service.key("plan")
    (raw,) = session.get(key, payload=payload, encoding="application/json", timeout=5.0)
    assert str(raw.ok.encoding) == "application/json;slopewise.plan_reply.v1"
    reply = json.loads(raw.ok.payload.to_bytes())
    assert reply["status"] == "ok"
    assert reply["plans"][0]["values"][8 - 1][0] == 1.0


def test_bad_and_old_maps_are_counted_and_change_nothing(
    client: PlanClient, session: zenoh.Session, service: Running
) -> None:
    client.put_map(flat(source="s", sequence=5))
    before = status_of(session, service)
    for sequence in (5, 4, 1):
        client.put_map(flat(source="s", sequence=sequence))
    client.put_map(flat(source="bad", elevation=np.zeros((1, 9))))
    client.put_map(flat(source="bad", elevation=np.zeros(9)))
    client.put_map(flat(source="bad", origin=(float("nan"), 0.0)))
    client.put_map(flat(source="bad", patch=True, origin=(1e6, 0.0)))
    blocking = zenoh.CongestionControl.BLOCK  # else a busy machine may drop it
    session.put(service.key("map"), b"\xff", encoding="nonsense", congestion_control=blocking)
    gained, end = Counter[str](), time.monotonic() + 5.0
    while sum(gained.values()) < 8 and time.monotonic() < end:
        after = status_of(session, service)
        assert after.map_version == before.map_version
        gained = Counter(after.counters) - Counter(before.counters)
        gained = Counter({k: n for k, n in gained.items() if k.startswith("map_updates")})
    assert gained == {"map_updates_ignored": 3, "map_updates_refused": 5}


def test_busy_is_sent_before_the_deadline_and_the_service_recovers(tmp_path: Path) -> None:
    settings = "workers = 1\nqueue = 2"
    with (
        running(tmp_path, planning=settings) as started,
        started.session() as opened,
        PlanClient(opened, namespace=started.namespace, timeout=5.0) as asking,
    ):
        put_map(asking)
        payload = codec.encode(PlanRequest(speed=1.0, paths=fan(200)), Format.MESSAGEPACK)
        key, begun = f"{started.key('plan')}?deadline=0.3", time.monotonic()
        queries = [
            opened.get(key, payload=payload, encoding=ENCODING, timeout=5.0) for _ in range(30)
        ]
        statuses = [plan_reply(query).status for query in queries]
        took = time.monotonic() - begun
        assert statuses.count("busy") >= 20
        assert took < 3.0
        assert asking.plan(1.0, fan(2)).reply is not None
        status = status_of(opened, started)
        assert status.counters["busy"] == statuses.count("busy")
