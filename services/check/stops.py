"""Emergency stops from many places at once, integrated in time.

Dead time, at held speed or with the drive cut; then ds/dt = v, dv/dt = −g (F_b/W + sin θ) − motion
terms, with the force of the speed at onset, its build-up and its heat, by a fourth-order
Runge–Kutta scheme whose lanes are the stops of one plan. Source: Braking (2), (7), (8), (12).
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.services.check.stop_field import StopField
from slopewise.services.check.stop_lanes import (
    TIME_STEP,
    State,
    coast,
    rates_at,
    step,
    weigh_braking,
)

_LONGEST = 60.0  # [s] of a stop


class StopEnds(NamedTuple):
    """What L stops come to; arrays are (L,).

    Attributes:
        end: where the vehicle rests, without safety offset [m]. ended: it does, before the give-up.
        rear, side, wheel: least shares of the level static load on the way.
        rear_even, side_even, wheel_even: the same without what crests take.
    """

    end: Floats
    ended: Bools
    rear: Floats
    side: Floats
    wheel: Floats
    rear_even: Floats
    side_even: Floats
    wheel_even: Floats

    def worst_of(self, other: StopEnds) -> StopEnds:
        """Of two ways in which the same stops may go, the longer way and the lesser loads."""
        least = (np.minimum(a, b) for a, b in zip(self[2:], other[2:], strict=True))
        return StopEnds(np.maximum(self.end, other.end), self.ended & other.ended, *least)


def stops_from(
    field: StopField, station: Floats, speed: Floats, dead_time: Floats, give_up: float
) -> StopEnds:
    """Emergency stops from L places at worst.

    Args:
        field: what they meet.
        station, speed, dead_time: (L,) of the commands [m], [m/s], [s].
        give_up: a stop that gets here is not followed further [m].

    Where the model says that the drive may be cut in the dead time, the longer of both counts.
    """
    held = _driven(field, station, speed, dead_time, give_up, False)
    steepest = -float(field.table[:, 0].min())
    runs_on = steepest > field.model.terrain.motion_resistance
    if field.model.braking.drive_in_dead_time == "held" or not runs_on:
        return held
    return held.worst_of(_driven(field, station, speed, dead_time, give_up, True))


def stops_as_told(
    field: StopField, station: Floats, speed: Floats, dead_time: Floats, give_up: float
) -> StopEnds:
    """Emergency stops as plans tell them: speed held in the dead time, force as learned."""
    learned = replace(field, as_learned=True)
    return _driven(learned, station, speed, dead_time, give_up, False)


def _driven(
    field: StopField, station: Floats, speed: Floats, dead_time: Floats, give_up: float, cut: bool
) -> StopEnds:
    count = len(station)
    zero = np.zeros(count)
    least = np.full((6, count), np.inf)
    state = State(np.arange(count), station, speed, speed, zero, zero, dead_time, least.copy())
    state = coast(field, state, cut=cut)
    end, ended = station.copy(), np.zeros(count, np.bool_)
    for _ in range(int(_LONGEST / TIME_STEP)):
        if len(state.lane) == 0:
            break
        state, rests = step(field, state)
        done = rests | (state.s > give_up)
        if done.any():
            gone = state.only(done)
            at_end = rates_at(field, gone, gone.s, gone.v, gone.force, gone.heat)
            weigh_braking(field, gone, at_end)
            end[gone.lane], ended[gone.lane] = gone.s, rests[done]
            least[:, gone.lane] = gone.least
            state = state.only(~done)
    end[state.lane], least[:, state.lane] = state.s, state.least
    return StopEnds(end, ended, *least)
