"""Emergency stops from many places at once, integrated in time.

Dead time, at held speed or with the drive cut; then ds/dt = v, dv/dt = −g (F_b/W + sin θ) − motion
terms, with the force of the speed at onset, its build-up and its heat, by a fourth-order
Runge–Kutta scheme whose lanes are the stops of one plan. Source: Braking (2), (7), (8), (12).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from models.arrays import Bools, Floats, Ints
from models.effects import registry
from models.effects.brake_fade import kept_share
from models.laws.crest import kept_force
from models.parameters import Model
from models.quantity import GRAVITY
from services.check.brakes import Brakes
from services.check.friction import braking_cap
from services.check.ground import Ground
from services.check.line import Line
from services.check.loads import Pose, pose_of, shares_of

TIME_STEP = 0.02
"""Step of the integrator [s]; halving it moves stops by less than a millimetre."""

_LONGEST = 60.0  # [s] of a stop


class Stops(NamedTuple):
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

    def worst_of(self, other: Stops) -> Stops:
        """Of two ways in which the same stops may go, the longer way and the lesser loads."""
        least = (np.minimum(a, b) for a, b in zip(self[2:], other[2:], strict=True))
        return Stops(np.maximum(self.end, other.end), self.ended & other.ended, *least)


class _Here(NamedTuple):
    """What L vehicles meet where they are; arrays are (L,)."""

    sample: Ints
    share: Floats
    pose: Pose
    curvature: Floats
    yaw: Floats
    friction: Floats


@dataclass(frozen=True)
class StopField:
    """Everything that decides a stop along one line of M samples.

    ``as_learned`` leaves out what the ground takes beyond the model file: turns, banks and locked
    axles of friction, crests that no effect names. Plans tell such stopping distances.
    """

    model: Model
    brakes: Brakes
    station: Floats
    table: Floats
    motion: registry.MotionTerms
    crest_share: float | None
    as_learned: bool = False

    @classmethod
    def along(cls, model: Model, line: Line, ground: Ground, brakes: Brakes) -> StopField:
        """Collect it."""
        pose = pose_of(ground.grade, ground.roll, ground.bend, line.curvature)
        table = np.stack((*pose, line.curvature, line.heading, brakes.friction), axis=1)
        return cls(
            model, brakes, ground.station, table, registry.motion(model.effect),
            registry.crest_share(model.effect),
        )  # fmt: skip

    def at(self, s: Floats) -> _Here:
        """Linear between samples; as at the first and the last beyond them."""
        k = np.searchsorted(self.station, s, "right") - 1
        k = np.minimum(np.maximum(k, 0), len(self.station) - 2)
        share = (s - self.station[k]) / (self.station[k + 1] - self.station[k])
        share = np.minimum(np.maximum(share, 0.0), 1.0)
        row = self.table[k]
        row += share[:, None] * (self.table[k + 1] - row)
        return _Here(k, share, Pose(*row[:, :5].T), row[:, 5], row[:, 6], row[:, 7])

    def force(self, here: _Here, onset_speed: Floats, *, most: bool = False) -> Floats:
        """F_b/W that is wanted, before build-up, heat, friction and crests."""
        ends = [self._force_at(here.sample + i, onset_speed, most) for i in (0, 1)]
        force: Floats = ends[0] + here.share * (ends[1] - ends[0])
        return force

    def _force_at(self, sample: Ints, onset_speed: Floats, most: bool) -> Floats:
        b = self.brakes
        part = b._replace(
            on=b.on[:, sample], slope=b.slope[:, sample], intercept=b.intercept[:, sample],
            spare=b.spare[:, sample], fastest=b.fastest[sample], extra=b.extra[sample],
        )  # fmt: skip
        return part.force(onset_speed, most=most)

    def deceleration(
        self, here: _Here, speed: Floats, force: Floats, heat: Floats, *, most: bool = False
    ) -> tuple[Floats, Floats]:
        """Deceleration [m/s²], and the force that is left of a force that has built up."""
        force = force * kept_share(np.maximum(heat, 0.0), self.motion.fade, self.motion.fade_tau)
        cap = here.friction * here.pose.upright
        if not self.as_learned:
            cap = braking_cap(self.model.vehicle, here.pose, here.friction, speed * speed)
        force = np.minimum(force, cap)
        if not most:
            force = force * self._kept_over_crests(here.pose, speed)
        extra = 0.0
        if self.motion.moves:
            extra = registry.motion_deceleration(speed, here.curvature, here.yaw, self.motion)
        return GRAVITY * (force + here.pose.sine) + extra, force

    def _kept_over_crests(self, pose: Pose, speed: Floats) -> Floats:
        """As the effect of the model says; else the force falls as the normal force does."""
        if self.crest_share is not None:
            kept: Floats = kept_force(speed, pose.bend, self.crest_share)
            return kept
        if self.as_learned:
            return np.ones_like(speed)
        lost = np.maximum(-pose.bend, 0.0) * speed * speed / (GRAVITY * pose.upright)
        return np.maximum(1.0 - lost, 0.0)


class _Lanes:
    """Stops under way: state of those that still move, and what was seen of all."""

    def __init__(self, field: StopField, station: Floats, speed: Floats) -> None:
        count = len(station)
        self.field = field
        self.moving = np.arange(count)
        self.s, self.v = station.copy(), speed.copy()
        self.onset_speed = speed.copy()
        self.f, self.q = np.zeros(count), np.zeros(count)
        self.least = np.full((6, count), np.inf)
        self.end, self.ended = station.copy(), np.zeros(count, np.bool_)
        two_sided = len(field.brakes.on) > 1 or bool(field.brakes.spare.any())
        self.two_sided = two_sided or bool((field.table[:, 3] < 0.0).any())

    def rates(
        self, s: Floats, v: Floats, f: Floats, q: Floats
    ) -> tuple[Floats, Floats, Floats, _Here]:
        """Deceleration, growth of the built-up force, growth of the heat, and where that is."""
        field, motion = self.field, self.field.motion
        here, v = field.at(s), np.maximum(v, 0.0)
        wanted = field.force(here, self.onset_speed)
        decel, force = field.deceleration(here, v, f if motion.lag > 0.0 else wanted, q)
        growth = (wanted - f) / motion.lag if motion.lag > 0.0 else 0.0 * f
        heating = GRAVITY * np.maximum(force, 0.0) * v - q / motion.fade_tau
        return decel, growth, heating, here

    def weigh(self, here: _Here, decel: Floats, *, braking: bool) -> None:
        """Note the loads where the vehicles are now."""
        field, v = self.field, np.maximum(self.v, 0.0)
        if braking and self.two_sided:
            force = field.force(here, self.onset_speed, most=True)
            decel = np.maximum(decel, field.deceleration(here, v, force, 0.0 * v, most=True)[0])
        for first, crest in ((0, True), (3, False)):
            shares = shares_of(field.model.vehicle, here.pose, v * v, decel, crest=crest)
            for i, share in enumerate((shares.rear, shares.side, shares.wheel), start=first):
                self.least[i, self.moving] = np.minimum(self.least[i, self.moving], share)

    def coast(self, time: Floats, *, cut: bool) -> None:
        """The dead times (L,) at held speed; or with the drive cut, faster where that is downhill.

        Motion resistance is all that holds it then; that it slows on other ground is not counted.
        """
        field, resistance = self.field, self.field.model.terrain.motion_resistance
        steps = max(int(np.ceil(float(time.max(initial=0.0)) / TIME_STEP)), 1)
        h = time / steps
        for _ in range(steps):
            here = field.at(self.s)
            growth = np.zeros_like(h)
            if cut:
                middle = field.at(self.s + 0.5 * h * self.v).pose
                growth = GRAVITY * np.maximum(-middle.sine - resistance, 0.0)
            self.weigh(here, -growth, braking=False)
            self.s += h * (self.v + 0.5 * h * growth)
            self.v += h * growth
        self.weigh(field.at(self.s), np.zeros_like(h), braking=False)
        self.onset_speed = self.v.copy()

    def brake(self, give_up: float) -> None:
        """One step of all that still move; those that come to rest, or go too far, are done."""
        h, b = TIME_STEP, 0.5 * TIME_STEP
        s, v, f, q = self.s, self.v, self.f, self.q
        a1, f1, q1, here = self.rates(s, v, f, q)
        self.weigh(here, a1, braking=True)
        v2 = v - b * a1
        a2, f2, q2, _ = self.rates(s + b * v, v2, f + b * f1, q + b * q1)
        v3 = v - b * a2
        a3, f3, q3, _ = self.rates(s + b * v2, v3, f + b * f2, q + b * q2)
        v4 = v - h * a3
        a4, f4, q4, _ = self.rates(s + h * v3, v4, f + h * f3, q + h * q3)
        after = v - h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
        rests = after <= 0.0
        # Within the last step the deceleration is as good as constant.
        part = np.where(rests, v / np.maximum(v - after, 1e-12), 1.0)
        ahead = np.where(rests, 0.5 * v * h * part, h * (v + 2.0 * v2 + 2.0 * v3 + v4) / 6.0)
        self.s, self.v = s + ahead, np.maximum(after, 0.0)
        self.f = f + h * (f1 + 2.0 * f2 + 2.0 * f3 + f4) / 6.0
        self.q = q + h * (q1 + 2.0 * q2 + 2.0 * q3 + q4) / 6.0
        done = rests | (self.s > give_up)
        if done.any():
            if rests.any():
                self._weigh_at_rest(rests, a4)
            gone = self.moving[done]
            self.end[gone], self.ended[gone] = self.s[done], rests[done]
            for name in ("moving", "s", "v", "f", "q", "onset_speed"):
                setattr(self, name, getattr(self, name)[~done])

    def _weigh_at_rest(self, rests: Bools, decel: Floats) -> None:
        kept = {n: getattr(self, n) for n in ("moving", "s", "v", "onset_speed")}
        for name, values in kept.items():
            setattr(self, name, values[rests])
        self.weigh(self.field.at(self.s), decel[rests], braking=True)
        for name, values in kept.items():
            setattr(self, name, values)


def stops_from(
    field: StopField, station: Floats, speed: Floats, dead_time: Floats, give_up: float
) -> Stops:
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
) -> Stops:
    """Emergency stops as plans tell them: speed held in the dead time, force as learned."""
    learned = replace(field, as_learned=True)
    return _driven(learned, station, speed, dead_time, give_up, False)


def _driven(
    field: StopField, station: Floats, speed: Floats, dead_time: Floats, give_up: float, cut: bool
) -> Stops:
    lanes = _Lanes(field, station, speed)
    lanes.coast(dead_time, cut=cut)
    for _ in range(int(_LONGEST / TIME_STEP)):
        if len(lanes.moving) == 0:
            break
        lanes.brake(give_up)
    lanes.end[lanes.moving] = lanes.s
    return Stops(lanes.end, lanes.ended, *lanes.least)
