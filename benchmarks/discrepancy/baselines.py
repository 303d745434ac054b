"""Other methods on the same logs: who they are, what they named, and their shares beside ours.

Each is handed the columns of a log and the configured coefficients, nothing else.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from . import gls_scan, peer, regime_tests
from .metrics import record, share
from .score import SetOutcome
from .sensing import Columns
from .world_outcomes import CLEAN, WorldOutcome

NamesEffects = Callable[[Columns, dict[str, float]], tuple[str, ...] | None]

PEERS: dict[str, NamesEffects] = {
    "pysindy": peer.name_effects,
    "gls_scan": gls_scan.name_effects,
    "regime_tests": regime_tests.name_effects,
}
TITLES = {
    "pysindy": "PySINDy",
    "gls_scan": "GLS scan",
    "regime_tests": "regime tests",
    "slopewise": "slopewise",
}


@dataclass(frozen=True, slots=True)
class PeerAnswer:
    """What one of them named, the strongest first, in how much processor time; its fault if any."""

    named: tuple[str, ...]
    seconds: float
    fault: str = ""


Answers = Mapping[str, PeerAnswer]


class JudgedSet(NamedTuple):
    """A set as both see it: sets of names that are right, what slopewise was, what peers said."""

    allowed: Sequence[frozenset[str]]
    right: bool
    wrong: bool
    alarm: bool
    peers: Answers


def ask(columns: Columns, configured: dict[str, float]) -> dict[str, PeerAnswer]:
    """All that are installed, about one log."""
    found = {}
    for key, name_effects in PEERS.items():
        begun, fault = time.process_time(), ""
        try:
            named = name_effects(columns, configured)
        except (ValueError, np.linalg.LinAlgError) as error:
            named, fault = (), str(error)
        if named is not None:
            found[key] = PeerAnswer(named, time.process_time() - begun, fault)
    return found


def summary(answers: Sequence[Answers], own: Sequence[SetOutcome]) -> list[dict[str, Any]] | None:
    """Shares of all on the same sets of the plant; None where nobody was asked."""
    rows = [
        (
            o,
            JudgedSet(
                (frozenset(o.truth),), o.right, o.wrong, o.verdict == "missing_effect", given
            ),
        )
        for given, o in zip(answers, own, strict=True)
        if given
    ]
    if not rows:
        return None
    single = [(o, j) for o, j in rows if o.kind == "single" and o.identifiable]
    listed = [j for o, j in single if o.truth[0] in peer.EFFECTS]
    everything, clean = [j for _, j in single], [j for o, j in rows if o.kind == "clean"]
    pairs = [j for o, j in rows if o.kind == "pair" and o.identifiable]
    hidden = [j for o, j in rows if o.kind in ("single", "pair", "off")]
    return [
        _row("right name first, effects in PySINDy's library", listed, _first, _own_right),
        _row("right name first, all effects", everything, _first, _own_right),
        _row("the right name and no other, all effects", everything, _exact, _own_right),
        _row("both names of a pair and no other", pairs, _exact, _own_right),
        _row("a wrong name given", hidden, _wrong, _own_wrong),
        _row("an effect named on clean sets", clean, _alarm, _own_alarm),
    ]


def world_summary(
    answers: Sequence[Answers],
    own: Sequence[WorldOutcome],
    names: Mapping[str, tuple[tuple[str, ...], ...]],
) -> list[dict[str, Any]] | None:
    """Shares of all on the same sets of a world of physics; None where nobody was asked."""
    rows = [
        (
            o,
            JudgedSet(
                tuple(frozenset(one) for one in names.get(o.what, ())),
                o.right,
                o.wrong,
                o.verdict == "missing_effect",
                given,
            ),
        )
        for given, o in zip(answers, own, strict=True)
        if given
    ]
    if not rows:
        return None
    hidden = [j for o, j in rows if o.what != CLEAN]
    clean = [j for o, j in rows if o.what == CLEAN]
    return [
        _row("the right names and no other", hidden, _exact, _own_right),
        _row("a wrong name given", hidden, _wrong, _own_wrong),
        _row("an effect named on clean sets", clean, _alarm, _own_alarm),
    ]


def _row(
    what: str,
    rows: Sequence[JudgedSet],
    hit: Callable[[JudgedSet, tuple[str, ...]], bool],
    mine: Callable[[JudgedSet], bool],
) -> dict[str, Any]:
    found: dict[str, Any] = {"what": what}
    for key in PEERS:
        asked = [j for j in rows if key in j.peers]
        if asked:
            found[key] = record(share(what, "", 0.0, [hit(j, j.peers[key].named) for j in asked]))
    return found | {"slopewise": record(share(what, "", 0.0, [mine(j) for j in rows]))}


def _first(judged: JudgedSet, named: tuple[str, ...]) -> bool:
    return frozenset(named[:1]) in judged.allowed


def _exact(judged: JudgedSet, named: tuple[str, ...]) -> bool:
    return frozenset(named) in judged.allowed


def _wrong(judged: JudgedSet, named: tuple[str, ...]) -> bool:
    return bool(named) and not any(frozenset(named) <= names for names in judged.allowed)


def _alarm(_: JudgedSet, named: tuple[str, ...]) -> bool:
    return bool(named)


def _own_right(judged: JudgedSet) -> bool:
    return judged.right


def _own_wrong(judged: JudgedSet) -> bool:
    return judged.wrong


def _own_alarm(judged: JudgedSet) -> bool:
    return judged.alarm
