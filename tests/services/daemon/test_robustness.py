"""Routers that restart, receivers that hang: with real processes."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from slopewise.services.client import PlanClient
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.connect import client_session
from slopewise.services.wire.plan_messages import PlanReply, PlanRequest
from tests.services.service_process import fan, flat, free_port, running

_ROUTER = """
import json, sys, time, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"router"')
config.insert_json5("listen/endpoints", json.dumps([sys.argv[1]]))
config.insert_json5("scouting/multicast/enabled", "false")
with zenoh.open(config):
    print("ready", flush=True)
    time.sleep(600)
"""

_GREEDY = """
import json, sys, time, zenoh
endpoint, namespace, payload, encoding = sys.argv[1:]
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([endpoint]))
config.insert_json5("scouting/multicast/enabled", "false")
# Through the sockets, as over a network: shared memory would hide a receiver that hangs.
config.insert_json5("transport/shared_memory/enabled", "false")
key, request = f"{namespace}/v1/plan", open(payload, "rb").read()
ignore = lambda _: None
with zenoh.open(config) as session:
    subscriber = session.declare_subscriber(f"{namespace}/**", ignore)
    print("ready", flush=True)
    while True:
        session.get(key, ignore, payload=request, encoding=encoding, timeout=60.0)
        time.sleep(0.05)
"""


@contextlib.contextmanager
def process(code: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    started = subprocess.Popen(
        [sys.executable, "-c", code, *arguments], stdout=subprocess.PIPE, text=True
    )
    try:
        assert started.stdout.readline() == "ready\n"
        yield started
    finally:
        started.send_signal(signal.SIGCONT)
        started.kill()
        started.wait(10.0)


def answered(client: PlanClient, seconds: float) -> PlanReply | None:
    """The first reply with plans within a duration [s]; the client's stop before it."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        outcome = client.plan(1.0, fan(2))
        assert (outcome.reply is None) != (outcome.stop is None)
        if outcome.reply is not None and outcome.reply.plans:
            return outcome.reply
        time.sleep(0.05)
    return None


def test_a_stopped_receiver_delays_no_other_client(tmp_path: Path) -> None:
    request = tmp_path / "request"
    request.write_bytes(codec.encode(PlanRequest(speed=1.0, paths=fan(10)), Format.MESSAGEPACK))
    encoding = codec.encoding_of(PlanRequest, Format.MESSAGEPACK)
    with (
        running(tmp_path) as started,
        started.session() as session,
        PlanClient(session, namespace=started.namespace, timeout=2.0) as client,
    ):
        client.put_map(flat())
        assert answered(client, 10.0) is not None
        with process(
            _GREEDY, started.endpoint, started.namespace, str(request), encoding
        ) as greedy:
            time.sleep(1.0)
            greedy.send_signal(signal.SIGSTOP)
            # What it asked before is worked off first.
            assert answered(client, 10.0) is not None
            outcomes = [client.plan(1.0, fan(2)) for _ in range(60)]
    assert all(outcome.reply is not None and outcome.reply.plans for outcome in outcomes)


def test_a_router_that_restarts_is_found_again(tmp_path: Path) -> None:
    router = f"tcp/127.0.0.1:{free_port()}"
    with running(tmp_path, zenoh_lines=f'connect = ["{router}"]') as started:
        with process(_ROUTER, router):
            session = client_session(router)
            client = PlanClient(session, namespace=started.namespace, timeout=1.0)
            # The service looks for its router from time to time.
            until = time.monotonic() + 20.0
            while client.plan(0.0, []).reply is None and time.monotonic() < until:
                time.sleep(0.1)
            client.put_map(flat())
            before = answered(client, 10.0)
            assert before is not None
        gone = client.plan(1.0, fan(2))
        assert gone.reply is None
        assert gone.stop is not None
        assert gone.seconds < 1.5
        with process(_ROUTER, router):
            after = answered(client, 30.0)
            client.__exit__(None, None, None)
            session.close()
    assert after.map_version == before.map_version
    assert after.plans[0].column("speed").max() == before.plans[0].column("speed").max()
