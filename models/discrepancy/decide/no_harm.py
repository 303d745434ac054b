"""Stops held out have a say: no name that makes them worse, no silence where a refit helps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import Gaps, compared
from slopewise.models.discrepancy.decide.size import practical_lengths
from slopewise.models.discrepancy.decide.verdict import Decision, FittedExplanation, drifted
from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.search.refine import Fit
from slopewise.models.discrepancy.search.resolvable import Resolvable
from slopewise.models.discrepancy.settings import DiscrepancySettings

_CLEARLY = 2.0  # error of the model as configured over that of a refit [1]


def that_predicts(
    table: StopTable, base: Fit, decision: Decision, gaps: Gaps, settings: DiscrepancySettings
) -> tuple[Decision, Gaps]:
    """The decision, or `unknown` where its names make stops held out worse.

    Args:
        table: stops. base: refitted model. decision: so far. gaps: with what it says.
        settings: parts, draws and seed.
    """
    if not decision.names or not gaps.harmful:
        return decision, gaps
    names = " and ".join(decision.names)
    words = f"{names} fits the log, but predicts stops held out worse than new coefficients do"
    plain = Decision(
        Verdict.UNKNOWN,
        FittedExplanation(base),
        axis=decision.axis,
        notes=(*decision.notes, words),
    )
    return plain, compared(table, base, base, decision.explanation.fit.noise, settings)


def worth_refitting(decision: Decision, gaps: Gaps) -> tuple[Decision, Gaps]:
    """The decision, with the model as configured where new coefficients predict no better."""
    refitted = decision.verdict in (Verdict.PARAMETER_DRIFT, Verdict.UNKNOWN)
    both = (gaps.speed, gaps.distance)
    if not refitted or any(gap.refit < gap.before for gap in both):
        return decision, gaps
    words = "new coefficients predict stops held out no better than those configured, which stay"
    drift = decision.verdict is Verdict.PARAMETER_DRIFT
    verdict = Verdict.NONE if drift else Verdict.UNKNOWN
    kept = replace(decision, verdict=verdict, notes=(*decision.notes, words), kept=True)
    return kept, as_configured(gaps)


def worth_a_word(
    table: StopTable,
    decision: Decision,
    gaps: Gaps,
    seen: Resolvable,
    settings: DiscrepancySettings,
) -> Decision:
    """The decision, or new coefficients where these alone make stops held out clearly better.

    They may lie within the errors of a calibration and still be worth centimetres.
    """
    calm = decision.verdict is Verdict.NONE
    before, refit = gaps.distance.before, gaps.distance.refit
    least = float(np.mean(practical_lengths(table.distance, settings)))
    if not calm or before < _CLEARLY * refit or before - refit < least:
        return decision
    return drifted(table, decision, seen)


def as_configured(gaps: Gaps) -> Gaps:
    """Gaps where nothing is changed."""
    speed, distance = (
        replace(g, after=g.before, closed=None, ci95=None) for g in (gaps.speed, gaps.distance)
    )
    return replace(gaps, speed=speed, distance=distance)
