"""Order, bounds and deadlines of waiting requests."""

from __future__ import annotations

import gc
import math
import threading
import time
import weakref

import pytest

from slopewise.services.wire.fair_queue import FULL, REPLACED, FairQueue, FairShare, Waiting


def entry(name: str, sender: str = "", **fields: object) -> Waiting[str]:
    return Waiting(name, sender, **fields)  # type: ignore[arg-type]


def known(queue: FairQueue[str], *senders: str) -> None:
    """Let the queue have answered some senders."""
    for sender in senders:
        queue.shares.note_answer(sender)


def served(queue: FairQueue[str]) -> list[str]:
    return [waiting.item for _ in range(len(queue)) if (waiting := queue.take()) is not None]


def displaced_by(queue: FairQueue[str], waiting: Waiting[str]) -> str:
    """Name of the entry that has to leave for one, "" without."""
    displaced = queue.put(waiting)
    return "" if displaced is None else displaced.item


def taken(queue: FairQueue[str], **options: object) -> Waiting[str]:
    waiting = queue.take(**options)  # type: ignore[arg-type]
    assert waiting is not None
    return waiting


def test_the_sender_with_the_lowest_used_time_is_served_first() -> None:
    queue = FairQueue[str](8)
    known(queue, "busy", "modest")
    queue.shares.charge("busy", 1.0)
    queue.shares.charge("modest", 0.1)
    queue.shares.charge("a new name", 0.5)
    for name in ("busy", "another new name", "modest"):
        queue.put(entry(name, name))
    queue.put(entry("driving", "busy", outranks=True))
    assert served(queue) == ["driving", "modest", "another new name", "busy"]


def test_entries_of_one_account_keep_their_order_while_its_time_decays() -> None:
    queue = FairQueue[str](300)
    for account in ("known", "a new name"):
        known(queue, "known")
        queue.shares.charge(account, 1.0)
        for n in range(100):
            queue.put(entry(f"{n}", account))
        assert served(queue) == [f"{n}" for n in range(100)]
        for n in range(400):
            queue.put(entry(f"{n}", account))
        assert served(queue) == [f"{n}" for n in range(300)], "the newest are rejected"


def test_small_entries_of_one_account_are_served_first() -> None:
    queue = FairQueue[str](8)
    queue.put(entry("large", "a", size=100_000))
    queue.put(entry("first", "b"))
    queue.put(entry("second", "c"))
    assert served(queue) == ["first", "second", "large"]


def test_the_newest_entry_of_the_largest_account_is_rejected_when_the_queue_is_full() -> None:
    queue = FairQueue[str](3)
    known(queue, "robot")
    for n in range(3):
        assert queue.put(entry(f"{n}", f"name {n}")) is None
    displaced = queue.put(entry("robot", "robot"))
    assert (displaced.item, displaced.reason) == ("2", FULL)
    assert displaced_by(queue, entry("3", "name 3")) == "3"
    assert displaced_by(queue, entry("driving", "x", outranks=True)) == "1"
    assert len(queue) == 3


def test_a_newer_entry_of_a_named_sender_replaces_the_older_one_if_asked() -> None:
    for newest_only in (True, False):
        queue = FairQueue[str](8, newest_only=newest_only)
        queue.put(entry("older", "robot"))
        queue.put(entry("unnamed"))
        queue.put(entry("unnamed too"))
        displaced = queue.put(entry("newer", "robot"))
        if newest_only:
            assert (displaced.item, displaced.reason) == ("older", REPLACED)
        else:
            assert displaced is None


def test_an_entry_with_higher_rank_is_not_replaced_by_one_of_the_same_name() -> None:
    """Access to that rank can be restricted, names cannot."""
    queue = FairQueue[str](8, newest_only=True)
    queue.put(entry("driving", "robot", outranks=True))
    assert displaced_by(queue, entry("spoofed", "robot")) == ""
    assert displaced_by(queue, entry("newer", "robot", outranks=True)) == "driving"


def test_only_senders_that_used_less_or_outrank_come_in_between() -> None:
    queue = FairQueue[str](8)
    known(queue, "a", "b")
    queue.shares.charge("a", 1.0)
    queue.put(entry("a", "a"))
    working = taken(queue)
    queue.put(entry("same", "a"))
    assert queue.take_before(working) is None
    queue.put(entry("b", "b"))
    between = queue.take_before(working)
    assert between.item == "b"
    queue.shares.charge("b", 5.0)
    queue.put(entry("b", "b"))
    assert queue.take_before(working) is None
    queue.put(entry("b", "b", outranks=True))
    assert queue.take_before(working) is not None


def test_a_driving_client_is_never_preceded_by_a_long_request() -> None:
    """It would wait for the driving request, which waits for it."""
    queue = FairQueue[str](8)
    known(queue, "robot", "tool")
    queue.shares.charge("robot", 1.0)
    queue.put(entry("driving", "robot", is_driving=True))
    working = taken(queue, only_driving=True)
    queue.put(entry("long", "tool"))
    assert queue.take_before(working) is None


def test_the_reserved_worker_serves_driving_clients_only() -> None:
    queue = FairQueue[str](8)
    queue.put(entry("other"))
    assert queue.take(only_driving=True, timeout=0.01) is None
    queue.put(entry("driving", "robot", is_driving=True))
    working = taken(queue, only_driving=True)
    assert working.item == "driving"
    begun = time.monotonic()
    queue.yield_to_driving(0.02)
    assert time.monotonic() - begun >= 0.02
    queue.done()
    queue.yield_to_driving(60.0)


def test_each_entry_is_claimed_once_and_is_overdue_after_its_deadline() -> None:
    queue = FairQueue[str](8)
    late, rejected, answered = entry("late", time_limit=0.02), entry("rejected"), entry("answered")
    for waiting in (late, answered):
        queue.put(waiting)
    assert queue.claim(answered)
    assert not queue.claim(answered)
    assert queue.reject(rejected)
    assert queue.overdue() == [rejected]
    assert queue.overdue() == [late]
    assert not queue.claim(late)
    assert late.is_claimed


def test_the_queue_releases_all_threads_and_entries_when_it_is_closed() -> None:
    queue = FairQueue[str](8)
    results: list[object] = []
    threads = [
        threading.Thread(target=lambda wait=wait: results.append(wait()))
        for wait in (lambda: queue.take(only_driving=True), queue.overdue)
    ]
    for thread in threads:
        thread.start()
    waiting = entry("a")
    queue.put(waiting)
    assert queue.close() == [waiting]
    for thread in threads:
        thread.join(5.0)
    assert results == [None, None]
    assert queue.put(waiting) is waiting
    assert not queue.reject(waiting)


def test_an_entry_without_deadline_is_not_retained_after_it_was_taken() -> None:
    queue = FairQueue[str](8)
    references = []
    for n in range(100):
        waiting = entry(f"{n}")
        references.append(weakref.ref(waiting))
        queue.put(waiting)
        assert queue.take() is waiting
        del waiting
    gc.collect()
    assert sum(reference() is not None for reference in references) == 0
    assert queue.close() == []


def test_rejected_entries_are_bounded() -> None:
    queue = FairQueue[str](1)
    assert [queue.reject(entry("a")) for _ in range(2000)].count(True) == 1024


@pytest.mark.parametrize(("passed", "is_driving"), [(0.0, True), (11.0, False)])
def test_a_client_drives_after_three_answers_until_it_is_silent(
    monkeypatch: pytest.MonkeyPatch, passed: float, is_driving: bool
) -> None:
    shares, now = FairShare(), time.monotonic()
    for _ in range(3):
        assert not shares.is_driving("robot")
        shares.note_answer("robot")
    monkeypatch.setattr(time, "monotonic", lambda: now + passed)
    assert shares.is_driving("robot") is is_driving
    assert not shares.is_driving("")


def test_used_time_decays_and_names_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    shares, now = FairShare(), time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now)
    for n in range(300):
        shares.note_answer(f"{n}")
    shares.charge("0", 2.0)
    assert shares.used("a new name", now) == shares.used("0", now) == 2.0
    shares.charge("299", 1.0)
    assert shares.used("299", now + 5.0) == pytest.approx(1.0 / math.e)
