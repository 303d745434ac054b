"""Axes that a disagreement may follow, flexible shapes along them.

Shapes know nothing of the library: smooth curves along the values of an axis, waves around a
heading and over a place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.likelihood.trace import WAVES
from slopewise.models.discrepancy.model.brakes import heat

_WAVES = np.geomspace(0.8, 12.0, 36)  # lengths of periodic ground [m]
COOLING = 150.0  # time constant of a brake of which nothing is known [s]


@dataclass(frozen=True, slots=True)
class Axis:
    """A quantity along each stop.

    Attributes:
        name, unit: as reported. values: (S, M).
        shapes: groups of shapes (S, M, p), each a separate hypothesis.
    """

    name: str
    unit: str
    values: Floats
    shapes: tuple[Floats, ...]


def causes_of(table: StopTable) -> list[Axis]:
    """Axes of causes that have no name, where stops differ along them."""
    constant = np.ones_like(table.speed)
    curves = {
        ("grade", "rad"): table.grade,
        ("onset_speed", "m/s"): table.held[:, None] * constant,
        ("time", "s"): table.session_time[:, None] * constant,
    }
    for name, unit in (("roll", "rad"), ("yaw_rate", "rad/s")):
        if name in table.logged:
            values = getattr(table, name)
            curves[name, unit] = np.clip(values, *np.quantile(values, [0.01, 0.99]))
    curves |= {(name, ""): values[:, None] * constant for name, values in table.further.items()}
    curves["speed", "m/s"] = table.speed
    axes = [_curve(*name, values) for name, values in curves.items()]
    if "yaw" in table.logged:
        waves = [f(k * table.yaw) for k in (1, 2) for f in (np.cos, np.sin)]
        axes.append(Axis("heading", "rad", table.yaw, (np.stack(waves, axis=2),)))
    ways = {"station": table.station}
    if {"x", "y"} <= table.logged:
        axes.append(Axis("place", "m", table.x, (_over_place(table.x, table.y),)))
        ways |= {"x": table.x, "y": table.y}
    axes += [Axis(name, "m", way, _periodic(way)) for name, way in ways.items()]
    return [a for a in axes if np.ptp(a.values) > 1e-9]


def axes_of(table: StopTable, dead_time: float) -> list[Axis]:
    """Every axis on which the stops of the log differ."""
    constant = np.ones_like(table.time)
    curves = {
        ("abs_grade", "rad"): np.abs(table.grade),
        ("time_since_onset", "s"): np.maximum(table.time - dead_time, 0.0),
        ("brake_heat", "J/kg"): heat(table, COOLING, table.speed, table.time, dead_time),
        ("run", "1"): _order(table)[:, None] * constant,
    }
    if "vertical_curvature" in table.logged:
        curves["vertical_curvature", "1/m"] = table.vertical_curvature
    names = sorted(set(table.terrain))
    if len(names) > 1:
        kinds = np.array([names.index(t) for t in table.terrain], np.float64)
        curves["terrain", "1"] = kinds[:, None] * constant
    further = [_curve(*name, values) for name, values in curves.items()]
    causes = [a for a in causes_of(table) if a.name != "station"]
    return [*causes, *(a for a in further if np.ptp(a.values) > 1e-9)]


def unit_range(values: Floats) -> Floats:
    """On −1 … 1."""
    low, high = float(values.min()), float(values.max())
    return 2.0 * (values - low) / max(high - low, 1e-12) - 1.0


def _curve(name: str, unit: str, values: Floats) -> Axis:
    z = 0.5 * (unit_range(values) + 1.0)
    waves = [np.cos(np.pi * j * z) for j in range(1, WAVES + 1)]
    return Axis(name, unit, values, (np.stack(waves, axis=2),))


def _over_place(x: Floats, y: Floats) -> Floats:
    x, y = (unit_range(c) for c in (x, y))
    places = [
        np.cos(0.5 * np.pi * i * (x + 1)) * np.cos(0.5 * np.pi * j * (y + 1))
        for i in range(4)
        for j in range(4)
        if 0 < i + j < 5
    ]
    return np.stack(places, axis=2)


def _periodic(way: Floats) -> tuple[Floats, ...]:
    turns = [2.0 * np.pi * way / length for length in _WAVES]
    return tuple(np.stack((np.cos(turn), np.sin(turn)), axis=2) for turn in turns)


def _order(table: StopTable) -> Floats:
    """(S,) number of the run, or of the stop in a log of few runs."""
    few = len(np.unique(table.run)) < max(8, len(table) // 8)
    return np.arange(len(table), dtype=np.float64) if few else table.run.astype(np.float64)
