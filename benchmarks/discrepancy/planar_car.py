"""A planar car that no method was developed on: sprung pitch, slipping axles, wheels that turn.

Brakes are torques at the wheels that build up; tyres give force by slip and load; the body pitches
on springs and shifts the load. Integrated in half milliseconds, all stops together.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from . import sensing
from .blind_run import tables_of
from .effect_plant import GRAVITY, DrivenStops
from .plant_physics import FIELD, Floats, Stops, draw
from .random_vehicles import WorldLog

EFFECTS: dict[str, tuple[str, ...]] = {
    "air": ("aerodynamic_drag",),
    "wind": ("headwind",),
    "driveline": ("viscous_resistance",),
    "slow brakes": ("brake_lag",),
    "fading pads": ("brake_fade",),
    "slippery": ("wheel_lockup",),
    "uphill booster": ("grade_asymmetry",),
    "side slope": ("cross_slope",),
    "turning": ("turning_resistance",),
    "soft area": ("surface_patch",),
    "furrows": ("directional_surface",),
    "load": ("step_change",),
    "glazing": ("session_drift",),
}
"""Right names."""
OUTSIDE: dict[str, tuple[str, ...]] = {"battery": ("battery",), "heading": ("heading",)}
"""Axes of effects without a name."""
_STEP = 5e-4  # [s]
_WHEEL = 0.3  # radius [m]
_SPIN = 0.02  # effective mass of all wheels, share of the mass [1]
_SLIDING_SPEED = 0.3  # [m/s] below which slip is counted against it


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarCar:
    """One car, SI, with at most one effect."""

    brake: float  # torque over weight at the rims [1]
    front: float  # share of it [1]
    wheelbase: float
    height: float  # of the centre of gravity [m]
    pitch_frequency: float  # [Hz]
    pitch_damping: float  # [1]
    stiffness: float  # of the tyre's force by slip [1]
    friction: float = 0.9  # of the tyres [1]
    resistance: float = 0.02  # of rolling [1]
    dead_time: float = 0.2
    build_up: float = 0.015
    at_wheels: bool = True  # where the speed is measured
    air: float = 0.0  # per mass [1/m]
    wind: float = 0.0
    wind_from: float = 0.0
    driveline: float = 0.0  # [s/m]
    fading: float = 0.0  # share per heat [kg/J]
    cooling: float = 150.0
    booster: float = 0.0  # [1/rad]
    side: float = 0.0  # [1/rad]
    turning: float = 0.0  # [s/rad]
    soft: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 0.0)  # x, y, radius [m], force [1]
    furrows: float = 0.0
    furrows_along: float = 0.0
    factor: tuple[float, ...] = ()  # of each stop's torque


def drive(car: PlanarCar, stops: Stops, time: Floats) -> DrivenStops:
    """Drive all stops, sampled at times since each command; speed and pitch as sensed."""
    n = len(stops.speed)
    factor = stops.friction * (np.array(car.factor) if car.factor else 1.0)
    heat = _heat_before(car, stops)
    pulse, v, way = 2.0 * np.pi * car.pitch_frequency, stops.speed.copy(), np.zeros(n)
    gain = GRAVITY * car.height / car.wheelbase / pulse**2  # pitch by its share of deceleration
    pitch, rate, rest = np.zeros(n), np.zeros(n), np.full(n, np.inf)
    spin = np.stack([v, v])  # at the rims
    speeds, ways, pitches, last = (np.zeros((n, len(time))) for _ in range(4))
    distance, accel = np.full(n, np.inf), np.zeros(n)
    share = np.array([car.front, 1.0 - car.front])[:, None]
    k = int(np.searchsorted(time, 0.0))
    speeds[:, :k], ways[:, :k] = v[:, None], v[:, None] * time[:k]
    onset = car.dead_time + stops.delay
    for step in range(round((time[-1]) / _STEP) + 1):
        t = step * _STEP
        if k < len(time) and t >= time[k] - 1e-9:
            sensed = spin.mean(axis=0) if car.at_wheels else v + car.height * rate
            speeds[:, k] = np.where(np.isinf(rest), sensed, 0.0)
            ways[:, k], pitches[:, k], last[:, k] = way, pitch, accel
            k += 1
        rolls = np.isinf(rest)
        if not rolls.any():
            for j in range(k, len(time)):
                ways[:, j], pitches[:, j] = way, pitch * np.exp(-(time[j] - t) / 0.15)
            break
        grade = _grade(stops, way)
        yaw = stops.heading + stops.curvature * way
        built = -np.expm1(-np.maximum(t - onset, 0.0) / car.build_up)
        demand = (
            (car.brake + car.booster * np.maximum(grade, 0.0)) * factor / (1 + car.fading * heat)
        )
        torque = np.maximum(demand, 0.0) * built
        rolling = _rolling(car, stops, way, yaw, v) * (t >= onset)
        shift = car.height / car.wheelbase * accel / GRAVITY
        load = np.stack([0.5 * np.cos(grade) + shift, 0.5 * np.cos(grade) - shift])
        slip = (v - spin) / np.maximum(v, _SLIDING_SPEED)
        tyre = car.friction * np.maximum(load, 0.02) * np.tanh(car.stiffness * slip)
        wind = v + car.wind * np.cos(yaw - car.wind_from)
        drag = car.air * (np.abs(wind) * wind) * (t >= onset)
        decel = GRAVITY * (tyre.sum(axis=0) + rolling) + drag
        decel += GRAVITY * np.sin(grade) * (t >= onset)
        accel = accel + (decel - accel) * min(1.0, _STEP / 0.01)
        # Implicit in the slip, which is stiff.
        slope = car.friction * np.maximum(load, 0.02) * car.stiffness
        slope = slope / np.cosh(np.clip(car.stiffness * slip, -20, 20)) ** 2
        slope = slope / np.maximum(v, _SLIDING_SPEED)
        push = GRAVITY / (0.5 * _SPIN) * (tyre - share * torque - 0.5 * car.driveline * spin)
        # Of the difference to the body, so that a steady slip costs no inertia that is not there.
        behind = v - spin
        behind = behind + _STEP * (-decel - push) / (1.0 + _STEP * GRAVITY / (0.5 * _SPIN) * slope)
        rate = rate + _STEP * (
            pulse**2 * (gain * decel / GRAVITY - pitch) - 2.0 * car.pitch_damping * pulse * rate
        )
        pitch = pitch + _STEP * rate
        before = v
        v = np.where(rolls, np.maximum(v - _STEP * decel, 0.0), 0.0)
        spin = np.clip(v - behind, 0.0, v)
        way = way + 0.5 * _STEP * (before + v)
        done = rolls & (v <= 0.0)
        rest, distance = np.where(done, t + _STEP, rest), np.where(done, way, distance)
        heat = heat + _STEP * (GRAVITY * torque * v - heat / car.cooling)
    yaws = stops.heading[:, None] + stops.curvature[:, None] * ways
    x = stops.x[:, None] + ways * np.cos(
        stops.heading[:, None] + 0.5 * stops.curvature[:, None] * ways
    )
    y = stops.y[:, None] + ways * np.sin(
        stops.heading[:, None] + 0.5 * stops.curvature[:, None] * ways
    )
    grades = _grade(stops, ways.T).T - pitches
    roll = np.broadcast_to(stops.roll[:, None], ways.shape)
    rates = stops.curvature[:, None] * speeds
    return DrivenStops(time, speeds, ways, x, y, yaws, rates, grades, roll, rest, distance, accel)


def _grade(stops: Stops, way: Floats) -> Floats:
    turn = 2.0 * np.pi * way / stops.wave_length + stops.wave_phase
    grade: Floats = stops.grade + stops.wave * np.sin(turn)
    return grade


def _rolling(car: PlanarCar, stops: Stops, way: Floats, yaw: Floats, v: Floats) -> Floats:
    x = stops.x + way * np.cos(yaw)
    y = stops.y + way * np.sin(yaw)
    inside = np.hypot(x - car.soft[0], y - car.soft[1]) < car.soft[2]
    total: Floats = car.resistance + car.soft[3] * inside + car.side * np.abs(stops.roll)
    total = total + car.furrows * np.cos(2.0 * (yaw - car.furrows_along))
    return total + car.turning * np.abs(stops.curvature * v)


def _heat_before(car: PlanarCar, stops: Stops) -> Floats:
    heat, before = 0.0, np.zeros(len(stops.speed))
    for i, clock in enumerate(stops.clock):
        gone = clock - stops.clock[i - 1] if i else 0.0
        heat *= float(np.exp(-gone / car.cooling))
        before[i] = heat
        heat += 0.5 * float(stops.speed[i]) ** 2
    return before


def make(kind: str, label: str, seed: int) -> WorldLog:
    """One log: clean, drift, single or outside."""
    rng = np.random.default_rng((47, seed))
    stops = draw("mixed", 50, float(rng.choice([0.01, 0.02, 0.03])), rng)
    plain = PlanarCar(
        brake=float(rng.uniform(0.35, 0.5)),
        front=float(rng.uniform(0.5, 0.65)),
        wheelbase=float(rng.uniform(1.2, 2.6)),
        height=float(rng.uniform(0.4, 0.7)),
        pitch_frequency=float(rng.uniform(1.2, 4.0)),
        pitch_damping=float(rng.uniform(0.2, 0.5)),
        stiffness=float(rng.uniform(12.0, 30.0)),
        dead_time=float(rng.uniform(0.15, 0.35)),
        build_up=float(rng.uniform(0.005, 0.03)),
        at_wheels=bool(rng.random() < 0.5),
    )
    share = float(rng.uniform(0.10, 0.2))
    car = _with(plain, label, share, stops, rng)
    if kind == "drift":
        car = replace(car, brake=car.brake * (1.0 + share * float(rng.choice([-1.0, 1.0]))))
    noise = float(rng.choice([0.01, 0.02, 0.03]))
    columns = sensing.log(drive(car, stops, sensing.sample_times(6.0)), stops, noise, rng)
    if label == "battery":
        columns["battery"] = columns.pop("ambient")
    # What a calibration of the plain car on gentle slopes says; wheels have inertia, too.
    level = (plain.brake + plain.resistance) / (1.0 + _SPIN)
    configured = {"m_m": 0.0, "b_m": -_SPIN, "m_b": 0.0, "b_b": level}
    configured["dead_time"] = plain.dead_time + plain.build_up
    truth = (EFFECTS[label],) if label in EFFECTS else ()
    return WorldLog(
        "planar",
        kind,
        label or kind,
        seed,
        truth,
        OUTSIDE.get(label, ()),
        columns,
        tables_of(configured),
    )


def _with(
    car: PlanarCar, label: str, share: float, stops: Stops, rng: np.random.Generator
) -> PlanarCar:
    """The car with an effect that takes this share of its force where it is strongest."""
    force, n = share * car.brake, len(stops.speed)
    way = float(rng.uniform(-np.pi, np.pi))
    factor = np.ones(n)
    match label:
        case "air":
            car = replace(car, air=force * GRAVITY / 12.0)
        case "wind":
            car = replace(car, air=force * GRAVITY / 40.0, wind=6.0, wind_from=way)
        case "driveline":
            car = replace(car, driveline=force / 3.5)
        case "slow brakes":
            car = replace(car, build_up=float(rng.uniform(0.12, 0.3)))
        case "fading pads":
            car = replace(car, fading=share / 45.0)
        case "slippery":
            car = replace(car, friction=car.brake * (1.0 - 0.5 * share))
        case "uphill booster":
            car = replace(car, booster=force / 0.15)
        case "side slope":
            car = replace(car, side=force / 0.1)
        case "turning":
            car = replace(car, turning=force / 0.25)
        case "soft area":
            place = rng.uniform(200.0, FIELD[0] - 200.0), rng.uniform(200.0, FIELD[1] - 200.0)
            car = replace(car, soft=(float(place[0]), float(place[1]), 200.0, force))
        case "furrows":
            car = replace(car, furrows=0.6 * force, furrows_along=way)
        case "load":
            factor[round(n * rng.uniform(0.3, 0.7)) :] = 1.0 - share
        case "glazing":
            factor = 1.0 - share * stops.clock / stops.clock[-1]
        case "battery":
            factor = 1.0 + share * (stops.ambient - 20.0) / 15.0
        case "heading":
            factor = 1.0 + 0.7 * share * np.cos(stops.heading - way)
    return replace(car, factor=tuple(factor.tolist()))


def requests(seed: int = 1) -> list[tuple[str, str, int]]:
    """Kind, label and seed of its logs."""
    rng = np.random.default_rng((48, seed))
    logs = [("single", what) for what in EFFECTS] + [("outside", what) for what in OUTSIDE]
    logs += [("clean", "")] * 4 + [("drift", "")] * 2
    return [(*what, int(rng.integers(2**31))) for what in logs]
