"""Stops held out confirm a decision: neither names nor a refit predict them worse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import LARGER, Gaps, compared
from slopewise.models.discrepancy.decide.verdict import Decision, drifted, practical_lengths
from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.likelihood.refit import Refit
from slopewise.models.discrepancy.likelihood.residual_axes import ResidualAxis, mainly_along
from slopewise.models.discrepancy.likelihood.resolvable import Resolvable
from slopewise.models.discrepancy.settings import DiscrepancySettings

_CLEARLY = 2.0  # error of the model as configured over that of a refit [1]


def held_to_account(
    table: StopTable,
    base: Refit,
    decision: Decision,
    located: list[ResidualAxis],
    seen: Resolvable,
    settings: DiscrepancySettings,
) -> tuple[Decision, Gaps]:
    """The decision as stops held out confirm it, and how far it closes the gap.

    Args:
        table, base, seen, settings: as in :func:`.verdict.decide`. located: axes that the refitted
            base disagrees along.
    """
    floor = decision.explanation.whitener
    gaps = compared(table, base, decision.explanation, floor, settings)
    if decision.names and gaps.harmful:
        decision = _contradicted(base, decision, located)
        gaps = compared(table, base, base, floor, settings)
    before, refit = gaps.distance.before, gaps.distance.refit
    min_change = float(np.mean(practical_lengths(table.distance, settings)))
    is_better = any(gap.refit < gap.before for gap in (gaps.speed, gaps.distance))
    # However likely new coefficients are, they are reported where stops held out need them.
    if decision.keeps_model and before >= max(_CLEARLY * refit, refit + min_change):
        decision = drifted(decision, seen)
    elif decision.verdict is Verdict.UNKNOWN and not (is_better and refit <= LARGER * before):
        note = "new coefficients predict stops held out no better than those configured, which stay"
        decision = replace(decision, notes=(*decision.notes, note), unchanged=True)
    return decision, _as_configured(gaps) if decision.keeps_model else gaps


def _contradicted(base: Refit, decision: Decision, located: list[ResidualAxis]) -> Decision:
    """Without its names: what is missing is unknown where an axis shows that something is."""
    names = " and ".join(decision.names)
    fits = f"{names} fits the log, but predicts stops held out worse than the model without"
    axis = mainly_along(located)
    verdict = Verdict.NONE if axis is None else Verdict.UNKNOWN
    return Decision(verdict, base, axis=axis, notes=(*decision.notes, fits))


def _as_configured(gaps: Gaps) -> Gaps:
    """Gaps where nothing is changed."""
    speed, distance = (
        replace(g, after=g.before, closed=None, ci95=None) for g in (gaps.speed, gaps.distance)
    )
    return replace(gaps, speed=speed, distance=distance)
