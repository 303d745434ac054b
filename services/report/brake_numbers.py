"""Numbers of a brake sheet: forces, slopes and stopping distances of one surface of a model.

Distances are stops on uniform grades by :mod:`slopewise.models.stops.simulation`. Next to the mean
stands the distance that plans reserve at a quantile: the stop begins with the onset speed margin,
lower bounds of force and friction hold, the axle that locks first ends the force, and the worst
state of the surface applies. Source: Braking (7), (8), (12).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.effects import registry
from slopewise.models.effects.effect_law import Enters, Place
from slopewise.models.laws import braking
from slopewise.models.laws import responsibility_sensitive_safety as rss
from slopewise.models.laws.holding import brakes_hold
from slopewise.models.laws.tip_over import rear_share_under_braking
from slopewise.models.laws.wheel_lockup import friction_cap, lockup_force_ratios
from slopewise.models.parameters import Braking, Model
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_promise import promised
from slopewise.models.stops.simulation import MAX_STOP_TIME, GroundTrack, force_law, simulate_stop
from slopewise.planner.bounds.speed_bounds import HOLDING
from slopewise.planner.ground.uncertainty import Uncertainty

_HEADINGS = 16
"""Headings at which wind and directional effects are evaluated [1]: every 22.5°."""
_MAX_GRADE, _GRADE_STEP = np.deg2rad(45.0), np.deg2rad(0.05)
"""Steepest slope that is searched, and resolution of the result [rad]."""


@dataclass(frozen=True, slots=True)
class SteepestSlope:
    """Steepest slope as a magnitude [rad]: by the law of the force, and within trained grades."""

    law: float
    claimed: float


@dataclass(frozen=True, slots=True)
class DistanceTable:
    """Stopping distances over V speeds and G grades; inf without a stop."""

    speeds: Floats  # (V,) [m/s]
    grades: Floats  # (G,) [rad]
    mean: Floats  # (V, G) by the mean of the model [m]
    allowed: Floats  # (V, G) as plans reserve [m]
    plain: Floats  # (V,) v²/2a [m]
    rule: Floats  # (V,) responsibility-sensitive safety, which knows no grade [m]


@dataclass(frozen=True)
class BrakeNumbers:
    """One surface of a model, "" for the base, at the quantile of an uncertainty."""

    model: Model
    survive: Uncertainty
    surface: str = ""

    @cached_property
    def tables(self) -> tuple[Braking, ...]:
        """The surface, and the states in which it may be, as promised at the quantile."""
        b = promised(self.model, self.survive.quantile).braking
        return tuple(map(b.on, (self.surface, *b.states_of(self.surface))))

    @cached_property
    def _margins(self) -> tuple[tuple[Braking, Floats], ...]:
        """Tables with the (4, 4) matrix of their margin, which each speed and grade needs."""
        return tuple((table, self.survive.force_matrix(table)) for table in self.tables)

    @cached_property
    def cautious(self) -> Model:
        """The model with its effects at the ends where stops are longer."""
        return self.survive.cautious(self.model)

    @cached_property
    def yaw(self) -> float:
        """Heading on which effects make stops longest [rad]; 0 without effects."""
        if not self.model.effect:
            return 0.0
        table = self.tables[0]
        speed, grade = table.speed_range[1], table.grade_range[0]
        headings = np.linspace(-np.pi, np.pi, _HEADINGS, endpoint=False).tolist()
        return float(max(headings, key=lambda yaw: self._allowed(speed, grade, yaw)))

    @cached_property
    def dead_time(self) -> float:
        """Dead time at the quantile [s]."""
        return max(self.survive.dead_time(table) for table in self.tables)

    @cached_property
    def offset(self) -> float:
        """Safety offset in each allowed distance [m]."""
        return max(table.distance_offset for table in self.tables)

    @cached_property
    def friction(self) -> float:
        """Lower end of the friction that caps the force [1]; inf where it is not known."""
        known = [t.sliding_friction for t in self.tables if t.sliding_friction is not None]
        for effect in self.model.effect:
            if registry.law_of(effect).enters is Enters.CAP:
                ((name, mu),) = registry.validate(effect).items()
                known.append(max(mu - self.survive.margin_of(effect, name), 0.0))
        return min(known, default=math.inf)

    def mean_force(self, speed: float, grade: float) -> float:
        """F_b/W by the mean of the model, for an onset speed [m/s] and a grade [rad]."""
        table = self.tables[0]
        motion = registry.motion(self.model.effect, table.sliding_friction)
        force = force_law(self.model, table, speed)(_place(grade, 0.0))
        return min(force, motion.friction * math.cos(grade))

    def least_force(self, speed: float, grade: float) -> float:  # words: ok (JSON key)
        """Lower bound of F_b/W at the quantile, as :meth:`mean_force`."""
        return self._lower_force(speed, grade, self.yaw)

    def mean_distance(self, speed: float, grade: float) -> float:
        """Stop by the mean of the model, without safety offset [m]; inf without a stop."""
        table = self.model.braking.on(self.surface)
        force = force_law(self.model, table, speed)(_place(grade, 0.0))
        braked = _braked_distance(self.model, table, force, speed, grade, 0.0)
        return speed * table.dead_time + braked

    def allowed_distance(self, speed: float, grade: float) -> float:
        """Distance that plans reserve, safety offset included [m]; inf without a stop."""
        return self._allowed(speed, grade, self.yaw)

    def level_deceleration(self, speed: float) -> float:
        """Deceleration on level ground from an onset speed, at the quantile [m/s²]."""
        return GRAVITY * max(self.least_force(speed, 0.0), 0.0)

    def plain_distance(self, speed: float) -> float:
        """Rule v²/2a [m], without dead time and slope."""
        deceleration = max(self.level_deceleration(speed), 1e-9)
        return float(rss.rule_distance(speed, 0.0, 0.0, deceleration))

    def rule_distance(self, speed: float) -> float:
        """Rule of responsibility-sensitive safety [m], at a constant speed in the dead time."""
        deceleration = max(self.level_deceleration(speed), 1e-9)
        return float(rss.rule_distance(speed, self.dead_time, 0.0, deceleration))

    def holds(self, sign: float) -> SteepestSlope:
        """Steepest slope, uphill (+1) or downhill (−1), on which brakes and friction hold."""
        slow = self.tables[0].speed_range[0]
        return self._steepest(
            lambda grade: min(
                brakes_hold(self.least_force(slow, sign * grade), grade),
                self.friction * math.cos(grade) - math.sin(grade),
            ),
            sign,
        )

    def stops(self, sign: float) -> SteepestSlope:
        """Steepest slope, up (+1) or down (−1), on which stops from all trained speeds end."""
        ends = self.tables[0].speed_range
        return self._steepest(
            lambda grade: (
                min(self.least_force(v, sign * grade) for v in ends)
                + math.sin(sign * grade)
                - HOLDING
            ),
            sign,
        )

    def least_rear_load(self) -> float:  # words: ok (JSON key)
        """Rear load of a full stop on the steepest trained descent, a share of the level one [1].

        With the brakes as strong as they may be at the quantile.
        """
        v, grade = self.model.vehicle, self.tables[0].grade_range[0]
        margin = sum(self.survive.ground_margin(e) for e in self.model.effect)
        strongest = max(
            force_law(self.model, table, speed)(_place(grade, self.yaw))
            + self._force_margin(table, matrix, speed, grade)
            + margin
            for table, matrix in self._margins
            for speed in self.tables[0].speed_range
        )
        return float(rear_share_under_braking(grade, 0.0, strongest, v.wheelbase, v.cg_x, v.cg_z))

    def distance_table(self, speeds: Floats, grades: Floats) -> DistanceTable:
        """Distances at speeds (V,) [m/s] and grades (G,) [rad]."""
        v, g = speeds[:, None], grades[None, :]
        return DistanceTable(
            speeds,
            grades,
            np.vectorize(self.mean_distance, otypes=[float])(v, g),
            np.vectorize(self.allowed_distance, otypes=[float])(v, g),
            np.vectorize(self.plain_distance, otypes=[float])(speeds),
            np.vectorize(self.rule_distance, otypes=[float])(speeds),
        )

    @cached_property
    def sheet_table(self) -> DistanceTable:
        """Distances between both ends of the trained speeds and grades, at round values."""
        table = self.tables[0]
        low, high = np.rad2deg(table.grade_range)
        speeds = round_values(*table.speed_range, (0.25, 0.5, 1.0, 2.0, 5.0), 6)
        grades = round_values(low, high, (1.0, 2.5, 5.0, 10.0), 9)
        return self.distance_table(speeds, np.deg2rad(grades))

    def _steepest(self, margin: Callable[[float], float], sign: float) -> SteepestSlope:
        slopes = np.arange(0.0, _MAX_GRADE + _GRADE_STEP, _GRADE_STEP)
        failing = (float(slope) for slope in slopes if margin(float(slope)) < 0.0)
        law = max(next(failing, float(slopes[-1]) + _GRADE_STEP) - _GRADE_STEP, 0.0)
        low, high = self.tables[0].grade_range
        return SteepestSlope(law, min(law, max(high if sign > 0.0 else -low, 0.0)))

    def _allowed(self, speed: float, grade: float, yaw: float) -> float:
        begin = speed + self._onset_speed_margin(grade)
        force = self._lower_force(begin, grade, yaw)
        braked = max(
            _braked_distance(self.cautious, table, force, begin, grade, yaw)
            for table in self.tables
        )
        return begin * self.dead_time + braked + self.offset

    def _onset_speed_margin(self, grade: float) -> float:
        """Speed error, and gain on a descent with the drive cut in the dead time [m/s]."""
        brakes = self.model.braking
        gain = 0.0
        if brakes.drive_in_dead_time != "held":
            pull = -math.sin(grade) - self.model.terrain.rolling_while_braking
            gain = GRAVITY * max(pull, 0.0) * self.dead_time
        return self.survive.width * brakes.speed_error + gain

    def _lower_force(self, speed: float, grade: float, yaw: float) -> float:
        """Force that plans rely on: over all states, with margins, capped by friction."""
        tables = self.tables
        lines = [self._force_line(table, grade, yaw) for table in tables]
        slope, intercept = min(s for s, _ in lines), min(i for _, i in lines)
        slowest = (min if slope > 0.0 else max)(t.speed_range[0] for t in tables)
        onset = max(speed, slowest)
        fastest = max(min(t.speed_range[1] for t in tables), onset)
        # The margin is convex in the onset speed: its chord over the trained speeds is above it.
        low, high = (
            max(self._force_margin(*each, v, grade) for each in self._margins)
            for v in (slowest, fastest)
        )
        per_speed = (high - low) / max(fastest - slowest, 1e-9)
        margin = sum(self.survive.ground_margin(e) for e in self.model.effect)

        def force(v: float) -> float:
            return slope * v + intercept - low - per_speed * (v - slowest) - margin

        # Sliding at some trained speed, the force is that of the weakest one, as plans have it.
        ends, cap = (force(slowest), force(fastest)), self._force_cap(grade)
        return min(*ends, cap) if max(ends) > cap else force(onset)

    def _force_line(self, table: Braking, grade: float, yaw: float) -> tuple[float, float]:
        """Slope [s/m] and intercept [1] of F_b/W over the onset speed, effects included."""
        slow, fast = table.speed_range
        low, high = (force_law(self.cautious, table, v)(_place(grade, yaw)) for v in (slow, fast))
        slope = (high - low) / (fast - slow)
        return slope, low - slope * slow

    def _force_cap(self, grade: float) -> float:
        """F_b/W at which the first axle locks [1]."""
        if not math.isfinite(self.friction):
            return math.inf
        v, cap = self.model.vehicle, float(friction_cap(grade, 0.0, self.friction))
        if v.brake_share is None:
            return cap
        sizes = v.brake_share, self.friction, v.wheelbase, v.cg_x, v.cg_z
        return min(cap, *map(float, lockup_force_ratios(grade, 0.0, *sizes)))

    def _force_margin(self, table: Braking, matrix: Floats, speed: float, grade: float) -> float:
        """Margin of F_b/W by the coefficients at the quantile [1]."""
        speed = max(speed, table.speed_range[0])
        phi = np.array([speed * grade, grade, speed, 1.0])  # a row of `design`
        scale = registry.force_scale(self.model.effect)
        return scale * math.sqrt(float(phi @ matrix @ phi))


def _place(grade: float, yaw: float) -> dict[str, float]:
    return {"grade": grade, "roll": 0.0, "x": 0.0, "y": 0.0, "yaw": yaw}


def _braked_distance(
    model: Model, table: Braking, force: float, speed: float, grade: float, yaw: float
) -> float:
    """Distance from onset to standstill with F_b/W on a uniform grade [m]; inf without a stop.

    Without effects the deceleration is constant: closed form in place of a thousand steps.
    """
    extra = float(registry.ground_term(model.effect, Place(grade, 0.0, 0.0, 0.0, yaw, 0.0)))
    brakes = (force - extra) / registry.force_scale(model.effect)
    if brakes <= 0.0 or force + math.sin(grade) < HOLDING:
        return math.inf
    if not model.effect:
        friction = math.inf if table.sliding_friction is None else table.sliding_friction
        capped = min(force, float(friction_cap(grade, 0.0, friction)))
        deceleration = float(braking.deceleration(capped, grade))
        if deceleration * MAX_STOP_TIME <= speed:
            return math.inf
        return float(braking.stopping_distance(speed, deceleration, 0.0, 0.0))
    flat = replace(table, m_m=0.0, b_m=0.0, m_b=0.0, b_b=brakes, uphill=None, terrain={})
    constant = replace(flat, dead_time=0.0, level=1.0, dead_band=0.0, saturation=1.0)
    track = replace(GroundTrack.of_grade(grade), yaw=np.array([yaw]))
    return simulate_stop(replace(model, braking=constant), track, speed).distance


def round_values(low: float, high: float, steps: tuple[float, ...], max_count: int) -> Floats:
    """Both ends and the multiples between them of the first step that gives few enough values."""
    for step in steps:
        inner = step * np.arange(math.ceil(low / step), math.floor(high / step) + 1)
        near = np.minimum(np.abs(inner - low), np.abs(inner - high)) < 0.4 * step
        values = np.unique(np.concatenate((inner[~near], [low, high])))
        if len(values) <= max_count:
            break
    return values
