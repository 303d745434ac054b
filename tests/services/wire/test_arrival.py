"""Order and age of messages: counts, stamps, growth of delay; clocks that drift and step."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.errors import ParameterError
from slopewise.services.wire.arrival import MessageOrder, SenderTable, SequenceTracker
from slopewise.services.wire.lateness import (
    ARRIVAL,
    DRIFT,
    GROWTH,
    RECOVERY,
    SHARED,
    SYNCHRONY,
    Lateness,
    SenderClock,
    WallClock,
)
from slopewise.services.wire.recent_warnings import RecentWarnings

FAR = 2**53
NEW, OLDER, DUPLICATE = MessageOrder.NEW, MessageOrder.OLDER, MessageOrder.DUPLICATE
RESTARTED, FORKED = MessageOrder.RESTARTED, MessageOrder.FORKED


def orders(
    tracker: SequenceTracker, *numbers: int, lead: float = 0.0, content: int = 0
) -> list[MessageOrder]:
    """Orders of messages, whose content differs unless given."""
    received = []
    for i, number in enumerate(numbers):
        digest = content or 1000 * i + number
        order = tracker.classify(number, digest, lead)
        if order.is_accepted:
            tracker.accept(number, digest)
        received.append(order)
    return received


def test_a_restarted_count_is_accepted_with_the_third_message() -> None:
    tracker = SequenceTracker()
    orders(tracker, 100, 101, 102)
    assert orders(tracker, 1, 2, 3, 4) == [OLDER, OLDER, RESTARTED, NEW]


def test_one_number_far_ahead_blocks_no_sender() -> None:
    tracker = SequenceTracker()
    orders(tracker, 100, FAR)
    assert orders(tracker, 101, 102, 103) == [FORKED, NEW, NEW]
    assert orders(tracker, FAR - 1, 104, FAR - 2, 105)[1::2] == [FORKED, FORKED]


def test_numbers_ahead_between_messages_block_no_sender_for_long() -> None:
    tracker, accepted = SequenceTracker(), 0
    orders(tracker, 5)
    for n in range(6, 40):
        orders(tracker, 1_000_000 + n)
        accepted += orders(tracker, n)[0].is_accepted
    assert accepted >= 10


def test_repeated_messages_stay_duplicates() -> None:
    tracker = SequenceTracker()
    orders(tracker, *range(1, 20), content=7)
    for _ in range(4):
        assert set(orders(tracker, *range(1, 20), content=7)) == {DUPLICATE}


def test_consecutive_late_messages_are_not_a_restarted_count() -> None:
    tracker = SequenceTracker()
    orders(tracker, 100)
    for number, sent in ((50, -40.0), (51, -30.0), (52, -20.0), (53, -10.0)):
        assert orders(tracker, number, lead=sent, content=number) == [OLDER]


def test_a_huge_number_does_not_block_a_sender_whose_time_stamps_are_constant() -> None:
    for huge in (10**6, 2**31, FAR):
        for first in (0, 5):
            tracker = SequenceTracker()
            orders(tracker, *range(1, first + 1), huge)
            # Each lead is that of a constant stamp on messages that come 3 s apart.
            received = [orders(tracker, n, lead=-3.0 * n)[0] for n in range(first + 1, first + 16)]
            refused = [order for order in received if not order.is_accepted]
            assert refused == [OLDER] * len(refused)
            assert len(refused) <= 9
            assert received[-1] is NEW


def test_late_messages_between_those_of_the_known_count_are_not_a_restarted_one() -> None:
    tracker = SequenceTracker()
    orders(tracker, 1000)
    for n in range(1, 40):
        assert orders(tracker, n, lead=-7.0 * n, content=n) == [OLDER]
        assert orders(tracker, *range(1000 + 9 * n, 1009 + 9 * n)) == [NEW] * 9


@given(st.lists(st.integers(0, FAR), max_size=60))
def test_at_most_three_consecutive_messages_are_lost_to_any_forged_numbers(
    forged: list[int],
) -> None:
    tracker = SequenceTracker()
    orders(tracker, *forged)
    last = orders(tracker, 10, 11, 12, 13, content=10**9)[-1]
    assert last.is_accepted or last is DUPLICATE


def test_the_sender_that_was_silent_longest_is_dropped() -> None:
    table = SenderTable[str, SequenceTracker](SequenceTracker, 2)
    first = table.of("a")
    table.of("b")
    assert table.of("a") is first
    table.of("c")
    assert [*table] == ["a", "c"]


def test_a_repeated_warning_keeps_its_position() -> None:
    warnings = RecentWarnings()
    for text in ("first", "second", "first", "third", "second"):
        warnings.add(text)
    assert warnings.active() == ["first", "second", "third"]
    warnings.clear("second")
    warnings.add("second")
    assert warnings.active() == ["first", "third", "second"]


def test_of_many_warnings_the_oldest_are_dropped() -> None:
    warnings = RecentWarnings()
    warnings.add("persists")
    for n in range(20):
        warnings.add(f"{n}")
        warnings.add("persists")
    assert warnings.active() == ["persists", *(f"{n}" for n in range(13, 20))]


def test_a_warning_expires() -> None:
    warnings = RecentWarnings(duration=0.0)
    warnings.add("over")
    assert warnings.active() == []


PERIOD = 0.02
DELAY = 0.15


def lateness_of(delays: np.ndarray, steps: np.ndarray | float = 0.0) -> np.ndarray:
    """Lateness of messages with these delays, whose stamps are off by ``steps``."""
    clock, sent = SenderClock(), PERIOD * np.arange(len(delays))
    stamps = 1e9 + sent + steps
    pairs = zip(stamps, sent + delays, strict=True)
    return np.array([clock.lateness(float(s), float(at), sent=1) for s, at in pairs])


def test_a_constant_delay_cannot_be_seen_and_its_growth_can() -> None:
    t = PERIOD * np.arange(500)
    assert lateness_of(np.full(500, DELAY)).max() < 1e-6
    grown = np.maximum(t - 2.0, 0.0) * 0.3
    assert np.abs(lateness_of(DELAY + grown) - grown).max() < 2.0 * DRIFT * 10.0


def test_jitter_costs_nothing_that_lasts() -> None:
    jitter = np.random.default_rng(1).uniform(0.0, 0.05, 5000)
    late = lateness_of(DELAY + jitter)
    assert np.all(late[1000:] <= jitter[1000:] + PERIOD)
    assert np.all(late[1000:] >= jitter[1000:] - 0.005)


@pytest.mark.parametrize("rate", [-DRIFT, DRIFT])
def test_clocks_may_drift_for_hours(rate: float) -> None:
    drift = rate * PERIOD * np.arange(200_000)
    late = lateness_of(np.full(200_000, DELAY), drift)
    assert late.max() < 0.001


@pytest.mark.parametrize("leap", [-5.0, -0.5, 0.1, 0.3, 0.5, 5.0])
def test_a_step_of_the_senders_clock_hides_no_growth_and_is_over_in_its_time(leap: float) -> None:
    count = round((RECOVERY + 8.0) / PERIOD)
    t = PERIOD * np.arange(count)
    grown = 0.3 * np.clip(t - 2.0, 0.0, 1.0)  # 0.3 s later from 3 s on
    late = lateness_of(DELAY + grown, np.where(t >= 4.0, leap, 0.0))
    assert np.all(late >= grown - DRIFT * t - 1e-6)
    over = t >= 4.0 + RECOVERY + PERIOD
    # Penalties are a message period at most, and forgotten.
    assert np.all(late <= grown + PERIOD + 1e-6)
    assert np.abs(late[over] - grown[over]).max() < 0.005


def test_a_delay_that_falls_is_no_step() -> None:
    """Of a queue of 0.3 s only the newest message arrives: sixteen numbers in one step."""
    clock, at = SenderClock(), 0.0
    for k in range(400):
        if not 200 <= k < 215:
            delay = DELAY + (0.3 if 100 <= k < 200 else 0.0)
            at = max(PERIOD * k + delay, at + 0.001)
            late = clock.lateness(50.0 + PERIOD * k, at, sent=16 if k == 215 else 1)
            assert (late > 0.25) == (100 <= k < 200)
    assert clock.steps == 0


def test_a_clock_that_steps_with_every_message_makes_none_fresh() -> None:
    count = 500
    late = lateness_of(np.full(count, DELAY), 0.1 * np.arange(count))
    assert late[-1] > 0.5 * PERIOD * count


def test_a_repeated_stamp_is_as_old_as_when_it_was_seen_first() -> None:
    newest = Lateness(0.2)
    newest.take(50.0, 1.0, 1)
    for k in range(1, 30):
        newest.take(50.0, 1.0 + 0.02 * k, k + 1)
        assert newest.repeated
        assert newest.age(1.0 + 0.02 * k) == pytest.approx(0.02 * k)
    assert newest.objection(1.6, 0.3) == "0.60 s old (repeated stamp), limit 0.3 s"
    newest.take(None, 1.7)  # omitted stamps do not refresh it either
    assert newest.age(1.7) == pytest.approx(0.7)


def test_what_stamps_are_good_for() -> None:
    now = [5.0]
    wall = WallClock(lambda: 1000.0 + now[0], lambda: now[0])
    shared, unshared, none = Lateness(0.2, wall), Lateness(0.2), Lateness(0.2)
    shared.take(1004.3, 5.0)
    unshared.take(3.0, 5.0)
    none.take(None, 5.0)
    assert [newest.stamps for newest in (shared, unshared, none)] == [SHARED, GROWTH, ARRIVAL]
    assert shared.age(5.1) == pytest.approx(0.8)
    assert shared.bound(5.1) == pytest.approx(0.8 + SYNCHRONY)
    assert unshared.bound(5.1) == none.bound(5.1) == pytest.approx(0.3)
    assert shared.objection(5.1, 0.3) == "0.80 s old (stamp), limit 0.3 s"


def test_stamps_of_the_future_are_refused() -> None:
    now = [5.0]
    wall = WallClock(lambda: 1000.0 + now[0], lambda: now[0])
    newest = Lateness(0.2, wall)
    assert newest.take(1005.0 + 0.5 * SYNCHRONY, 5.0)
    with pytest.raises(ParameterError, match=r"got 4\.00 s later"):
        newest.take(1009.0, 5.0)
    with pytest.raises(ParameterError, match="finite"):
        newest.take(float("nan"), 5.0)


@pytest.mark.parametrize("leap", [-0.1, 0.1])
def test_a_step_of_the_clock_here_counts_the_worse_until_it_is_over(leap: float) -> None:
    """Messages 0.15 s late; the wall clock here is set by a tenth of a second."""
    now, set_by = [0.0], [0.0]
    wall = WallClock(lambda: 1000.0 + now[0] + set_by[0], lambda: now[0])
    newest = Lateness(0.2, wall)
    ages = []
    for k in range(round(1.2 * RECOVERY / PERIOD)):
        now[0] = PERIOD * k
        set_by[0] = leap if k >= 50 else 0.0
        newest.take(1000.0 + now[0] - DELAY, now[0])
        ages.append(newest.age(now[0]))
    assert min(ages[: round(RECOVERY / PERIOD)]) >= DELAY - 1e-6
    assert ages[-1] == pytest.approx(DELAY + leap, abs=0.005)


def test_without_numbers_an_overtaken_message_is_ignored() -> None:
    newest = Lateness(0.2)
    assert newest.take(10.0, 1.0)
    assert not newest.take(9.9, 1.01)
    assert newest.take(4.9, 1.02)  # the clock was set
    assert newest.stepped == 1.02


def test_without_numbers_a_clock_set_back_by_less_than_a_second_is_over_in_its_time() -> None:
    """Half a second back: what looks overtaken is refused, and what comes after it is a step."""
    newest, ages = Lateness(0.2), []
    for k in range(round((RECOVERY + 4.0) / PERIOD)):
        now = PERIOD * k
        if newest.take(50.0 + now - (0.5 if now >= 2.0 else 0.0), now):
            ages.append((now, newest.age(now)))
    first = next(age for now, age in ages if now > 2.0)
    assert first >= 0.5 - PERIOD
    assert newest.stepped > 2.0
    assert ages[-1][1] < 0.01


def test_stamps_that_no_clock_reaches_are_refused_and_hide_no_delay() -> None:
    """In another unit, or so large that fractions of a second are lost in them."""
    newest = Lateness(0.2)
    for k in range(200):
        sent = PERIOD * k
        assert newest.take(1e9 + sent, sent + 0.4 * (k >= 100), k)
    for stamp in (1e300, -1e300, 1.7e18):
        with pytest.raises(ParameterError, match="a finite time in seconds"):
            newest.take(stamp, sent + 0.41)
    newest.take(1e9 + PERIOD * 200, PERIOD * 200 + 0.4, 200)
    assert newest.age(PERIOD * 200 + 0.4) == pytest.approx(0.4, abs=0.001)


@pytest.mark.parametrize("rate", [0.9, 0.99])
def test_simulated_time_that_runs_slower_makes_messages_late_unless_stamps_are_ignored(
    rate: float,
) -> None:
    used, ignored = Lateness(0.2), Lateness(0.2, uses_stamps=False)
    for k in range(3000):
        now = PERIOD * k
        used.take(rate * now, now, k)
        ignored.take(rate * now, now, k)
    assert used.age(now) > 0.5
    assert ignored.stamps == ARRIVAL
    assert ignored.age(now + 0.1) == pytest.approx(0.1)
    assert ignored.bound(now + 0.1) == pytest.approx(0.3)


def test_a_wall_clock_that_is_set_twice_counts_the_worst_of_all_settings() -> None:
    now, set_by = [0.0], [0.0]
    wall = WallClock(lambda: 1000.0 + now[0] + set_by[0], lambda: now[0])
    for k, leap in enumerate((0.0, -0.3, -0.6)):
        now[0], set_by[0] = 1.0 + k, leap
        earliest, latest = wall.at(now[0])
    assert latest == pytest.approx(1000.0 + now[0])
    assert earliest == pytest.approx(999.4 + now[0])
    now[0] += RECOVERY + 0.1
    assert wall.at(now[0]) == pytest.approx((999.4 + now[0],) * 2)
