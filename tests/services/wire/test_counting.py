"""Sources that count their messages, lose count, and lie about it."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from slopewise.services.wire.counting import Count, MessageOrder

FAR = 2**53


def told(count: Count, *numbers: int, lead: float = 0.0, content: int = 0) -> list[MessageOrder]:
    """What becomes of messages; each has something else in it unless told otherwise."""
    found = []
    for i, number in enumerate(numbers):
        inside = content or 1000 * i + number
        order = count.judge(number, inside, lead)
        if order.taken:
            count.take(number, inside)
        found.append(order)
    return found


def test_a_count_that_begins_anew_is_believed_with_the_third_message() -> None:
    count = Count()
    told(count, 100, 101, 102)
    assert told(count, 1, 2, 3, 4) == [
        MessageOrder.OLDER,
        MessageOrder.OLDER,
        MessageOrder.ANEW,
        MessageOrder.NEW,
    ]


def test_one_number_far_ahead_stops_nobody() -> None:
    count = Count()
    told(count, 100, FAR)
    assert told(count, 101, 102, 103) == [MessageOrder.TWICE, MessageOrder.NEW, MessageOrder.NEW]
    assert told(count, FAR - 1, 104, FAR - 2, 105)[1::2] == [MessageOrder.TWICE, MessageOrder.TWICE]


def test_numbers_ahead_between_messages_stop_nobody_for_long() -> None:
    count, taken = Count(), 0
    told(count, 5)
    for n in range(6, 40):
        told(count, 1_000_000 + n)
        taken += told(count, n)[0].taken
    assert taken >= 10


def test_what_comes_again_is_a_duplicate_however_often() -> None:
    count = Count()
    told(count, *range(1, 20), content=7)
    for _ in range(4):
        assert set(told(count, *range(1, 20), content=7)) == {MessageOrder.DUPLICATE}


def test_late_ones_that_pile_up_are_no_new_count() -> None:
    count = Count()
    told(count, 100)
    for number, sent in ((50, -40.0), (51, -30.0), (52, -20.0), (53, -10.0)):
        assert told(count, number, lead=sent, content=number) == [MessageOrder.OLDER]


def test_a_huge_number_silences_nobody_for_good_whose_time_stamps_stand_still() -> None:
    for huge in (10**6, 2**31, FAR):
        for first in (0, 5):
            count = Count()
            told(count, *range(1, first + 1), huge)
            # Each lead is that of a stamp that stands still while messages come 3 s apart.
            orders = [told(count, n, lead=-3.0 * n)[0] for n in range(first + 1, first + 16)]
            refused = [order for order in orders if not order.taken]
            assert refused == [MessageOrder.OLDER] * len(refused)
            assert len(refused) <= 9
            assert orders[-1] is MessageOrder.NEW


def test_late_ones_between_messages_of_the_known_count_are_no_new_one() -> None:
    count = Count()
    told(count, 1000)
    for n in range(1, 40):
        assert told(count, n, lead=-7.0 * n, content=n) == [MessageOrder.OLDER]
        assert told(count, *range(1000 + 9 * n, 1009 + 9 * n)) == [MessageOrder.NEW] * 9


@given(st.lists(st.integers(0, FAR), max_size=60))
def test_at_most_three_in_a_row_are_lost_to_any_lies(lies: list[int]) -> None:
    count = Count()
    told(count, *lies)
    honest = told(count, 10, 11, 12, 13, content=10**9)
    assert honest[-1].taken or honest[-1] is MessageOrder.DUPLICATE
