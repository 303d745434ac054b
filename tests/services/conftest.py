"""One running service for all tests that leave it as it was, and a robot that talks to it."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
import zenoh

from tests.services.parameter_client import Robot, send_ground
from tests.services.service_process import Running, running

SETTINGS = (
    "[learning]\nstops_at_once = 10000  # stops take no time here\nrise = 0.02\n"
    '[store]\npath = "p.sqlite"'
)


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    with running(tmp_path_factory.mktemp("service"), planning=SETTINGS) as started:
        yield started


@pytest.fixture(scope="session")
def session(service: Running) -> Iterator[zenoh.Session]:
    with service.session() as opened:
        yield opened


@pytest.fixture
def robot(
    service: Running, session: zenoh.Session, request: pytest.FixtureRequest
) -> Iterator[Robot]:
    """A new sender on level ground, on parameters as in the model file."""
    sender = Robot(service, session, f"{request.node.name}-{time.monotonic_ns()}"[-100:])
    assert sender.roll_back(1)["status"] == "ok"
    send_ground(sender)
    yield sender
    assert sender.roll_back(1)["status"] == "ok"
