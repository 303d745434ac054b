"""Another method on the same logs, and its shares next to those of slopewise.

It receives the columns of a log and the configured coefficients, nothing else.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import gls_scan
from .discrepancy_metrics import share
from .sensing import Columns

TITLES = {
    "pysindy": "PySINDy",
    "gls_scan": "GLS scan",
    "regime_tests": "regime tests",
    "slopewise": "slopewise",
}
"""Columns of stored results; PySINDy and the regime tests are no longer run."""


@dataclass(frozen=True, slots=True)
class BaselineAnswer:
    """Names given, the strongest first, processor time [s], and the fault if any."""

    named: tuple[str, ...]
    seconds: float
    fault: str = ""


Scored = tuple[Any, BaselineAnswer]
"""Outcome by slopewise with `right`, `wrong` and `verdict`, and the answer on the same set."""


def ask(columns: Columns, configured: dict[str, float]) -> BaselineAnswer:
    """Answer of the least-squares scan about one log."""
    start, fault = time.process_time(), ""
    try:
        named = gls_scan.name_effects(columns, configured)
    except (ValueError, np.linalg.LinAlgError) as error:
        named, fault = (), str(error)
    return BaselineAnswer(named, time.process_time() - start, fault)


def summary(
    rows: Mapping[str, tuple[Sequence[Scored], str]],
    right_names: Callable[[Any], Sequence[Sequence[str]]],
) -> list[dict[str, Any]]:
    """Shares of both methods on the same sets: rows count first, exact, wrong or any names."""

    def is_hit(outcome: Any, named: tuple[str, ...], counted: str) -> bool:
        allowed = [frozenset(names) for names in right_names(outcome)]
        match counted:
            case "first":
                return frozenset(named[:1]) in allowed
            case "exact":
                return frozenset(named) in allowed
            case "wrong":
                return bool(named) and not any(frozenset(named) <= names for names in allowed)
        return bool(named)

    def own_hit(outcome: Any, counted: str) -> bool:
        if counted == "named":
            return bool(outcome.verdict == "missing_effect")
        return bool(outcome.wrong if counted == "wrong" else outcome.right)

    result = []
    for what, (sets, counted) in rows.items():
        row: dict[str, Any] = {"what": what}
        if sets:
            hits = [is_hit(o, answer.named, counted) for o, answer in sets]
            row["gls_scan"] = share(what, "", 0.0, hits).record()
        own_hits = [own_hit(o, counted) for o, _ in sets]
        result.append(row | {"slopewise": share(what, "", 0.0, own_hits).record()})
    return result
