"""The whole workflow: replay, refit, locate, name, add, show, propose.

Arrays in, findings out; files and screens are for others.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.prepare import prepare
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import Gaps, distance_floor
from slopewise.models.discrepancy.decide.held_out import held_to_account
from slopewise.models.discrepancy.decide.revised import revised
from slopewise.models.discrepancy.decide.verdict import decide
from slopewise.models.discrepancy.findings import Findings
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.answer import answered, likely
from slopewise.models.discrepancy.likelihood.refit import refitted
from slopewise.models.discrepancy.likelihood.residual_axes import residual_axes
from slopewise.models.discrepancy.likelihood.resolvable import resolvable
from slopewise.models.discrepancy.likelihood.weigh import weighed
from slopewise.models.discrepancy.likelihood.whitener import Whitener
from slopewise.models.discrepancy.report.cost import changes, cost_of
from slopewise.models.discrepancy.report.evidence import evidence_of
from slopewise.models.discrepancy.report.experiment import next_experiment
from slopewise.models.discrepancy.report.summary import located_axes, named_effects, summary
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.parameters import Model

HUNDREDTHS = 100  # of the typical time, when all is done
_STOPS, _SEARCH = 6, 80  # of them, when stops are measured and explanations weighed
_BY_CHANCE = 4.0  # distance by which one stop in ten thousand ends late by chance [std]


def investigate(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    model: Model,
    *,
    ground: Floats | None = None,
    settings: DiscrepancySettings | None = None,
    source: str = "",
    advance: Callable[[int], None] = lambda done: None,
) -> Findings:
    """Where a log and a model disagree, and the model that does not.

    Args:
        columns: channels of a drive log, (n,): ``t``, ``v``, ``v_cmd``, ``pitch`` and what else it
            has; further numeric columns are candidate explanations.
        runs: samples of each run. model: as configured.
        ground: (n,) grade of the ground from a map [rad], NaN where unknown.
        settings: required confidence. source: name of the log, written into added effects.
        advance: receives hundredths of the typical time when they are done.

    Raises:
        ParameterError: too few usable stops.
    """
    begin, reported = time.perf_counter(), 0

    def reach(hundredths: float) -> None:
        nonlocal reported
        if int(hundredths) > reported:
            advance(int(hundredths) - reported)
            reported = int(hundredths)

    # Its matrices are small: threads would wait for one another.
    with threadpool_limits(1):
        settings = settings or DiscrepancySettings()
        table, notes = prepare(columns, runs, model, ground, settings)
        reach(_STOPS)
        explanations, book = weighed(
            *(table, model, settings.odds),
            advance=lambda share: reach(_STOPS + share * (_SEARCH - _STOPS)),
        )
        answer = answered(explanations)
        base = refitted(answer.calm)
        located = residual_axes(answer.calm.fit.trace, base)
        seen = resolvable(answer.calm.fit, answer.calm.at, book)
        decision = decide(table, base, answer, located, seen, settings)
        noise = decision.explanation.whitener
        decision, gaps = held_to_account(table, base, decision, located, seen, settings)
        better, added = revised(table, decision, gaps.held_out, source)
        above = gaps.speed.refit**2 - gaps.speed.noise_floor**2
        findings = Findings(
            decision.verdict,
            summary(table, decision, seen.visible, gaps.distance, gaps.ends),
            named_effects(decision, located),
            likely(explanations),
            located_axes(decision, located, above, settings.structure),
            gaps.speed,
            gaps.distance,
            next_experiment(table, decision, _beyond(table, model, better, gaps, noise)),
            better,
            added,
            len(table),
            (*notes, *decision.notes, *_warnings(table, noise)),
            time.perf_counter() - begin,
            cost_of(table, decision.explanation, unchanged=decision.keeps_model),
            changes(model, better),
            {name: size for name, size in seen.visible.items() if np.isfinite(size)},
            evidence_of(table, base, decision, located),
        )
        reach(HUNDREDTHS)
        return findings


def _warnings(table: StopTable, noise: Whitener) -> tuple[str, ...]:
    if noise.scatter < prior.SLAB:
        return ()
    return (
        f"stops differ by ±{noise.scatter:.0%} of the braking force among themselves: "
        f"only effects larger than that show in {len(table)} stops",
    )


def _beyond(table: StopTable, model: Model, better: Model, gaps: Gaps, noise: Whitener) -> float:
    """By which stops end later than the finding predicts, 0 if a perfect model's do, too [m]."""
    late = table.distance - gaps.held_out
    chance = _BY_CHANCE * np.sqrt(distance_floor(table, noise))
    beyond = float(np.max(late, where=late > chance, initial=0.0))
    offset = better.braking.distance_offset
    added = offset > max(model.braking.distance_offset, float(chance.max()))
    return max(beyond, offset) if added else beyond
