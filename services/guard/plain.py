"""Most commands are far from any bound: one closed form over the worst of the way tells it.

The steepest grade, the weakest and the strongest brakes, the sharpest crest and the deepest roll of
the whole way are taken to be everywhere at once. Where that is still fine, so are all stops from
all speeds up to the highest, and :mod:`slopewise.services.guard.stops` need not look at each of
them.
"""

from __future__ import annotations

import itertools
import math

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY
from slopewise.services.guard.arc import ArcAhead
from slopewise.services.guard.model_reader import GuardModel
from slopewise.services.guard.stops import Tables


def plainly_fine(
    model: GuardModel,
    tables: Tables,
    way: ArcAhead,
    speed: float,
    held: float,
    least_load: float,
    end: float,
) -> bool:
    """Whether stops from all speeds up to one end before ``end`` [m], with all loads kept.

    False means nothing but that it has to be looked at closely.

    Args:
        model, tables, way, least_load: as of :func:`slopewise.services.guard.stops.stops_along`.
        speed: highest [m/s]. held: time for which it may be held [s].
    """
    if model.effects or way.why:
        return False
    low, high = float(way.grade.min()), float(way.grade.max())
    roll, bend = float(abs(way.roll).max()), float(way.bend.min())
    rows = [table[k] for table, k in itertools.product(tables, way.kinds)]
    surfaces = list(model.surfaces.values())
    top = speed + max(surfaces[k].speed_error for k in way.kinds)
    dead = held + max(float(row[15]) for row in rows)
    gain = max(-math.sin(low) - model.resistance, 0.0)
    onset_sq = top * top + 2.0 * GRAVITY * gain * top * dead
    onset = math.sqrt(onset_sq)
    weakest, strongest = _forces(rows, (low, high), onset)
    upright = math.cos(max(-low, high)) * math.cos(roll)
    lost = max(-bend, 0.0) * onset_sq / (GRAVITY * upright)
    weakest = min(weakest, min(float(row[7]) for row in rows) * upright) * max(1.0 - lost, 0.0)
    decel = GRAVITY * (weakest + math.sin(low))
    if not decel > 0.0:
        return False
    # The steps of the close look are as much longer.
    reach = onset * dead + onset_sq / (2.0 * decel) + 2.0 * way.step
    offset = max(surfaces[k].offset for k in way.kinds)
    if reach + offset > end or abs(way.curvature) * speed * speed > model.lateral:
        return False
    normal = upright + min(bend, 0.0) * onset_sq / GRAVITY
    axle = normal - model.cg_z / (model.wheelbase - model.cg_x) * max(strongest, 0.0)
    climbing = normal - model.cg_z / model.cg_x * max(math.sin(high), 0.0)
    turn = abs(way.curvature) * onset_sq / (GRAVITY * math.cos(roll))
    side = normal - 2.0 * model.cg_z / model.track * (math.sin(roll) + turn)
    return min(axle, climbing, side) >= least_load


def _forces(rows: list[Floats], grades: tuple[float, float], onset: float) -> tuple[float, float]:
    """Least and most F_b/W there may be: it is bilinear, with a kink on level ground."""
    weakest, strongest = math.inf, -math.inf
    for row in rows:
        m_m, b_m, m_b, b_b, up_m, up_b, slowest, _, level, rolls = (float(v) for v in row[:10])
        for speed in (slowest, max(onset, slowest)):
            for grade in (*grades, 0.0):
                m, b = (up_m, up_b) if grade > 0.0 else (m_m, b_m)
                force = level * ((m * speed + b) * grade + m_b * speed + b_b)
                force += (1.0 - level) * rolls
                weakest = min(weakest, force)
                strongest = max(strongest, force * float(row[16]) + float(row[17]))
    return weakest, strongest
