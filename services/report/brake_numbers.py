"""What the brakes of a model can do, stop by stop on even slopes: the numbers of a brake sheet.

Every distance is a stop of :mod:`slopewise.models.stops.simulation` with the laws and effects of
the model; beside its mean stands what plans count on at a quantile: force and dead time at their
lower ends, the drive cut where that is longer, the worst state of the surface, the safety offset.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from slopewise.models.calibration.force_fit import design
from slopewise.models.effects import registry
from slopewise.models.effects.effect_law import Place
from slopewise.models.laws.holding import brakes_hold
from slopewise.models.laws.tip_over import rear_share_under_braking
from slopewise.models.parameters import Braking, Model
from slopewise.models.quantity import GRAVITY
from slopewise.models.stops.simulation import force_ratio
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.services.report.even_stop import even_stop

_HEADINGS = 16
_STEEPEST = np.deg2rad(45.0)
_FINE = np.deg2rad(0.05)
_LEAST = 0.01
"""Of the weight: less than that, net of the slope, is called no stop."""


@dataclass(frozen=True, slots=True)
class SteepestSlope:
    """How steep a slope may be, as a size >= 0 [rad].

    Attributes:
        law: by the law of the force, 0 if none. claimed: the same within the trained grades.
    """

    law: float
    claimed: float


@dataclass(frozen=True)
class BrakeNumbers:
    """One surface of a model; V speeds and G grades.

    Attributes:
        model: to tell of. survive: what its numbers at the quantile survive.
        surface: name, "" for the base.
    """

    model: Model
    survive: Uncertainty
    surface: str = ""

    @cached_property
    def tables(self) -> tuple[Braking, ...]:
        """The surface and the states that it may turn out to be in."""
        b = self.model.braking
        return tuple(b.on(n) if n else b for n in (self.surface, *b.states_of(self.surface)))

    @cached_property
    def cautious(self) -> Model:
        """The model with its effects where the vehicle stops later."""
        return self.survive.cautious(self.model)

    @cached_property
    def yaw(self) -> float:
        """Heading on which effects make stops longest [rad]; 0 without effects."""
        if not self.model.effect:
            return 0.0
        on = self.tables[0]
        case = on.speed_range[1], on.grade_range[0]
        headings = np.linspace(-np.pi, np.pi, _HEADINGS, endpoint=False)
        longest = [self._stop(self.cautious, on, *case, float(h), True) for h in headings]
        return float(headings[int(np.argmax(longest))])

    @cached_property
    def dead_time(self) -> float:
        """Dead time that is rarely exceeded [s]."""
        return max(self.survive.dead_time(on) for on in self.tables)

    @cached_property
    def offset(self) -> float:
        """Safety offset in each distance at the quantile [m]."""
        return max(on.distance_offset for on in self.tables)

    def mean_force(self, speed: float, grade: float) -> float:
        """F_b/W by the model's mean, of a speed at onset [m/s] and a grade [rad]."""
        on = self.tables[0]
        force = self._force(self.model, on, speed, grade, 0.0)
        return min(force, _friction(self.model, on) * math.cos(grade))

    def least_force(self, speed: float, grade: float) -> float:
        """F_b/W that stops rarely fall short of, as :meth:`mean_force`."""
        model = self.cautious
        return min(
            min(
                self._force(model, on, speed, grade, self.yaw) - self._margin(on, speed, grade),
                _friction(model, on) * math.cos(grade),
            )
            for on in self.tables
        )

    def mean_distance(self, speed: float, grade: float) -> float:
        """Stop by the model's mean, without safety offset [m]; inf if it does not stop."""
        return self._stop(self.model, self.tables[0], speed, grade, 0.0, False)

    def allowed_distance(self, speed: float, grade: float) -> float:
        """Stop that is rarely longer, safety offset included [m]; inf if it may not stop."""
        return max(
            self._stop(self.cautious, on, speed, grade, self.yaw, True) for on in self.tables
        )

    def level_deceleration(self, speed: float) -> float:
        """On level ground from a speed at onset, at the quantile [m/s²]."""
        return GRAVITY * max(self.least_force(speed, 0.0), 0.0)

    def holds(self, sign: float) -> SteepestSlope:
        """Steepest slope, uphill (+1) or downhill (−1), on which brakes and friction hold."""
        slow = self.tables[0].speed_range[0]
        friction = min(_friction(self.cautious, on) for on in self.tables)
        return self._steepest(
            lambda g: min(
                brakes_hold(self.least_force(slow, sign * g), g),
                friction * math.cos(g) - math.sin(g) if math.isfinite(friction) else math.inf,
            ),
            sign,
        )

    def stops(self, sign: float) -> SteepestSlope:
        """Steepest slope on which a stop from each trained speed ends."""
        ends = self.tables[0].speed_range
        return self._steepest(
            lambda g: (
                min(self.least_force(v, sign * g) + math.sin(sign * g) for v in ends) - _LEAST
            ),
            sign,
        )

    def least_rear_load(self) -> float:
        """Least rear load of a full stop on the steepest trained descent, a share of the level one.

        The brakes as strong as they may be at the quantile.
        """
        v, on = self.model.vehicle, self.tables[0]
        grade = on.grade_range[0]
        strongest = max(
            self._force(self.model, t, speed, grade, self.yaw) + self._margin(t, speed, grade)
            for t in self.tables
            for speed in on.speed_range
        )
        return float(rear_share_under_braking(grade, 0.0, strongest, v.wheelbase, v.cg_x, v.cg_z))

    def _steepest(self, spare: Callable[[float], float], sign: float) -> SteepestSlope:
        slopes = np.arange(0.0, _STEEPEST + _FINE, _FINE)
        fails = (float(g) for g in slopes if spare(float(g)) < 0.0)
        law = max(next(fails, float(slopes[-1]) + _FINE) - _FINE, 0.0)
        low, high = self.tables[0].grade_range
        return SteepestSlope(law, min(law, max(high if sign > 0.0 else -low, 0.0)))

    def _force(self, model: Model, on: Braking, speed: float, grade: float, yaw: float) -> float:
        place = {"grade": grade, "roll": 0.0, "x": 0.0, "y": 0.0, "yaw": yaw}
        return force_ratio(model, on, place, speed)

    def _margin(self, on: Braking, speed: float, grade: float) -> float:
        """What the quantile takes of F_b/W."""
        phi = design(np.array([max(speed, on.speed_range[0])]), np.array([grade]))[0]
        scale = registry.force_scale(self.model.effect)
        learned = scale * math.sqrt(float(phi @ self.survive.force_matrix(on) @ phi))
        return learned + sum(self.survive.ground_margin(e) for e in self.model.effect)

    def _stop(
        self, model: Model, on: Braking, speed: float, grade: float, yaw: float, at_quantile: bool
    ) -> float:
        dead, drift, offset, margin = on.dead_time, 0.0, 0.0, 0.0
        if at_quantile:
            dead, offset = self.survive.dead_time(on), on.distance_offset
            if on.drive_in_dead_time != "held":
                pull = -math.sin(grade) - model.terrain.motion_resistance
                drift = GRAVITY * max(pull, 0.0)
        onset = speed + drift * dead
        if at_quantile:
            margin = self._margin(on, onset, grade)
        force = self._force(model, on, onset, grade, yaw) - margin
        extra = registry.ground_term(model.effect, Place(grade, 0.0, 0.0, 0.0, yaw, 0.0))
        own = (force - float(extra)) / registry.force_scale(model.effect)
        if own <= 0.0 or force + math.sin(grade) < _LEAST:
            return math.inf
        braked = even_stop(model, on, own, onset, grade, yaw)
        return speed * dead + 0.5 * drift * dead * dead + braked + offset


def _friction(model: Model, on: Braking) -> float:
    """What caps the force on level ground [1]; inf where it is not known."""
    return registry.motion(model.effect, on.sliding_friction).friction
