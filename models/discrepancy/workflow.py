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
from slopewise.models.discrepancy.data.prepare import prepare, sessions_of
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide import no_harm
from slopewise.models.discrepancy.decide.gap import Gaps, compared, distance_floor
from slopewise.models.discrepancy.decide.model_form import as_in_the_model
from slopewise.models.discrepancy.decide.revised import revised
from slopewise.models.discrepancy.decide.verdict import Decision, decide
from slopewise.models.discrepancy.findings import Experiment, Findings, Verdict
from slopewise.models.discrepancy.likelihood.answer import answered
from slopewise.models.discrepancy.likelihood.posterior import LAG
from slopewise.models.discrepancy.likelihood.weigh import weighed
from slopewise.models.discrepancy.model.noise import Noise
from slopewise.models.discrepancy.progress import Progress, Stage
from slopewise.models.discrepancy.report import experiment
from slopewise.models.discrepancy.report.cost import changes, cost_of
from slopewise.models.discrepancy.report.evidence import Evidence, evidence_of
from slopewise.models.discrepancy.report.summary import located_axes, named_effects, summary
from slopewise.models.discrepancy.search.extent import extents
from slopewise.models.discrepancy.search.locate import WITHIN, follow
from slopewise.models.discrepancy.search.refine import as_output, fit_base, start_of, with_build_up
from slopewise.models.discrepancy.search.resolvable import resolvable
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.thresholds import BY_CHANCE, WILD_SCATTER
from slopewise.models.parameters import Model


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
        settings: how sure to be. source: of the log, written into the effects that are added.
        advance: told of hundredths of the usual time as they are done.

    Raises:
        ParameterError: too few usable stops.
    """
    return investigate_with_evidence(
        columns, runs, model, ground=ground, settings=settings, source=source, advance=advance
    )[0]


def investigate_with_evidence(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    model: Model,
    *,
    ground: Floats | None = None,
    settings: DiscrepancySettings | None = None,
    source: str = "",
    advance: Callable[[int], None] = lambda done: None,
) -> tuple[Findings, Evidence]:
    """As :func:`investigate`, and the residuals that its pictures are made of."""
    with threadpool_limits(1):  # its matrices are small: threads would wait for one another
        return _investigated(columns, runs, model, ground, settings, source, Progress(advance))


def _investigated(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    model: Model,
    ground: Floats | None,
    settings: DiscrepancySettings | None,
    source: str,
    progress: Progress,
) -> tuple[Findings, Evidence]:
    begin = time.perf_counter()
    wanted = settings or DiscrepancySettings()
    table, notes = prepare(columns, runs, model, ground, wanted)
    progress.reach(Stage.STOPS)
    base = fit_base(table, start_of(table, model))
    built = with_build_up(table, base)
    progress.reach(Stage.BASE)
    weights = weighed(table, model, sessions_of(table, columns, runs), wanted.odds, progress.search)
    answer = answered(weights)
    progress.reach(Stage.SEARCH)
    lagging = LAG in answer.leader.names
    located = follow(table, base if lagging else built, wanted.seed)
    seen = resolvable(table, built)
    decision = decide(table, base, built, answer, located, seen, wanted)
    progress.reach(Stage.LEFT)
    output = as_output(table, decision.explanation.fit) if decision.names else table
    decision = as_in_the_model(output, decision)
    floor = decision.explanation.fit.noise
    gaps = compared(table, base, decision.explanation.fit, floor, wanted)
    decision, gaps = no_harm.that_predicts(table, base, decision, gaps, wanted)
    decision = no_harm.worth_a_word(table, decision, gaps, seen, wanted)
    decision, gaps = no_harm.worth_refitting(decision, gaps)
    if decision.verdict in (Verdict.NONE, Verdict.TOO_NOISY):
        gaps = no_harm.as_configured(gaps)
    widths = extents(output, decision.explanation.fit)
    better, added = revised(table, decision, gaps.held_out, widths, source)
    progress.reach(Stage.GAPS)
    plan = _next(table, decision, _beyond(table, model, better, gaps, floor))
    above = float(np.mean(gaps.refit_squares)) - gaps.speed.noise_floor**2
    findings = Findings(
        decision.verdict,
        summary(table, decision, gaps.distance, gaps.ends),
        named_effects(decision, located, widths),
        located_axes(decision, located, above, wanted.structure),
        gaps.speed,
        gaps.distance,
        plan,
        better,
        added,
        len(table),
        (*notes, *decision.notes, *_doubts(table, floor)),
        time.perf_counter() - begin,
        cost_of(table, decision.explanation.fit, as_it_was=decision.kept_as_it_was),
        changes(model, better),
        {name: size for name, size in decision.visible.items() if np.isfinite(size)},
    )
    progress.reach(Stage.FINDINGS)
    return findings, evidence_of(table, base, decision, located)


def _doubts(table: StopTable, noise: Noise) -> tuple[str, ...]:
    share = noise.scatter / max(float(np.median(table.force)), 1e-3)
    if share < WILD_SCATTER:
        return ()
    return (
        f"stops differ by ±{share:.0%} of the braking force among themselves: only effects larger "
        f"than that show in {len(table)} stops",
    )


_QUIETER = (
    "repeat one stop ten times, everything the same: if they still differ, mend the speed or the "
    "command channel first; if not, drive each kind of stop three times"
)


def _beyond(table: StopTable, model: Model, better: Model, gaps: Gaps, noise: Noise) -> float:
    """By which stops end later than the finding predicts, 0 if a perfect model's do, too [m]."""
    late, chance = table.distance - gaps.held_out, BY_CHANCE * np.sqrt(distance_floor(table, noise))
    beyond = float(np.max(late, where=late > chance, initial=0.0))
    offset = better.braking.distance_offset
    added = offset > max(model.braking.distance_offset, float(chance.max()))
    return max(beyond, offset) if added else beyond


def _next(table: StopTable, decision: Decision, beyond: float) -> Experiment:
    fit = decision.explanation.fit
    match decision.verdict:
        case Verdict.AMBIGUOUS:
            return experiment.between(table, fit, [r.fit for r in decision.rivals])
        case Verdict.MISSING_EFFECT:
            return experiment.sharpening(table, fit, beyond)
        case Verdict.UNIDENTIFIABLE:
            words = "; ".join(f"for {a.name}: {a.test}" for a in decision.absorbed)
            return Experiment(words)
        case Verdict.UNKNOWN:
            return Experiment(_along(decision))
        case Verdict.TOO_NOISY:
            return Experiment(_QUIETER)
        case _:
            return Experiment("")


def _along(decision: Decision) -> str:
    if decision.axis is None:
        return "repeat some of these stops unchanged: what differs between them is not the stop"
    axis = decision.axis.axis
    if axis.name in WITHIN:
        return (
            "log speed and brake pressure as fast as the sensors can, and stop from several "
            "speeds on level ground: what is missing happens within each stop"
        )
    values = axis.values
    low, high = np.quantile(values, [0.02, 0.98])
    return (
        f"repeat one stop, everything else the same, at six values of {axis.name} from {low:.3g} "
        f"to {high:.3g} {axis.unit}, three times each"
    )
