"""A stop straight along an even slope, in closed form or in steps of time; numbers or symbols.

Never shorter than the stop that the model drives (:mod:`slopewise.models.stops.simulation`), nor
than the one that plans keep room for at the model's mean. It is exact where nothing acts but brakes
and grade. What has no closed form counts on the safe side:

- the drive is cut in the dead time: the speed gained in it counts from the command on, as in plans;
- brakes that fade have, from the onset on, the heat of the whole stop;
- wind comes from behind, because the heading is not an input;
- the force is the least of a surface and of the states that it may turn out to be in.

Source: Braking (2), (7), (8), (12); effects as :mod:`slopewise.models.effects.registry` says.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from slopewise.models.effects import registry
from slopewise.models.effects.effect_law import Enters
from slopewise.models.laws import braking
from slopewise.models.laws.holding import brakes_hold
from slopewise.models.laws.wheel_lockup import friction_cap, lockup_force_ratios
from slopewise.models.parameters import Braking, Effect, Model
from slopewise.models.quantity import GRAVITY
from slopewise.planner.bounds.speed_bounds import HOLDING

_STEPS = 32
"""Steps of time of a stop: drag counts by its least in each, 2 % of it too little at most."""


def choose(condition: Any, then: Any, otherwise: Any) -> Any:
    """``then`` where the condition holds, element by element; for symbols as for numbers."""
    if any(isinstance(value, ca.SX) for value in (condition, then, otherwise)):
        return ca.if_else(condition, then, otherwise)
    return np.where(condition, then, otherwise)


@dataclass(frozen=True, slots=True)
class EvenSlope:
    """One table of the braking model; speeds [m/s], grades [rad], ``extra``: ground terms [1]."""

    model: Model
    table: Braking  # braking coefficients of the surface, or of a state of it

    def trained(self, grade: Any) -> Any:
        """1 on grades that were trained, or that the model may extrapolate to; 0 elsewhere."""
        if self.table.extrapolate:
            return grade == grade
        low, high = self.table.grade_range
        return (grade >= low) * (grade <= high)

    def force(self, speed: Any, grade: Any, extra: Any, *, upper: bool = False) -> Any:
        """F_b/W of full brakes from a speed at onset: the least that it is, or the most [1].

        Above the trained speeds it counts as at their end where it would grow; with friction known,
        the axle that locks first ends it.
        """
        table, sign = self.table, 1.0 if upper else -1.0
        slope, intercept = self._line(grade)
        if table.extrapolate:
            low, high = table.grade_range
            beyond = choose((grade < low) + (grade > high), 1.0, 0.0)
            share = sign * table.extrapolation_margin * beyond
            slope, intercept = slope + share * abs(slope), intercept + share * abs(intercept)
        slow, fast = table.speed_range
        v = np.fmax(speed, slow)
        ends = slope * v, slope * np.fmin(v, fast)
        force = (np.fmax(*ends) if upper else np.fmin(*ends)) + intercept + extra
        cap = self._cap(grade, upper)
        if cap is None:
            return force
        # As plans have it: a force that slides at some trained speed is that of the weakest one.
        ends = slope * slow + intercept + extra, slope * fast + intercept + extra
        level = np.fmax(*ends) if upper else np.fmin(*ends)
        level = level if upper else np.fmin(level, force)
        return choose(np.fmax(*ends) > cap, np.fmin(level, cap), np.fmin(force, cap))

    def _cap(self, grade: Any, upper: bool) -> Any:
        """F_b/W at which an axle locks, or all wheels for the most force; None without friction."""
        friction = registry.motion(self.model.effect, self.table.sliding_friction).friction
        if not math.isfinite(friction):
            return None
        cap, v = friction_cap(grade, 0.0, friction), self.model.vehicle
        if upper or v.brake_share is None:
            return cap
        sizes = v.brake_share, friction, v.wheelbase, v.cg_x, v.cg_z
        return np.fmin(cap, np.fmin(*lockup_force_ratios(grade, 0.0, *sizes)))

    def distance(self, speed: Any, grade: Any, extra: Any) -> Any:
        """From the stop command to rest, safety offset included [m]; inf where no stop is known."""
        table, motion = self.table, registry.motion(self.model.effect)
        begin = speed + self._gain(grade)
        force = np.fmin(self.force(speed, grade, extra), self.force(begin, grade, extra))
        push, is_bounded = self._push(begin, grade)
        down = np.fmax(push - np.sin(grade), 0.0)
        full = begin + GRAVITY * down * motion.lag
        retained, stops_hot = self._unfaded(force, down, full)
        net = retained + np.sin(grade) - push
        slowing = GRAVITY * np.fmax(net, HOLDING)
        if motion.lag > 0.0 or motion.moves:
            lasts = motion.lag + full / slowing
            braked = self._in_steps(begin, lasts, retained, grade, down)
        else:
            braked = begin * begin / (2.0 * slowing)
        # Of driving backwards the model knows nothing, and a speed that is no number is not >= 0.
        ends = self.trained(grade) * is_bounded * stops_hot * (net >= HOLDING) * (speed >= 0.0)
        return choose(ends, begin * table.dead_time + braked + table.distance_offset, math.inf)

    def speed_bound(self, clear: Any, grade: Any, extra: Any) -> Any:
        """A speed whose :meth:`distance` is within ``clear`` [m], by a bound in closed form [m/s].

        At most what was trained, the limits and the wheels allow; 0 on ground that was not trained
        or on which the brakes do not stop or do not hold the vehicle.
        """
        table, lag = self.table, registry.motion(self.model.effect).lag
        cap, gain, slow = self._fastest(grade), self._gain(grade), table.speed_range[0]
        # F_b/W is linear in the speed at onset: the weaker end is weaker than all between.
        force = np.fmin(self.force(slow, grade, extra), self.force(cap + gain, grade, extra))
        push, is_bounded = self._push(cap + gain, grade)
        down = np.fmax(push - np.sin(grade), 0.0)
        gained = GRAVITY * down * lag
        retained, stops_hot = self._unfaded(force, down, cap + gain + gained)
        net = retained + np.sin(grade) - push
        slowing, dead = GRAVITY * np.fmax(net, HOLDING), table.dead_time + lag
        # No brakes at all for the time of the lag, and all of them then, is a longer stop.
        far = clear + gained * (dead - 0.5 * lag)
        full = braking.speed_of_stopping_distance(far, slowing, dead, table.distance_offset)
        speed = full - gained - gain
        stops = self.trained(grade) * is_bounded * stops_hot * (net >= HOLDING) * (speed > 0.0)
        stops = stops * (brakes_hold(self.force(slow, grade, extra), grade) >= 0.0)
        return choose(stops, choose(speed > cap, cap, speed), 0.0)

    def _line(self, grade: Any) -> tuple[Any, Any]:
        """Slope over the speed at onset [s/m] and intercept [1] of F_b/W, without ground terms."""
        table, level = self.table, self.table.share_at()
        scale = registry.force_scale(self.model.effect)
        up, rises = table.uphill or table, grade > 0.0
        slope = choose(rises, up.m_m, table.m_m) * grade + table.m_b
        intercept = choose(rises, up.b_m, table.b_m) * grade + table.b_b
        held = (1.0 - level) * self.model.terrain.rolling_while_braking
        return scale * level * slope, scale * (level * intercept + held)

    def _gain(self, grade: Any) -> Any:
        """Speed that a slope may add in the dead time with the drive cut [m/s]."""
        if self.table.drive_in_dead_time == "held":
            return 0.0 * grade
        pull = -np.sin(grade) - self.model.terrain.rolling_while_braking
        return GRAVITY * self.table.dead_time * np.fmax(pull, 0.0)

    def _fastest(self, grade: Any) -> Any:
        """Highest speed that was trained and that limits allow; by grade where there is a hull."""
        model, table = self.model, self.table
        cap = min(model.limits.speed, model.vehicle.max_wheel_speed, table.speed_range[1])
        fastest = cap + 0.0 * grade
        if table.speed_by_grade is not None and not table.extrapolate:
            corners = table.speed_by_grade
            for (first, speed), (second, next_speed) in itertools.pairwise(corners):
                rise = (next_speed - speed) / (second - first)
                fastest = np.fmin(fastest, speed + rise * (grade - first))
        return np.fmax(fastest, 0.0)

    def _drags(self, speed: Any) -> list[Any]:
        """Deceleration by each effect on the motion, straight ahead [m/s²].

        In the speed each is concave or rises, so that the least over some speeds is at their ends.
        """
        return [
            registry.motion_deceleration(
                speed, 0.0, _from_behind(effect), registry.motion([effect])
            )
            for effect in self.model.effect
            if registry.law_of(effect).enters is Enters.MOTION
        ]

    def _push(self, begin: Any, grade: Any) -> tuple[Any, Any]:
        """The most that wind pushes in a stop, over the weight, and whether the bound holds."""

        def push_at(speed: Any) -> Any:
            ends = zip(self._drags(0.0 * speed), self._drags(speed), strict=True)
            return sum((np.fmax(-np.fmin(*pair), 0.0) for pair in ends), 0.0 * speed) / GRAVITY

        lag = registry.motion(self.model.effect).lag
        fastest = begin + GRAVITY * lag * np.fmax(-np.sin(grade), 0.0)
        push = push_at(fastest)
        # While the brakes build up it pushes as well, and more the faster the vehicle is.
        fully = push_at(fastest + 2.0 * GRAVITY * lag * push)
        return fully, fully <= 2.0 * push

    def _unfaded(self, force: Any, down: Any, full: Any) -> tuple[Any, Any]:
        """F_b/W that brakes keep with the heat of the whole stop, and whether there is any such.

        F (F − d) + k e F² = F₀ (F − d): over the distance to rest speed and slope d make the heat
        e F/(F − d) of the brakes, with which F₀ falls to F.
        """
        fade = registry.motion(self.model.effect).fade
        if fade <= 0.0:
            return force, 1.0
        hot, total = 1.0 + 0.5 * fade * full * full, force + down
        root = total * total - 4.0 * hot * force * down
        retained = (total + np.sqrt(np.fmax(root, 0.0))) / (2.0 * hot)
        return np.fmin(retained, force), root >= 0.0

    def _in_steps(self, begin: Any, lasts: Any, force: Any, grade: Any, down: Any) -> Any:
        """Distance from the onset to rest with the least drag of each step of time [m].

        The build-up of the force is integrated exactly; no vehicle of this force is faster at any
        time. Within ``lasts`` [s] it stands.
        """
        lag, step = max(registry.motion(self.model.effect).lag, 1e-9), lasts / _STEPS
        brakes, speed, gone = GRAVITY * (force + np.sin(grade)), begin, 0.0 * begin
        moves, missing, decay = 1.0 + 0.0 * begin, GRAVITY * force, np.exp(-step / lag)
        for _ in range(_STEPS):
            fastest = np.fmax(speed, 0.0) + GRAVITY * down * step
            max_slowing = sum((np.fmax(drag, 0.0) for drag in self._drags(fastest)), brakes)
            slowest = np.fmax(speed - np.fmax(max_slowing, 0.0) * step, 0.0)
            ends = zip(self._drags(slowest), self._drags(fastest), strict=True)
            slowing = sum((np.fmin(*pair) for pair in ends), brakes)
            late = lag * missing * (1.0 - decay)
            after = speed - slowing * step + late
            way = (speed - 0.5 * slowing * step) * step + lag * (missing * step - late)
            in_part = (np.fmax(speed, 0.0) + 0.5 * GRAVITY * down * step) * step
            gone = gone + moves * choose(after > 0.0, way, in_part)
            moves = choose(after > 0.0, moves, 0.0)
            speed, missing = after, missing * decay
        return gone


def _from_behind(effect: Effect) -> float:
    """Heading on which the wind of an effect comes from behind [rad]."""
    values = registry.validate(effect)
    turned = math.pi if values.get("wind", 0.0) > 0.0 else 0.0
    return values.get("direction", 0.0) + turned
