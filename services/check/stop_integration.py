"""Emergency stops from many places together, integrated in time.

Dead time, at held speed or with the drive cut; then ds/dt = v, dv/dt = −g (F_b/W + sin θ) − motion
terms, with the force of the speed at onset, its build-up and its heat, by a fourth-order
Runge–Kutta scheme whose lanes are the stops of one plan. Source: Braking (2), (7), (8), (12).
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.quantity import GRAVITY
from slopewise.services.check.loads import shares_of
from slopewise.services.check.stop_dynamics import PathState, StopDynamics

TIME_STEP = 0.04  # Step of the integrator [s]; halving it moves stops by less than a millimetre
_MAX_STOP_TIME = 60.0  # [s] of a stop: brakes that take longer do not hold the vehicle


class Rates(NamedTuple):
    """Where L vehicles are, and how their state changes; arrays are (L,)."""

    here: PathState
    demanded: Floats
    decel: Floats
    growth: Floats
    heating: Floats


class State(NamedTuple):
    """State of L stops under way; arrays are (L,), the last (6, L)."""

    lane: Ints
    s: Floats  # station [m]
    v: Floats  # speed [m/s]
    onset_speed: Floats  # speed when the brakes take hold [m/s]
    force: Floats  # built-up F_b/W [1]
    heat: Floats  # heat of the brakes [J/kg]
    time: Floats  # dead time [s]
    min_shares: Floats  # lowest rear, side and wheel shares so far, and the same without crests

    def only(self, selected: Bools) -> State:
        """Some of them."""
        return State._make(values[..., selected] for values in self)


def rates_at(
    field: StopDynamics, state: State, s: Floats, v: Floats, f: Floats, q: Floats
) -> Rates:
    motion, v = field.motion, np.maximum(v, 0.0)
    here = field.at(s)
    demanded = field.force(here, state.onset_speed)
    decel, force = field.deceleration(here, v, f if motion.lag > 0.0 else demanded, q)
    growth = (demanded - f) / motion.lag if motion.lag > 0.0 else 0.0 * f
    heating = GRAVITY * np.maximum(force, 0.0) * v - q / motion.fade_tau
    return Rates(here, demanded, decel, growth, heating)


def _weigh(field: StopDynamics, state: State, here: PathState, decel: Floats) -> None:
    """Note the loads where the vehicles are now; a crest takes the same of all of them."""
    speed_sq = state.v * state.v
    shares = shares_of(field.model.vehicle, here.pose, speed_sq, decel, crest=False)
    lost = np.maximum(-here.pose.vertical_curvature, 0.0) * speed_sq / GRAVITY
    for i, even in enumerate((shares.rear, shares.side, shares.wheel)):
        np.minimum(state.min_shares[i], even - lost, out=state.min_shares[i])
        np.minimum(state.min_shares[i + 3], even, out=state.min_shares[i + 3])


def weigh_braking(field: StopDynamics, state: State, rates: Rates) -> None:
    """Note the loads under the highest force that the brakes may have."""
    demanded = rates.demanded
    if field.two_sided:
        demanded = field.force(rates.here, state.onset_speed, upper=True)
    highest, _ = field.deceleration(
        rates.here, state.v, demanded, np.zeros_like(state.v), upper=True
    )
    _weigh(field, state, rates.here, np.maximum(rates.decel, highest))


def coast(field: StopDynamics, state: State, *, cut: bool) -> State:
    """The dead times at held speed; or with the drive cut, faster where that is downhill.

    Motion resistance is all that holds it then; that it slows on other ground is ignored.
    """
    resistance = field.model.terrain.motion_resistance
    steps = max(int(np.ceil(float(state.time.max(initial=0.0)) / TIME_STEP)), 1)
    h = state.time / steps
    for _ in range(steps):
        here = field.at(state.s)
        growth = np.zeros_like(h)
        if cut:
            middle = field.at(state.s + 0.5 * h * state.v).pose
            growth = GRAVITY * np.maximum(-middle.sine - resistance, 0.0)
        _weigh(field, state, here, -growth)
        after = state.v + h * growth
        state = state._replace(s=state.s + 0.5 * h * (state.v + after), v=after)
    _weigh(field, state, field.at(state.s), np.zeros_like(h))
    return state._replace(onset_speed=state.v.copy())


def step(field: StopDynamics, state: State) -> tuple[State, Bools]:
    """One step of the brakes, and which come to rest in it."""
    h, b = TIME_STEP, 0.5 * TIME_STEP
    s, v, f, q = state.s, state.v, state.force, state.heat
    first = rates_at(field, state, s, v, f, q)
    weigh_braking(field, state, first)
    v2 = v - b * first.decel
    two = rates_at(field, state, s + b * v, v2, f + b * first.growth, q + b * first.heating)
    v3 = v - b * two.decel
    three = rates_at(field, state, s + b * v2, v3, f + b * two.growth, q + b * two.heating)
    v4 = v - h * three.decel
    four = rates_at(field, state, s + h * v3, v4, f + h * three.growth, q + h * three.heating)

    def mean(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
        return (a + 2.0 * b + 2.0 * c + d) / 6.0

    after = v - h * mean(first.decel, two.decel, three.decel, four.decel)
    stopped = after <= 0.0
    # Within the last step the deceleration is as good as constant.
    part = np.where(stopped, v / np.maximum(v - after, 1e-12), 1.0)
    ahead = np.where(stopped, 0.5 * v * h * part, h * mean(v, v2, v3, v4))
    after_step = state._replace(
        s=s + ahead,
        v=np.maximum(after, 0.0),
        force=f + h * mean(first.growth, two.growth, three.growth, four.growth),
        heat=q + h * mean(first.heating, two.heating, three.heating, four.heating),
    )
    return after_step, stopped


class StopEnds(NamedTuple):
    """Results of L stops (L,): lowest shares of the level static loads, also without crests."""

    end: Floats  # station where the vehicle comes to rest, without safety offset [m]
    ended: Bools
    rear: Floats
    side: Floats
    wheel: Floats
    rear_even: Floats
    side_even: Floats
    wheel_even: Floats

    def worst_of(self, alternative: StopEnds) -> StopEnds:
        """Of two courses of the same stops, the longer distances and the lower loads."""
        lowest = (np.minimum(a, b) for a, b in zip(self[2:], alternative[2:], strict=True))
        end = np.maximum(self.end, alternative.end)
        return StopEnds(end, self.ended & alternative.ended, *lowest)


def worst_case_stops(
    field: StopDynamics, station: Floats, speed: Floats, dead_time: Floats, give_up: float
) -> StopEnds:
    """Emergency stops from L places at worst: stations, speeds and dead times (L,) of the commands.

    Where the model says that the drive may be cut in the dead time, the longer stop is used. A stop
    that gets to the station ``give_up`` is not followed further [m].
    """
    held = _driven(field, station, speed, dead_time, give_up, False)
    steepest = -float(field.table[0].min())
    runs_on = steepest > field.model.terrain.motion_resistance
    if field.model.braking.drive_in_dead_time == "held" or not runs_on:
        return held
    return held.worst_of(_driven(field, station, speed, dead_time, give_up, True))


def nominal_stops(
    field: StopDynamics, station: Floats, speed: Floats, dead_time: Floats, give_up: float
) -> StopEnds:
    """Emergency stops as plans report them: speed held in the dead time, force as learned."""
    learned = replace(field, nominal=True)
    return _driven(learned, station, speed, dead_time, give_up, False)


def _driven(
    field: StopDynamics,
    station: Floats,
    speed: Floats,
    dead_time: Floats,
    give_up: float,
    cut: bool,
) -> StopEnds:
    count = len(station)
    zero = np.zeros(count)
    lowest = np.full((6, count), np.inf)
    state = State(np.arange(count), station, speed, speed, zero, zero, dead_time, lowest.copy())
    if field.errors.latency > 0.0 and not field.nominal:
        # Before the command nothing cuts the drive.
        late = state._replace(time=np.full(count, field.errors.latency))
        state = coast(field, late, cut=False)._replace(time=dead_time)
    state = coast(field, state, cut=cut)
    end, ended = station.copy(), np.zeros(count, np.bool_)
    for _ in range(int(_MAX_STOP_TIME / TIME_STEP)):
        if len(state.lane) == 0:
            break
        state, stopped = step(field, state)
        done = stopped | (state.s > give_up)
        if done.any():
            gone = state.only(done)
            at_end = rates_at(field, gone, gone.s, gone.v, gone.force, gone.heat)
            weigh_braking(field, gone, at_end)
            end[gone.lane], ended[gone.lane] = gone.s, stopped[done]
            lowest[:, gone.lane] = gone.min_shares
            state = state.only(~done)
    end[state.lane], lowest[:, state.lane] = state.s, state.min_shares
    return StopEnds(end, ended, *lowest)
