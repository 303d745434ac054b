"""Real processes and certificates: a client without the right changes nothing."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest
import zenoh

from slopewise.models.errors import InputError
from slopewise.services.client import PlanClient
from slopewise.services.guard.service_updates import ServiceUpdates
from slopewise.services.guard.zenoh_transport import ZenohTransport
from slopewise.services.ros.inbox import Inbox
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.connect import client_session
from slopewise.services.wire.observations import ObservationAck, StopObservation, TerrainLabel
from slopewise.services.wire.parameter_messages import (
    AdoptOffer,
    DiscrepancyQuestion,
    ParameterReply,
    RollBack,
    SetParameters,
)
from slopewise.services.wire.plan_messages import PlanReply, ServiceStatus
from tests.services import certificates
from tests.services.guard.guard_fixtures import MODEL, guard
from tests.services.service_process import Running, fan, flat, running

NAMESPACE = "slopewise/robot"
_SETTLED = 0.4
"""Time after which a message that has not arrived never will [s]."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("mtls")
    certificates.make(folder)
    return folder


@pytest.fixture(scope="module")
def service(folder: Path) -> Iterator[Running]:
    locked = 'config = "mtls.json5"'
    with running(folder, scheme="tls", namespace=NAMESPACE, zenoh_lines=locked) as started:
        yield started


def as_(folder: Path, service: Running, name: str) -> zenoh.Session:
    return certificates.session(folder, name, service.endpoint)


def send_map(session: zenoh.Session, service: Running, **changes: object) -> None:
    update = flat(**{"source": f"s{time.monotonic_ns()}", **changes})
    payload = codec.encode(update, Format.MESSAGEPACK)
    encoding = codec.encoding_of(type(update), Format.MESSAGEPACK)
    session.put(service.key("map"), payload, encoding=encoding)


def plan(session: zenoh.Session) -> PlanReply | None:
    with PlanClient(session, namespace=NAMESPACE, timeout=2.0) as asking:
        return asking.plan(1.0, fan(3)).reply


def planned(folder: Path, service: Running) -> PlanReply:
    with as_(folder, service, "navigation") as navigation:
        reply = plan(navigation)
    assert reply is not None
    return reply


def planned_on_a_new_map(folder: Path, service: Running) -> PlanReply:
    with as_(folder, service, "mapping") as mapping:
        send_map(mapping, service)
        time.sleep(_SETTLED)
    return planned(folder, service)


def test_mapping_brings_ground_and_navigation_gets_plans_on_it(
    folder: Path, service: Running
) -> None:
    before = planned(folder, service).map_version
    reply = planned_on_a_new_map(folder, service)
    assert reply.map_version == before + 1
    assert len(reply.plans) == 3
    assert reply.plans[0].column("speed").max() > 2.0


def test_a_certificate_of_another_authority_opens_nothing(folder: Path, service: Running) -> None:
    with pytest.raises(zenoh.ZError):
        as_(folder, service, "forged")


def test_nobody_answers_in_the_service_s_place(folder: Path, service: Running) -> None:
    key = service.key("plan")

    def forge(query: zenoh.Query) -> None:
        with query:
            query.reply(key, b"faster", encoding="application/msgpack")

    with (
        as_(folder, service, "estimator") as forger,
        as_(folder, service, "navigation") as navigation,
    ):
        forger.declare_queryable(key, forge, complete=True)
        time.sleep(_SETTLED)
        reply = plan(navigation)
    assert reply.service == "planner"


def test_tls_alone_shows_the_service_s_certificate(folder: Path, tmp_path: Path) -> None:
    locked = f'config = "{folder / "tls.json5"}"'
    with running(tmp_path, scheme="tls", zenoh_lines=locked) as started:
        with (
            client_session(started.endpoint, str(folder / "tls-client.json5")) as session,
            PlanClient(session, namespace=started.namespace, timeout=2.0) as asking,
        ):
            assert asking.plan(0.0, []).reply is not None
        foreign = tmp_path / "foreign"
        foreign.mkdir()
        certificates.make(foreign)
        with pytest.raises(InputError, match="lets this client in"):
            client_session(started.endpoint, str(foreign / "tls-client.json5"))
        with pytest.raises(InputError, match="lets this client in"):
            client_session(started.endpoint.replace("tls/", "tcp/"))


def ask(session: zenoh.Session, key: str, message: object = None) -> list[object]:
    """OK replies to a query, decoded; empty where no service may answer."""
    written: dict[str, object] = {}
    if message is not None:
        written["payload"] = codec.encode(message, Format.MESSAGEPACK)
        written["encoding"] = codec.encoding_of(type(message), Format.MESSAGEPACK)
    kinds = {codec.schema_of(kind): kind for kind in (ParameterReply, ObservationAck)}
    messages = []
    for reply in session.get(key, timeout=1.0, **written):
        if reply.ok is not None:
            encoding = str(reply.ok.encoding)
            kind = kinds[encoding.partition(";")[2]]
            messages.append(codec.decode(kind, reply.ok.payload, encoding, key, 10**8))
    return messages


def parameters(folder: Path, service: Running) -> bytes:
    """All parameters with their versions, without what only time changes."""
    with as_(folder, service, "operator") as operator:
        (reply,) = ask(operator, service.key("params"))
    raw = msgspec.to_builtins(reply)
    for group in raw["groups"]:
        group["age"] = 0.0
    return msgspec.json.encode(raw, order="deterministic")


def stop(source: str) -> StopObservation:
    measured = {"speed": 2.0, "grade": 0.0, "deceleration": 0.8, "deceleration_std": 0.05}
    return StopObservation(source=source, sequence=1, time=time.monotonic(), **measured)


CHANGES = {
    "obs/stop": stop("intruder"),
    "obs/terrain": TerrainLabel(source="intruder", sequence=1, time=0.0, surface="ice"),
    "params/set": SetParameters(group="limits", values={"speed": 4.0}),
    "params/rollback": RollBack(version=1),
    "params/adopt": AdoptOffer(offer="none"),
    "discrepancy": DiscrepancyQuestion(start=True),
}


@pytest.mark.parametrize("name", ["navigation", "mapping", "stranger", "estimator", "operator"])
def test_a_role_without_the_right_changes_nothing(
    folder: Path, service: Running, name: str
) -> None:
    """Each role tries what it may not, as put and as query; without plans a client stops."""
    allowed = {"estimator": ("obs/",), "operator": ("params/", "discrepancy")}.get(name, ())
    before = parameters(folder, service)
    first = planned(folder, service)
    with as_(folder, service, name) as intruder:
        for key, message in CHANGES.items():
            if key.startswith(allowed or "\0"):
                continue
            payload = codec.encode(message, Format.MESSAGEPACK)
            encoding = codec.encoding_of(type(message), Format.MESSAGEPACK)
            intruder.put(service.key(key), payload, encoding=encoding)
            assert ask(intruder, service.key(key), message) == []
        if name in ("navigation", "estimator", "stranger"):
            send_map(intruder, service, elevation=np.full((49, 193), 7.0))
        if name in ("mapping", "estimator", "stranger"):
            with PlanClient(intruder, namespace=NAMESPACE, timeout=0.5) as asking:
                outcome = asking.plan(1.0, fan(3))
            assert (outcome.reply is None, outcome.stop is None) == (True, False)
        time.sleep(_SETTLED)
    assert parameters(folder, service) == before
    again = planned(folder, service)
    assert again.parameters.version == first.parameters.version
    assert again.map_version == first.map_version
    for plan_again, plan in zip(again.plans, first.plans, strict=True):
        np.testing.assert_array_equal(plan_again.values, plan.values)


def test_everybody_with_a_role_may_read_parameters(folder: Path, service: Running) -> None:
    for name in ("navigation", "mapping", "estimator", "operator"):
        with as_(folder, service, name) as reader:
            (reply,) = ask(reader, service.key("params"))
            (braking,) = ask(reader, service.key("params/braking"))
            (effects,) = ask(reader, service.key("params/effects"))
        assert reply.status == braking.status == "ok"
        assert {group.group for group in reply.groups} >= {"braking", "limits"}
        assert [group.group for group in braking.groups] == ["braking"]
        assert [group.group for group in effects.groups] == ["effects"]
    with as_(folder, service, "stranger") as unknown:
        assert ask(unknown, service.key("params")) == []


def test_an_estimator_sends_stops_and_an_operator_sets(folder: Path, service: Running) -> None:
    with as_(folder, service, "estimator") as estimator:
        (receipt,) = ask(estimator, service.key("obs/stop"), stop("estimator"))
    assert receipt.status == "taken", receipt
    with as_(folder, service, "operator") as operator:
        slower = SetParameters(group="limits", values={"speed": 1.5})
        (reply,) = ask(operator, service.key("params/set"), slower)
        assert reply.status == "ok", reply
        absurd = SetParameters(group="limits", values={"speed": -1.0})
        (refused,) = ask(operator, service.key("params/set"), absurd)
        (examined,) = ask(operator, service.key("discrepancy"), DiscrepancyQuestion(start=True))
        (adopted,) = ask(operator, service.key("params/adopt"), AdoptOffer(offer="none"))
    assert examined.status == adopted.status == "refused"
    assert "samples" in examined.reason
    assert refused.status == "refused"
    assert refused.version == reply.version > receipt.version - 1
    answer = planned_on_a_new_map(folder, service)
    assert answer.plans[0].column("speed").max() <= 1.5 + 1e-9


def degraded(session: zenoh.Session, service: Running, expected: bool) -> bool:
    """Whether the status says so within five seconds."""
    received: list[ServiceStatus] = []

    def receive(sample: zenoh.Sample) -> None:
        encoding = str(sample.encoding)
        received.append(codec.decode(ServiceStatus, sample.payload, encoding, "status", 10**6))

    with session.declare_subscriber(service.key("status"), receive):
        until = time.monotonic() + 5.0
        while time.monotonic() < until and not (
            received and bool(received[-1].degraded) is expected
        ):
            time.sleep(0.05)
    return bool(received) and bool(received[-1].degraded) is expected


def test_an_estimator_shows_that_it_lives_and_nobody_else_for_it(
    folder: Path, tmp_path: Path
) -> None:
    needed = '[learning]\nestimators = ["slip"]\n'
    locked = f'config = "{folder / "mtls.json5"}"'
    with (
        running(tmp_path, needed, scheme="tls", namespace=NAMESPACE, zenoh_lines=locked) as started,
        as_(folder, started, "operator") as operator,
    ):
        assert degraded(operator, started, True)
        with as_(folder, started, "navigation") as navigation:
            forged = navigation.liveliness().declare_token(started.key("alive/slip"))
            time.sleep(_SETTLED)
            assert degraded(operator, started, True)
            forged.undeclare()
        with as_(folder, started, "estimator") as estimator:
            # A token lives as long as its session.
            token = estimator.liveliness().declare_token(started.key("alive/slip"))
            assert degraded(operator, started, False)
            token.undeclare()
        assert degraded(operator, started, True)


def test_an_estimators_certificate_cannot_hold_the_planners_token(
    folder: Path, service: Running
) -> None:
    def seen(session: zenoh.Session) -> list[str]:
        replies = session.liveliness().get(service.key("alive/*"), timeout=2.0)
        return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]

    with (
        as_(folder, service, "estimator") as estimator,
        as_(folder, service, "operator") as operator,
    ):
        received: list[zenoh.Sample] = []
        with operator.liveliness().declare_subscriber(service.key("alive/*"), received.append):
            time.sleep(_SETTLED)
            before = len(received)
            forged = estimator.liveliness().declare_token(service.key("alive/planner"))
            token = estimator.liveliness().declare_token(service.key("alive/slip"))
            time.sleep(_SETTLED)
            encoding = [str(sample.key_expr) for sample in received[before:]]
            forged.undeclare()
            time.sleep(_SETTLED)
            assert encoding == [service.key("alive/slip")]
            assert not [s for s in received if s.kind == zenoh.SampleKind.DELETE]
        assert service.key("alive/planner") in seen(operator)
        token.undeclare()


def test_a_guard_receives_what_it_needs_and_the_base_only_its_output(
    folder: Path, service: Running
) -> None:
    """Every other role tries all its keys; names in an inbox are those of senders."""
    it, inbox, outputs, states = guard(known=None), Inbox(), [], []
    names = ("guard", "base", "navigation", "mapping", "estimator", "operator", "stranger")
    with contextlib.ExitStack() as stack:
        by = {name: stack.enter_context(as_(folder, service, name)) for name in names}
        updates = ServiceUpdates(by["guard"], NAMESPACE, None, MODEL.vehicle)
        transport = ZenohTransport(by["guard"], NAMESPACE, inbox)
        updates.open()
        # A session receives its own messages without a router.
        for name, key, to in (
            ("base", "output", outputs),
            ("operator", "status", states),
            ("stranger", "*", outputs),
        ):
            key = service.key(f"guard/{key}")
            by[name].declare_subscriber(key, to.append, allowed_origin=zenoh.Locality.REMOTE)
        time.sleep(_SETTLED)
        send_map(by["mapping"], service)
        blocking = zenoh.CongestionControl.BLOCK  # else a busy machine may drop one
        for name, session in by.items():
            for key in ("output", "status", "command", "motion", "clear", "confirm"):
                session.put(service.key(f"guard/{key}"), name, congestion_control=blocking)
        time.sleep(_SETTLED)
        updates.take(it)
        received = inbox.take(tuple(transport.topics), time.monotonic())
        updates.close()
        transport.close()
    senders = {
        kind: {item.raw.decode() for item in items} - {"guard"} for kind, items in received.items()
    }
    assert senders == {
        "command": {"navigation"},
        "motion": {"estimator"},
        "clear": {"mapping"},
        "confirm": {"operator"},
    }
    assert [sample.payload.to_string() for sample in outputs + states] == ["guard", "guard"]
    assert it.learned.waits == it.learned.silence == ""
    assert {"braking", "limits"} <= it.learned.groups.keys()
    assert it.maps.fresh(time.monotonic()) is not None
