"""Cost of the finding in metres of a stop, and changes of the model file."""

from __future__ import annotations

import itertools

import numpy as np

from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import distances
from slopewise.models.discrepancy.findings import PlannedStop, StopCost
from slopewise.models.discrepancy.likelihood.refit import Refit
from slopewise.models.discrepancy.model.hypothesis import Hypothesis, is_placed
from slopewise.models.discrepancy.report.experiment import sheet_of
from slopewise.models.parameters import Model

_SPEED, _GRADE = 3.0, np.deg2rad(-10.0)  # of the stop that a cost is reported for [m/s], [rad]
_HEADINGS = 12  # of which the worst is reported
_REPORTED = (*NAMES, "dead_time", "distance_offset", "force_std", "dead_time_std")
_UNITS = {"dead_time": " s", "dead_time_std": " s", "distance_offset": " m"}


def cost_of(table: StopTable, fit: Refit, *, unchanged: bool) -> StopCost:
    """One stop by the model as configured, and with what was found."""
    speeds, grades = np.quantile(table.held, (0.0, 1.0)), np.quantile(table.grade, (0.02, 0.98))
    speed = float(np.clip(_SPEED, *speeds))
    grade = float(np.clip(_GRADE, *grades))
    turning = "yaw" in table.logged
    headings = np.linspace(0.0, 2.0 * np.pi, _HEADINGS, endpoint=False)
    patches = [e.parameters for e in fit.hypothesis.added if is_placed(e.name)]
    places = [(float(np.mean(table.x)), float(np.mean(table.y)))]
    places += [(p["x"], p["y"]) for p in patches]
    plans = [
        PlannedStop(speed, grade, heading=float(heading), x=x, y=y)
        for heading, (x, y) in itertools.product(headings if turning else (0.0,), places)
    ]
    sheet = sheet_of(table, plans, fit)
    before = distances(sheet, Hypothesis.configured(fit.hypothesis.model))
    after = before if unchanged else distances(sheet, fit.hypothesis)
    worst = int(np.argmax(after))
    return StopCost(speed, grade, float(before[worst]), float(after[worst]))


def changes(before: Model, after: Model) -> tuple[str, ...]:
    """Changed numbers of the model file, as text."""
    text = [
        f"{name} {getattr(before.braking, name):.4g} → {getattr(after.braking, name):.4g}"
        f"{_UNITS.get(name, '')}"
        for name in _REPORTED
        if getattr(before.braking, name) != getattr(after.braking, name)
    ]
    for effect in after.effect[len(before.effect) :]:
        values = ", ".join(f"{name} = {value:.4g}" for name, value in effect.parameters.items())
        text.append(f"{effect.name} added: {values}")
    return tuple(text)
