"""Numbers at the ends of what a float can hold, in everything that a robot may send to learn from.

What cannot be is refused with a reason, and with any input the parameters of plans stay
finite.

Observations are used once, in order, with any clock of their sender; columns are validated.
"""

from __future__ import annotations

import itertools
import json
import math
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.errors import InputError
from slopewise.models.parameters import Model
from slopewise.services.parameters.observation_filter import ObservationFilter, columns_of
from slopewise.services.parameters.parameter_endpoint import KINDS
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.observations import DRIVE_COLUMNS, TerrainLabel
from tests.services.parameters.parameter_fixtures import samples, started
from tests.services.robot_plant import Surface, Vehicle

SIZES = (0.0, 5e-324, 2.2e-308, 1e-160, 1e-12, 1.0, 2.0**53, 2.0**63, 1e154, 1e308, math.inf)
EXTREMES = (*SIZES, *(-size for size in SIZES), math.nan)
STOP = {"speed": 2.0, "grade": 0.0, "deceleration": 3.9, "deceleration_std": 0.02}
MORE = {"dead_time": 0.3, "distance": 1.11}
COLUMNS = (*DRIVE_COLUMNS, "roll", "yaw_rate", "v_left", "v_right", "current_left", "current_right")
COLUMNS += ("grade",)


class Sender:
    """A learning service, sent messages in the encoding of the wire."""

    def __init__(self) -> None:
        self.service, self.clock = started(""), itertools.count(1)

    def send(self, kind: str, fields: dict[str, Any], written: Format = Format.MESSAGEPACK) -> str:
        """Status of an observation; "malformed" where no message can be read."""
        n = next(self.clock)
        # Ten minutes apart, so that no stop is one too many.
        raw = {"source": "fuzz", "sequence": n, "time": 600.0 * n, **fields}
        encode = msgspec.json.encode if written is Format.JSON else msgspec.msgpack.encode
        kind_of = KINDS[kind]
        encoding = codec.encoding_of(kind_of, written)
        try:
            message = codec.decode(kind_of, encode(raw), encoding, "obs", 10**7)
        except InputError:
            return "malformed"
        receipt = self.service.observe(kind, message, "obs", 600.0 * n)
        assert receipt.status in ("taken", "ignored", "refused")
        assert receipt.reason
        self.check()
        return receipt.status

    def check(self) -> None:
        self.service.tick()
        assert self.service.degraded() == []
        numbers = parameters_of(self.service.active.model)
        assert np.all(np.isfinite(numbers)), numbers
        for group in self.service.learner.state.names():
            json.dumps(self.service.learner.state.group(group).state(group), allow_nan=False)


def parameters_of(model: Model) -> np.ndarray:
    braking, terrain = model.braking, model.terrain
    values = [braking.m_m, braking.b_m, braking.m_b, braking.b_b, braking.dead_time]
    values += [terrain.motion_resistance, terrain.lateral_resistance, terrain.slip_track]
    matrix = [] if braking.covariance is None else np.ravel(braking.covariance).tolist()
    return np.array([*values, braking.force_std, *matrix])


@pytest.mark.parametrize("field", [*STOP, *MORE, "time", "sequence"])
def test_no_number_of_a_stop_breaks_learning(field: str) -> None:
    sender = Sender()
    for value, grade in itertools.product(EXTREMES, (0.0, -0.1, 0.1, -0.8, -5e-324)):
        for stop in (STOP | MORE, STOP):
            sender.send("stop", {**stop, "grade": grade, field: value})
    assert sender.send("stop", STOP | MORE) in ("taken", "ignored", "refused")


@pytest.mark.parametrize("grade", [-0.1, -0.8, -5e-324])
def test_a_stop_without_deceleration_is_refused_by_its_deceleration(grade: float) -> None:
    sender = Sender()
    for value in (5e-324, 1e-300, 1e-17, 1e-3):
        fields = {"speed": 2.0, "grade": grade, "deceleration": value}
        assert sender.send("stop", fields) == "refused"
    assert sender.service.counters["stop_refused"] == 4


def test_seeded_stops_of_any_numbers_break_nothing() -> None:
    rng, sender, names = np.random.default_rng(7), Sender(), [*STOP, *MORE]
    for _ in range(2000):
        fields = STOP | MORE
        for name in rng.choice(names, rng.integers(1, 5), replace=False):
            any_size = rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-320.0, 308.0)
            fields[str(name)] = float(rng.choice([any_size, *EXTREMES, rng.uniform(0.0, 10.0)]))
        sender.send("stop", fields)


@pytest.mark.parametrize("column", COLUMNS)
def test_no_number_of_drive_samples_breaks_learning(column: str) -> None:
    sender, rng = Sender(), np.random.default_rng(3)
    n, begin = 200, itertools.count(0)
    for value in EXTREMES:
        for where in ((0,), (100,), range(n)):
            t = 100.0 * next(begin) + 0.02 * np.arange(n)
            v = np.clip(2.0 - 3.9 * np.maximum(t - t[0] - 1.3, 0.0), 0.0, None)
            rows = {name: 0.1 * rng.standard_normal(n) for name in COLUMNS}
            rows |= {"t": t, "v": v, "v_cmd": np.where(t < t[0] + 1.0, 2.0, 0.0)}
            rows |= {"v_left": v, "v_right": v, "pitch": np.zeros(n), "grade": np.zeros(n)}
            rows[column][list(where)] = value
            values = np.ascontiguousarray(list(rows.values()), "<f8")
            block = {"shape": values.shape, "data": values.tobytes()}
            sender.send("drive", {"columns": list(rows), "values": block})


def test_no_number_of_a_label_breaks_learning() -> None:
    sender = Sender()
    for value in EXTREMES:
        sender.send("terrain", {"surface": "sand", "probability": value})
        sender.send("terrain", {"surface": "sand", "probability": 0.9, "time": value})


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("written", Format)
def test_a_count_that_is_none_is_malformed(kind: str, written: Format) -> None:
    sender = Sender()
    fields: dict[str, Any] = {
        "stop": STOP | MORE,
        "terrain": {"surface": "sand"},
        "drive": {"columns": list(DRIVE_COLUMNS), "values": [[0.0, 1.0]] * 4},
    }[kind]
    for count in (-1, 2**53 + 1, 2**63, 2**64 - 1, 1.5, "7", None, True):
        assert sender.send(kind, {**fields, "sequence": count}, written) == "malformed"
    encoding = codec.encoding_of(KINDS[kind], Format.JSON)
    raw = json.dumps({"source": "fuzz", "time": 1.0, "sequence": 0, **fields})
    for text in ("1e400", "1" + 400 * "0", "NaN", "-Infinity", "0x7"):
        for shown in ('"time": 1.0', '"sequence": 0'):
            assert shown in raw
            payload = raw.replace(shown, f"{shown.partition(':')[0]}: {text}").encode()
            with pytest.raises(InputError):
                codec.decode(KINDS[kind], payload, encoding, "obs", 10**7)


LATE, TWICE, FUTURE = "out_of_order", "duplicate", "future"


def sent(known: ObservationFilter, number: int, time: float, now: float, source: str = "a") -> str:
    label = TerrainLabel(source=source, sequence=number, time=time, surface="x")
    reason = known.check("terrain", label, now)
    if not reason:
        known.accept("terrain", label)
    return reason


def test_each_observation_is_used_once_and_in_order() -> None:
    known = ObservationFilter(2.0, {"terrain:b": 7})
    assert [sent(known, n, 0.0, 0.0) for n in (1, 3, 3, 2, 4)] == ["", "", TWICE, LATE, ""]
    assert sent(known, 7, 0.0, 0.0, "b") == TWICE, "stored before this start"
    assert sent(known, 8, 0.0, 0.0, "b") == ""
    known.restore({"terrain:a": 9, "terrain:b": 5})
    assert [sent(known, n, 0.0, 0.0) for n in (8, 10)] == [LATE, ""]
    assert sent(known, 9, 0.0, 0.0, "b") == "", "ahead of the store"


@given(epoch=st.floats(-1e9, 1e9), delays=st.lists(st.floats(0.0, 5.0), min_size=1, max_size=50))
def test_any_epoch_and_any_short_delay_are_accepted(epoch: float, delays: list[float]) -> None:
    known = ObservationFilter(6.0)
    for n, delay in enumerate(delays):
        assert sent(known, n, epoch + 10.0 * n, 10.0 * n + delay) == ""
    assert known.clocks.active() == []


def test_a_clock_that_is_set_is_accepted_once_it_is_steady() -> None:
    known = ObservationFilter(2.0)
    assert sent(known, 1, 0.0, 0.0) == ""
    noise = [sent(known, 2, 1000.0 * n, float(n)) for n in range(1, 20)]
    assert set(noise) == {FUTURE}, "a clock that jumps about is never accepted"
    steady = [sent(known, 2 + n, 5000.0 + n, 20.0 + n) for n in range(5)]
    assert steady == [FUTURE] * 4 + [""]
    assert known.clocks.active() == ["the clock of a was set"]
    assert sent(known, 30, 5010.0, 30.0) == ""


def test_a_restarted_sender_is_accepted_with_its_new_clock() -> None:
    known = ObservationFilter(2.0)
    for n in range(1, 30):
        sent(known, n, 50_000.0 + n, float(n))
    assert [sent(known, n, 5.0 + n, 40.0 + n) for n in range(1, 12)][-1] == ""
    assert known.clocks.active() == ["the clock of a was set"]


def test_a_restarted_count_is_accepted_after_a_few_messages_and_flagged() -> None:
    known = ObservationFilter(2.0, {"terrain:a": 2**53})
    assert [sent(known, n, float(n), float(n)) for n in range(1, 5)] == [LATE, LATE, "", ""]
    assert known.notices.active() == ["terrain observations of a: the source restarted its count"]


def test_only_the_latest_sources_are_remembered() -> None:
    known = ObservationFilter(2.0)
    for n in range(3000):
        sent(known, 1, 0.0, 0.0, f"source {n}")
    assert sent(known, 1, 0.0, 0.0, "source 2999") == TWICE
    assert sent(known, 1, 0.0, 0.0, "source 0") == "", "forgotten"


def test_columns_are_validated_before_anything_is_learned() -> None:
    _, columns = Vehicle().stop(Surface(0.3), 2.0)
    drive = samples(columns)
    assert list(columns_of(drive, "obs/drive")) == list(columns)
    steps = np.tile(np.arange(20_001.0) * 1e-4, (4, 1))
    with pytest.raises(InputError, match="at most 20000 samples"):
        columns_of(msgspec.structs.replace(drive, values=steps), "obs/drive")
    names = drive.columns
    for columns in (["t", "v", "v_cmd", "v"], names[:2] + names[3:], ["colour", *names[1:]]):
        with pytest.raises(InputError, match="columns"):
            columns_of(msgspec.structs.replace(drive, columns=columns), "obs/drive")
    for name, i, value in (("v", 5, np.nan), ("pitch", 0, np.inf), ("t", 9, 0.0), ("v", 0, 1e6)):
        values = drive.values.copy()
        values[names.index(name), i] = value
        with pytest.raises(InputError, match=rf"values\.{name}\[{i}\]"):
            columns_of(msgspec.structs.replace(drive, values=values), "obs/drive")
