"""The whole way: replay, refit, locate, name, add, show, propose.

Arrays in, findings out; files and screens are for others.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from models.discrepancy import gap
from models.discrepancy.findings import Experiment, Findings, Gap, Verdict
from models.discrepancy.hypothesis import Hypothesis
from models.discrepancy.prepare import prepare
from models.discrepancy.refine import Fit, fit, fit_with_noise
from models.discrepancy.settings import DiscrepancySettings
from models.discrepancy.stop_table import StopTable
from models.parameters import Model

Floats = NDArray[np.float64]

STEPS = 3
"""Steps that :func:`investigate` tells of."""


def investigate(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    model: Model,
    *,
    ground: Floats | None = None,
    settings: DiscrepancySettings | None = None,
    advance: Callable[[int], None] = lambda done: None,
) -> Findings:
    """Where a log and a model disagree, and the model that does not.

    Args:
        columns: channels of a drive log, (n,): ``t``, ``v``, ``v_cmd``, ``pitch`` and what else it
            has; further numeric columns are candidate explanations.
        runs: samples of each run. model: as configured.
        ground: (n,) grade of the ground from a map [rad], NaN where unknown.
        settings: how sure to be. advance: told of each step done.

    Raises:
        ParameterError: too few usable stops.
    """
    begin = time.perf_counter()
    wanted = settings or DiscrepancySettings()
    table, notes = prepare(columns, runs, model, ground, wanted)
    advance(1)
    start = Hypothesis.configured(model)
    base, white = fit_with_noise(table, start)
    as_it_is = fit(table, start, white, passes=0)
    advance(1)
    drifted = as_it_is.deviance - base.deviance > float(chi2.isf(wanted.false_alarm, 5))
    verdict = Verdict.PARAMETER_DRIFT if drifted else Verdict.NONE
    speed, distance = _gaps(table, base.hypothesis, base, wanted)
    advance(1)
    return Findings(
        verdict, "", (), (), speed, distance, Experiment(""), _refitted(model, base), (),
        len(table), tuple(notes), time.perf_counter() - begin,
    )  # fmt: skip


def _refitted(model: Model, found: Fit) -> Model:
    shift = found.hypothesis.shift
    on = model.braking
    braking = replace(
        on, m_m=on.m_m + float(shift[0]), b_m=on.b_m + float(shift[1]),
        m_b=on.m_b + float(shift[2]), b_b=on.b_b + float(shift[3]),
        dead_time=found.hypothesis.dead_time,
    )  # fmt: skip
    return replace(model, braking=braking)


def _gaps(
    table: StopTable, best: Hypothesis, fit: Fit, settings: DiscrepancySettings
) -> tuple[Gap, Gap]:
    parts = gap.folds(table, settings.folds, settings.seed)
    configured = Hypothesis.configured(best.model)

    def learned(start: Hypothesis) -> Callable[[StopTable], Hypothesis]:
        return lambda seen: fit_with_noise(seen, start)[0].hypothesis

    before = gap.speed_errors(table, configured), gap.distances(table, configured)
    refit = gap.held_out(table, parts, learned(configured))
    after = gap.held_out(table, parts, learned(best)) if best.added else refit
    draws = np.random.default_rng(settings.seed).integers(
        0, len(table), (settings.resamples, len(table))
    )
    used = table.spread > 0.0
    floor = np.where(used, gap.speed_floor(table, fit.noise, best.dead_time), np.nan)
    squared = [np.nanmean(e[0] ** 2, axis=1) for e in (before, refit, after)]
    speed = gap.gap_of(
        "speed while stopping, rms", "m/s", (*squared, np.nanmean(floor, axis=1)), draws
    )
    squared = [(e[1] - table.distance) ** 2 for e in (before, refit, after)]
    distance = gap.gap_of(
        "stopping distance, rms", "m", (*squared, gap.distance_floor(table, fit.noise)), draws
    )
    return speed, distance
