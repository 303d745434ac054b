"""Parameters of a stopping vehicle's world and of its stops, and five habits of driving them."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Physics(NamedTuple):
    """Base model and all effects that may act in addition; defaults are absent effects."""

    # m_m, b_m, m_b, b_b, dead_time: F_b/W = (m_m v_i + b_m) θ + m_b v_i + b_b after dead_time
    m_m: float
    b_m: float
    m_b: float
    b_b: float
    dead_time: float
    drag: float = 0.0  # a += drag v² [1/m]; viscous: a += g viscous v [s/m]
    viscous: float = 0.0
    # wind_drag, wind, wind_direction: a += c (|u| u − v²), u = v + wind cos(yaw − direction)
    wind_drag: float = 0.0
    wind: float = 0.0
    wind_direction: float = 0.0
    lag: float = 0.0  # time constant of the force after the onset [s]
    fade: float = 0.0  # fade, fade_tau: F/(1 + fade q), dq/dt = braking power per mass − q/fade_tau
    fade_tau: float = 100.0
    friction: float = 100.0  # F_b/W ≤ friction cos θ cos φ, a share of the load on the ground
    # asymmetry, nonlinearity, cross_slope: F_b/W += k max(θ, 0), k θ|θ|, k |φ|
    asymmetry: float = 0.0
    nonlinearity: float = 0.0
    cross_slope: float = 0.0
    turning: float = 0.0  # a += g k |yaw rate|
    # patch, patch_x, patch_y, patch_radius: F_b/W += patch inside a circle; patch_2 … patch_4
    # likewise
    patch: float = 0.0
    patch_x: float = 0.0
    patch_y: float = 0.0
    patch_radius: float = 1.0
    patch_2: float = 0.0
    patch_2_x: float = 0.0
    patch_2_y: float = 0.0
    patch_2_radius: float = 1.0
    patch_3: float = 0.0
    patch_3_x: float = 0.0
    patch_3_y: float = 0.0
    patch_3_radius: float = 1.0
    patch_4: float = 0.0
    patch_4_x: float = 0.0
    patch_4_y: float = 0.0
    patch_4_radius: float = 1.0
    furrow: float = 0.0  # furrow, furrow_direction: F_b/W += k cos 2(yaw − direction)
    furrow_direction: float = 0.0
    # step_scale, step_delta, step_run: from that run on F_b/W × scale + delta
    step_scale: float = 1.0
    step_delta: float = 0.0
    step_run: float = 1e9
    drift: float = 0.0  # F_b/W += k t
    ripple: float = 0.0  # ripple, ripple_length: F_b/W += A sin(2π x/length), x on the map
    ripple_length: float = 1.0


class Stops(NamedTuple):
    """Driven stops, one run per stop; every field has shape (n,)."""

    speed: Floats  # speed until the onset [m/s]
    # grade, wave, wave_length, wave_phase: θ(s) = grade + wave sin(2π s/length + phase)
    grade: Floats
    wave: Floats
    wave_length: Floats
    wave_phase: Floats
    roll: Floats  # roll, curvature: roll and path curvature [rad], [1/m]
    curvature: Floats
    heading: Floats  # heading, x, y: pose at the stop command [rad], [m]
    x: Floats
    y: Floats
    clock: Floats  # time of the command in the log [s]
    ambient: Floats  # value of the further column [1]
    friction: Floats  # factor on the force of this stop [1]
    delay: Floats  # addition to the dead time [s]


SPACING = 60.0  # Distance of neighbouring places [m]: no two stops cross, so each has its own slope
FIELD = (20 * SPACING, 15 * SPACING)  # Extent of the field in x and y [m]
_LONG_PAUSE = 0.05  # share of pauses in which brakes cool [1]
_CURVED = 0.6  # share of stops in a curve [1]
_MAX_YAW_RATE = 0.35  # [rad/s] at the command, comfortable for a skid-steered vehicle
_MIN_GRADE = -0.20  # [rad]; steeper, not every brake drawn here holds


@dataclass(frozen=True, slots=True)
class Ranges:
    """Ranges of a design: speed [m/s], size of the grade [rad], spread of the heading [rad]."""

    speed: tuple[float, float]
    grade: tuple[float, float]
    heading: float = np.pi


# As operators collect stops: anything, fast, on slopes, at walking pace, along one field track.
_RANGES = {
    "mixed": Ranges((1.0, 5.0), (0.0, 0.22)),
    "fast": Ranges((3.5, 6.0), (0.0, 0.14)),
    "steep": Ranges((1.0, 4.5), (0.12, 0.26)),
    "slow": Ranges((0.6, 2.2), (0.0, 0.20)),
    "one-way": Ranges((1.0, 5.0), (0.0, 0.22), 0.08),
}


def draw(design: str, count: int, scatter: float, rng: np.random.Generator) -> Stops:
    """Draw stops of a design, each with its random friction (of this scatter [1]) and delay."""
    r = _RANGES[design]
    speed = rng.uniform(*r.speed, count)
    grade = rng.uniform(*r.grade, count) * rng.choice([-1.0, 1.0], count)
    curvature = rng.uniform(-_MAX_YAW_RATE, _MAX_YAW_RATE, count) / np.maximum(speed, 1.0)
    pause = rng.lognormal(np.log(14.0), 0.5, count)
    pause = np.where(rng.random(count) < _LONG_PAUSE, rng.uniform(120.0, 400.0, count), pause)
    columns = round(FIELD[0] / SPACING)
    cell = rng.permutation(columns * round(FIELD[1] / SPACING))[:count]
    offset = rng.uniform(-0.15, 0.15, (2, count))
    return Stops(
        speed=speed,
        grade=np.maximum(grade, _MIN_GRADE),
        wave=rng.uniform(0.0, 0.02, count),
        wave_length=rng.uniform(5.0, 15.0, count),
        wave_phase=rng.uniform(0.0, 2.0 * np.pi, count),
        roll=np.clip(rng.normal(0.0, 0.07, count), -0.2, 0.2),
        curvature=np.where(rng.random(count) < _CURVED, curvature, 0.0),
        heading=0.4 + rng.uniform(-r.heading, r.heading, count),
        x=SPACING * (cell % columns + 0.5 + offset[0]),
        y=SPACING * (cell // columns + 0.5 + offset[1]),
        clock=20.0 + np.cumsum(pause + 8.0),
        ambient=rng.uniform(5.0, 35.0, count),
        friction=np.maximum(1.0 + scatter * rng.standard_normal(count), 0.5),
        delay=0.006 * rng.standard_normal(count),
    )


def ranged(low: float, high: float) -> Any:
    """Field of a vehicle that :func:`draw_ranged` draws from a range."""
    return field(metadata={"range": (low, high)})


def draw_ranged(vehicle: Any, rng: np.random.Generator) -> dict[str, float]:
    """Draw the fields with a range, in their order."""
    ranges = {f.name: f.metadata["range"] for f in fields(vehicle) if f.metadata}
    numbers = rng.uniform(*np.array(list(ranges.values())).T)
    return dict(zip(ranges, numbers.tolist(), strict=True))
