"""Sets of the multi-body car: the nature drawn for each effect, its log, and its score."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from . import sensing
from .blind_run import COEFFICIENTS, Finding
from .car_outcomes import CAR_NAMES, CLEAN, CarOutcome, CarSpec
from .effect_plant import speeds
from .multibody import MAX_CURVATURE, CarNature, drive
from .plant_physics import FIELD, Floats, Physics, Stops, draw
from .score import closed_share, physics_of
from .vehicle_models import CAR

STOPS, FRESH = 70, 24  # of a log, and fresh ones to score it
EAGER = -0.4  # assist of brakes that press harder downhill, so that grip ends only there [1/rad]
SHARES = {"small": 0.04, "medium": 0.10, "large": 0.25}
"""Share of the braking force on level ground that an effect takes at its largest [1]."""

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
_MIN_SPEED = 0.1  # [m/s] of compared samples


@dataclass(frozen=True, slots=True)
class CarSet:
    """A log of the car, the configured model, and the truth."""

    spec: CarSpec
    noise: float
    scatter: float
    nature: CarNature
    columns: sensing.Columns
    configured: dict[str, float]
    stops: Stops


def car_table() -> dict[str, Any]:
    """Vehicle table of the model file for the car's logs."""
    base = CAR.a + CAR.b
    return {
        "mass": CAR.m,
        "wheelbase": base,
        "track_width": 0.5 * (CAR.T_f + CAR.T_r),
        "cg_x": (CAR.m_s * CAR.b + CAR.m_uf * base) / CAR.m,
        "cg_z": CAR.h_cg,
        "wheel_radius": CAR.R_w,
        "drive": "ackermann",
        "max_wheel_speed": 7.0,
        "max_drive_force": 5000.0,
        "max_drive_power": 20000.0,
    }


def make(spec: CarSpec, count: int = STOPS, configured: dict[str, float] | None = None) -> CarSet:
    """Drive and measure one set, with the coefficients of the car before any change."""
    rng = np.random.default_rng(spec.seed)
    noise, scatter = float(rng.choice([0.01, 0.03])), float(rng.choice([0.0075, 0.02]))
    stops = draw_stops(count, scatter, rng)
    nature = draw_nature(spec, stops, rng)
    columns = sensing.log(drive(nature, stops), stops, noise, rng)
    known = configured or calibrated(nature.assist)
    return CarSet(spec, noise, scatter, nature, columns, known, stops)


def draw_stops(count: int, scatter: float, rng: np.random.Generator) -> Stops:
    """Draw stops within the car's steering range."""
    stops = draw("mixed", count, scatter, rng)
    curvature = np.clip(stops.curvature, -MAX_CURVATURE, MAX_CURVATURE)
    return stops._replace(curvature=curvature, roll=0.6 * stops.roll)


def draw_nature(spec: CarSpec, stops: Stops, rng: np.random.Generator) -> CarNature:
    """Draw a car with one effect: its size, place, time and direction."""
    vary, eager = float(rng.uniform(0.85, 1.15)), bool(rng.random() < 0.5)
    run = round(len(stops.speed) * rng.uniform(0.35, 0.65))
    direction = float(rng.uniform(-np.pi, np.pi))
    x, y, across = (float(rng.uniform(_MARGIN, FIELD[k] - _MARGIN)) for k in (0, 1, 1))
    if not spec.what:
        return CarNature(assist=EAGER if eager else CarNature().assist)
    size = float(np.interp(SHARES[spec.strength] * vary, _KNOTS, SIZES[spec.what]))
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
    return replace(CarNature(), **changes[spec.what])


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


def score_set(hidden: CarSet, finding: Finding) -> CarOutcome:
    """Compare names with the truth, and measure the gap on fresh stops that are driven twice."""
    spec = hidden.spec
    allowed = [frozenset(names) for names in CAR_NAMES.get(spec.what, ())]
    named = frozenset(finding.names)
    before, after, floor = _gap_on_fresh_stops(hidden, finding)
    conditions = (spec.seed, hidden.noise, hidden.scatter)
    return CarOutcome(
        *(spec.what or CLEAN, *conditions, finding.verdict, finding.names),
        right=finding.is_confident and named in allowed,
        wrong=finding.is_confident and not any(named <= names for names in allowed),
        before=before,
        after=after,
        floor=floor,
        closed=closed_share(before, after, floor) if spec.what else None,
        seconds=finding.seconds * 100.0 / len(hidden.stops.speed),
        text=finding.text,
        strength=spec.strength,
        worse=finding.worse,
    )


def _gap_on_fresh_stops(hidden: CarSet, finding: Finding) -> tuple[float, float, float]:
    """Speed disagreement by the configured model, by the finding, and between repeats [m/s]."""
    rng = np.random.default_rng((hidden.spec.seed, 9))
    count = len(hidden.stops.speed)
    share_of_runs = FRESH / count
    clock = np.interp(np.linspace(0.0, count - 1.0, FRESH), np.arange(count), hidden.stops.clock)
    run = round(hidden.nature.payload_run * share_of_runs)
    nature = replace(hidden.nature, payload_run=run)
    stops = draw_stops(FRESH, 0.0, rng)._replace(clock=clock)
    repeats = []
    for _ in range(2):
        friction = 1.0 + hidden.scatter * rng.standard_normal(FRESH)
        delay = 0.006 * rng.standard_normal(FRESH)
        repeats.append(drive(nature, stops._replace(friction=friction, delay=delay)))
    # Resistance lets a vehicle arrive a little slower than commanded.
    command = int(np.searchsorted(repeats[0].time, 0.0))
    calm = stops._replace(
        friction=np.ones(FRESH),
        delay=np.zeros(FRESH),
        speed=0.5 * (repeats[0].speed[:, command] + repeats[1].speed[:, command]),
    )
    time = repeats[0].time[repeats[0].time >= 0.0]
    real = [driven.speed[:, driven.time >= 0.0] for driven in repeats]
    rolling = (real[0] > _MIN_SPEED) & (real[1] > _MIN_SPEED)
    noise = hidden.noise**2
    floor = np.sqrt(0.5 * np.mean((real[0] - real[1])[rolling] ** 2) + noise)
    base = Physics(**hidden.configured)
    model = physics_of(finding, base)
    model = model._replace(step_run=float(round(model.step_run * share_of_runs)))
    gaps = []
    for physics in (base, model):
        here = speeds(physics, calm, time)
        errors = [(driven - here)[rolling] ** 2 for driven in real]
        gaps.append(float(np.sqrt(np.mean(errors) + noise)))
    return gaps[0], gaps[1], float(floor)
