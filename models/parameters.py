"""Everything one model file holds: vehicle, braking, terrain, limits and named effects.

Frozen and validated once at the door, so that no law has to check again. Optional keys are marked
by a default; physical constants of a vehicle have none.
"""

from __future__ import annotations

import copyreg
import dataclasses
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from slopewise.models.errors import ParameterError
from slopewise.models.input_errors import Tracking
from slopewise.models.quantity import (
    Matrix,
    Quantities,
    non_negative,
    positive,
    quantity,
    validate_angles,
    validate_covariance,
    validate_quantities,
    validate_range,
)
from slopewise.models.steering import Steering, SteeringGeometry, steering_geometry
from slopewise.models.stop_distance import StopDistance
from slopewise.models.surface_braking import SurfaceBraking, UphillBraking, validate_hull
from slopewise.models.surface_names import states_of
from slopewise.models.typed_arguments import check_fields
from slopewise.models.vehicle import Vehicle


def _read_only(mapping: dict[str, object]) -> MappingProxyType[str, object]:
    return MappingProxyType(mapping)


# Models are copied and sent to other processes; Python does neither with a read-only mapping.
copyreg.pickle(MappingProxyType, lambda mapping: (_read_only, (dict(mapping),)))

_DEFAULT_DEVIATION_SHARE = 0.25
"""How far from a given path a plan may lead, as a share of the vehicle's width: paths are seldom
given through gaps that are less than half as wide again as the vehicle [1]."""

_MIN_DEFAULT_DEVIATION = 0.05
"""The same at least: noise of a path and rounding of its corners [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Braking:
    """The empirical braking model of one vehicle. Source: Braking (7), (8), (11), (12).

    F_b/W = (m_m v_i + b_m) θ + (m_b v_i + b_b), dimensionless, with θ the grade (uphill positive)
    and v_i the speed at brake onset. The sign of the slope coefficients is learned, not assumed.

    Attributes:
        speed_range: lowest and highest onset speed that the coefficients were learned on [m/s].
        grade_range: likewise the grades [rad], uphill positive.
        roll_range: likewise the rolls [rad], left side up positive; by default as far to
            either side as the steeper end of ``grade_range``.
        speed_by_grade: corners (grade [rad], highest speed [m/s]) of what was driven, concave over
            the grade; by default every speed of ``speed_range`` was driven on every grade.
        covariance: of m_m, b_m, m_b, b_b, in their units; exact by default.
        drive_in_dead_time: what the drive does between stop command and onset: the speed is held,
            or the drive is cut and the vehicle rolls; of either, the longer stop counts.
        extrapolate: plan on ground steeper than trained, with a margin, instead of not at all.
        distance: allowed over predicted stop distances; where it is given, it and not the
            covariance and the scatter is what plans at a quantile allow.
        uphill: m_m and b_m that hold uphill instead. terrain: surfaces that differ, by name.
    """

    m_m: float = quantity(
        "s/m", "Change of the slope coefficient with speed at onset.", (-3.0, 3.0)
    )
    b_m: float = quantity("1", "Slope coefficient at rest.", (-5.0, 5.0))
    m_b: float = quantity(
        "s/m", "Change of the level-ground force with speed at onset.", (-0.5, 0.5)
    )
    b_b: float = quantity(
        "1", "Force on level ground at rest, as a share of the weight.", (0.02, 1.5)
    )
    dead_time: float = non_negative("s", "From stop command to onset.", (0.0, 10.0), at_most=10.0)
    distance_offset: float = non_negative("m", "Safety offset s_offset.", (0.0, 20.0), default=0.0)
    time_offset: float = non_negative(
        "s", "Safety offset t_offset of stopping times; bounds none.", (0.0, 50.0), default=0.0
    )
    speed_range: tuple[float, float]
    grade_range: tuple[float, float]
    roll_range: tuple[float, float] | None = None
    speed_by_grade: Matrix | None = None
    covariance: Matrix | None = None
    force_std: float = non_negative(
        "1", "Scatter of F_b/W from stop to stop that the model leaves.", (0.0, 1.0), default=0.0
    )
    force_scatter: float = non_negative(
        "1",
        "The part of that scatter that is in proportion, as a share of F_b/W.",
        (0.0, 2.0),
        default=0.0,
    )
    dead_time_std: float = non_negative("s", "Scatter of the dead time.", (0.0, 5.0), default=0.0)
    speed_error: float = non_negative(
        "m/s",
        "Standard deviation of the driven speed around the planned one.",
        default=0.0,
        at_most=5.0,
    )
    drive_in_dead_time: Literal["held", "cut", "either"] = "either"
    sliding_friction: float | None = positive(
        "1", "Friction of locked wheels; caps the force.", (0.02, 2.0), default=None
    )
    level: float = positive("1", "Share of full brake application.", default=1.0, at_most=1.0)
    dead_band: float = non_negative(
        "1", "Application up to which the brakes do nothing.", default=0.0, at_most=0.9
    )
    saturation: float = positive(
        "1", "Application from which they do all they can.", default=1.0, at_most=1.0
    )
    uphill: UphillBraking | None = None
    distance: StopDistance | None = None
    extrapolate: bool = False
    extrapolation_margin: float = non_negative(
        "1", "Share of the force given up where it extrapolates.", default=0.3, at_most=1.0
    )
    terrain: MappingProxyType[str, SurfaceBraking] | dict[str, SurfaceBraking] = field(
        default_factory=dict
    )

    def __post_init__(self) -> None:
        validate_quantities(self)
        validate_range("speed_range", self.speed_range)
        validate_angles("grade_range", self.grade_range)
        if self.roll_range is not None:
            validate_angles("roll_range", self.roll_range)
        validate_hull("speed_by_grade", self.speed_by_grade)
        if self.speed_range[0] < 0.0:
            raise ParameterError("speed_range", f"speeds >= 0, got {self.speed_range[0]:g}")
        validate_covariance("covariance", self.covariance, 4)
        if not self.dead_band < self.saturation:
            expected = f"more than the dead band of {self.dead_band:g}, got {self.saturation:g}"
            raise ParameterError("saturation", expected)
        if not self.level_force(self.speed_range[0]) > 0.0:
            raise ParameterError(
                "b_b", "brakes that slow the vehicle on level ground, m_b v + b_b > 0"
            )
        object.__setattr__(self, "terrain", MappingProxyType(dict(self.terrain)))
        for name in self.terrain:
            try:
                self.on(name)
            except ParameterError as error:
                raise ParameterError(f"terrain.{name}.{error.field}", error.expected) from None
            of = self.terrain[name].state_of
            if of and (of not in self.terrain or of == name):
                expected = f'"" for the base or another surface of the file, got "{of}"'
                raise ParameterError(f"terrain.{name}.state_of", expected)

    @property
    def coefficients(self) -> tuple[float, float, float, float]:
        """Coefficients m_m [s/m], b_m [1], m_b [s/m], b_b [1]."""
        return self.m_m, self.b_m, self.m_b, self.b_b

    @property
    def trained_roll(self) -> tuple[float, float]:
        """Rolls that stops were learned on [rad]; as far as the grades by default."""
        if self.roll_range is not None:
            return self.roll_range
        widest = max(abs(self.grade_range[0]), abs(self.grade_range[1]))
        return -widest, widest

    def level_force(self, onset_speed: float) -> float:
        """F_b/W on level ground, without brake level or effects."""
        return self.m_b * onset_speed + self.b_b

    def share_at(self, level: float | None = None) -> float:
        """Share of the full force at an application, that of the file by default.

        Linear between dead band and saturation.
        """
        applied = self.level if level is None else level
        share = (applied - self.dead_band) / (self.saturation - self.dead_band)
        return min(max(share, 0.0), 1.0)

    def states_of(self, surface: str) -> tuple[str, ...]:
        """Names of the states that a surface may turn out to be in; "" is the base."""
        return states_of(self.terrain, surface)

    def on(self, surface: str) -> Braking:
        """The braking model on a named surface; the base for "" and for one without a table."""
        if not surface:
            return self
        table = self.terrain.get(surface)
        return dataclasses.replace(self, terrain={}, **({} if table is None else table.given))


@dataclass(frozen=True, slots=True, kw_only=True)
class Terrain(Quantities):
    """Wheel-terrain interaction on the ground driven now. Source: Slip, Table 2."""

    motion_resistance: float = non_negative(
        "1", "Coefficient f_r that the drive has to overcome.", (0.0, 1.0)
    )
    braking_resistance: float | None = non_negative(
        "1",
        "The f_r that slows the vehicle with its drive cut, and counts as part of the braking "
        "force at a level below 1; motion_resistance by default or if higher.",
        (0.0, 1.0),
        default=None,
    )
    lateral_resistance: float = non_negative("1", "Coefficient μ_t.", (0.0, 1.5))
    slip_track: float = positive("m", "Slip track B_s, at least the track width.", (0.05, 50.0))

    @property
    def rolling_while_braking(self) -> float:
        """The f_r that slows without the drive, alone or, Braking (6), under part brakes [1]."""
        share = self.braking_resistance
        return self.motion_resistance if share is None else min(share, self.motion_resistance)


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits(Quantities):
    """Limits of plans on the vehicle and its load."""

    speed: float = positive("m/s", "Highest planned speed.", (0.01, 40.0))
    accel: float = positive("m/s²", "Highest planned acceleration.", (0.01, 12.0))
    decel: float = positive("m/s²", "Highest planned (service) deceleration.", (0.01, 12.0))
    jerk: float = positive("m/s³", "Highest planned change of acceleration.", (0.01, 1000.0))
    lateral_accel: float = positive(
        "m/s²", "Highest lateral acceleration in turns, the bank counted in.", (0.01, 15.0)
    )
    vertical_accel: float = positive(
        "m/s²",
        "Highest vertical acceleration of the body on rough ground and in dips.",
        (0.1, 100.0),
        default=5.0,
    )
    min_load: float = positive(
        "1",
        "Share of its level static load every axle and side must keep.",
        (1e-3, 0.9),
        at_most=0.9,
    )
    max_path_deviation: float | None = positive(
        "m",
        "Largest distance between a given path and the planned line; a quarter of the "
        "vehicle's width, 0.05 m at least, by default.",
        (1e-3, 5.0),
        default=None,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """One named effect with its parameters; :mod:`slopewise.models.effects.registry` knows what
    they mean.
    """

    name: str
    parameters: dict[str, float]
    covariance: Matrix | None = None
    source: str = ""

    def __post_init__(self) -> None:
        validate_covariance("covariance", self.covariance, len(self.parameters))
        # Kernels are compiled for floats; an int would cause another compilation.
        floats = {k: float(v) for k, v in self.parameters.items() if type(v) is int}
        object.__setattr__(self, "parameters", MappingProxyType({**self.parameters, **floats}))


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """One model file: what the planner needs to know of one vehicle on its ground."""

    name: str
    vehicle: Vehicle
    braking: Braking
    terrain: Terrain
    limits: Limits
    steering: Steering | None = None
    tracking: Tracking | None = None
    effect: tuple[Effect, ...] = ()

    @property
    def max_path_deviation(self) -> float:
        """Largest distance between a given path and the planned line [m]."""
        given = self.limits.max_path_deviation
        if given is not None:
            return given
        return max(_DEFAULT_DEVIATION_SHARE * self.vehicle.shape.width, _MIN_DEFAULT_DEVIATION)

    @property
    def front(self) -> float:
        """End of the body ahead of the reference point [m]."""
        return self.vehicle.shape.front + self.steering_geometry.body_offset

    @property
    def steering_geometry(self) -> SteeringGeometry:
        """How the vehicle turns; keys omitted in the file follow its drive."""
        return steering_geometry(self.steering, self.vehicle.drive, self.vehicle.wheelbase)

    def __post_init__(self) -> None:
        check_fields(self)
        drive = self.vehicle.drive
        if self.steering is not None:
            skids = self.steering.kind == "skid_steer"
            if skids != (drive == "skid_steer"):
                raise ParameterError(
                    "steering.kind",
                    f"a kind that fits vehicle.drive = '{drive}', got '{self.steering.kind}'",
                )
        if self.terrain.slip_track < self.vehicle.track_width:
            raise ParameterError(
                "terrain.slip_track",
                f"at least the track width of {self.vehicle.track_width:g} m, "
                f"got {self.terrain.slip_track:g}",
            )
