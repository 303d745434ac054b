"""How much something changes a stop, and what is too little to be worth a name.

Significance and size are two things: thousands of samples tell an effect of millimetres for
certain, and nobody stops a centimetre later by it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import distances
from slopewise.models.discrepancy.search.refine import Fit
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.thresholds import CHANGED_STOPS


@dataclass(frozen=True, slots=True)
class ChangeOfStops:
    """How far apart two explanations put the ends of stops.

    Attributes:
        length: of the third stop of those that they disagree most about [m].
        practical: the same as a multiple of what matters in each stop; below 1 nothing does.
    """

    length: float
    practical: float


def practical_lengths(distance: Floats, settings: DiscrepancySettings) -> Floats:
    """(S,) change of each stop from which one matters [m]."""
    return np.maximum(settings.practical_share * distance, settings.practical_length) + 1e-9


def sizes_of(
    table: StopTable, found: Fit, settings: DiscrepancySettings
) -> tuple[ChangeOfStops, ...]:
    """What each effect of an explanation changes: the stops with it less those without.

    Args:
        table: stops. found: with its effects. settings: what matters.
    """
    added = found.hypothesis.added
    least = practical_lengths(table.distance, settings)
    ends = distances(table, found.hypothesis)
    sizes = []
    for i in range(len(added)):
        rest = replace(found.hypothesis, added=(*added[:i], *added[i + 1 :]))
        off = np.abs(ends - distances(table, rest))
        length, practical = (float(np.sort(x)[-CHANGED_STOPS]) for x in (off, off / least))
        sizes.append(ChangeOfStops(length, practical))
    return tuple(sizes)
