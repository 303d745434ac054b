"""Data of pictures: residuals of every stop before and after, against every axis."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import distances
from slopewise.models.discrepancy.decide.verdict import Decision
from slopewise.models.discrepancy.findings import AxisResidual, Evidence
from slopewise.models.discrepancy.likelihood.refit import Refit, residual
from slopewise.models.discrepancy.likelihood.residual_axes import ResidualAxis
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import simulate
from slopewise.models.quantity import GRAVITY


def evidence_of(
    table: StopTable, base: Refit, decision: Decision, located: list[ResidualAxis]
) -> Evidence:
    """Residuals of the model as refitted (before) and with what was found (after)."""
    best = decision.explanation.hypothesis
    configured = Hypothesis.configured(best.model)
    axes = tuple(
        AxisResidual(f.axis.name, f.axis.unit, _thirds(table, best, f.axis.values), f.p_value)
        for f in located
    )
    written = configured if decision.keeps_model else best
    simulated = [distances(table, h) for h in (configured, written)]
    i = _clearest(table.distance, *simulated)
    stop = table.take([i])
    used = stop.spread[0] > 0.0
    measured_at = np.einsum("km,m->k", stop.average[0], stop.time[0])[used]
    speeds = [
        np.einsum("km,m->k", stop.average[0], simulate(stop, h, stop.held, stop.time)[0][0])[used]
        for h in (configured, written)
    ]
    placed = {"x", "y"} <= table.logged
    return Evidence(
        axes,
        missing_force(table, base.hypothesis),
        missing_force(table, best),
        table.x[:, 0] if placed else None,
        table.y[:, 0] if placed else None,
        table.distance,
        simulated[0],
        simulated[1],
        measured_at,
        stop.binned[0][used],
        speeds[0],
        speeds[1],
        decision.explanation.whitener.force_std,
    )


def _clearest(measured: Floats, before: Floats, after: Floats) -> int:
    """The stop that changes most, or where none does the one that the model misses most."""
    changed = np.abs(after - before)
    return int(np.argmax(changed if changed.any() else np.abs(measured - before)))


def missing_force(table: StopTable, hypothesis: Hypothesis) -> Floats:
    """(S, 3) force of the vehicle less that of the model, in each third of the braking.

    By differences of mean speeds over thirds of the fall: integrals, not derivatives.
    """
    left = residual(table, hypothesis)
    at = np.einsum("skm,sm->sk", table.average, table.time)
    used = (table.spread > 0.0) & (at > hypothesis.dead_time)
    forces = np.full((len(table), 3), np.nan)
    for i in range(len(table)):
        t, r = at[i, used[i]], left[i, used[i]]
        for j, part in enumerate(np.array_split(np.arange(len(t)), 3)):
            if len(part) >= 3:
                # Less speed than predicted is more force.
                forces[i, j] = -float(np.polyfit(t[part], r[part], 1)[0]) / GRAVITY
    return forces


def _thirds(table: StopTable, hypothesis: Hypothesis, values: Floats) -> Floats:
    after = table.time > hypothesis.dead_time
    forces = np.empty((len(table), 3))
    for i in range(len(table)):
        parts = np.array_split(values[i, after[i]], 3)
        forces[i] = [float(np.mean(p)) if len(p) else float(values[i, -1]) for p in parts]
    return forces
