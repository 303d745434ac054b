"""Reasons not to give a name although it fits best: too little evidence, or too free a shape."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.size import change_between
from slopewise.models.discrepancy.model.hypothesis import is_placed
from slopewise.models.discrepancy.search.candidates import search_of
from slopewise.models.discrepancy.search.identify import ScoredExplanation, holds
from slopewise.models.discrepancy.search.locate import WITHIN, Followed, follow
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.thresholds import (
    BEATS_PART,
    BEATS_SEVERAL,
    BEATS_TRACE,
    FEWEST_IN_PATCH,
    HARDLY,
    ONE_SIDED_WIND,
    P_IMITATED,
    P_SHAPE,
    PLAIN_EVIDENCE,
    TOLD_APART,
)
from slopewise.models.effects.effect_law import Enters, Search
from slopewise.models.effects.registry import LAWS
from slopewise.models.effects.surface_patch import share_inside
from slopewise.models.parameters import Effect


def weak(
    table: StopTable, best: ScoredExplanation, refitted: ScoredExplanation, located: list[Followed]
) -> bool:
    """Too little evidence for a name: hardly better than none, or along an axis that shows none.

    Args:
        table: stops. best: explanation with names. refitted: that without any.
        located: axes that the refitted model disagrees along.
    """
    margin = refitted.score - best.score
    if refitted.names or margin > PLAIN_EVIDENCE:
        return False
    unseen = [n for n in best.names if not _seen(search_of(n), located)]
    patches = [e for e in best.fit.hypothesis.added if is_placed(e)]
    few = any(_stops_inside(table, patch) < FEWEST_IN_PATCH for patch in patches)
    return margin < HARDLY or few or (len(best.names) == 1 and bool(unseen))


def _seen(how: Search, located: list[Followed]) -> bool:
    """The log disagrees along an axis that has to show the effect, if one has to."""
    seen = {f.axis.name for f in located if f.p_value < how.seen_below}
    return not how.shows_along or bool(seen & set(how.shows_along))


def _placed(left: list[Followed], names: set[str]) -> bool:
    """What is left follows the places of such effects."""
    axes = {axis for name in names for axis in search_of(name).shows_along}
    return any(f.axis.name in axes and f.p_value < P_SHAPE for f in left)


def _stops_inside(table: StopTable, patch: Effect) -> int:
    p = patch.parameters
    inside = share_inside(table.x, table.y, p["x"], p["y"], p["radius"]) > 0.5
    return int(((table.time > table.onset) & inside).any(axis=1).sum())


def plainer_one(
    table: StopTable,
    best: ScoredExplanation,
    others: tuple[ScoredExplanation, ...],
    doubt: float,
    settings: DiscrepancySettings,
) -> ScoredExplanation | None:
    """The best explanation with fewer effects, where the further ones are not believed.

    Args:
        table: stops. best, others: explanations. doubt: chi square that means nothing.
        settings: seed of permutations, and what matters.
    """
    parts = [e for e in others if e.names and holds(best.names, e.names)]
    if not parts:
        return None
    plainer = min(parts, key=lambda e: e.score)
    further = set((Counter(best.names) - Counter(plainer.names)).elements())
    doubt = max(doubt, BEATS_PART)
    as_good = [e for e in others if e.names and e.score < best.score + doubt]
    if any(holds(e.names, plainer.names) and not further <= set(e.names) for e in as_good):
        doubt = max(doubt, BEATS_SEVERAL)  # something more, but nobody knows what
    placed = {name for name in further if search_of(name).placed}
    if placed and not _placed(follow(table, plainer.fit, settings.seed), placed):
        doubt = max(doubt, PLAIN_EVIDENCE)  # a place can be found for any few stops that differ
    margin = plainer.score - best.score
    change = change_between(table, best.fit.hypothesis, plainer.fit.hypothesis, settings)
    trace = change.practical < 1.0 and margin < BEATS_TRACE
    return plainer if margin < doubt or trace else None


def told_apart(
    best: ScoredExplanation,
    others: tuple[ScoredExplanation, ...],
    together: list[str],
    left: list[Followed],
) -> bool:
    """Whether the traces of speed hold each of several effects along one axis by itself.

    A lag acts at the onset, air drag through the whole stop: together they leave nothing along the
    axis, and neither can be had for less. Two effects that imitate a third leave some of its shape.

    Args:
        best: explanation. others: those that it is weighed against.
        together: names of it that act along one axis. left: what it leaves.
    """
    shape = any(f.axis.name in WITHIN and f.p_value < P_IMITATED for f in left)
    missing = (
        min((e.score for e in others if name not in e.names), default=np.inf) for name in together
    )
    return not shape and all(score - best.score > TOLD_APART for score in missing)


def along_one_axis(table: StopTable, best: ScoredExplanation) -> list[str]:
    """Two or more names that act along the same axis, [] if there are none."""
    one_way = abs(np.mean(np.exp(1j * table.yaw))) > ONE_SIDED_WIND
    shapes: dict[str, list[str]] = {}
    for name in (name for name in LAWS if name in best.names):
        how = search_of(name)
        # Met from one side, a wind is a curve over speed and nothing else.
        shape = how.shape or (how.shape_one_way if one_way else "")
        if shape:
            shapes.setdefault(shape, []).append(name)
    return next((sorted(names) for names in shapes.values() if len(names) > 1), [])


def build_up_under_a_cap(names: Sequence[str]) -> list[str]:
    """A build-up of the brakes and a friction cap among names, [] without both.

    A cap cuts off the long end of a build-up: together they fit brakes whose force grows in another
    way, and slow brakes alone or locking wheels alone as well as they fit both.
    """
    ways = {LAWS[name].enters: name for name in names}
    both = [ways[way] for way in (Enters.LAG, Enters.CAP) if way in ways]
    return both if len(both) > 1 else []
