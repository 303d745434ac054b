"""Malformed payloads on all keys: no crash, nothing learned, and a reply or a count."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError
from slopewise.services.client import PlanClient
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.parameters import replies
from slopewise.services.parameters.active_parameters import ActiveParameters
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.planning.map_store import MapSnapshot, MapStore
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.planning.request_validation import validate_request
from slopewise.services.settings.learning_settings import StoreSettings
from slopewise.services.settings.service_settings import Planning, ServiceConfig, SizeLimits
from slopewise.services.wire import codec
from slopewise.services.wire.observations import DriveSamples, StopObservation, TerrainLabel
from slopewise.services.wire.parameter_messages import ParameterQuestion, RollBack, SetParameters
from slopewise.services.wire.plan_messages import Path as Candidate
from slopewise.services.wire.plan_messages import PlanRequest, ServiceStatus
from tests.services.malformed import Malformed
from tests.services.service_process import fan, flat, running

_MAX_BYTES = 1_000_000
_NIGHTLY = 125_000  # for each of eight keys
_TOGETHER = 250
_COMPARED_EVERY = 25
"""Payloads between two comparisons of all parameters; their version is always compared."""

_POINTS = np.array([[0.0, 0.0], [1.0, 0.1], [2.0, 0.0], [3.0, 0.0]])
_COLUMNS = ["t", "v", "v_cmd", "pitch", "roll"]


def messages() -> dict[str, list[msgspec.Struct]]:
    """Messages that are right, by key."""
    samples = np.stack([np.arange(6) * 0.1, *np.full((2, 6), 1.0), *np.zeros((2, 6))])
    header = {"source": "s", "sequence": 1, "time": 1.0}
    stop = {"speed": 2.0, "grade": 0.1, "deceleration": 3.0, "deceleration_std": 0.1}
    stop |= {"dead_time": 0.3, "distance": 1.2}
    return {
        "plan": [
            PlanRequest(speed=1.0, paths=[Candidate(name="a", points=_POINTS)], clear=3.0),
            PlanRequest(
                speed=1.0,
                client="c",
                pose=(0.0, 0.0, 0.0),
                sequence=3,
                paths=[
                    Candidate(name="a", points=_POINTS, speed_limit=np.ones(4), clear=2.0),
                    Candidate(name="b", points=_POINTS + 0.5),
                ],
            ),
        ],
        "map": [
            flat(elevation=np.zeros((4, 5))),
            flat(2, elevation=np.zeros((2, 2)), patch=True),
            flat(3, elevation=np.zeros((2, 2)), terrain_class=np.zeros((2, 2)), class_names=["a"]),
        ],
        "obs/stop": [StopObservation(**header, **stop, surface="sand")],
        "obs/drive": [DriveSamples(**header, columns=_COLUMNS, values=samples, surface="sand")],
        "obs/terrain": [TerrainLabel(**header, surface="sand", probability=0.9)],
        "params": [ParameterQuestion(group="braking", history=3)],
        "params/set": [
            SetParameters(group="limits", values={"speed": 2.0}),
            SetParameters(group="braking", values={"b_b": 0.3, "m_b": 0.01}, who="operator"),
        ],
        "params/rollback": [RollBack(version=1, group="braking"), RollBack(version=3)],
    }


KEYS = list(messages())


class Desk:
    """All that the service does with a payload, in this process."""

    def __init__(self, folder: Path) -> None:
        config = ServiceConfig(
            model="atv",
            planning=Planning(smooth=False),
            sizes=SizeLimits(stations=1000, points=100),
            store=StoreSettings(path=str(folder / "parameters.db"), changes=100),
        )
        prior = read_model(find_model("atv"))
        self.plans = PlanService(config, ActiveParameters(prior))
        self.parameters = ParameterService(config, prior, apply=self.plans.learn)
        heights = np.zeros((12, 16))
        self.level = ElevationMap(elevation=heights, resolution=0.5, origin=(-3.0, -3.0))
        self.maps = MapStore(self.level)

    @property
    def ground(self) -> MapSnapshot:
        """As received now: a night takes longer than a map may be old."""
        return MapSnapshot(self.level, 1, time.monotonic())

    def handle(self, key: str, payload: bytes, encoding: str) -> str:
        kind = type(messages_of[key][0])
        try:
            check = self._check if key == "plan" else lambda _: None
            message = codec.decode(kind, payload, encoding, key, _MAX_BYTES, check=check)
            return str(self._do(key, message))
        except InputError as error:
            text = str(error)
        assert text.isprintable()
        assert len(text) < 2000
        return "error"

    def _check(self, message: PlanRequest) -> None:
        validate_request(message, self.plans.config.sizes, "plan")

    def _do(self, key: str, message: Any) -> str:
        if key == "plan":
            reply = self.plans.answer(message, self.ground, key)
            assert codec.encode(reply, codec.Format.JSON)
            assert all(np.isfinite(plan.column("speed")).all() for plan in reply.plans)
            return reply.status
        if key == "map":
            return "taken" if self.maps.apply(message, key) else "ignored"
        if key.startswith("obs/"):
            kind = key.removeprefix("obs/")
            return self.parameters.observe(kind, message, key, time.monotonic()).status
        if key == "params":
            return replies.read(self.parameters, message).status
        return replies.change(self.parameters, message).status

    def known(self) -> bytes:
        """All parameters but their age, byte by byte."""
        groups = replies.read(self.parameters, ParameterQuestion()).groups
        assert groups
        raw = [msgspec.to_builtins(group) | {"age": 0.0} for group in groups]
        return msgspec.json.encode(raw, order="deterministic")


messages_of = messages()
_ACCEPTED = ("taken", "ok", "blocked", "infeasible", "degraded")


def fuzz(key: str, seed: int, count: int, desk: Desk) -> Counter[str]:
    """Hand in ``count`` payloads; returns the number of each status."""
    supply = Malformed(messages_of[key], seed)
    became: Counter[str] = Counter()
    known, ground = desk.known(), desk.maps.snapshot
    version = desk.parameters.active.version
    for n in range(count):
        payload, encoding = supply.draw()
        status = desk.handle(key, payload, encoding)
        became[status] += 1
        if status in _ACCEPTED:
            known, ground = desk.known(), desk.maps.snapshot
            version = desk.parameters.active.version
        assert desk.parameters.active.version == version, payload
        assert desk.maps.snapshot is ground, payload
        if n % _COMPARED_EVERY == 0 or n == count - 1:
            assert desk.known() == known, payload
    return became


def limits_hold(desk: Desk) -> None:
    """Plans are made with a valid model, no faster than its limits."""
    request = PlanRequest(speed=0.0, paths=[Candidate(name="a", points=_POINTS)])
    reply = desk.plans.answer(request, desk.ground, "plan")
    limit = desk.parameters.active.model.limits.speed
    assert reply.plans[0].column("speed").max() <= limit + 1e-9


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Desk]:
    desk = Desk(tmp_path_factory.mktemp("fuzz"))
    yield desk
    desk.parameters.close()


@pytest.mark.parametrize("field", ["speed", "session_time", "brake_heat", "clear", "pose"])
@pytest.mark.parametrize("value", [1e300, 1e15, -1e300])
@pytest.mark.parametrize("client", ["", "c"])
def test_numbers_that_are_no_quantities(desk: Desk, field: str, value: float, client: str) -> None:
    raw = {"speed": 1.0, "paths": [{"name": "a", "points": _POINTS.tolist()}], "client": client}
    raw |= {"pose": [0.0, 0.0, 0.0]} | {field: [value] * 3 if field == "pose" else value}
    assert desk.handle("plan", msgspec.json.encode(raw), "application/json") in (
        "error",
        *_ACCEPTED,
    )


@pytest.mark.parametrize("key", KEYS)
def test_nothing_malformed_crashes_or_is_learned_from(key: str, desk: Desk) -> None:
    became = fuzz(key, 1, 400, desk)
    assert became["error"] > 100
    limits_hold(desk)


@pytest.mark.nightly
@pytest.mark.parametrize("key", KEYS)
def test_a_million_malformed_payloads_in_all(key: str, tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    became: Counter[str] = Counter()

    @settings(max_examples=_NIGHTLY // _TOGETHER, database=None)
    @given(st.integers(0, 2**63))
    def some(seed: int) -> None:
        became.update(fuzz(key, seed, _TOGETHER, desk))

    # What was right by chance does not count.
    while sum(count for status, count in became.items() if status not in _ACCEPTED) < _NIGHTLY:
        some()
    limits_hold(desk)


def test_a_real_service_answers_or_counts_all_of_it(tmp_path: Path) -> None:
    count = 60
    with (
        running(tmp_path) as started,
        started.session() as session,
        PlanClient(session, namespace=started.namespace, timeout=5.0) as client,
    ):
        received: list[ServiceStatus] = []

        def receive(sample: Any) -> None:
            encoding = str(sample.encoding)
            received.append(
                codec.decode(ServiceStatus, sample.payload, encoding, "status", _MAX_BYTES)
            )

        for key in KEYS:
            supply = Malformed(messages_of[key], 7)
            for _ in range(count):
                payload, encoding = supply.draw()
                name = started.key(key)
                if key == "map":
                    session.put(name, payload, encoding=encoding)
                    continue
                answers = list(session.get(name, payload=payload, encoding=encoding, timeout=5.0))
                assert len(answers) == 1, (key, payload)
                assert answers[0].ok is not None, (key, payload)
        client.put_map(flat(source="after"))
        with session.declare_subscriber(started.key("status"), receive):
            until = time.monotonic() + 5.0
            while time.monotonic() < until and not (
                received and _maps(received[-1]) >= count + 1 and len(received) > 1
            ):
                time.sleep(0.05)
        last = received[-1].counters
        assert last.get("faults", 0) == 0, last
        assert last.get("queries_lost", 0) == last.get("observations_lost", 0) == 0
        assert last["queries"] == last["refused"] + last["answered"] + last.get("busy", 0)
        assert _maps(received[-1]) == count + 1
        assert client.plan(1.0, fan(2)).reply is not None


def _maps(status: ServiceStatus) -> int:
    names = ("map_updates", "map_updates_refused", "map_updates_ignored", "map_updates_lost")
    return sum(status.counters.get(name, 0) for name in names)
