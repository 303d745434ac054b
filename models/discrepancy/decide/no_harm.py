"""Stops held out confirm a decision: neither names nor a refit predict them worse."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import LARGER, Gaps, compared
from slopewise.models.discrepancy.decide.verdict import Decision, drifted, practical_lengths
from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.likelihood.refit import Refit
from slopewise.models.discrepancy.likelihood.residual_axes import ResidualAxis, mainly_along
from slopewise.models.discrepancy.likelihood.resolvable import Resolvable
from slopewise.models.discrepancy.likelihood.weigh import LEADERS
from slopewise.models.discrepancy.settings import DiscrepancySettings

_CLEARLY = 2.0  # error of the model as configured over that of a refit [1]


def held_to_account(
    table: StopTable,
    base: Refit,
    decision: Decision,
    located: list[ResidualAxis],
    seen: Resolvable,
    settings: DiscrepancySettings,
    next_to: Callable[[Sequence[frozenset[str]]], Decision],
) -> tuple[Decision, Gaps]:
    """The decision as stops held out confirm it, and how far it closes the gap.

    Args:
        table, base, seen, settings: as in :func:`.verdict.decide`. located: axes that the refitted
            base disagrees along.
        next_to: the decision without explanations that hold any of these sets of names.
    """
    decision, gaps, contradicted = _confirmed(table, base, decision, settings, next_to)
    # Something is missing for certain: no name is no reason for `none`.
    is_certain = contradicted and any(a.p_value < settings.structure for a in located)
    unknown = Decision(Verdict.UNKNOWN, base, axis=mainly_along(located), notes=decision.notes)
    has_gap = gaps.distance.closed is not None
    if contradicted and decision.keeps_model and (is_certain or has_gap):
        decision = unknown
    before, refit = gaps.distance.before, gaps.distance.refit
    min_change = float(np.mean(practical_lengths(table.distance, settings)))
    # However likely new coefficients are, they are reported where stops held out need them.
    if decision.keeps_model and before >= max(_CLEARLY * refit, refit + min_change):
        decision = drifted(decision, seen)
    is_drift = decision.verdict in (Verdict.PARAMETER_DRIFT, Verdict.UNIDENTIFIABLE)
    is_better = any(gap.refit < gap.before for gap in (gaps.speed, gaps.distance))
    is_better = is_better and refit <= LARGER * before
    if (is_drift or decision.verdict is Verdict.UNKNOWN) and not is_better:
        note = "new coefficients predict stops held out no better than those configured, which stay"
        if is_drift:
            is_none = not is_certain
            decision = replace(decision, verdict=Verdict.NONE, absorbed={}) if is_none else unknown
        decision = replace(decision, notes=(*decision.notes, note), unchanged=True)
    return decision, _as_configured(gaps) if decision.keeps_model else gaps


def _confirmed(
    table: StopTable,
    base: Refit,
    decision: Decision,
    settings: DiscrepancySettings,
    next_to: Callable[[Sequence[frozenset[str]]], Decision],
) -> tuple[Decision, Gaps, bool]:
    """The first decision that stops held out do not contradict, and whether there was another."""
    floor = decision.explanation.whitener
    gaps = compared(table, base, decision.explanation, floor, settings)
    contradicted: list[frozenset[str]] = []
    notes: tuple[str, ...] = ()
    while decision.names and gaps.harmful:
        contradicted.append(frozenset(decision.explanation.names))
        names = " and ".join(decision.names)
        fits = f"{names} fits the log, but predicts stops held out worse than the model without"
        notes = (*notes, *decision.notes, fits)
        decision = next_to(contradicted)
        if decision.names and len(contradicted) == LEADERS:
            decision = Decision(Verdict.NONE, base)
        gaps = compared(table, base, decision.explanation, floor, settings)
    notes = (*notes, *decision.notes)
    return replace(decision, notes=notes), gaps, bool(contradicted)


def _as_configured(gaps: Gaps) -> Gaps:
    """Gaps where nothing is changed."""
    speed, distance = (
        replace(g, after=g.before, closed=None, ci95=None) for g in (gaps.speed, gaps.distance)
    )
    return replace(gaps, speed=speed, distance=distance)
