"""What all worlds share in which effects come about by physics: sets, coefficients, judgement."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np
from scipy.optimize import least_squares

from . import sensing
from .fresh import WORTH_CLOSING, physics_of
from .physics import Floats, Physics, Stops
from .plant import DrivenStops, speeds
from .sealed import InquiryFinding
from .world_outcomes import CLEAN, WorldOrder, WorldOutcome

N = TypeVar("N")
Names = dict[str, tuple[tuple[str, ...], ...]]

STOPS, FRESH = 70, 24
_KEYS = ("m_m", "b_m", "m_b", "b_b", "dead_time")
_ROLLING = 0.1  # [m/s]


@dataclass(frozen=True, slots=True)
class World(Generic[N]):
    """One of them; N is the dataclass of what is so in it, with a ``payload_run`` among it.

    Attributes:
        drive: the stops. scene: draws stops that its vehicle can drive: count, scatter, chance.
        nature: draws what an order hides in such stops. names: what each is called.
    """

    drive: Callable[[N, Stops], DrivenStops]
    scene: Callable[[int, float, np.random.Generator], Stops]
    nature: Callable[[WorldOrder, Stops, np.random.Generator], N]
    names: Names


@dataclass(frozen=True, slots=True)
class WorldSet(Generic[N]):
    """A log of a world, the configured model, and the truth."""

    order: WorldOrder
    noise: float
    scatter: float
    nature: N
    columns: sensing.Columns
    configured: dict[str, float]
    stops: Stops

    def truth(self) -> dict[str, Any]:
        """What is true of it, for the sealed file."""
        nature: Any = self.nature
        return asdict(self.order) | {"nature": asdict(nature)}


def make(
    world: World[N],
    order: WorldOrder,
    configured: Callable[[N], dict[str, float]],
    count: int = STOPS,
) -> WorldSet[N]:
    """Drive and measure one set.

    Args:
        world: in which. order: what is wanted. count: of stops.
        configured: coefficients and dead time of a vehicle before anything happened to it.
    """
    rng = np.random.default_rng(order.seed)
    noise, scatter = float(rng.choice([0.01, 0.03])), float(rng.choice([0.0075, 0.02]))
    stops = world.scene(count, scatter, rng)
    nature = world.nature(order, stops, rng)
    motion = world.drive(nature, stops)
    columns = sensing.log(motion, stops, noise, rng)
    return WorldSet(order, noise, scatter, nature, columns, configured(nature), stops)


def calibrated(world: World[N], nature: N) -> dict[str, float]:
    """Coefficients and dead time by least squares over the speeds of noise-free stops."""
    stops = world.scene(50, 0.0, np.random.default_rng(77))
    stops = stops._replace(delay=np.zeros_like(stops.speed))
    motion = world.drive(nature, stops)
    time = motion.time[motion.time >= 0.0]
    real = motion.speed[:, motion.time >= 0.0]
    even = stops._replace(friction=np.ones_like(stops.speed))
    rolling = real > _ROLLING

    def left(values: Floats) -> Floats:
        found: Floats = (speeds(Physics(*values), even, time, 0.005) - real)[rolling]
        return found

    start = np.array([0.0, 0.0, 0.0, 0.42, 0.25])
    best = least_squares(left, start, x_scale=[0.01, 0.1, 0.01, 0.1, 0.05], diff_step=1e-4)
    return dict(zip(_KEYS, (float(v) for v in best.x), strict=True))


def judge(world: World[N], one: WorldSet[N], finding: InquiryFinding) -> WorldOutcome:
    """Names beside the truth, and the gap on fresh stops that are driven twice."""
    order = one.order
    right, wrong = _named(finding, world.names.get(order.what, ()))
    before, after, floor = _fresh(world, one, finding)
    closed = None
    if order.what and before >= WORTH_CLOSING * floor:
        closed = (before - after) / (before - floor)
    return WorldOutcome(
        order.what or CLEAN,
        order.seed,
        one.noise,
        one.scatter,
        finding.verdict,
        finding.names,
        right,
        wrong,
        before,
        after,
        floor,
        closed,
        finding.closed,
        finding.seconds * 100.0 / len(one.stops.speed),
        finding.text,
        order.strength,
        finding.worse,
    )


def _named(finding: InquiryFinding, allowed: Sequence[tuple[str, ...]]) -> tuple[bool, bool]:
    """Whether the names are right, and whether one of them is wrong."""
    sure = finding.verdict == "missing_effect"
    known = [frozenset(names) for names in allowed]
    named = frozenset(finding.names)
    return sure and named in known, sure and not any(named <= names for names in known)


def _fresh(
    world: World[N], one: WorldSet[N], finding: InquiryFinding
) -> tuple[float, float, float]:
    """Root mean square disagreement in speed: configured, found, and from twin to twin [m/s]."""
    rng = np.random.default_rng((one.order.seed, 9))
    count = len(one.stops.speed)
    share_of_runs = FRESH / count
    clock = np.interp(np.linspace(0.0, count - 1.0, FRESH), np.arange(count), one.stops.clock)
    known: Any = one.nature
    nature: N = replace(known, payload_run=round(known.payload_run * share_of_runs))
    stops = world.scene(FRESH, 0.0, rng)._replace(clock=clock)
    even = stops._replace(friction=np.ones(FRESH), delay=np.zeros(FRESH))
    twins = []
    for _ in range(2):
        friction = 1.0 + one.scatter * rng.standard_normal(FRESH)
        delay = 0.006 * rng.standard_normal(FRESH)
        twins.append(world.drive(nature, stops._replace(friction=friction, delay=delay)))
    # What holds a vehicle back while it is driven lets it come a little slower than it was told.
    command = int(np.searchsorted(twins[0].time, 0.0))
    even = even._replace(speed=0.5 * (twins[0].speed[:, command] + twins[1].speed[:, command]))
    time = twins[0].time[twins[0].time >= 0.0]
    real = [twin.speed[:, twin.time >= 0.0] for twin in twins]
    rolling = (real[0] > _ROLLING) & (real[1] > _ROLLING)
    noise = one.noise**2
    floor = np.sqrt(0.5 * np.mean((real[0] - real[1])[rolling] ** 2) + noise)
    base = Physics(**one.configured)
    found = physics_of(finding, base)
    found = found._replace(step_run=float(round(found.step_run * share_of_runs)))
    sizes = []
    for physics in (base, found):
        here = speeds(physics, even, time)
        errors = [(driven - here)[rolling] ** 2 for driven in real]
        sizes.append(float(np.sqrt(np.mean(errors) + noise)))
    return sizes[0], sizes[1], float(floor)
