"""What pictures need: residuals of every stop before and after, against every axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import distances
from slopewise.models.discrepancy.decide.verdict import Decision
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import simulate
from slopewise.models.discrepancy.search.locate import Followed
from slopewise.models.discrepancy.search.refine import Fit, residual
from slopewise.models.quantity import GRAVITY


@dataclass(frozen=True, slots=True)
class AxisResidual:
    """Force that is missing, as a share of the weight, against one axis.

    Attributes:
        name, unit: of the axis. value: (S, 3) at begin, middle and end of the braking.
        before, after: (S, 3) force of the vehicle less that of the model there.
        p_value: of the axis, before.
    """

    name: str
    unit: str
    value: Floats
    before: Floats
    after: Floats
    p_value: float


@dataclass(frozen=True, slots=True)
class Evidence:
    """Of all stops.

    Attributes:
        axes: the most telling first. x, y: (S,) where each stop began [m], None without places.
        distance: (S,) measured [m]; configured, found: (S,) simulated, the same where the model
            stays as configured.
        time, speed: (T,) of the stop that changes most, or is missed most where none does,
            measured [s], [m/s]; speed_before, speed_after: (T,) simulated.
        scatter: of the force, for bands.
    """

    axes: tuple[AxisResidual, ...]
    x: Floats | None
    y: Floats | None
    distance: Floats
    configured: Floats
    found: Floats
    time: Floats
    speed: Floats
    speed_before: Floats
    speed_after: Floats
    scatter: float

    @property
    def changed(self) -> bool:
        """What was found stops otherwise than the model as configured."""
        return not np.array_equal(self.found, self.configured)


def evidence_of(
    table: StopTable, base: Fit, decision: Decision, located: list[Followed]
) -> Evidence:
    """Residuals of the model as refitted (before) and with what was found (after)."""
    best = decision.explanation.fit.hypothesis
    configured = Hypothesis.configured(best.model)
    before = missing_force(table, base.hypothesis)
    after = missing_force(table, best)
    axes = tuple(
        AxisResidual(
            f.axis.name, f.axis.unit, _thirds(table, best, f.axis.values), before, after, f.p_value
        )
        for f in located
    )
    written = configured if decision.kept_as_it_was else best
    simulated = [distances(table, h) for h in (configured, written)]
    i = _most_telling(table.distance, *simulated)
    one = table.take([i])
    used = one.spread[0] > 0.0
    measured_at = np.einsum("km,m->k", one.average[0], one.time[0])[used]
    speeds = [
        np.einsum("km,m->k", one.average[0], simulate(one, h, one.held, one.time)[0][0])[used]
        for h in (configured, written)
    ]
    placed = {"x", "y"} <= table.logged
    return Evidence(
        axes,
        table.x[:, 0] if placed else None,
        table.y[:, 0] if placed else None,
        table.distance,
        simulated[0],
        simulated[1],
        measured_at,
        one.binned[0][used],
        speeds[0],
        speeds[1],
        decision.explanation.fit.noise.scatter,
    )


def _most_telling(measured: Floats, before: Floats, after: Floats) -> int:
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
    found = np.full((len(table), 3), np.nan)
    for i in range(len(table)):
        t, r = at[i, used[i]], left[i, used[i]]
        for j, part in enumerate(np.array_split(np.arange(len(t)), 3)):
            if len(part) >= 3:
                # Less speed than predicted is more force.
                found[i, j] = -float(np.polyfit(t[part], r[part], 1)[0]) / GRAVITY
    return found


def _thirds(table: StopTable, hypothesis: Hypothesis, values: Floats) -> Floats:
    after = table.time > hypothesis.dead_time
    found = np.empty((len(table), 3))
    for i in range(len(table)):
        parts = np.array_split(values[i, after[i]], 3)
        found[i] = [float(np.mean(p)) if len(p) else float(values[i, -1]) for p in parts]
    return found
