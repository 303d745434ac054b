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
from slopewise.services.check.stop_dynamics import PathState, StopDynamics
from slopewise.services.physics.loads import shares_of

TIME_STEP = 0.04  # Step of the integrator [s]; halving it moves stops by less than a millimetre
_MAX_STOP_TIME = 60.0  # [s] of a stop: brakes that take longer do not hold the vehicle


class Rates(NamedTuple):
    """Where L vehicles are, and how their state changes; arrays are (L,)."""

    here: PathState
    demanded: Floats
    decel: Floats
    change: Floats  # (4, L) of the motion, per second


class State(NamedTuple):
    """State of L stops under way; arrays are (L,)."""

    lane: Ints
    motion: Floats  # (4, L) station [m], speed [m/s], built-up F_b/W [1], heat of the brakes [J/kg]
    onset_speed: Floats  # speed when the brakes take hold [m/s]
    # (2, 3, L) lowest rear, side and wheel shares so far, and those without crests
    min_loads: Floats

    def only(self, selected: Bools) -> State:
        """Some of them."""
        return State._make(values[..., selected] for values in self)


def rates_at(field: StopDynamics, onset_speed: Floats, motion: Floats) -> Rates:
    """Rates of stops that are in a state of motion (4, L)."""
    terms, (s, speed, f, q) = field.motion, motion
    here, v = field.at(s), np.maximum(speed, 0.0)
    demanded = field.force(here, onset_speed)
    decel, force = field.deceleration(here, v, f if terms.lag > 0.0 else demanded, q)
    growth = (demanded - f) / terms.lag if terms.lag > 0.0 else 0.0 * f
    heating = GRAVITY * np.maximum(force, 0.0) * v - q / terms.fade_tau
    return Rates(here, demanded, decel, np.stack((speed, -decel, growth, heating)))


def _weigh(field: StopDynamics, state: State, here: PathState, decel: Floats) -> None:
    """Note the loads where the vehicles are now; a crest takes the same of all of them."""
    speed_sq = state.motion[1] * state.motion[1]
    shares = shares_of(field.model.vehicle, here.pose, speed_sq, decel, crest=False)
    even = np.stack((shares.rear, shares.side, shares.wheel))
    lost = np.maximum(-here.pose.vertical_curvature, 0.0) * speed_sq / GRAVITY
    np.minimum(state.min_loads, np.stack((even - lost, even)), out=state.min_loads)


def weigh_braking(field: StopDynamics, state: State, rates: Rates) -> None:
    """Note the loads under the highest force that the brakes may have."""
    demanded, v = rates.demanded, state.motion[1]
    if field.two_sided:
        demanded = field.force(rates.here, state.onset_speed, upper=True)
    highest, _ = field.deceleration(rates.here, v, demanded, np.zeros_like(v), upper=True)
    _weigh(field, state, rates.here, np.maximum(rates.decel, highest))


def coast(
    field: StopDynamics, state: State, dead_time: Floats, *, cut: bool, commanded: bool = True
) -> tuple[State, State]:
    """The dead times (L,) at held speed; or with the drive cut, faster where that is downhill.

    Motion resistance is all that holds it then; that it slows on other ground is ignored. Also the
    stops whose brakes take hold earlier, as soon as the dead time of the ground they are on is
    over; from there on loads have to suffice under brakes too. None do before a stop is commanded.
    """
    grips, first = np.zeros(len(dead_time), np.bool_), state.motion.copy()
    may_differ = commanded and field.brakes_early and not field.nominal
    resistance = field.model.terrain.rolling_while_braking
    steps = max(int(np.ceil(float(dead_time.max(initial=0.0)) / TIME_STEP)), 1)
    h = dead_time / steps
    for i in range(steps):
        s, v, *rest = state.motion
        if may_differ:
            is_new = ~grips & (i * h >= _shortest_dead_time(field, s)) & (i * h < dead_time)
            first[:, is_new] = state.motion[:, is_new]
            grips |= is_new
            _weigh_early(field, state, grips)
        growth = np.zeros_like(h)
        if cut:
            middle = field.at(s + 0.5 * h * v).pose
            growth = GRAVITY * np.maximum(-middle.sine - resistance, 0.0)
        _weigh(field, state, field.at(s), -growth)
        after = v + h * growth
        state = state._replace(motion=np.stack((s + 0.5 * h * (v + after), after, *rest)))
    _weigh(field, state, field.at(state.motion[0]), np.zeros_like(h))
    early = state._replace(motion=first, onset_speed=first[1]).only(grips)
    return state._replace(onset_speed=state.motion[1].copy()), early


def _shortest_dead_time(field: StopDynamics, s: Floats) -> Floats:
    """Of the surfaces at stations (L,) [s]."""
    shortest, sample = field.brakes.shortest_dead_time, field.at(s).sample
    return np.minimum(shortest[sample], shortest[sample + 1])


def _weigh_early(field: StopDynamics, state: State, grips: Bools) -> None:
    """Note the loads of those whose brakes take hold in the dead time of the others."""
    if grips.any():
        early = state._replace(onset_speed=state.motion[1]).only(grips)
        weigh_braking(field, early, rates_at(field, early.onset_speed, early.motion))
        state.min_loads[..., grips] = early.min_loads


def step(field: StopDynamics, state: State) -> tuple[State, Bools]:
    """One step of the brakes, and which come to rest in it."""
    h, begin, onset = TIME_STEP, state.motion, state.onset_speed
    first = rates_at(field, onset, begin)
    weigh_braking(field, state, first)
    two = rates_at(field, onset, begin + 0.5 * h * first.change).change
    three = rates_at(field, onset, begin + 0.5 * h * two).change
    four = rates_at(field, onset, begin + h * three).change
    end = begin + h * ((first.change + 2.0 * two + 2.0 * three + four) / 6.0)
    v, after = begin[1], end[1]
    stopped = after <= 0.0
    # Within the last step the deceleration is as good as constant.
    part = v / np.maximum(v - after, 1e-12)
    end[0] = np.where(stopped, begin[0] + 0.5 * v * h * part, end[0])
    end[1] = np.maximum(after, 0.0)
    return state._replace(motion=end), stopped


class StopEnds(NamedTuple):
    """Results of L stops (L,), shares (3, L): rear axle, lighter side and lightest wheel."""

    end: Floats  # station where the vehicle comes to rest, without safety offset [m]
    ended: Bools
    min_loads: Floats  # lowest shares of the level static loads
    even: Floats  # the same without crests

    def worst_of(self, alternative: StopEnds) -> StopEnds:
        """Of two courses of the same stops, the longer distances and the lower loads."""
        return StopEnds(
            np.maximum(self.end, alternative.end),
            self.ended & alternative.ended,
            np.minimum(self.min_loads, alternative.min_loads),
            np.minimum(self.even, alternative.even),
        )


class StopStarts(NamedTuple):
    """Beginnings of L stops, (L,); not followed further than the station ``give_up`` [m]."""

    station: Floats
    speed: Floats
    dead_time: Floats  # from the command to the brakes [s]
    give_up: float


def worst_case_stops(field: StopDynamics, starts: StopStarts) -> StopEnds:
    """Emergency stops at worst.

    Where the model says that the drive may be cut in the dead time, the longer stop is used.
    """
    held = _driven(field, starts, cut=False)
    steepest = -float(field.table[0].min())
    runs_on = steepest > field.model.terrain.rolling_while_braking
    if field.model.braking.drive_in_dead_time == "held" or not runs_on:
        return held
    return held.worst_of(_driven(field, starts, cut=True))


def nominal_stops(field: StopDynamics, starts: StopStarts) -> StopEnds:
    """Emergency stops as plans report them: speed held in the dead time, force as learned."""
    return _driven(replace(field, nominal=True), starts, cut=False)


def _driven(field: StopDynamics, starts: StopStarts, *, cut: bool) -> StopEnds:
    station, speed, dead_time, give_up = starts
    count = len(station)
    motion = np.stack((station, speed, np.zeros(count), np.zeros(count)))
    state = State(np.arange(count), motion, speed, np.full((2, 3, count), np.inf))
    if field.errors.latency > 0.0 and not field.nominal:
        # Before the command nothing cuts the drive.
        late = np.full(count, field.errors.latency)
        state, _ = coast(field, state, late, cut=False, commanded=False)
    state, early = coast(field, state, dead_time, cut=cut)
    stops = _braked(field, state, count, give_up)
    if len(early.lane):
        # Between the first and the last onset v² is, and a load is concave in it.
        loads = _braked(field, early, count, give_up)
        stops = stops._replace(
            min_loads=np.minimum(stops.min_loads, loads.min_loads),
            even=np.minimum(stops.even, loads.even),
        )
    return stops


def _braked(field: StopDynamics, state: State, count: int, give_up: float) -> StopEnds:
    """Ends of stops of some of L = ``count`` lanes whose brakes take hold; inf loads of others."""
    end, ended = np.zeros(count), np.zeros(count, np.bool_)
    min_loads = np.full((2, 3, count), np.inf)
    for _ in range(int(_MAX_STOP_TIME / TIME_STEP)):
        if len(state.lane) == 0:
            break
        state, stopped = step(field, state)
        done = stopped | (state.motion[0] > give_up)
        if done.any():
            gone = state.only(done)
            weigh_braking(field, gone, rates_at(field, gone.onset_speed, gone.motion))
            end[gone.lane], ended[gone.lane] = gone.motion[0], stopped[done]
            min_loads[..., gone.lane] = gone.min_loads
            state = state.only(~done)
    end[state.lane], min_loads[..., state.lane] = state.motion[0], state.min_loads
    return StopEnds(end, ended, *min_loads)
