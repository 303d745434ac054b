"""Other methods on the same logs, and their shares next to those of slopewise.

Each receives the columns of a log and the configured coefficients, nothing else.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from . import gls_scan
from .discrepancy_metrics import record, share
from .score import SetOutcome
from .sensing import Columns
from .world_outcomes import CLEAN, Names, WorldOutcome

BASELINES: dict[str, Callable[[Columns, dict[str, float]], tuple[str, ...]]] = {
    "gls_scan": gls_scan.name_effects
}
TITLES = {
    "pysindy": "PySINDy",
    "gls_scan": "GLS scan",
    "regime_tests": "regime tests",
    "slopewise": "slopewise",
}
"""Columns of stored results; PySINDy and the regime tests are no longer run."""


@dataclass(frozen=True, slots=True)
class BaselineAnswer:
    """Names given by one method, the strongest first, its processor time [s], its fault if any."""

    named: tuple[str, ...]
    seconds: float
    fault: str = ""


Answers = Mapping[str, BaselineAnswer]


class ScoredSet(NamedTuple):
    """One set: right names, slopewise's own score, and the answers of the other methods."""

    allowed: Sequence[frozenset[str]]
    right: bool
    wrong: bool
    alarm: bool
    answers: Answers


def ask_all(columns: Columns, configured: dict[str, float]) -> dict[str, BaselineAnswer]:
    """Answers of all methods about one log."""
    answers = {}
    for key, name_effects in BASELINES.items():
        start, fault = time.process_time(), ""
        try:
            named = name_effects(columns, configured)
        except (ValueError, np.linalg.LinAlgError) as error:
            named, fault = (), str(error)
        answers[key] = BaselineAnswer(named, time.process_time() - start, fault)
    return answers


def summary(
    answers: Sequence[Answers], outcomes: Sequence[SetOutcome]
) -> list[dict[str, Any]] | None:
    """Shares of all methods on the same sets of the plant; None without answers."""
    rows = [
        (o, _scored((frozenset(o.truth),), o, given))
        for given, o in zip(answers, outcomes, strict=True)
        if given
    ]
    if not rows:
        return None
    single = [s for o, s in rows if o.kind == "single" and o.identifiable]
    pairs = [s for o, s in rows if o.kind == "pair" and o.identifiable]
    hidden = [s for o, s in rows if o.kind in ("single", "pair", "off")]
    clean = [s for o, s in rows if o.kind == "clean"]
    return [
        _row("right name first, all effects", single, _is_first, lambda s: s.right),
        _row("the right name and no other, all effects", single, _is_exact, lambda s: s.right),
        _row("both names of a pair and no other", pairs, _is_exact, lambda s: s.right),
        _row("a wrong name given", hidden, _is_wrong, lambda s: s.wrong),
        _row("an effect named on clean sets", clean, _is_named, lambda s: s.alarm),
    ]


def world_summary(
    answers: Sequence[Answers], outcomes: Sequence[WorldOutcome], names: Names
) -> list[dict[str, Any]] | None:
    """Shares of all methods on the same sets of a world of physics; None without answers."""
    rows = [
        (o, _scored([frozenset(right) for right in names.get(o.what, ())], o, given))
        for given, o in zip(answers, outcomes, strict=True)
        if given
    ]
    if not rows:
        return None
    hidden = [s for o, s in rows if o.what != CLEAN]
    clean = [s for o, s in rows if o.what == CLEAN]
    return [
        _row("the right names and no other", hidden, _is_exact, lambda s: s.right),
        _row("a wrong name given", hidden, _is_wrong, lambda s: s.wrong),
        _row("an effect named on clean sets", clean, _is_named, lambda s: s.alarm),
    ]


def _scored(
    allowed: Sequence[frozenset[str]], o: SetOutcome | WorldOutcome, answers: Answers
) -> ScoredSet:
    return ScoredSet(allowed, o.right, o.wrong, o.verdict == "missing_effect", answers)


def _row(
    what: str,
    rows: Sequence[ScoredSet],
    is_hit: Callable[[ScoredSet, tuple[str, ...]], bool],
    slopewise: Callable[[ScoredSet], bool],
) -> dict[str, Any]:
    row: dict[str, Any] = {"what": what}
    for key in BASELINES:
        hits = [is_hit(s, s.answers[key].named) for s in rows if key in s.answers]
        if hits:
            row[key] = record(share(what, "", 0.0, hits))
    return row | {"slopewise": record(share(what, "", 0.0, [slopewise(s) for s in rows]))}


def _is_first(scored: ScoredSet, named: tuple[str, ...]) -> bool:
    return frozenset(named[:1]) in scored.allowed


def _is_exact(scored: ScoredSet, named: tuple[str, ...]) -> bool:
    return frozenset(named) in scored.allowed


def _is_wrong(scored: ScoredSet, named: tuple[str, ...]) -> bool:
    return bool(named) and not any(frozenset(named) <= names for names in scored.allowed)


def _is_named(_: ScoredSet, named: tuple[str, ...]) -> bool:
    return bool(named)
