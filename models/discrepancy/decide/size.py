"""How much something changes a stop, and what is too little to be worth a name.

Significance and size are two things: thousands of samples tell a lag of milliseconds for certain,
and nobody stops a centimetre later by it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import distances
from slopewise.models.discrepancy.model.brakes import lag_of
from slopewise.models.discrepancy.model.hypothesis import Hypothesis, builds_up
from slopewise.models.discrepancy.search.refine import Fit, as_output, fit_either_way
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.thresholds import (
    CHANGED_STOPS,
    LAG_BLURS,
    LEAST_LAG,
    MOTION_BEYOND_DOUBT,
    PLAIN_EVIDENCE,
)
from slopewise.models.effects.effect_law import Enters
from slopewise.models.effects.registry import LAWS


@dataclass(frozen=True, slots=True)
class ChangeOfStops:
    """How far apart two explanations put the ends of stops.

    Attributes:
        length: of the third stop of those that they disagree most about, or of all stops as a root
            mean square [m].
        practical: the same as a multiple of what matters in each stop; below 1 nothing does.
        gain: chi square that tells them apart, where it was worked out.
    """

    length: float
    practical: float
    gain: float = np.inf


def practical_lengths(distance: Floats, settings: DiscrepancySettings) -> Floats:
    """(S,) change of each stop from which one matters [m]."""
    return np.maximum(settings.practical_share * distance, settings.practical_length) + 1e-9


def change_between(
    table: StopTable, one: Hypothesis, other: Hypothesis, settings: DiscrepancySettings
) -> ChangeOfStops:
    """Of the stops of a log, by one hypothesis and by another."""
    off = np.abs(distances(table, one) - distances(table, other))
    return _largest(off, practical_lengths(table.distance, settings))


def sizes_of(
    table: StopTable, found: Fit, settings: DiscrepancySettings
) -> tuple[ChangeOfStops, ...]:
    """What each effect of an explanation changes.

    Where the log tells it from other numbers of everything else beyond doubt, that is its own share
    of a stop; else what they cannot take up. As the speed falls the base's own shape is a little
    wrong in every vehicle: terms of motion need more, unless that shape is fitted along.

    A build-up of the brakes is there in every vehicle and every stop: what counts is what it
    changes on the whole, and only where it takes longer than usual.

    Args:
        table: stops. found: with its effects. settings: what matters.
    """
    added = found.hypothesis.added
    if not added:
        return ()
    output = as_output(table, found)
    here = fit_either_way(output, found.hypothesis, found.noise, rounds=1)
    ends, least = distances(table, found.hypothesis), practical_lengths(table.distance, settings)
    sizes = []
    for i, effect in enumerate(added):
        rest = replace(found.hypothesis, added=(*added[:i], *added[i + 1 :]))
        without = fit_either_way(output, rest, found.noise, rounds=1)
        gain = without.deviance - here.deviance
        base_like = LAWS[effect.name].enters is Enters.MOTION and not found.hypothesis.bends
        own = gain > (MOTION_BEYOND_DOUBT if base_like else PLAIN_EVIDENCE)
        if builds_up(effect):
            size = _on_the_whole(np.abs(ends - distances(table, without.hypothesis)), least)
            if lag_of(found.hypothesis) < _usual_build_up(table, found):
                size = replace(size, practical=0.0)
        else:
            other = rest if own else without.hypothesis
            size = _largest(np.abs(ends - distances(table, other)), least)
        sizes.append(replace(size, gain=gain))
    return tuple(sizes)


def _largest(off: Floats, least: Floats) -> ChangeOfStops:
    return ChangeOfStops(
        float(np.sort(off)[-CHANGED_STOPS]), float(np.sort(off / least)[-CHANGED_STOPS])
    )


def _on_the_whole(off: Floats, least: Floats) -> ChangeOfStops:
    return ChangeOfStops(
        float(np.sqrt(np.mean(off**2))), float(np.sqrt(np.mean((off / least) ** 2)))
    )


def _usual_build_up(table: StopTable, found: Fit) -> float:
    """Lag up to which it is none worth a name [s]: scatter of the onset rounds the knee as well."""
    blur = np.hypot(found.noise.dead_time_std, table.sample / np.sqrt(12.0))
    return max(LEAST_LAG, LAG_BLURS * float(blur))
