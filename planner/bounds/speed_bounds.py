"""Speed bounds along candidates: how fast each station may be passed, and what says so.

They are found in the core: the bounds of a single station in `core/bounds/pointwise.hpp`, the
stopping path, which looks ahead, in `closed_form_stop.hpp` and, stop by stop, in
`integrated_stop.hpp`.

An emergency stop is written three times, and no two share a line: here as a *bound*, the highest
speed of a station; in :mod:`slopewise.planner.verify` as the *judge* of a finished plan, in a
different form on purpose; in :mod:`slopewise.models.stops.simulation` as the slow *reference* that
both are tested against.

The bound itself has two ways to the same answer. Where nothing but the grade acts, the energy that
the brakes take out from onset to the target is an integral that is summed once along the path, and
the speed follows from a quadratic. Where an effect acts on the motion itself, or a load may run
short on the path, stops are marched along the path, and the speed is tried for. They share their
inputs and nothing of their method: the closed form sums backwards from the target, the other
one marches forwards from the command.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from slopewise.models.arrays import Floats, Ints
from slopewise.models.effects.registry import crest_share
from slopewise.models.parameters import Model
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.braking_ground import BrakingGround
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.planning_limits import planning_limits
from slopewise.planner.swept.hazards import Hazards

HOLDING = core.HOLDING
"""Least F_b/W + sin θ: below it the brakes barely slow the vehicle, let alone stop it."""

STOP_GUARD = core.STOP_GUARD
"""Kept free between stopping path and clear distance, above all errors of integration [m]."""


@dataclass(frozen=True, slots=True)
class SpeedBounds:
    """Bounds along M candidates; arrays are (N, M) unless stated otherwise.

    Attributes:
        speed_sq_max: highest v² with which v² may be linear between stations [m²/s²].
        limiting: which bound that is, as :class:`Limiting`.
        accel_max: highest acceleration by comfort, thrust and front axle load [m/s²].
        lift, lift_per_speed_sq: in a turn the wheel that bank and turn unload allows an
            acceleration of lift − lift_per_speed_sq v² [m/s²], [1/m].
        demand: thrust that holds the speed, as a share of the weight.
        clear_distance: (M,) station up to which the vehicle may stop [m].
        barrier: (M,) what ends the clear distance, as :class:`Limiting`; STOPPING_PATH if it is
            the end of the path or of the part known to be free.
        barrier_station: (M,) index of the first blocked station, N without one.
        ground: braking with what crests and friction leave of the lower bound of its force.
        even_ground: with the learned force unchanged; the same as ``ground`` where the model
            itself states what crests take.
    """

    speed_sq_max: Floats
    limiting: Ints
    accel_max: Floats
    lift: Floats
    lift_per_speed_sq: Floats
    demand: Floats
    clear_distance: Floats
    barrier: Ints
    barrier_station: Ints
    ground: BrakingGround
    even_ground: BrakingGround


def speed_bounds(
    profile: TerrainProfile,
    ground: BrakingGround,
    model: Model,
    clear: Floats,
    speed_limit: Floats | None = None,
    hazards: Hazards | None = None,
    *,
    holds_anywhere: bool = False,
    curves: Floats | None = None,
) -> SpeedBounds:
    """Bounds on speed along candidates.

    Args:
        profile: terrain under the wheels.
        ground: braking along the candidates.
        model: vehicle, terrain and limits.
        clear: (M,) station up to which the vehicle may come, inf if unlimited [m].
        speed_limit: (N, M) limits of the path itself [m/s].
        hazards: obstacles of body and wheels; none if omitted.
        holds_anywhere: for what-if questions: a vehicle at rest is held on any slope.
        curves: (len(Limiting), N) receives v² that each bound at a station individually allows the
            first candidate, where it says anything [m²/s²].
    """
    rows, codes, barrier, barrier_station, clear_distance = core.speed_bounds(
        profile,
        ground,
        hazards or Hazards(),
        speed_limit,
        clear,
        planning_limits(model)._replace(holding=0.0 if holds_anywhere else 1.0),
        curves,
    )
    speed_sq_max, accel_max, lift, lost, demand, lower_slope, lower_intercept = rows
    left = replace(ground, lower_slope=lower_slope, lower_intercept=lower_intercept)
    return SpeedBounds(
        speed_sq_max,
        codes,
        accel_max,
        lift,
        lost,
        demand,
        clear_distance,
        barrier,
        barrier_station,
        left,
        ground if crest_share(model.effect) is None else left,
    )
