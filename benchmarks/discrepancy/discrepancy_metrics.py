"""Metrics of the plant's and of the car's sets, and counts by effect."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import binomtest

from .car_outcomes import CAR_NAMES, CLEAN, STRENGTHS, CarOutcome
from .score import SetOutcome

Target = float | tuple[float, float]


@dataclass(frozen=True, slots=True)
class Metric:
    """One row of the table."""

    what: str  # name of the metric
    relation: str  # ">=" or "<=", "in" for a range, "" without a target
    target: Target  # value or range to reach
    reached: float | None  # share or figure, None without any set
    low: float  # low, high: Wilson interval (95 %) of a share, quartiles of a figure
    high: float
    hits: int  # hits, of: counts behind a share; of alone for a figure
    of: int
    unit: str = "%"  # "%", or unit of the figure

    def record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        values = asdict(self)
        return values | {"wanted": values.pop("target"), "passed": self.passed}

    @property
    def passed(self) -> bool | None:
        """Whether the target is met; None without a target or a figure."""
        if self.reached is None or not self.relation:
            return None
        if isinstance(self.target, tuple):
            return self.target[0] <= self.reached <= self.target[1]
        return self.reached >= self.target if self.relation == ">=" else self.reached <= self.target


def wilson(hits: int, of: int) -> tuple[float, float]:
    """95 % interval of a share."""
    if of == 0:
        return 0.0, 1.0
    interval = binomtest(hits, of).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def share(what: str, relation: str, target: Target, answers: Sequence[bool]) -> Metric:
    """A share of sets."""
    hits, of = sum(answers), len(answers)
    return Metric(what, relation, target, hits / of if of else None, *wilson(hits, of), hits, of)


def figure(
    what: str,
    relation: str,
    target: float,
    values: Sequence[float],
    of: Callable[[Any], Any] = np.median,
    unit: str = "",
) -> Metric:
    """A figure over sets, with quartiles."""
    if not values:
        return Metric(what, relation, target, None, 0.0, 0.0, 0, 0, unit)
    low, high = np.quantile(values, (0.25, 0.75))
    reached = float(of(values))
    return Metric(what, relation, target, reached, float(low), float(high), 0, len(values), unit)


def metrics(outcomes: Sequence[SetOutcome]) -> list[Metric]:
    """All metrics of the plant's sets."""
    known = [o for o in outcomes if o.identifiable]
    single = [o for o in known if o.kind == "single"]
    pairs = [o for o in known if o.kind == "pair"]
    unnamed = [o for o in known if o.kind == "off"]
    closed = [c for o in single + pairs if (c := o.closing.share) is not None]
    absorbed = [o.verdict for o in outcomes if o.kind == "absorbed"]
    seconds = [o.seconds for o in outcomes]
    covered = [yes for o in single if o.right for yes in o.covered.values()]
    unknown = [_is_unknown(o) for o in unnamed]
    unidentifiable = [v == "unidentifiable" for v in absorbed]
    return [
        *_name_metrics(outcomes, single, pairs, unnamed),
        share("both names of a pair", ">=", 0.90, [o.right for o in pairs]),
        share("off-library: unknown or its axis, no name", ">=", 0.90, unknown),
        share(
            "absorbed by the base: no name", ">=", 0.99, [v != "missing_effect" for v in absorbed]
        ),
        share("absorbed by the base: called unidentifiable", "", 0.0, unidentifiable),
        figure("closable gap closed, fresh stops, median", ">=", 0.95, closed, unit="share"),
        share("sets that close four fifths of it", ">=", 0.90, [c >= 0.8 for c in closed]),
        share("right axis located", ">=", 0.90, [o.axis_right for o in single + unnamed]),
        share("95 % intervals of parameters cover", "in", (0.92, 0.97), covered),
        figure("time per 100 stops, median", "<=", 5.0, seconds, unit="s"),
        figure("time per 100 stops, worst", "<=", 20.0, seconds, np.max, "s"),
        *_workflow_metrics(outcomes),
    ]


def _name_metrics(
    outcomes: Sequence[SetOutcome],
    single: Sequence[SetOutcome],
    pairs: Sequence[SetOutcome],
    unnamed: Sequence[SetOutcome],
) -> list[Metric]:
    """Metrics of right and false names."""
    weak = [
        o for o in outcomes if not o.identifiable and o.kind not in ("clean", "drift", "absorbed")
    ]
    clean = [o.verdict == "missing_effect" for o in outcomes if o.kind == "clean"]
    drift = [o.verdict == "parameter_drift" for o in outcomes if o.kind == "drift"]
    listed = [set(o.truth) <= {*o.named, *o.alternatives} for o in single]
    named = [o.wrong for o in (*single, *pairs, *unnamed)]
    large = [o.right for o in single if o.size != "small"]
    small = [o.right for o in single if o.size == "small"]
    return [
        share("right name first, medium and large", ">=", 0.95, large),
        share("right name first, small", ">=", 0.85, small),
        share("right name first or an alternative, all sizes", "", 0.0, listed),
        share("wrong name given with confidence", "<=", 0.01, named),
        share("the same on sets that are too weak to name", "<=", 0.01, [o.wrong for o in weak]),
        share("missing_effect on clean sets", "<=", 0.02, clean),
        share("drift called drift", ">=", 0.95, drift),
    ]


def _workflow_metrics(outcomes: Sequence[Any]) -> list[Metric]:
    """Faults, and predictions that became worse."""
    return [
        share("stops held out made worse", "<=", 0.0, [o.worse > 1.0 for o in outcomes]),
        share("faults of the workflow", "<=", 0.0, [o.verdict == "fault" for o in outcomes]),
    ]


def _is_unknown(o: SetOutcome) -> bool:
    if o.verdict in ("missing_effect", "fault"):
        return False
    return o.verdict == "unknown" or (bool(o.located) and o.axis_right)


def car_metrics(outcomes: Sequence[CarOutcome]) -> list[Metric]:
    """Metrics of the car's sets."""
    clean = [o.verdict for o in outcomes if o.what == CLEAN]
    hidden = [o for o in outcomes if o.what != CLEAN]
    large = [o.right for o in hidden if o.strength != "small"]
    with_lag = [o.right or _is_right_with_lag(o) for o in hidden]
    closed = [o.closed for o in hidden if o.closed is not None]
    return [
        share("right name, medium and large", ">=", 0.90, large),
        share("right name, small", ">=", 0.75, [o.right for o in hidden if o.strength == "small"]),
        share("right name, or it and the build-up that is there, all", "", 0.0, with_lag),
        share("wrong name given with confidence", "<=", 0.01, [o.wrong for o in hidden]),
        share("a name on clean sets", "<=", 0.0, [v == "missing_effect" for v in clean]),
        share("nothing found on clean sets", "", 0.0, [v == "none" for v in clean]),
        figure("closable gap closed, fresh stops, median", ">=", 0.90, closed, unit="share"),
        figure("time per 100 stops, median", "<=", 5.0, [o.seconds for o in outcomes], unit="s"),
        *_workflow_metrics(outcomes),
    ]


def _is_right_with_lag(o: CarOutcome) -> bool:
    """Whether the right names and `brake_lag` were given: brakes of this car take 30 ms."""
    names = set(o.named) - {"brake_lag"}
    return o.verdict == "missing_effect" and names in map(set, CAR_NAMES[o.what])


def effect_rows(outcomes: Sequence[SetOutcome]) -> list[dict[str, Any]]:
    """Counts of the plant's sets by kind and effect."""
    groups: dict[tuple[str, str], list[SetOutcome]] = {}
    for outcome in outcomes:
        groups.setdefault((outcome.kind, " + ".join(outcome.truth)), []).append(outcome)
    rows = []
    for key, group in sorted(groups.items()):
        known = [o for o in group if o.identifiable]
        closed, axis = [o.closing.share for o in known], sum(o.axis_right for o in known)
        rows.append(_effect_row(*key, group, known, closed, axis))
    return rows


def car_rows(outcomes: Sequence[CarOutcome]) -> list[dict[str, Any]]:
    """Counts of the car's sets by effect and strength."""
    groups: dict[tuple[str, str], list[CarOutcome]] = {}
    for o in sorted(outcomes, key=lambda o: (o.what, STRENGTHS.index(o.strength))):
        groups.setdefault((o.what, o.strength), []).append(o)
    return [
        _effect_row("multibody", ", ".join(filter(None, key)), g, g, [o.closed for o in g], None)
        for key, g in groups.items()
    ]


def _effect_row(
    kind: str,
    effect: str,
    group: Sequence[Any],
    known: Sequence[Any],
    closed: Sequence[float | None],
    axis: int | None,
) -> dict[str, Any]:
    """Counts of sets, and of right names, axes and closed shares of the identifiable ones."""
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
