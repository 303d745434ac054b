"""Sets of the physics engine: effects made by physics, clean ones, and how they are judged."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from . import sensing
from .designs import FIELD, draw
from .engine import Nature, drive
from .engine_outcomes import NAMES, EngineOrder, EngineOutcome
from .fresh import WORTH_CLOSING, physics_of
from .physics import Floats, Physics, Stops
from .plant import DrivenStops, speeds
from .sealed import Finding

_KEYS = ("m_m", "b_m", "m_b", "b_b", "dead_time")
_STOPS, _FRESH = 70, 24
_ROLLING = 0.1  # [m/s]


@dataclass(frozen=True, slots=True)
class EngineSet:
    """A log of the engine, the configured model, and the truth."""

    order: EngineOrder
    noise: float
    scatter: float
    nature: Nature
    columns: sensing.Columns
    configured: dict[str, float]
    stops: Stops


@cache
def calibrated() -> dict[str, float]:
    """Coefficients and dead time of the vehicle before anything happened to it."""
    stops = _straight("mixed", 50, 0.0, np.random.default_rng(77))
    motion = drive(Nature(), stops._replace(delay=np.zeros_like(stops.speed)))
    return _fitted(motion, stops)


def make(order: EngineOrder, configured: dict[str, float], count: int = _STOPS) -> EngineSet:
    """Drive and measure one set."""
    rng = np.random.default_rng(order.seed)
    noise, scatter = float(rng.choice([0.01, 0.03])), float(rng.choice([0.0075, 0.02]))
    stops = _straight("mixed", count, scatter, rng)
    nature = _nature(order.what, stops, rng)
    motion = drive(nature, stops)
    columns = sensing.log(motion, stops, noise, rng)
    return EngineSet(order, noise, scatter, nature, columns, configured, stops)


def _straight(design: str, count: int, scatter: float, rng: np.random.Generator) -> Stops:
    """The engine's vehicle cannot steer."""
    stops = draw(design, count, scatter, rng)
    return stops._replace(curvature=np.zeros(count), roll=0.6 * stops.roll)


def _nature(what: str, stops: Stops, rng: np.random.Generator) -> Nature:
    strong = float(rng.uniform(0.8, 1.4))
    run = round(len(stops.speed) * rng.uniform(0.35, 0.65))
    x, y = (float(rng.uniform(230.0, side - 230.0)) for side in FIELD)
    towards = float(rng.uniform(-np.pi, np.pi))
    changes: dict[str, dict[str, Any]] = {
        "": {},
        "heavier body": {"payload": 90.0 * strong, "payload_run": run},
        "weaker brakes": {"repair": 1.0 - 0.15 * strong, "payload_run": run},
        "air": {"air": 12.0 * strong},
        "wind": {"air": 4.0 * strong, "wind": 7.0, "wind_from": towards},
        "fading brakes": {"fading": 0.004 * strong, "cooling": 150.0},
        "slippery area": {"slippery": (x, y, 200.0, 0.34 / strong)},
        "viscous bearings": {"bearing": 1.6 * strong},
        "slow hydraulics": {"build_up": 0.12 * strong},
        "glazing pads": {"glazing": 0.15 * strong / float(stops.clock[-1])},
    }
    return replace(Nature(), **changes[what])


def _fitted(motion: DrivenStops, stops: Stops) -> dict[str, float]:
    """Base coefficients by least squares over the speeds of noise-free stops."""
    time = motion.time[motion.time >= 0.0]
    real = motion.speed[:, motion.time >= 0.0]
    even = stops._replace(friction=np.ones_like(stops.speed), delay=np.zeros_like(stops.speed))
    rolling = real > _ROLLING

    def left(values: Floats) -> Floats:
        found: Floats = (speeds(Physics(*values), even, time, 0.005) - real)[rolling]
        return found

    start = np.array([0.0, 0.0, 0.0, 0.42, 0.25])
    best = least_squares(left, start, x_scale=[0.01, 0.1, 0.01, 0.1, 0.05], diff_step=1e-4)
    return dict(zip(_KEYS, (float(v) for v in best.x), strict=True))


def judge(engine_set: EngineSet, finding: Finding) -> EngineOutcome:
    """Names beside the truth, and the gap on fresh stops that are driven twice."""
    order = engine_set.order
    sure = finding.verdict == "missing_effect"
    allowed = [frozenset(names) for names in NAMES.get(order.what, ())]
    named = frozenset(finding.names)
    right = sure and named in allowed
    wrong = sure and not any(named <= names for names in allowed)
    before, after, floor = _fresh(engine_set, finding)
    closed = None
    if order.what and before >= WORTH_CLOSING * floor:
        closed = (before - after) / (before - floor)
    return EngineOutcome(
        order.what or "clean", order.seed, engine_set.noise, engine_set.scatter,
        finding.verdict, finding.names, right, wrong, before, after, floor, closed,
        finding.closed, finding.seconds * 100.0 / len(engine_set.stops.speed), finding.text,
    )  # fmt: skip


def _fresh(engine_set: EngineSet, finding: Finding) -> tuple[float, float, float]:
    """Root mean square disagreement in speed: configured, found, and from twin to twin [m/s]."""
    rng = np.random.default_rng((engine_set.order.seed, 9))
    count = len(engine_set.stops.speed)
    share_of_runs = _FRESH / count
    clock = np.interp(
        np.linspace(0.0, count - 1.0, _FRESH), np.arange(count), engine_set.stops.clock
    )
    nature = replace(
        engine_set.nature, payload_run=round(engine_set.nature.payload_run * share_of_runs)
    )
    stops = _straight("mixed", _FRESH, 0.0, rng)._replace(clock=clock)
    even = stops._replace(friction=np.ones(_FRESH), delay=np.zeros(_FRESH))
    twins = []
    for _ in range(2):
        friction = 1.0 + engine_set.scatter * rng.standard_normal(_FRESH)
        delay = 0.006 * rng.standard_normal(_FRESH)
        twins.append(drive(nature, stops._replace(friction=friction, delay=delay)))
    time = twins[0].time[twins[0].time >= 0.0]
    real = [twin.speed[:, twin.time >= 0.0] for twin in twins]
    rolling = (real[0] > _ROLLING) & (real[1] > _ROLLING)
    noise = engine_set.noise**2
    floor = np.sqrt(0.5 * np.mean((real[0] - real[1])[rolling] ** 2) + noise)
    base = Physics(**engine_set.configured)
    found = physics_of(finding, base)
    found = found._replace(step_run=float(round(found.step_run * share_of_runs)))
    sizes = []
    for physics in (base, found):
        here = speeds(physics, even, time)
        errors = [(one - here)[rolling] ** 2 for one in real]
        sizes.append(float(np.sqrt(np.mean(errors) + noise)))
    return sizes[0], sizes[1], float(floor)


def truth_of(engine_set: EngineSet) -> dict[str, Any]:
    """What is true of a set, for the sealed file."""
    return asdict(engine_set.order) | {"nature": asdict(engine_set.nature)}
