"""What was wanted, what was reached, and how sure that is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import binomtest

from .score import SetOutcome

SEVERAL = 0.90  # share of sets that have to close four fifths


@dataclass(frozen=True, slots=True)
class Metric:
    """One line of the table.

    Attributes:
        what: in words. wanted: the mark. relation: ">=" or "<=", "in" for a range, "" for none.
        reached: share or figure, None without any set. low, high: Wilson interval (95 %) of a
            share, quartiles of a figure. hits, of: what a share is of; of alone for a figure.
        unit: "%" or of the figure.
    """

    what: str
    relation: str
    wanted: float | tuple[float, float]
    reached: float | None
    low: float
    high: float
    hits: int
    of: int
    unit: str = "%"

    @property
    def passed(self) -> bool | None:
        """Whether the mark is met; None without a mark or a figure."""
        if self.reached is None or not self.relation:
            return None
        if self.relation == "in":
            assert isinstance(self.wanted, tuple)
            return self.wanted[0] <= self.reached <= self.wanted[1]
        assert isinstance(self.wanted, float)
        return self.reached >= self.wanted if self.relation == ">=" else self.reached <= self.wanted


def wilson(hits: int, of: int) -> tuple[float, float]:
    """95 % interval of a share."""
    if of == 0:
        return 0.0, 1.0
    interval = binomtest(hits, of).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def share(
    what: str, relation: str, wanted: float | tuple[float, float], answers: Sequence[bool]
) -> Metric:
    """A share of sets."""
    hits, of = sum(answers), len(answers)
    return Metric(what, relation, wanted, hits / of if of else None, *wilson(hits, of), hits, of)


def figure(
    what: str,
    relation: str,
    wanted: float,
    values: Sequence[float],
    of: Callable[[Any], Any] = np.median,
    unit: str = "",
) -> Metric:
    """A figure over sets, with quartiles."""
    if not values:
        return Metric(what, relation, wanted, None, 0.0, 0.0, 0, 0, unit)
    low, high = np.quantile(values, (0.25, 0.75))
    reached = float(of(values))
    return Metric(what, relation, wanted, reached, float(low), float(high), 0, len(values), unit)


def metrics(outcomes: Sequence[SetOutcome]) -> list[Metric]:
    """All of them for the plant's sets."""
    known = [o for o in outcomes if o.identifiable]
    single = [o for o in known if o.kind == "single"]
    marked = [o for o in single if o.size != "small"]
    small = [o for o in single if o.size == "small"]
    pairs = [o for o in known if o.kind == "pair"]
    off = [o for o in known if o.kind == "off"]
    of_kind = {k: [o for o in outcomes if o.kind == k] for k in ("clean", "drift", "absorbed")}
    hidden = [o for o in outcomes if o.kind not in ("clean", "drift")]
    weak = [o for o in hidden if not o.identifiable and o.kind != "absorbed"]
    closed = [c for o in single + pairs if (c := o.closing.share) is not None]
    covered = [yes for o in single if o.right for yes in o.covered.values()]
    seconds = [o.seconds for o in outcomes]
    return [
        share("right name first, medium and large", ">=", 0.95, [o.right for o in marked]),
        share("right name first, small", ">=", 0.85, [o.right for o in small]),
        share(
            "right name first or among the rivals, all sizes",
            "",
            0.0,
            [set(o.truth) <= {*o.named, *o.alternatives} for o in single],
        ),
        share(
            "wrong name given with confidence", "<=", 0.01, [o.wrong for o in single + pairs + off]
        ),
        share("the same on sets that are too weak to name", "<=", 0.01, [o.wrong for o in weak]),
        share(
            "missing_effect on clean sets",
            "<=",
            0.02,
            [o.verdict == "missing_effect" for o in of_kind["clean"]],
        ),
        share(
            "drift called drift",
            ">=",
            0.95,
            [o.verdict == "parameter_drift" for o in of_kind["drift"]],
        ),
        share("both names of a pair", ">=", 0.90, [o.right for o in pairs]),
        share(
            "off-library: unknown or its axis, no name", ">=", 0.90, [_told_unknown(o) for o in off]
        ),
        share(
            "absorbed by the base: no name",
            ">=",
            0.99,
            [o.verdict != "missing_effect" for o in of_kind["absorbed"]],
        ),
        share(
            "absorbed by the base: called unidentifiable",
            "",
            0.0,
            [o.verdict == "unidentifiable" for o in of_kind["absorbed"]],
        ),
        figure("closable gap closed, fresh stops, median", ">=", 0.95, closed, unit="share"),
        share("sets that close four fifths of it", ">=", SEVERAL, [c >= 0.8 for c in closed]),
        share("right axis located", ">=", 0.90, [o.axis_right for o in single + off]),
        share("95 % intervals of parameters cover", "in", (0.92, 0.97), covered),
        figure("time per 100 stops, median", "<=", 5.0, seconds, unit="s"),
        figure("time per 100 stops, worst", "<=", 20.0, seconds, np.max, "s"),
        share("stops held out made worse", "<=", 0.0, [o.worse > 1.0 for o in outcomes]),
        share("faults of the workflow", "<=", 0.0, [o.verdict == "fault" for o in outcomes]),
    ]


def _told_unknown(o: SetOutcome) -> bool:
    if o.verdict == "missing_effect" or o.verdict == "fault":
        return False
    return o.verdict == "unknown" or (bool(o.located) and o.axis_right)


def record(metric: Metric) -> dict[str, Any]:
    """For JSON."""
    names = ("what", "relation", "wanted", "reached", "low", "high", "hits", "of", "unit")
    return {name: getattr(metric, name) for name in names} | {"passed": metric.passed}


def effect_row(
    kind: str,
    effect: str,
    group: Sequence[Any],
    known: Sequence[Any],
    closed: Sequence[float | None],
    axis: int | None,
) -> dict[str, Any]:
    """One effect in a table: sets, identifiable ones, right and wrong names, gap closed.

    Args:
        kind, effect: of the sets. group: their outcomes. known: of the identifiable ones.
        closed: their share of the gap, None without one. axis: right axes among them, if asked.
    """
    shares = sorted(share for share in closed if share is not None)
    return {
        "kind": kind,
        "effect": effect,
        "sets": len(group),
        "identifiable": len(known),
        "right": sum(o.right for o in known),
        "wrong": sum(o.wrong for o in group),
        "axis": axis,
        "verdicts": dict(Counter(o.verdict for o in known or group)),
        "closed": shares[len(shares) // 2] if shares else None,
    }
