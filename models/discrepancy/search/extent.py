"""How well places and times of change are known, which have no derivative.

The edge of a patch matters only where a stop crosses it, and the run of a change only between runs:
chi square is flat in between and jumps at the edges. The interval is what chi square does not rule
out (Wilks), told as the standard deviation of a normal distribution with the same 95 %.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.hypothesis import is_placed
from slopewise.models.discrepancy.search import screening
from slopewise.models.discrepancy.search.candidates import (
    EffectColumn,
    candidates,
    finer_patches,
    share_of,
)
from slopewise.models.discrepancy.search.patches import WeighedPatches, left_of, without_effect
from slopewise.models.discrepancy.search.refine import Fit, prior_precision
from slopewise.models.discrepancy.thresholds import (
    CHI2_95,
    EDGE_SIDES,
    EXTENT_MOVES,
    EXTENT_ROUNDS,
    JUMP_95,
    NORMAL_95,
    UNFITTED_SHARE,
)
from slopewise.models.effects.effect_law import Enters
from slopewise.models.effects.registry import LAWS
from slopewise.models.parameters import Effect


def extents(table: StopTable, found: Fit) -> list[dict[str, float]]:
    """Standard deviations of such parameters by name, for each added effect.

    Args:
        table: stops. found: an explanation at its best.
    """
    widths = []
    for index, effect in enumerate(found.hypothesis.added):
        if is_placed(effect):
            widths.append(_of_patch(table, found, index, effect))
        elif LAWS[effect.name].enters is Enters.LASTING:
            widths.append(_of_change(table, found, index, effect))
        else:
            widths.append({})
    return widths


def _of_patch(table: StopTable, found: Fit, index: int, effect: Effect) -> dict[str, float]:
    names = ("x", "y", "radius")
    inner = {name: float(effect.parameters[name]) for name in names}
    without = without_effect(found, index)
    here = EffectColumn(effect.name, inner)
    weighed = WeighedPatches(table, without)
    best = float(weighed.scores(share_of(table, here)).z[0] ** 2)
    kept = [(best, here)]
    for draw in range(EXTENT_ROUNDS):
        # From where the region reaches farthest, to each side in turn.
        name, side = names[draw % 3], 1.0 if draw % 2 == 0 else -1.0
        start = max(kept, key=lambda one: side * one[1].inner[name])[1]
        reach = EXTENT_MOVES[draw % len(EXTENT_MOVES)]
        tried, shares = finer_patches(table, start, reach, draw)
        if not tried:
            continue
        z_square = weighed.scores(shares).z ** 2
        best = max(best, float(z_square.max()))
        kept += zip(z_square.tolist(), tried, strict=True)
        kept = [one for one in kept if one[0] > best - JUMP_95 - UNFITTED_SHARE * best] or kept[:1]
    edges = _edges(table, inner)
    widths = {}
    for name in names:
        off = max(abs(one.inner[name] - inner[name]) for _, one in kept)
        widths[name] = float(max(off / NORMAL_95, edges[name]))
    return widths


def _edges(table: StopTable, inner: dict[str, float]) -> dict[str, float]:
    """Standard deviations by how far apart stops inside and outside are on each side of a patch.

    An edge lies anywhere between the last place inside and the first one outside; centre and
    radius follow from the edges on four sides.
    """
    braking = table.time > table.onset
    x, y = table.x[braking] - inner["x"], table.y[braking] - inner["y"]
    away = np.hypot(x, y) - inner["radius"]
    gaps = []
    for along, aside in ((x, y), (-x, y), (y, x), (-y, x)):
        here = away[along > np.abs(aside)]
        outside = float(np.min(here[here > 0.0], initial=inner["radius"]))
        inside = float(np.min(-here[here <= 0.0], initial=inner["radius"]))
        gaps.append(outside + inside)
    each = np.square(EDGE_SIDES * np.asarray(gaps)) / 12.0
    return {
        "x": 0.5 * float(np.sqrt(each[0] + each[1])),
        "y": 0.5 * float(np.sqrt(each[2] + each[3])),
        "radius": 0.25 * float(np.sqrt(each.sum())),
    }


def _of_change(table: StopTable, found: Fit, index: int, effect: Effect) -> dict[str, float]:
    without = without_effect(found, index)
    library, columns = candidates(table, without.hypothesis)
    own = [i for i, c in enumerate(library) if c.name == effect.name]
    if not own:
        return {"run": 0.0}
    z_square = _chi_squares(table, without, columns[:, :, own])
    runs = np.array([library[i].inner["run"] for i in own])
    kept = runs[z_square > float(z_square.max()) - CHI2_95]
    ends = [*kept.tolist(), float(effect.parameters["run"])]
    # A change between two runs is known to no better than one run.
    return {"run": (0.5 * (max(ends) - min(ends)) + 0.5) / NORMAL_95}


def _chi_squares(table: StopTable, without: Fit, columns: Floats) -> Floats:
    white = without.white
    precision = prior_precision(without.hypothesis)
    sums = screening.reduced(white, without.jacobian, columns, precision)
    both = np.zeros(columns.shape[2], np.bool_)
    left = left_of(table, without)
    result: Floats = screening.scores(sums, left, white.noise.scatter, both).z ** 2
    return result
