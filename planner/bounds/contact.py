"""How hard the wheels press, and what friction then gives: crests, dips, banks and turns.

A crest takes load from every wheel and force from the brakes, more of both the faster it is passed:
it bounds the speed (what it takes of the force: :mod:`slopewise.planner.bounds.crest_force`). Where
friction is known, slope, turn, brakes and drive share it.

Laws: :mod:`slopewise.models.laws.crest`, :mod:`slopewise.models.laws.friction_ellipse`,
:mod:`slopewise.models.laws.holding`, :mod:`slopewise.models.laws.wheel_lockup`; written out here in
sines and cosines for many lanes at once, and held against those by tests.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.laws.friction_ellipse import TURNING_SHARE
from slopewise.models.quantity import GRAVITY
from slopewise.planner.kernels.compiled import row_pass
from slopewise.planner.kernels.limits import PlanningLimits

HOLDING = 0.02
"""Least F_b/W + sin θ: below it the brakes hardly slow the vehicle, let alone stop it."""

SPENT = 0.8
"""Share of what the brakes have beyond :data:`HOLDING` that a crest may take."""

_NONE = 1e-12
"""In place of a curvature or a force of zero."""


class ContactRow(NamedTuple):
    """One row of M candidates; the last six are written.

    Attributes:
        sin_grade, sin_roll, cosine, cos_lean, curvature, vertical_curvature: terrain.
        excess: by how much a stop may begin faster than planned [m/s].
        slowest, fastest, limit: speeds [m/s]. dead_time: before the brakes take hold [s].
        friction: inf where it is not known [1].
        force_slope, force_intercept: lower bound of F_b/W on even ground.
        lower_slope, lower_intercept: what turns and banks leave of it.
        crest_sq, friction_sq: highest v² by either [m²/s²].
        grip: F_x/W that friction leaves at the highest speed [1].
        holds: F_b(0)/W − |sin θ| [1].
    """

    sin_grade: Floats
    sin_roll: Floats
    cosine: Floats
    cos_lean: Floats
    curvature: Floats
    vertical_curvature: Floats
    excess: Floats
    dead_time: Floats
    slowest: Floats
    fastest: Floats
    limit: Floats
    friction: Floats
    force_slope: Floats
    force_intercept: Floats
    lower_slope: Floats
    lower_intercept: Floats
    crest_sq: Floats
    friction_sq: Floats
    grip: Floats
    holds: Floats


@row_pass
def normal_force(row: ContactRow, limits: PlanningLimits) -> None:
    """Speed over crests and through dips at which wheels and brakes keep enough."""
    for j in range(row.sin_grade.shape[0]):
        sine, up = row.sin_grade[j], row.cosine[j] * row.cos_lean[j]
        slow = row.slowest[j]
        cap = min(min(limits.speed, row.limit[j]), row.fastest[j])
        slope, intercept = row.force_slope[j], row.force_intercept[j]
        axle = up + min(limits.rear_lever * sine, -limits.front_lever * sine)
        side = up - limits.side_lever * abs(row.cosine[j] * row.sin_roll[j])
        falls = max(-row.vertical_curvature[j], _NONE)
        # A wheel carries what is left of its axle's share and of its side's.
        carried = max(axle + side - up - limits.min_load, 0.0)
        force = intercept + min(slow * slope, max(cap, slow) * slope)
        spare = SPENT * max(force + sine - HOLDING, 0.0) / max(force * limits.crest_share, _NONE)
        crest = GRAVITY * min(carried, up * spare) / falls
        dip = limits.vertical_accel / max(row.vertical_curvature[j], _NONE)
        # A stop that was commanded before the crest passes it faster than the plan would.
        reached = row.excess[j] + limits.decel * row.dead_time[j]
        passed = np.sqrt(crest)
        passed = max(passed - reached, 0.5 * passed)
        row.crest_sq[j] = min(passed * passed, dip)
        row.lower_slope[j] = slope
        row.lower_intercept[j] = intercept
        row.holds[j] = slow * slope + intercept - limits.holding * abs(sine)


@row_pass
def friction_ellipse(row: ContactRow, limits: PlanningLimits) -> None:
    """Speed that friction allows on banks and in turns, and what it leaves along the path."""
    coupled = limits.brake_share < 0.0
    for j in range(row.sin_grade.shape[0]):
        mu, up = row.friction[j], row.cosine[j] * row.cos_lean[j]
        bank = row.cosine[j] * row.sin_roll[j]
        bend = abs(row.curvature[j])
        outward = bank if row.curvature[j] > 0.0 else -bank
        falls = max(-row.vertical_curvature[j], 0.0)
        resistance = limits.resistance + limits.turning_drag * bend
        along = max(abs(row.sin_grade[j]), row.sin_grade[j] + resistance * row.cosine[j]) / up
        taken = abs(bank) / up
        # Half of what holding the speed leaves stays for speeding up, or it would never start.
        kept = along + 0.5 * max(mu - along, 0.0)
        share = TURNING_SHARE * mu + (1.0 - TURNING_SHARE) * taken
        share = min(share, np.sqrt(max(mu * mu - kept * kept, 0.0)))
        share = max(share, taken)
        # Both ways of sliding: out of the turn, and down a bank that the turn leans into.
        out = GRAVITY * max(share * up - outward, 0.0) / max(bend + share * falls, _NONE)
        down = GRAVITY * max(share * up + outward, 0.0) / max(share * falls - bend, _NONE)
        # And over a crest enough load for the same.
        held = along + 0.25 * max(mu - along, 0.0)
        over = GRAVITY * up * max(1.0 - held / max(kept, _NONE), 0.0) / max(falls, _NONE)
        friction_sq = min(over, min(out, down))
        cap = min(min(limits.speed, row.limit[j]), row.fastest[j])
        top = min(min(cap * cap, row.crest_sq[j]), friction_sq)
        normal = max(up - falls * top / GRAVITY, _NONE)
        sideways = max(abs(bank), abs(outward + bend * top / GRAVITY))
        grip = np.sqrt(max(mu * mu * normal * normal - sideways * sideways, 0.0))
        left = grip / normal
        rear = left * (1.0 - limits.ahead) / (1.0 - limits.brake_share + left * limits.high)
        front = left * limits.ahead / max(limits.brake_share - left * limits.high, _NONE)
        most = grip if coupled else normal * min(left, min(rear, front))
        slope, intercept = row.lower_slope[j], row.lower_intercept[j]
        slow, fast = row.slowest[j], max(cap, row.slowest[j])
        low, high = min(slow * slope, fast * slope), max(slow * slope, fast * slope)
        slides = intercept + high > most
        row.lower_slope[j] = 0.0 if slides else slope
        row.lower_intercept[j] = min(intercept + low, most) if slides else intercept
        row.friction_sq[j] = friction_sq
        row.grip[j] = grip
