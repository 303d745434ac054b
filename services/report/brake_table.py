"""Stopping distances over speed and grade, beside rules that know no grade."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.parameters import Braking
from slopewise.services.report.brake_numbers import BrakeNumbers
from slopewise.services.report.brake_rules import plain_distance, rule_distance


@dataclass(frozen=True, slots=True)
class DistanceTable:
    """Stopping distances over V speeds and G grades.

    Attributes:
        speeds: (V,) [m/s]. grades: (G,) [rad]. mean, allowed: (V, G) [m], inf where none ends.
        plain, rule: (V,) v²/2a and responsibility-sensitive safety, which know no grade [m].
    """

    speeds: Floats
    grades: Floats
    mean: Floats
    allowed: Floats
    plain: Floats
    rule: Floats


def distance_table(numbers: BrakeNumbers, speeds: Floats, grades: Floats) -> DistanceTable:
    """All distances at speeds (V,) [m/s] and grades (G,) [rad]."""
    mean, allowed = (
        np.array([[of(float(v), float(g)) for g in grades] for v in speeds])
        for of in (numbers.mean_distance, numbers.allowed_distance)
    )
    plain, rule = (
        np.array([of(numbers, float(v)) for v in speeds]) for of in (plain_distance, rule_distance)
    )
    return DistanceTable(speeds, grades, mean, allowed, plain, rule)


def shown_distances(numbers: BrakeNumbers) -> DistanceTable:
    """The table of a sheet: over the trained speeds and grades."""
    b = numbers.tables[0]
    return distance_table(numbers, shown_speeds(b), shown_grades(b))


def shown_speeds(braking: Braking, most: int = 6) -> Floats:
    """Both ends of the trained speeds and round ones between [m/s]."""
    low, high = braking.speed_range
    return _round_between(low, high, (0.25, 0.5, 1.0, 2.0, 5.0), most)


def shown_grades(braking: Braking, most: int = 9) -> Floats:
    """Both ends of the trained grades and round ones between [rad]."""
    low, high = np.rad2deg(braking.grade_range)
    return np.deg2rad(_round_between(low, high, (1.0, 2.5, 5.0, 10.0), most))


def _round_between(low: float, high: float, steps: tuple[float, ...], most: int) -> Floats:
    for step in steps:
        inner = step * np.arange(math.ceil(low / step), math.floor(high / step) + 1)
        near = np.minimum(np.abs(inner - low), np.abs(inner - high)) < 0.4 * step
        values = np.unique(np.concatenate((inner[~near], [low, high])))
        if len(values) <= most:
            break
    return values
