"""Numbers of a brake sheet: forces, slopes and stopping distances of one surface of a model.

Distances are stops on uniform grades by :mod:`slopewise.models.stops.simulation`. Next to the mean
stands the distance that plans reserve at a quantile: the stop begins with the onset speed margin,
and with the force that plans count on, by :mod:`slopewise.planner.bounds`. Source: Braking (7),
(8), (12).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.effects import registry
from slopewise.models.effects.effect_law import Place
from slopewise.models.laws import braking
from slopewise.models.laws import responsibility_sensitive_safety as rss
from slopewise.models.laws.holding import brakes_hold, friction_holds
from slopewise.models.laws.tip_over import rear_share_under_braking
from slopewise.models.laws.wheel_lockup import friction_cap
from slopewise.models.parameters import Braking, Model
from slopewise.models.quantity import GRAVITY
from slopewise.models.stops.simulation import MAX_STOP_TIME, GroundTrack, force_law, simulate_stop
from slopewise.planner.bounds.speed_bounds import HOLDING, speed_bounds
from slopewise.planner.ground.braking_ground import BrakingGround, ground_along
from slopewise.planner.ground.terrain_profile import BodyRows, TerrainProfile
from slopewise.planner.ground.uncertainty import Uncertainty

_HEADINGS = 16
"""Headings at which wind and directional effects are evaluated [1]: every 22.5°."""
_SLOPES = np.arange(0.0, np.deg2rad(45.05), np.deg2rad(0.05))
"""Slopes that are searched for the steepest [rad]."""


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
    def cautious(self) -> Model:
        """The model with its effects at the ends where stops are longer."""
        return self.survive.cautious(self.model)

    @cached_property
    def table(self) -> Braking:
        """The surface as promised at the quantile."""
        return self.cautious.braking.on(self.surface)

    @cached_property
    def yaw(self) -> float:
        """Heading on which effects make stops longest [rad]; 0 without effects."""
        if not self.model.effect:
            return 0.0
        speed, grade = self.table.speed_range[1], self.table.grade_range[0]
        headings = np.linspace(-np.pi, np.pi, _HEADINGS, endpoint=False).tolist()
        return float(max(headings, key=lambda yaw: self._allowed(speed, grade, yaw)))

    @cached_property
    def _level(self) -> BrakingGround:
        return self._ground(np.zeros(1), 0.0)

    @property
    def dead_time(self) -> float:
        """Dead time at the quantile [s]."""
        return float(self._level.dead_time.max())

    @property
    def offset(self) -> float:
        """Safety offset in each allowed distance [m]."""
        return float(self._level.distance_offset.max())

    @property
    def friction(self) -> float:
        """Lower end of the friction that caps the force [1]; inf where it is not known."""
        friction = self._level.friction
        return math.inf if friction is None else float(friction.min())

    def mean_force(self, speed: float, grade: float) -> float:
        """F_b/W by the mean of the model, for an onset speed [m/s] and a grade [rad]."""
        motion = registry.motion(self.model.effect, self.table.sliding_friction)
        force = force_law(self.model, self.table, speed)(_place(grade, 0.0))
        return min(force, motion.friction * math.cos(grade))

    def least_force(self, speed: float, grade: float) -> float:  # words: ok (JSON key)
        """Lower bound of F_b/W at the quantile, as :meth:`mean_force`."""
        return float(self._lower_force(speed, np.array([grade]), self.yaw)[0])

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
        force = self._lower_force(self.table.speed_range[0], sign * _SLOPES, self.yaw)
        by_friction = friction_holds(self.friction, _SLOPES, 0.0)
        return self._steepest(np.minimum(brakes_hold(force, _SLOPES), by_friction), sign)

    def stops(self, sign: float) -> SteepestSlope:
        """Steepest slope, up (+1) or down (−1), on which stops from all trained speeds end."""
        grades, ends = sign * _SLOPES, self.table.speed_range
        force = np.minimum(*(self._lower_force(v, grades, self.yaw) for v in ends))
        return self._steepest(force + np.sin(grades) - HOLDING, sign)

    def least_rear_load(self) -> float:  # words: ok (JSON key)
        """Rear load of a full stop on the steepest trained descent, a share of the level one [1].

        With the brakes as strong as they may be at the quantile.
        """
        v, (slow, fast) = self.model.vehicle, self.table.speed_range
        grade = self.table.grade_range[0]
        ground = self._ground(np.array([grade]), self.yaw)
        forces = (
            ground.upper_slope[0] * speed + ground.upper_intercept[0] for speed in (slow, fast)
        )
        strongest = float(np.maximum(*forces)[0])
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
        table = self.table
        low, high = np.rad2deg(table.grade_range)
        speeds = round_values(*table.speed_range, (0.25, 0.5, 1.0, 2.0, 5.0), 6)
        grades = round_values(low, high, (1.0, 2.5, 5.0, 10.0), 9)
        return self.distance_table(speeds, np.deg2rad(grades))

    def _steepest(self, margin: Floats, sign: float) -> SteepestSlope:
        """Steepest of all slopes up to the first where the margin is negative."""
        failing = np.flatnonzero(margin < 0.0)
        law = float(_SLOPES[max(failing[0] - 1, 0) if len(failing) else -1])
        low, high = self.table.grade_range
        return SteepestSlope(law, min(law, max(high if sign > 0.0 else -low, 0.0)))

    def _allowed(self, speed: float, grade: float, yaw: float) -> float:
        begin = speed + self._onset_speed_margin(grade)
        force = float(self._lower_force(begin, np.array([grade]), yaw)[0])
        braked = _braked_distance(self.cautious, self.table, force, begin, grade, yaw)
        return begin * self.dead_time + braked + self.offset

    def _onset_speed_margin(self, grade: float) -> float:
        """Speed error, and gain on a descent with the drive cut in the dead time [m/s]."""
        errors = self._level.errors
        pull = -math.sin(grade) - self.model.terrain.rolling_while_braking
        gain = GRAVITY * max(pull, 0.0) * self.dead_time if errors.drive_cut else 0.0
        return errors.speed + gain

    def _lower_force(self, speed: float, grades: Floats, yaw: float) -> Floats:
        """Force that plans count on from an onset speed, at grades (M,) [1]."""
        ground = self._ground(grades, yaw)
        onset = np.maximum(speed, ground.slowest[0])
        return np.asarray(ground.lower_slope[0] * onset + ground.lower_intercept[0])

    def _ground(self, grades: Floats, yaw: float) -> BrakingGround:
        """Braking on planes of grades (M,), as plans have it at the quantile."""
        planes = _planes(grades, yaw)
        ground = ground_along(planes, self.cautious, (self.surface,), uncertainty=self.survive)
        clear = np.full(len(grades), np.inf)
        return speed_bounds(planes, ground, self.cautious, clear).ground


def _planes(grades: Floats, yaw: float) -> TerrainProfile:
    """Straight paths up planes of grades (M,), all of one heading [rad]: two stations each."""
    zero = np.zeros((2, len(grades)))
    grade, ahead, left = grades + zero, math.cos(yaw) + zero, math.sin(yaw) + zero
    return TerrainProfile(
        count=np.full(len(grades), len(zero)),
        x=zero,
        y=zero,
        z=zero,
        station=zero + np.arange(2.0)[:, None],
        heading_x=ahead,
        heading_y=left,
        curvature=zero,
        grade=grade,
        sin_grade=np.sin(grade),
        sin_roll=zero,
        vertical_curvature=zero,
        known=zero == 0.0,
        surfaces=np.ones(zero.shape, np.int64),
        twist=zero.astype(np.float32),
        front=np.zeros((2, *zero.shape), np.float32),
        body=BodyRows(zero, zero, ahead, left),
    )


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
