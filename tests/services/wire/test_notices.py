"""What has to be told for a while: each once, in an order that does not change by itself."""

from __future__ import annotations

from slopewise.services.wire.notices import Notices


def test_what_happens_again_keeps_its_place() -> None:
    notices = Notices()
    for words in ("first", "second", "first", "third", "second"):
        notices.say(words)
    assert notices.told() == ["first", "second", "third"]
    notices.take_back("second")
    notices.say("second")
    assert notices.told() == ["first", "third", "second"]


def test_of_many_those_that_did_not_happen_for_the_longest_time_go() -> None:
    notices = Notices()
    notices.say("lives on")
    for n in range(20):
        notices.say(f"{n}")
        notices.say("lives on")
    assert notices.told() == ["lives on", *(f"{n}" for n in range(13, 20))]


def test_what_is_long_ago_is_not_told() -> None:
    notices = Notices(seconds=0.0)
    notices.say("over")
    assert notices.told() == []
