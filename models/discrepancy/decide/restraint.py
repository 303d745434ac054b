"""Reasons not to give a name although it fits best: too little evidence, or too free a shape."""

from __future__ import annotations

import numpy as np

from models.discrepancy.data.stop_table import StopTable
from models.discrepancy.decide.gap import distances
from models.discrepancy.model.prediction import ground_of, inside_patch
from models.discrepancy.search.identify import ScoredExplanation
from models.discrepancy.search.locate import Followed, follow
from models.discrepancy.thresholds import (
    BEATS_PART,
    BEATS_SEVERAL,
    BEATS_TRACE,
    FEWEST_IN_PATCH,
    HARDLY,
    ONE_SIDED_WIND,
    P_CHANNEL,
    P_PLACE,
    P_SHAPE,
    PLAIN_EVIDENCE,
    TRACE,
)
from models.parameters import Effect

_SHOWS_AT = {"surface_patch": ("place", "x", "y")}
_SHOWS_ALONG = {
    "grade_asymmetry": ("grade", "abs_grade"),
    "grade_nonlinearity": ("grade", "abs_grade"),
}
_SHOWS_PLAINLY_ALONG = {
    "step_change": ("run", "time"),
    "session_drift": ("run", "time"),
    "cross_slope": ("roll",),
    "turning_resistance": ("yaw_rate",),
    "directional_surface": ("heading",),
}
_ONE_AXIS = (
    frozenset(("aerodynamic_drag", "viscous_resistance", "brake_lag")),
    frozenset(("grade_asymmetry", "grade_nonlinearity", "wheel_lockup")),
    frozenset(("step_change", "session_drift")),
)
"""Two of these together imitate any shape along their axis."""


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
    unseen = []
    shows = ((P_PLACE, _SHOWS_AT), (P_SHAPE, _SHOWS_ALONG), (P_CHANNEL, _SHOWS_PLAINLY_ALONG))
    for p_value, along in shows:
        seen = {f.axis.name for f in located if f.p_value < p_value}
        unseen += [n for n in best.names if n in along and not seen & set(along[n])]
    patches = [e for e in best.fit.hypothesis.added if e.name == "surface_patch"]
    few = any(_stops_inside(table, patch) < FEWEST_IN_PATCH for patch in patches)
    return margin < HARDLY or few or (len(best.names) == 1 and bool(unseen))


def _placed(left: list[Followed]) -> bool:
    """What is left follows a place."""
    return any(f.axis.name in _SHOWS_AT["surface_patch"] and f.p_value < P_SHAPE for f in left)


def _stops_inside(table: StopTable, patch: Effect) -> int:
    p = patch.parameters
    inside = inside_patch(ground_of(table), p["x"], p["y"], p["radius"]) > 0.5
    return int(((table.time > table.onset) & inside).any(axis=1).sum())


def plainer_one(
    table: StopTable,
    best: ScoredExplanation,
    others: tuple[ScoredExplanation, ...],
    doubt: float,
    seed: int,
) -> ScoredExplanation | None:
    """The best explanation with fewer effects, where the further ones are not believed.

    Args:
        table: stops. best, others: explanations. doubt: chi square that means nothing.
        seed: of permutations.
    """
    parts = [e for e in others if e.names and set(e.names) < set(best.names)]
    if not parts:
        return None
    plainer = min(parts, key=lambda e: e.score)
    further = set(best.names) - set(plainer.names)
    doubt = max(doubt, BEATS_PART)
    as_good = [e for e in others if e.names and e.score < best.score + doubt]
    if any(set(e.names) > set(plainer.names) and not further <= set(e.names) for e in as_good):
        doubt = max(doubt, BEATS_SEVERAL)  # something more, but nobody knows what
    if "surface_patch" in further and not _placed(follow(table, plainer.fit, seed)):
        doubt = max(doubt, PLAIN_EVIDENCE)  # a place can be found for any few stops that differ
    margin = plainer.score - best.score
    trace = _way_between(table, best, plainer) < TRACE and margin < BEATS_TRACE
    return plainer if margin < doubt or trace else None


def _way_between(table: StopTable, one: ScoredExplanation, other: ScoredExplanation) -> float:
    """Root mean square difference of stopping distances, as a share of their mean."""
    off = distances(table, one.fit.hypothesis) - distances(table, other.fit.hypothesis)
    return float(np.sqrt(np.mean(off**2)) / np.mean(table.distance))


def along_one_axis(table: StopTable, best: ScoredExplanation) -> list[str]:
    """Two or more names that act along the same axis, [] if there are none."""
    one_way = abs(np.mean(np.exp(1j * table.yaw))) > ONE_SIDED_WIND
    for i, group in enumerate(_ONE_AXIS):
        # Met from one side, a wind is a curve over speed and nothing else.
        whole = group | {"headwind"} if i == 0 and one_way else group
        found = sorted(whole & set(best.names))
        if len(found) > 1:
            return found
    return []
