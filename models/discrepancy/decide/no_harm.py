"""Nothing that is said may predict stops held out worse than saying less would."""

from __future__ import annotations

from dataclasses import replace

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import Gaps, compared
from slopewise.models.discrepancy.decide.verdict import Decision
from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.search.identify import ScoredExplanation
from slopewise.models.discrepancy.search.refine import Fit
from slopewise.models.discrepancy.settings import DiscrepancySettings


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
        ScoredExplanation(base, decision.explanation.score),
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


def as_configured(gaps: Gaps) -> Gaps:
    """Gaps where nothing is changed."""
    speed, distance = (
        replace(g, after=g.before, closed=None, ci95=None) for g in (gaps.speed, gaps.distance)
    )
    return replace(gaps, speed=speed, distance=distance)
