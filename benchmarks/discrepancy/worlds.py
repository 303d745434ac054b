"""Worlds in which effects arise from physics: sets, calibrated coefficients, scores."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np
from scipy.optimize import least_squares

from . import sensing
from .blind_run import COEFFICIENTS, Finding
from .effect_plant import DrivenStops, speeds
from .fresh_stops import closed_share, physics_of
from .plant_physics import Floats, Physics, Stops
from .world_outcomes import CLEAN, Names, WorldOutcome, WorldSpec

N = TypeVar("N")

STOPS, FRESH = 70, 24  # of a log, and fresh ones to score it
_MIN_SPEED = 0.1  # [m/s] of compared samples


@dataclass(frozen=True, slots=True)
class World(Generic[N]):
    """One world; N is the dataclass of its nature, which has a ``payload_run``.

    Attributes:
        drive: drives stops.
        scene: draws stops that its vehicle can drive: count, scatter, generator.
        nature: draws the nature of a set in such stops.
        names: right names of each effect.
    """

    drive: Callable[[N, Stops], DrivenStops]
    scene: Callable[[int, float, np.random.Generator], Stops]
    nature: Callable[[WorldSpec, Stops, np.random.Generator], N]
    names: Names


@dataclass(frozen=True, slots=True)
class WorldSet(Generic[N]):
    """A log of a world, the configured model, and the truth."""

    spec: WorldSpec
    noise: float
    scatter: float
    nature: N
    columns: sensing.Columns
    configured: dict[str, float]
    stops: Stops

    def truth(self) -> dict[str, Any]:
        """Truth of the set, for the commitment."""
        nature: Any = self.nature
        return asdict(self.spec) | {"nature": asdict(nature)}


def make(
    world: World[N],
    spec: WorldSpec,
    configured: Callable[[N], dict[str, float]],
    count: int = STOPS,
) -> WorldSet[N]:
    """Drive and measure one set.

    Args:
        world: the world.
        spec: request.
        configured: coefficients and dead time of its vehicle before any change.
        count: number of stops.
    """
    rng = np.random.default_rng(spec.seed)
    noise, scatter = float(rng.choice([0.01, 0.03])), float(rng.choice([0.0075, 0.02]))
    stops = world.scene(count, scatter, rng)
    nature = world.nature(spec, stops, rng)
    columns = sensing.log(world.drive(nature, stops), stops, noise, rng)
    return WorldSet(spec, noise, scatter, nature, columns, configured(nature), stops)


def calibrated(world: World[N], nature: N) -> dict[str, float]:
    """Fit coefficients and dead time to the speeds of noise-free stops by least squares."""
    stops = world.scene(50, 0.0, np.random.default_rng(77))
    stops = stops._replace(delay=np.zeros_like(stops.speed))
    motion = world.drive(nature, stops)
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


def score_world(world: World[N], hidden: WorldSet[N], finding: Finding) -> WorldOutcome:
    """Compare names with the truth, and measure the gap on fresh stops that are driven twice."""
    spec = hidden.spec
    allowed = [frozenset(names) for names in world.names.get(spec.what, ())]
    named = frozenset(finding.names)
    before, after, floor = _gap_on_fresh_stops(world, hidden, finding)
    return WorldOutcome(
        spec.what or CLEAN,
        spec.seed,
        hidden.noise,
        hidden.scatter,
        finding.verdict,
        finding.names,
        finding.is_confident and named in allowed,
        finding.is_confident and not any(named <= names for names in allowed),
        before,
        after,
        floor,
        closed_share(before, after, floor) if spec.what else None,
        finding.closed,
        finding.seconds * 100.0 / len(hidden.stops.speed),
        finding.text,
        spec.strength,
        finding.worse,
    )


def _gap_on_fresh_stops(
    world: World[N], hidden: WorldSet[N], finding: Finding
) -> tuple[float, float, float]:
    """Speed disagreement by the configured model, by the finding, and between repeats [m/s]."""
    rng = np.random.default_rng((hidden.spec.seed, 9))
    count = len(hidden.stops.speed)
    share_of_runs = FRESH / count
    clock = np.interp(np.linspace(0.0, count - 1.0, FRESH), np.arange(count), hidden.stops.clock)
    drawn_nature: Any = hidden.nature
    nature: N = replace(drawn_nature, payload_run=round(drawn_nature.payload_run * share_of_runs))
    stops = world.scene(FRESH, 0.0, rng)._replace(clock=clock)
    repeats = []
    for _ in range(2):
        friction = 1.0 + hidden.scatter * rng.standard_normal(FRESH)
        delay = 0.006 * rng.standard_normal(FRESH)
        repeats.append(world.drive(nature, stops._replace(friction=friction, delay=delay)))
    # Resistance lets a vehicle arrive a little slower than commanded.
    command = int(np.searchsorted(repeats[0].time, 0.0))
    calm = stops._replace(
        friction=np.ones(FRESH),
        delay=np.zeros(FRESH),
        speed=0.5 * (repeats[0].speed[:, command] + repeats[1].speed[:, command]),
    )
    time = repeats[0].time[repeats[0].time >= 0.0]
    real = [drive.speed[:, drive.time >= 0.0] for drive in repeats]
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
