"""What was found, in metres of one stop and in numbers of the model file."""

from __future__ import annotations

import itertools
from dataclasses import fields

import numpy as np

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import distances
from slopewise.models.discrepancy.findings import PlannedStop, StopCost
from slopewise.models.discrepancy.model.hypothesis import Hypothesis, is_placed
from slopewise.models.discrepancy.report.experiment import sheet_of
from slopewise.models.discrepancy.search.refine import Fit
from slopewise.models.discrepancy.thresholds import (
    PICTURED_GRADE,
    PICTURED_HEADINGS,
    PICTURED_SPEED,
)
from slopewise.models.parameters import Braking, Model

_TOLD = ("m_m", "b_m", "m_b", "b_b", "dead_time", "distance_offset", "force_std", "dead_time_std")
_UNITS = {"dead_time": " s", "dead_time_std": " s", "distance_offset": " m"}


def cost_of(table: StopTable, found: Fit, *, as_it_was: bool) -> StopCost:
    """One stop by the model as configured, and with what was found.

    Args:
        table: stops, whose speeds and grades are not left. found: an explanation.
        as_it_was: the model stays as configured.
    """
    speeds, grades = np.quantile(table.held, (0.0, 1.0)), np.quantile(table.grade, (0.02, 0.98))
    speed = float(np.clip(PICTURED_SPEED, *speeds))
    grade = float(np.clip(PICTURED_GRADE, *grades))
    turning = "yaw" in table.logged
    headings = np.linspace(0.0, 2.0 * np.pi, PICTURED_HEADINGS, endpoint=False)
    patches = [e.parameters for e in found.hypothesis.added if is_placed(e)]
    places = [(float(np.mean(table.x)), float(np.mean(table.y)))]
    places += [(p["x"], p["y"]) for p in patches]
    plans = [
        PlannedStop(speed, grade, heading=float(heading), x=x, y=y)
        for heading, (x, y) in itertools.product(headings if turning else (0.0,), places)
    ]
    sheet = sheet_of(table, plans, found)
    before = distances(sheet, Hypothesis.configured(found.hypothesis.model))
    after = before if as_it_was else distances(sheet, found.hypothesis)
    worst = int(np.argmax(after))
    return StopCost(speed, grade, float(before[worst]), float(after[worst]))


def changes(before: Model, after: Model) -> tuple[str, ...]:
    """What is another in the model file, in words."""
    said = [
        f"{name} {getattr(before.braking, name):.4g} → {getattr(after.braking, name):.4g}"
        f"{_UNITS.get(name, '')}"
        for name in (f.name for f in fields(Braking))
        if name in _TOLD and getattr(before.braking, name) != getattr(after.braking, name)
    ]
    for effect in after.effect[len(before.effect) :]:
        values = ", ".join(f"{name} = {value:.4g}" for name, value in effect.parameters.items())
        said.append(f"{effect.name} added: {values}")
    return tuple(said)
