"""Axes that a disagreement may follow, and flexible shapes along each of them.

Shapes know nothing of the library: bumps along the values of an axis, coarse and fine, and waves
where things may repeat (time, order, place, heading).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_ground import session_time
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.brakes import heat
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.thresholds import (
    AXIS_COOLING,
    COARSE_BUMPS,
    FINE_BUMPS,
    HARMONICS,
    LEAST_AXIS_SPREAD,
    PLACE_BUMPS,
    WAVES,
)


@dataclass(frozen=True, slots=True)
class Axis:
    """A quantity along each stop.

    Attributes:
        name, unit: as reported. values: (S, M). periodic: an angle that closes on itself.
        repeats: waves along it are tried, too.
        second: (S, M) the other coordinate of a place.
    """

    name: str
    unit: str
    values: Floats
    periodic: bool = False
    repeats: bool = False
    second: Floats | None = None


def axes_of(table: StopTable, hypothesis: Hypothesis) -> list[Axis]:
    """Every axis on which the stops of the log differ."""
    one = np.ones_like(table.time)
    since = np.maximum(table.time - hypothesis.dead_time, 0.0)
    warm = heat(table, AXIS_COOLING, table.speed, table.time, hypothesis.dead_time)
    found = [
        Axis("grade", "rad", table.grade),
        Axis("abs_grade", "rad", np.abs(table.grade)),
        Axis("onset_speed", "m/s", table.held[:, None] * one),
        Axis("speed", "m/s", table.speed),
        Axis("time_since_onset", "s", since),
        Axis("brake_heat", "J/kg", warm),
        Axis("time", "s", session_time(table)[:, None] * one, repeats=True),
        Axis("run", "1", _order(table)[:, None] * one, repeats=True),
    ]
    if "yaw" in table.logged:
        found.append(Axis("heading", "rad", table.yaw, periodic=True))
    if "yaw_rate" in table.logged:
        found.append(Axis("yaw_rate", "rad/s", table.yaw_rate))
    if "roll" in table.logged:
        found.append(Axis("roll", "rad", table.roll))
    if "vertical_curvature" in table.logged:
        found.append(Axis("vertical_curvature", "1/m", table.vertical_curvature))
    if {"x", "y"} <= table.logged:
        found.append(Axis("x", "m", table.x, repeats=True))
        found.append(Axis("y", "m", table.y, repeats=True))
        found.append(Axis("place", "m", table.x, second=table.y))
    found += [Axis(n, "", v[:, None] * one, repeats=False) for n, v in table.further.items()]
    names = sorted(set(table.terrain))
    if len(names) > 1:
        kind = np.array([names.index(t) for t in table.terrain], np.float64)
        found.append(Axis("terrain", "1", kind[:, None] * one))
    return [a for a in found if float(np.ptp(a.values)) > LEAST_AXIS_SPREAD]


def _order(table: StopTable) -> Floats:
    """(S,) number of the run, or of the stop in a log of few runs."""
    few = len(np.unique(table.run)) < max(8, len(table) // 8)
    return np.arange(len(table), dtype=np.float64) if few else table.run.astype(np.float64)


def shapes_of(axis: Axis) -> list[Floats]:
    """Groups of shapes (S, M, p) along an axis, each a hypothesis of its own."""
    a = axis.values
    if axis.second is not None:
        return _bumps_in_place(a, axis.second)
    if axis.periodic:
        waves = [np.stack((np.cos(k * a), np.sin(k * a)), 2) for k in range(1, HARMONICS + 1)]
        return [*waves, np.concatenate(waves, axis=2)]
    knots = np.unique(a[:, 0]) if np.ptp(a, axis=1).max() == 0.0 else None
    if knots is not None and len(knots) <= COARSE_BUMPS:
        return [np.stack([(a == k).astype(np.float64) for k in knots[1:]], axis=2)]
    fine = _bumps(a, FINE_BUMPS)
    groups = [_line(a), _bumps(a, COARSE_BUMPS), fine]
    if not axis.repeats:
        groups += [fine[:, :, k : k + 1] for k in range(fine.shape[2])]
    if axis.repeats:
        low, span = float(a.min()), float(np.ptp(a))
        for k in np.arange(1.0, WAVES + 0.25, 0.5):
            phase = 2.0 * np.pi * k * (a - low) / span
            groups.append(np.stack((np.cos(phase), np.sin(phase)), axis=2))
    return groups


def _line(a: Floats) -> Floats:
    middle, spread = float(np.mean(a)), max(float(np.std(a)), 1e-12)
    return ((a - middle) / spread)[:, :, None]


def _bumps(a: Floats, count: int) -> Floats:
    """Hats between quantiles: a line in pieces."""
    knots = np.unique(np.quantile(a, np.linspace(0.0, 1.0, count + 1)))
    return np.stack([np.interp(a, knots, row) for row in np.eye(len(knots))], axis=2)


def _bumps_in_place(x: Floats, y: Floats) -> list[Floats]:
    """Each bump by itself, then all of them together."""
    size = float(max(np.ptp(x), np.ptp(y)))
    width = 0.6 * size / PLACE_BUMPS
    single = []
    for count in (PLACE_BUMPS, 2 * PLACE_BUMPS):
        for cx in np.linspace(float(x.min()), float(x.max()), count):
            for cy in np.linspace(float(y.min()), float(y.max()), count):
                away = ((x - cx) ** 2 + (y - cy) ** 2) / (width * PLACE_BUMPS / count) ** 2
                bump = np.exp(-0.5 * away)
                if float(bump.max()) > 0.5:
                    single.append(bump[:, :, None])
    together = np.concatenate(single[: PLACE_BUMPS**2], axis=2)
    return [*single, together]
