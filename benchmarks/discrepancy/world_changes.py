"""Stops on a field of 800 m by 600 m, and changes of a vehicle that its model file does not know.

Shared by worlds of different physics: which stops, which change of which size, which log. How a
change acts is for each world to say.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from .effect_plant import GRAVITY
from .plant_physics import Floats, Stops

SINGLES = (
    "aerodynamic_drag",
    "headwind",
    "viscous_resistance",
    "brake_lag",
    "brake_fade",
    "wheel_lockup",
    "grade_asymmetry",
    "grade_nonlinearity",
    "cross_slope",
    "turning_resistance",
    "surface_patch",
    "directional_surface",
    "step_change",
    "session_drift",
)
PAIRS = (
    ("aerodynamic_drag", "step_change"),
    ("viscous_resistance", "cross_slope"),
    ("brake_lag", "surface_patch"),
    ("brake_fade", "grade_asymmetry"),
    ("headwind", "session_drift"),
    ("turning_resistance", "step_change"),
    ("directional_surface", "cross_slope"),
    ("brake_lag", "directional_surface"),
)
OUTSIDE: dict[str, tuple[str, ...]] = {
    "battery": ("battery",),
    "ripple": ("x", "y", "place", "station"),
    "heading": ("heading",),
    "temperature": ("temperature",),
    "tyre_pressure": ("roll", "abs_roll", "yaw_rate"),
    "sticking_sensor": (),
}
"""Effects that no name fits, and axes that are right; () where any answer without a name is."""

_FIELD, _SPACING = (800.0, 600.0), 40.0
"""Extent of the field and distance of places [m]: no two stops cross."""

_SIZES = ((0.08, 0.12), (0.15, 0.25))  # share of the braking force at the largest effect [1]
_GRADE, _YAW_RATE, _CURVED = 0.2, 0.35, 0.6  # largest [rad], [rad/s]; share of stops in curves [1]
_PAUSE = (10.0, 120.0)  # between stops [s]
_SESSION = 0.02  # differences of the force between sessions [1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Changes:
    """Changes of a vehicle since its model file; forces as shares of the weight."""

    air: float = 0.0  # drag per mass and squared air speed [1/m]
    wind: float = 0.0  # speed [m/s] against a vehicle that heads towards ``wind_from`` [rad]
    wind_from: float = 0.0
    viscous: float = 0.0  # [s/m]
    lag: float = 0.0  # time constant of brakes, 0 for the vehicle's own [s]
    fade: float = 0.0  # F/(1 + fade q) [kg/J]
    cooling: float = 100.0  # time constant of the heat q [s]
    grip: float = 0.0  # friction of the ground, 0 for the vehicle's own [1]
    asymmetry: float = 0.0  # of the brakes, by max(θ, 0) [1/rad]
    nonlinearity: float = 0.0  # of the brakes, by θ|θ| [1/rad²]
    cross: float = 0.0  # [1/rad]
    turning: float = 0.0  # [s/rad]
    patch: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)  # x, y, radius [m], force
    furrows: float = 0.0
    furrows_along: float = 0.0  # [rad]
    ripple: float = 0.0
    ripple_length: float = 1.0  # [m]
    eager: float = 0.0  # slope of the demanded force, in the model file, too [1/rad]
    factor: tuple[float, ...] = ()  # on the brakes of each stop [1]


def draw_stops(count: int, force: float, scatter: float, rng: np.random.Generator) -> Stops:
    """Draw stops for a vehicle of this braking force, each with its scatter of force [1]."""
    speed = rng.uniform(1.5, 6.0, count)
    columns = round(_FIELD[0] / _SPACING)
    cell = rng.permutation(columns * round(_FIELD[1] / _SPACING))[:count]
    rate = rng.uniform(-_YAW_RATE, _YAW_RATE, count) * (rng.random(count) < _CURVED)
    pause = np.exp(rng.uniform(math.log(_PAUSE[0]), math.log(_PAUSE[1]), count))
    return Stops(
        speed=speed,
        grade=np.maximum(rng.uniform(-_GRADE, _GRADE, count), -0.5 * force),
        wave=rng.uniform(0.0, 0.012, count) * (rng.random() < 0.5),
        wave_length=rng.uniform(8.0, 20.0, count),
        wave_phase=rng.uniform(0.0, 2.0 * np.pi, count),
        roll=np.clip(rng.normal(0.0, 0.07, count), -0.18, 0.18),
        curvature=rate / speed,
        heading=rng.uniform(-np.pi, np.pi, count),
        x=_SPACING * (cell % columns + rng.uniform(0.3, 0.7, count)),
        y=_SPACING * (cell // columns + rng.uniform(0.3, 0.7, count)),
        clock=20.0 + np.cumsum(pause + 8.0),
        ambient=rng.uniform(5.0, 35.0, count),
        friction=1.0 + scatter * rng.standard_normal(count),
        delay=0.006 * rng.standard_normal(count),
    )


def calibration_stops(force: float, rng: np.random.Generator) -> Stops:
    """Straight stops of an earlier log, with their own scatter and days."""
    stops = draw_scene("clean", "", force, rng).stops
    return stops._replace(curvature=np.zeros_like(stops.speed))


def draw_change(
    name: str, known: Changes, stops: Stops, force: float, rng: np.random.Generator
) -> Changes:
    """Add one named change, sized against the braking force F/W [1]."""
    size = float(rng.uniform(*_SIZES[int(rng.integers(2))]))
    taken, way = size * force, float(rng.uniform(-np.pi, np.pi))
    either = float(rng.choice([-1.0, 1.0]))
    fastest = float(stops.speed.max())
    match name:
        case "aerodynamic_drag":
            return replace(known, air=taken * GRAVITY / fastest**2)
        case "headwind":
            wind = float(rng.uniform(5.0, 8.0))
            gust = 2.0 * 4.0 * wind + wind**2  # at 4 m/s against the wind, beyond still air
            return replace(known, air=taken * GRAVITY / gust, wind=wind, wind_from=way)
        case "viscous_resistance":
            return replace(known, viscous=taken / fastest)
        case "brake_lag":
            return replace(known, lag=float(rng.uniform(0.12, 0.35)))
        case "brake_fade":
            cooling = float(rng.uniform(80.0, 250.0))
            hottest = float(heat_before(stops, cooling).max())
            return replace(known, fade=size / (1.0 - size) / hottest, cooling=cooling)
        case "wheel_lockup":
            slope = -taken / (1.0 - size) / _GRADE
            demand = (force + slope * stops.grade) / np.cos(stops.grade)
            return replace(
                known, eager=slope, grip=float(np.quantile(demand, rng.uniform(0.5, 0.75)))
            )
        case "grade_asymmetry":
            return replace(known, asymmetry=either * taken / _GRADE)
        case "grade_nonlinearity":
            return replace(known, nonlinearity=either * taken / _GRADE**2)
        case "cross_slope":
            return replace(known, cross=taken / 0.15)
        case "turning_resistance":
            return replace(known, turning=taken / 0.3)
        case "surface_patch":
            return replace(known, patch=(*_draw_place(stops, rng), either * taken))
        case "directional_surface":
            return replace(known, furrows=taken, furrows_along=way)
    return replace(known, factor=tuple(_lasting(name, either * size, stops, rng).tolist()))


def _draw_place(stops: Stops, rng: np.random.Generator) -> tuple[float, float, float]:
    """Circle that holds a fifth to two fifths of the stops."""
    x, y = (float(rng.uniform(0.3 * side, 0.7 * side)) for side in _FIELD)
    away = np.hypot(stops.x - x, stops.y - y)
    return x, y, float(np.quantile(away, rng.uniform(0.2, 0.4)))


def _lasting(name: str, size: float, stops: Stops, rng: np.random.Generator) -> Floats:
    count = len(stops.speed)
    factor = np.ones(count)
    if name == "step_change":
        factor[round(count * rng.uniform(0.3, 0.7)) :] += size
    elif name == "session_drift":
        factor += size * stops.clock / stops.clock[-1]
    return factor


def heat_before(stops: Stops, cooling: float) -> Floats:
    """Energy per mass that earlier stops left in the brakes, shape (n,) [J/kg]."""
    heat, before = 0.0, np.zeros(len(stops.speed))
    for i, clock in enumerate(stops.clock):
        gone = float(clock - stops.clock[i - 1]) if i else 0.0
        heat = (heat + (0.5 * float(stops.speed[i - 1]) ** 2 if i else 0.0)) * np.exp(
            -gone / cooling
        )
        before[i] = heat
    return before


def _draw_outside(
    label: str, stops: Stops, force: float, rng: np.random.Generator
) -> tuple[Changes, dict[str, Floats]]:
    """A change without a name, and further columns by run."""
    size = float(rng.uniform(*_SIZES[int(rng.integers(2))])) * float(rng.choice([-1.0, 1.0]))
    count = len(stops.speed)
    extra: dict[str, Floats] = {}
    by = np.zeros(count)
    if label == "battery":
        # Full again three times in the log, so that it is not the time.
        charge = 1.0 - np.mod(3.0 * np.arange(count) / count + rng.random(), 1.0)
        by = charge - 0.5
        extra["battery"] = 24.0 + 2.0 * charge + 0.05 * rng.standard_normal(count)
    elif label == "ripple":
        length = float(rng.uniform(2.0, 4.0))
        return Changes(ripple=size * force, ripple_length=length), extra
    elif label == "heading":
        by = np.cos(stops.heading - rng.uniform(-np.pi, np.pi))
    elif label == "temperature":
        turns = rng.uniform(1.2, 2.5) * stops.clock / stops.clock[-1]
        by = 0.7 * np.sin(2.0 * np.pi * (turns + rng.random())) + 0.3 * rng.standard_normal(count)
        extra["temperature"] = 15.0 + 8.0 * by
    elif label == "tyre_pressure":
        by = np.tanh(stops.roll / 0.05)
    return Changes(factor=tuple((1.0 + size * by).tolist())), extra


@dataclass(frozen=True, slots=True)
class Scene:
    """Stops of one log, the changes of its vehicle, and columns by run."""

    stops: Stops
    changes: Changes
    extra: dict[str, Floats]


def draw_scene(kind: str, label: str, force: float, rng: np.random.Generator) -> Scene:
    """Draw one log's stops and changes for a vehicle of this braking force [1]."""
    scatter = float(rng.uniform(0.01, 0.03))
    stops = draw_stops(int(rng.integers(50, 71)), force, scatter, rng)
    changes = Changes()
    extra: dict[str, Floats] = {}
    if kind == "outside":
        changes, extra = _draw_outside(label, stops, force, rng)
    elif kind == "drift":
        factor = 1.0 + float(rng.uniform(0.08, 0.2)) * float(rng.choice([-1.0, 1.0]))
        changes = Changes(factor=(factor,) * len(stops.speed))
    else:
        for name in label.split("+") if label else ():
            changes = draw_change(name, changes, stops, force, rng)
    slow = {"step_change", "session_drift", "brake_fade", "temperature", "battery"}
    if not slow & set(label.split("+")) and rng.random() < 0.5:
        stops, extra["session"] = in_sessions(stops, rng)
    return Scene(stops, changes, extra)


def in_sessions(stops: Stops, rng: np.random.Generator) -> tuple[Stops, Floats]:
    """Stops of several days whose brakes differ, and the number of each stop's day."""
    day = np.arange(len(stops.speed)) * int(rng.integers(3, 6)) // len(stops.speed)
    offset = 1.0 + _SESSION * rng.standard_normal(6)[day]
    return stops._replace(friction=stops.friction * offset), np.asarray(day, np.float64)


def requests_of(
    key: int, clean: int, drift: int, outside: tuple[str, ...]
) -> list[tuple[str, str, int]]:
    """Kind, label and seed of singles (two of each), pairs, clean, drift and outside logs."""
    rng = np.random.default_rng(key)
    kinds = [("single", name) for name in SINGLES * 2]
    kinds += [("clean", "")] * clean + [("drift", "")] * drift
    kinds += [("pair", "+".join(names)) for names in PAIRS]
    kinds += [("outside", name) for name in outside]
    return [(*what, int(rng.integers(2**31))) for what in kinds]
