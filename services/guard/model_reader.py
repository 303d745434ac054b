"""The guard's own reader of model files: only what a stop needs, the worst of what is left open.

A key that may change a stop and that is not known here is an error: a guard that leaves out a part
of a model guards another vehicle.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.effects import registry
from slopewise.models.errors import InputError, ParameterError
from slopewise.models.parameters import Effect
from slopewise.models.plausibility import check_plausible

SPREAD = 2.0
"""Standard deviations by which force and dead time may be worse from stop to stop."""

NO_LIMIT = 1e6
_SIZES = ("mass", "wheelbase", "track_width", "cg_x", "cg_z", "wheel_radius", "max_wheel_speed")
_VEHICLE = {
    *_SIZES,
    "drive",
    "max_drive_force",
    "max_drive_power",
    "motor_torque_constant",
    "gear_ratio",
    "idle_current",
    "width",
    "front_overhang",
    "rear_overhang",
    "ground_clearance",
    "max_step",
    "wheel_width",
    "wheel_travel",
    "front_brake_share",
    "ride_frequency",
    "ride_damping",
}
_FORCE = ("m_m", "b_m", "m_b", "b_b")
_OF_SURFACE = {
    *_FORCE,
    "dead_time",
    "distance_offset",
    "time_offset",
    "speed_range",
    "grade_range",
    "roll_range",
    "covariance",
    "force_std",
    "dead_time_std",
    "speed_error",
    "drive_in_dead_time",
    "sliding_friction",
    "level",
    "uphill",
    "extrapolate",
    "extrapolation_margin",
    "class_id",
    "force_scatter",
    "dead_band",
    "saturation",
    "state_of",
    "speed_by_grade",
}
_ANGLES = ("grade_range", "roll_range")
_LIMITS = ("speed", "accel", "decel", "lateral_accel", "min_load")


class GuardSurface(NamedTuple):
    """Brakes on one surface, F_b/W = (m_m v + b_m) θ + (m_b v + b_b), spread taken off.

    Attributes:
        m_m, b_m, m_b, b_b: downhill and level. up_m, up_b: m_m and b_m uphill.
        dead_time: [s]. offset: safety offset [m]. speed_error: of the driven speed [m/s].
        slowest, fastest: trained speeds [m/s]. grades, rolls: widest trained, (low, high) [rad].
        friction: cap of the force [1]. level, rolls_on: share of the brakes, and what stays [1].
        class_id: number of the surface in maps; None: its name.
        state_of: the surface that may turn out to be like this one; None: it is one of its own.
        stronger, more: factor and addition by which the force may be above that; for loads [1].
    """

    m_m: float
    b_m: float
    m_b: float
    b_b: float
    up_m: float
    up_b: float
    dead_time: float
    offset: float
    speed_error: float
    slowest: float
    fastest: float
    grades: tuple[float, float]
    rolls: tuple[float, float]
    friction: float
    level: float
    rolls_on: float
    class_id: int | None
    state_of: str | None
    stronger: float
    more: float


class GuardModel(NamedTuple):
    """What the guard knows of a vehicle; SI.

    Attributes:
        surfaces: by name, "" is the base. effects: of the model file; motion: of them.
        scale: of the force by lasting effects. resistance: f_r that holds a rolling vehicle [1].
        wheelbase, track, cg_x, cg_z: [m]. front, rear: ends of the body from the middle of the
            wheelbase; width: of it; step: that a wheel may climb [m].
        wheel_speed, speed: highest [m/s]. accel, decel, lateral: [m/s²]. min_load: [1].
    """

    surfaces: dict[str, GuardSurface]
    effects: tuple[Effect, ...]
    motion: registry.MotionTerms
    scale: float
    resistance: float
    wheelbase: float
    track: float
    cg_x: float
    cg_z: float
    front: float
    rear: float
    width: float
    step: float
    wheel_speed: float
    speed: float
    accel: float
    decel: float
    lateral: float
    min_load: float


def read_guard_model(path: Path) -> GuardModel:
    """The model in a file.

    Raises:
        InputError: names the file and the key.
    """
    try:
        data = tomllib.loads(path.read_text())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(str(path), "", f"expected TOML, got: {error}") from None
    return _ModelReader(str(path)).model(data)


class _ModelReader:
    """Reads tables of one file, and names it in errors."""

    def __init__(self, source: str) -> None:
        self._source = source

    def model(self, data: Mapping[str, Any]) -> GuardModel:
        vehicle, limits = self._table(data, "vehicle"), self._table(data, "limits")
        braking, terrain = self._table(data, "braking"), self._table(data, "terrain")
        self._known(vehicle, "vehicle", _VEHICLE)
        effects = self._effects(data.get("effect", []))
        sizes = {name: self._number(vehicle, "vehicle", name, above=0.0) for name in _SIZES}
        most = {name: self._number(limits, "limits", name, above=0.0) for name in _LIMITS}
        radius, half = sizes["wheel_radius"], 0.5 * sizes["wheelbase"]
        resistance = self._number(terrain, "terrain", "motion_resistance", least=0.0)
        held = self._number(terrain, "terrain", "braking_resistance", resistance, least=0.0)
        wide = sizes["track_width"] + 0.7 * radius
        tables = {"": braking}
        for name, table in self._table(braking, "braking.terrain", "terrain", {}).items():
            tables[name] = {**braking, "class_id": None, "state_of": None, **table}
        for name, table in tables.items():
            of = table.get("state_of")
            if of and (of not in tables or of == name):
                words = f'expected "" for the base or another surface of the file, got {of!r}'
                raise self._fault(f"braking.terrain.{name}.state_of", words)
        rolls_on = min(held, resistance)
        surfaces = {
            name: self._surface(table, name, rolls_on, effects) for name, table in tables.items()
        }
        self._check_plausible(data)
        return GuardModel(
            surfaces,
            effects,
            registry.motion(effects),
            registry.force_scale(effects),
            resistance,
            sizes["wheelbase"],
            sizes["track_width"],
            sizes["cg_x"],
            sizes["cg_z"],
            half + self._number(vehicle, "vehicle", "front_overhang", radius, least=0.0),
            half + self._number(vehicle, "vehicle", "rear_overhang", radius, least=0.0),
            self._number(vehicle, "vehicle", "width", wide, above=0.0),
            self._number(vehicle, "vehicle", "max_step", radius / 3.0, above=0.0),
            sizes["max_wheel_speed"],
            most["speed"],
            most["accel"],
            most["decel"],
            most["lateral_accel"],
            most["min_load"],
        )

    def _check_plausible(self, data: Mapping[str, Any]) -> None:
        try:
            check_plausible(data)
        except ParameterError as error:
            raise self._fault(error.field, f"expected {error.expected}") from None
        except (KeyError, TypeError, ValueError) as error:
            raise self._fault("", f"expected numbers of a model file: {error}") from None

    def _surface(
        self, table: Mapping[str, Any], name: str, rolls_on: float, effects: tuple[Effect, ...]
    ) -> GuardSurface:
        where = f"braking.terrain.{name}" if name else "braking"
        self._known(table, where, {*_OF_SURFACE, "terrain"})

        def number(key: str, default: float | None = None, **bounds: float) -> float:
            return self._number(table, where, key, default, **bounds)

        force = [number(key) for key in _FORCE]
        up = self._table(table, f"{where}.uphill", "uphill", {})
        up_m = self._number(up, f"{where}.uphill", "m_m", force[0])
        up_b = self._number(up, f"{where}.uphill", "b_m", force[1])
        speeds, grades = (self._range(table, where, f"{n}_range") for n in ("speed", "grade"))
        widest = max(abs(grades[0]), abs(grades[1]))
        rolls = self._range(table, where, "roll_range", (-widest, widest))
        margin = 0.0
        if table.get("extrapolate", False):
            # Steeper ground than trained is driven with less force, everywhere: on the safe side.
            margin = number("extrapolation_margin", 0.3, least=0.0)
            grades = rolls = (-0.5 * np.pi, 0.5 * np.pi)
        lag = registry.motion(effects).lag
        caps = [number("sliding_friction", NO_LIMIT, above=0.0), registry.motion(effects).friction]
        class_id = table.get("class_id")
        if class_id is not None and type(class_id) is not int:
            raise self._fault(f"{where}.class_id", f"expected a whole number, got {class_id!r}")
        worse = SPREAD * number("force_std", 0.0, least=0.0)
        scatter = SPREAD * number("force_scatter", 0.0, least=0.0)
        kept = (1.0 - margin) * max(1.0 - scatter, 0.1)
        band, full = number("dead_band", 0.0, least=0.0), number("saturation", 1.0, above=0.0)
        applied = (number("level", 1.0, above=0.0) - band) / max(full - band, 1e-6)
        return GuardSurface(
            kept * force[0],
            kept * force[1],
            kept * force[2],
            kept * force[3] - worse,
            kept * up_m,
            kept * up_b,
            # A lag makes stops longer by no more than the same time at held speed.
            number("dead_time", least=0.0) + lag + SPREAD * number("dead_time_std", 0.0, least=0.0),
            number("distance_offset", 0.0, least=0.0),
            number("speed_error", 0.0, least=0.0),
            speeds[0],
            speeds[1],
            grades,
            rolls,
            min(caps),
            min(max(applied, 0.0), 1.0),
            rolls_on,
            class_id,
            table.get("state_of"),
            (1.0 + margin) * (1.0 + scatter) / kept,
            2.0 * worse,
        )

    def _effects(self, tables: object) -> tuple[Effect, ...]:
        if not isinstance(tables, list) or not all(isinstance(t, Mapping) for t in tables):
            raise self._fault("effect", "expected tables")
        found: list[Effect] = []
        for k, table in enumerate(tables):
            try:
                effect = Effect(name=table["name"], parameters=table["parameters"])
                registry.validate(effect)
                found.append(effect)
                registry.motion(found)
            except ParameterError as error:
                words = f"expected {error.expected}"
                raise self._fault(f"effect[{k}].{error.field}", words) from None
            except (KeyError, TypeError) as error:
                raise self._fault(f"effect[{k}]", f"expected name and numbers: {error}") from None
        return tuple(found)

    def _table(
        self, data: Mapping[str, Any], where: str, key: str = "", default: Any = None
    ) -> Mapping[str, Any]:
        table = data.get(key or where, default)
        if not isinstance(table, Mapping):
            raise self._fault(where, "expected a table")
        return table

    def _known(self, table: Mapping[str, Any], where: str, keys: set[str]) -> None:
        for key in table:
            if key not in keys:
                words = "unknown to the guard, which guards only what it understands"
                raise self._fault(f"{where}.{key}", words)

    def _number(
        self,
        table: Mapping[str, Any],
        where: str,
        key: str,
        default: float | None = None,
        *,
        least: float = -NO_LIMIT,
        above: float = -NO_LIMIT,
    ) -> float:
        value = table.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self._fault(f"{where}.{key}", f"expected a number, got {value!r}")
        if not (np.isfinite(value) and value >= least and value > above):
            words = f"expected a finite number, not below {max(least, above):g}, got {value}"
            raise self._fault(f"{where}.{key}", words)
        return float(value)

    def _range(
        self,
        table: Mapping[str, Any],
        where: str,
        key: str,
        default: tuple[float, float] | None = None,
    ) -> tuple[float, float]:
        value = table.get(key, default)
        try:
            low, high = (float(end) for end in value)
        except (TypeError, ValueError):
            raise self._fault(f"{where}.{key}", f"expected [low, high], got {value!r}") from None
        if not low < high:
            raise self._fault(f"{where}.{key}", f"expected low < high, got {value!r}")
        if key in _ANGLES and max(abs(low), abs(high)) > 0.5 * np.pi:
            raise self._fault(f"{where}.{key}", f"expected radians, got {value!r}: degrees?")
        return low, high

    def _fault(self, where: str, words: str) -> InputError:
        return InputError(self._source, where, words)


def stands_for(model: GuardModel) -> list[int]:
    """For each surface the number of the one under wheels where it counts: its own, mostly."""
    names = list(model.surfaces)
    return [
        k if s.state_of is None or s.state_of not in names else names.index(s.state_of)
        for k, s in enumerate(model.surfaces.values())
    ]


def rows_of(model: GuardModel) -> Floats:
    """Numbers of the R surfaces as rows (R + 1, 18), in the order of the model's names.

    The last row, number −1, is ground that may be any of them; its force is that of none.
    """
    own = np.array(
        [
            [
                s.m_m,
                s.b_m,
                s.m_b,
                s.b_b,
                s.up_m,
                s.up_b,
                s.slowest,
                s.friction,
                s.level,
                s.rolls_on,
                *s.grades,
                *s.rolls,
                s.fastest,
                s.dead_time,
                s.stronger,
                s.more,
            ]
            for s in model.surfaces.values()
        ]
    )
    either = own[0].copy()
    either[[10, 12, 15]] = own[:, [10, 12, 15]].max(axis=0)
    either[[11, 13, 14]] = own[:, [11, 13, 14]].min(axis=0)
    return np.vstack((own, either))
