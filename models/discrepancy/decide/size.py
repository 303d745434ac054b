"""How much something changes a stop, and what is too little to be worth a name.

Significance and size are two things: thousands of samples tell a lag of milliseconds for certain,
and nobody stops a centimetre later by it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models.arrays import Floats
from models.discrepancy.data.stop_table import StopTable
from models.discrepancy.decide.gap import distances
from models.discrepancy.model.hypothesis import Hypothesis
from models.discrepancy.search.refine import Fit, as_output, fit_either_way
from models.discrepancy.settings import DiscrepancySettings
from models.discrepancy.thresholds import CHANGED_STOPS
from models.effects.effect_law import Enters
from models.effects.registry import LAWS


@dataclass(frozen=True, slots=True)
class ChangeOfStops:
    """How far apart two explanations put the ends of stops.

    Attributes:
        length: of the third stop of those that they disagree most about, or of all stops as a root
            mean square [m].
        practical: the same as a multiple of what matters in each stop; below 1 nothing does.
    """

    length: float
    practical: float


def practical_lengths(distance: Floats, settings: DiscrepancySettings) -> Floats:
    """(S,) change of each stop from which one matters [m]."""
    return np.maximum(settings.practical_share * distance, settings.practical_length)


def change_between(
    table: StopTable, one: Hypothesis, other: Hypothesis, settings: DiscrepancySettings
) -> ChangeOfStops:
    """Of the stops of a log, by one hypothesis and by another."""
    off = np.abs(distances(table, one) - distances(table, other))
    least = practical_lengths(table.distance, settings)
    return ChangeOfStops(
        float(np.sort(off)[-CHANGED_STOPS]), float(np.sort(off / least)[-CHANGED_STOPS])
    )


def sizes_of(
    table: StopTable, found: Fit, settings: DiscrepancySettings
) -> tuple[ChangeOfStops, ...]:
    """What each effect of an explanation changes, the others and the coefficients as they are.

    A build-up of the brakes is there in every vehicle and every stop, and dead time and
    coefficients know of it: what counts is what they cannot take up, on the whole.

    Args:
        table: stops. found: with its effects. settings: what matters.
    """
    added = found.hypothesis.added
    sizes = []
    for i, effect in enumerate(added):
        rest = replace(found.hypothesis, added=(*added[:i], *added[i + 1 :]))
        if LAWS[effect.name].enters is Enters.LAG:
            rest = fit_either_way(as_output(table, found), rest, found.noise, rounds=1).hypothesis
            sizes.append(_usual_change(table, found.hypothesis, rest, settings))
        else:
            sizes.append(change_between(table, found.hypothesis, rest, settings))
    return tuple(sizes)


def _usual_change(
    table: StopTable, one: Hypothesis, other: Hypothesis, settings: DiscrepancySettings
) -> ChangeOfStops:
    off = distances(table, one) - distances(table, other)
    least = practical_lengths(table.distance, settings)
    return ChangeOfStops(
        float(np.sqrt(np.mean(off**2))), float(np.sqrt(np.mean((off / least) ** 2)))
    )
