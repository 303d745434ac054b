"""Senders that number their messages, restart, and send wrong numbers; recent warnings."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from slopewise.services.wire.arrival import MessageOrder, SenderTable, SequenceTracker
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
