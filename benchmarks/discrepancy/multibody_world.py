"""Logs of the multi-body car: the nature drawn for each effect, and what is measured."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from . import sensing
from .blind_run import COEFFICIENTS, tables_of
from .effect_plant import speeds
from .multibody import MAX_CURVATURE, CarNature, drive
from .plant_physics import FIELD, Floats, Physics, Stops, draw
from .vehicle_models import CAR
from .world_logs import WorldLog, vehicle_table

STOPS = 60  # of a log
EAGER = -0.4  # assist of brakes that press harder downhill, so that grip ends only there [1/rad]
SHARES = {"small": 0.04, "medium": 0.10, "large": 0.25}
"""Share of the braking force on level ground that an effect takes at its largest [1]."""

CAR_NAMES: dict[str, tuple[tuple[str, ...], ...]] = {
    "heavier body": (("step_change",),),
    "weaker brakes": (("step_change",),),
    "air": (("aerodynamic_drag",),),
    "wind": (("headwind",), ("headwind", "aerodynamic_drag")),
    "fading pads": (("brake_fade",),),
    "slippery area": (("surface_patch",),),
    "two slippery areas": (("surface_patch",),),
    "viscous driveline": (("viscous_resistance",),),
    "slow hydraulics": (("brake_lag",),),
    "glazing pads": (("session_drift",),),
    "locking wheels": (("wheel_lockup",),),
    "furrows": (("directional_surface",),),
}
"""Right names of each effect; wind on a body is also drag on it."""

_KNOTS = (0.03, 0.06, 0.12, 0.30)  # shares of the figures below [1]
SIZES: dict[str, tuple[float, float, float, float]] = {
    "heavier body": (34.4, 71.0, 152.0, 480.0),
    "weaker brakes": (0.031, 0.062, 0.124, 0.31),
    "air": (6.0, 11.9, 23.4, 55.0),
    "wind": (1.1, 2.15, 4.2, 9.6),
    "fading pads": (0.0366, 0.0731, 0.1455, 0.36),
    "slippery area": (0.423, 0.407, 0.379, 0.301),
    "two slippery areas": (0.423, 0.407, 0.379, 0.301),
    "viscous driveline": (0.67, 1.31, 2.55, 5.8),
    "slow hydraulics": (0.025, 0.042, 0.07, 0.15),
    "glazing pads": (0.0377, 0.0753, 0.15, 0.376),
    "locking wheels": (0.509, 0.4895, 0.462, 0.381),
    "furrows": (0.0247, 0.0492, 0.098, 0.256),
}
"""Sizes of each effect at these shares, measured in this car on sets like those drawn here: the
95th percentile, over stops from 3 m/s on, of the change in mean deceleration; in slippery areas the
median. Hydraulics are slower: the part of a lag that the dead time absorbs is no effect."""

_MARGIN = 230.0  # [m] from the middle of a slippery area to the field's edge
_RADIUS = 200.0  # [m]
_MIN_SPEED = 0.1  # [m/s] of samples to calibrate by


def car_table() -> dict[str, Any]:
    """Vehicle table of the model file for the car's logs."""
    base = CAR.a + CAR.b
    sizes = (base, 0.5 * (CAR.T_f + CAR.T_r), (CAR.m_s * CAR.b + CAR.m_uf * base) / CAR.m)
    table = vehicle_table(CAR.m, *sizes, CAR.h_cg, CAR.R_w)
    limits = {"max_wheel_speed": 7.0, "max_drive_force": 5000.0, "max_drive_power": 20000.0}
    return table | limits


def make(kind: str, label: str, seed: int) -> WorldLog:
    """One log, clean or with one change of the car."""
    rng = np.random.default_rng((43, seed))
    strength = str(rng.choice(["medium", "large"])) if label else ""
    rng = np.random.default_rng(seed)
    noise, scatter = float(rng.choice([0.01, 0.03])), float(rng.choice([0.0075, 0.02]))
    stops = draw_stops(STOPS, scatter, rng)
    nature = draw_nature(label, strength, stops, rng)
    columns = sensing.log(drive(nature, stops), stops, noise, rng)
    tables = tables_of(calibrated(nature.assist), car_table())
    return WorldLog(kind, CAR_NAMES.get(label, ()), (), columns, tables)


def requests(seed: int = 1) -> list[tuple[str, str, int]]:
    """Kind, label and seed of a round of logs: each change twice, and clean ones."""
    rng = np.random.default_rng(47 + 1000 * seed)
    kinds = [("single", what) for what in CAR_NAMES] * 2 + [("clean", "")] * 10
    return [(*kind, int(rng.integers(2**31))) for kind in kinds]


def draw_stops(count: int, scatter: float, rng: np.random.Generator) -> Stops:
    """Draw stops within the car's steering range."""
    stops = draw("mixed", count, scatter, rng)
    curvature = np.clip(stops.curvature, -MAX_CURVATURE, MAX_CURVATURE)
    return stops._replace(curvature=curvature, roll=0.6 * stops.roll)


def draw_nature(change: str, strength: str, stops: Stops, rng: np.random.Generator) -> CarNature:
    """Draw a car with one effect: its size, place, time and direction."""
    vary, eager = float(rng.uniform(0.85, 1.15)), bool(rng.random() < 0.5)
    run = round(len(stops.speed) * rng.uniform(0.35, 0.65))
    direction = float(rng.uniform(-np.pi, np.pi))
    x, y, across = (float(rng.uniform(_MARGIN, FIELD[k] - _MARGIN)) for k in (0, 1, 1))
    if not change:
        return CarNature(assist=EAGER if eager else CarNature().assist)
    size = float(np.interp(SHARES[strength] * vary, _KNOTS, SIZES[change]))
    opposite = float(np.clip((x + 0.5 * FIELD[0]) % FIELD[0], _MARGIN, FIELD[0] - _MARGIN))
    areas = ((x, y, _RADIUS, size), (opposite, across, _RADIUS, size))
    changes: dict[str, dict[str, Any]] = {
        "heavier body": {"payload": size, "payload_run": run},
        "weaker brakes": {"repair": 1.0 - size, "payload_run": run},
        "air": {"air": size},
        "wind": {"air": size, "wind": 7.0, "wind_from": direction},
        "fading pads": {"fading": size},
        "slippery area": {"slippery": areas[:1]},
        "two slippery areas": {"slippery": areas},
        "viscous driveline": {"driveline": size},
        "slow hydraulics": {"build_up": size},
        "glazing pads": {"glazing": size / float(stops.clock[-1])},
        "locking wheels": {"friction": size, "assist": EAGER},
        "furrows": {"furrows": size, "furrows_along": direction},
    }
    return replace(CarNature(), **changes[change])


@cache
def calibrated(assist: float) -> dict[str, float]:
    """Coefficients and dead time of a car without effects: noise-free stops by least squares."""
    stops = draw_stops(50, 0.0, np.random.default_rng(77))
    stops = stops._replace(delay=np.zeros_like(stops.speed))
    motion = drive(CarNature(assist=assist), stops)
    time = motion.time[motion.time >= 0.0]
    real = motion.speed[:, motion.time >= 0.0]
    calm = stops._replace(friction=np.ones_like(stops.speed))
    rolling = real > _MIN_SPEED

    def residual(values: Floats) -> Floats:
        difference: Floats = (speeds(Physics(*values), calm, time, 0.005) - real)[rolling]
        return difference

    start = np.array([0.0, 0.0, 0.0, 0.42, 0.25])
    best = least_squares(residual, start, x_scale=[0.01, 0.1, 0.01, 0.1, 0.05], diff_step=1e-4)
    return dict(zip(COEFFICIENTS, (float(v) for v in best.x), strict=True))
