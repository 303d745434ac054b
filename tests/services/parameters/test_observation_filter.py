"""Observations are used once, in order, with any clock of their sender; columns are validated."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.errors import InputError
from slopewise.services.parameters.observation_filter import ObservationFilter, columns_of
from slopewise.services.wire.observations import DriveSamples, TerrainLabel
from tests.services.robot_plant import Surface, Vehicle

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


def test_stored_messages_that_are_sent_late_are_no_restarted_count() -> None:
    known = ObservationFilter(2.0)
    for n in range(1, 30):
        sent(known, n, 10.0 * n, 10.0 * n)
    again = [sent(known, n, 10.0 * n, 400.0) for n in range(5, 20)]
    assert set(again) <= {LATE, TWICE}


def test_only_the_latest_sources_are_remembered() -> None:
    known = ObservationFilter(2.0)
    for n in range(3000):
        sent(known, 1, 0.0, 0.0, f"source {n}")
    assert sent(known, 1, 0.0, 0.0, "source 2999") == TWICE
    assert sent(known, 1, 0.0, 0.0, "source 0") == "", "forgotten"


def test_columns_are_validated_before_anything_is_learned() -> None:
    _, columns = Vehicle().stop(Surface(0.3), 2.0)
    samples = DriveSamples(
        source="robot",
        sequence=1,
        time=0.0,
        columns=list(columns),
        values=np.stack(list(columns.values())),
    )
    assert list(columns_of(samples, "obs/drive")) == list(columns)
    steps = np.tile(np.arange(20_001.0) * 1e-4, (4, 1))
    with pytest.raises(InputError, match="at most 20000 samples"):
        columns_of(msgspec.structs.replace(samples, values=steps), "obs/drive")
    names = samples.columns
    for columns in (["t", "v", "v_cmd", "v"], names[:2] + names[3:], ["colour", *names[1:]]):
        with pytest.raises(InputError, match="columns"):
            columns_of(msgspec.structs.replace(samples, columns=columns), "obs/drive")
    for name, i, value in (("v", 5, np.nan), ("pitch", 0, np.inf), ("t", 9, 0.0), ("v", 0, 1e6)):
        values = samples.values.copy()
        values[names.index(name), i] = value
        with pytest.raises(InputError, match=rf"values\.{name}\[{i}\]"):
            columns_of(msgspec.structs.replace(samples, values=values), "obs/drive")
