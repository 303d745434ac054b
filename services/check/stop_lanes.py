"""Many emergency stops of one plan under way at once: dead time, and steps of the brakes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.quantity import GRAVITY
from slopewise.services.check.loads import shares_of
from slopewise.services.check.stop_field import Here, StopField

TIME_STEP = 0.02
"""Step of the integrator [s]; halving it moves stops by less than a millimetre."""


class Rates(NamedTuple):
    """Where L vehicles are, and how their state changes; arrays are (L,)."""

    here: Here
    wanted: Floats
    decel: Floats
    growth: Floats
    heating: Floats


class State(NamedTuple):
    """What L stops under way are at; arrays are (L,), the last (6, L).

    Attributes:
        lane: which stop it is. s, v: [m], [m/s]. onset_speed: when the brakes take hold [m/s].
        force: that has built up. heat: of the brakes [J/kg]. time: the dead time [s].
        least: rear, side and wheel shares so far, and the same without what crests take.
    """

    lane: Ints
    s: Floats
    v: Floats
    onset_speed: Floats
    force: Floats
    heat: Floats
    time: Floats
    least: Floats

    def only(self, kept: Bools) -> State:
        """Some of them."""
        return State._make(values[..., kept] for values in self)


def rates_at(field: StopField, state: State, s: Floats, v: Floats, f: Floats, q: Floats) -> Rates:
    motion, v = field.motion, np.maximum(v, 0.0)
    here = field.at(s)
    wanted = field.force(here, state.onset_speed)
    decel, force = field.deceleration(here, v, f if motion.lag > 0.0 else wanted, q)
    growth = (wanted - f) / motion.lag if motion.lag > 0.0 else 0.0 * f
    heating = GRAVITY * np.maximum(force, 0.0) * v - q / motion.fade_tau
    return Rates(here, wanted, decel, growth, heating)


def _weigh(field: StopField, state: State, here: Here, decel: Floats) -> None:
    """Note the loads where the vehicles are now; a crest takes the same of all of them."""
    speed_sq = state.v * state.v
    shares = shares_of(field.model.vehicle, here.pose, speed_sq, decel, crest=False)
    lost = np.maximum(-here.pose.bend, 0.0) * speed_sq / GRAVITY
    for i, even in enumerate((shares.rear, shares.side, shares.wheel)):
        np.minimum(state.least[i], even - lost, out=state.least[i])
        np.minimum(state.least[i + 3], even, out=state.least[i + 3])


def weigh_braking(field: StopField, state: State, rates: Rates) -> None:
    """Loads count for the most force that there may be."""
    wanted = rates.wanted
    if field.two_sided:
        wanted = field.force(rates.here, state.onset_speed, most=True)
    most, _ = field.deceleration(rates.here, state.v, wanted, np.zeros_like(state.v), most=True)
    _weigh(field, state, rates.here, np.maximum(rates.decel, most))


def coast(field: StopField, state: State, *, cut: bool) -> State:
    """The dead times at held speed; or with the drive cut, faster where that is downhill.

    Motion resistance is all that holds it then; that it slows on other ground is not counted.
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


def step(field: StopField, state: State) -> tuple[State, Bools]:
    """One step of the brakes, and which come to rest in it."""
    h, b = TIME_STEP, 0.5 * TIME_STEP
    s, v, f, q = state.s, state.v, state.force, state.heat
    one = rates_at(field, state, s, v, f, q)
    weigh_braking(field, state, one)
    v2 = v - b * one.decel
    two = rates_at(field, state, s + b * v, v2, f + b * one.growth, q + b * one.heating)
    v3 = v - b * two.decel
    three = rates_at(field, state, s + b * v2, v3, f + b * two.growth, q + b * two.heating)
    v4 = v - h * three.decel
    four = rates_at(field, state, s + h * v3, v4, f + h * three.growth, q + h * three.heating)

    def mean(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
        return (a + 2.0 * b + 2.0 * c + d) / 6.0

    after = v - h * mean(one.decel, two.decel, three.decel, four.decel)
    rests = after <= 0.0
    # Within the last step the deceleration is as good as constant.
    part = np.where(rests, v / np.maximum(v - after, 1e-12), 1.0)
    ahead = np.where(rests, 0.5 * v * h * part, h * mean(v, v2, v3, v4))
    after_step = state._replace(
        s=s + ahead,
        v=np.maximum(after, 0.0),
        force=f + h * mean(one.growth, two.growth, three.growth, four.growth),
        heat=q + h * mean(one.heating, two.heating, three.heating, four.heating),
    )
    return after_step, rests
