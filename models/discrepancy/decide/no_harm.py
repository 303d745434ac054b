"""Stops held out confirm a decision: no name that predicts them worse, a refit that helps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import Gaps, compared
from slopewise.models.discrepancy.decide.verdict import Decision, drifted, practical_lengths
from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.likelihood.refit import Refit
from slopewise.models.discrepancy.likelihood.resolvable import Resolvable
from slopewise.models.discrepancy.settings import DiscrepancySettings

_CLEARLY = 2.0  # error of the model as configured over that of a refit [1]


def held_to_account(
    table: StopTable,
    base: Refit,
    decision: Decision,
    seen: Resolvable,
    settings: DiscrepancySettings,
    calm: Callable[[frozenset[str]], bool],
) -> tuple[Decision, Gaps]:
    """The decision as stops held out confirm it, and how far it closes the gap.

    ``calm``: does the log need no cause, of explanations without these names?
    """
    floor = decision.explanation.whitener
    gaps = compared(table, base, decision.explanation, floor, settings)
    if decision.names and gaps.harmful:
        # Without a gap above the noise the other explanations are enough.
        is_calm = gaps.distance.closed is None and calm(frozenset(decision.names))
        decision = _contradicted(base, decision, Verdict.NONE if is_calm else Verdict.UNKNOWN)
        gaps = compared(table, base, base, floor, settings)
    before, refit = gaps.distance.before, gaps.distance.refit
    min_change = float(np.mean(practical_lengths(table.distance, settings)))
    none = decision.verdict is Verdict.NONE
    # New coefficients may lie within the errors of a calibration and still be worth centimetres.
    if none and before >= max(_CLEARLY * refit, refit + min_change):
        decision = drifted(decision, seen)
    is_drift = decision.verdict in (Verdict.PARAMETER_DRIFT, Verdict.UNIDENTIFIABLE)
    is_better = any(gap.refit < gap.before for gap in (gaps.speed, gaps.distance))
    if (is_drift or decision.verdict is Verdict.UNKNOWN) and not is_better:
        note = "new coefficients predict stops held out no better than those configured, which stay"
        verdict = Verdict.NONE if is_drift else Verdict.UNKNOWN
        notes = (*decision.notes, note)
        decision = replace(decision, verdict=verdict, absorbed=(), notes=notes, unchanged=True)
    return decision, _as_configured(gaps) if decision.keeps_model else gaps


def _contradicted(base: Refit, decision: Decision, verdict: Verdict) -> Decision:
    names = " and ".join(decision.names)
    note = f"{names} fits the log, but predicts stops held out worse than the model without"
    return Decision(verdict, base, notes=(*decision.notes, note), visible=decision.visible)


def _as_configured(gaps: Gaps) -> Gaps:
    """Gaps where nothing is changed."""
    speed, distance = (
        replace(g, after=g.before, closed=None, ci95=None) for g in (gaps.speed, gaps.distance)
    )
    return replace(gaps, speed=speed, distance=distance)
