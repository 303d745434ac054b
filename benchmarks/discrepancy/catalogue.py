"""Which sets there are, and how one comes about from its seed."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from . import sensing
from .designs import DESIGNS, draw
from .hidden import NAMED, OFF_LIBRARY, PAIRS, SIZES, HiddenTerm, draw_hidden
from .physics import Physics, Stops
from .plant import drive
from .worth import Worth, worth

T = TypeVar("T")

ABSORBED = ("grade_bias", "furrows one way", "uphill only", "same roll everywhere")

_TRIES = 6  # for a set in which the effect can be named at all
_BIAS = 0.025  # [rad] of the pitch sensor


@dataclass(frozen=True, slots=True, kw_only=True)
class SetConditions:
    """From which those of a set are drawn: designs, numbers of stops, noise [m/s], scatter [1]."""

    designs: tuple[str, ...] = DESIGNS
    counts: tuple[int, ...] = (40, 70, 100, 150, 200)
    noises: tuple[float, ...] = (0.01, 0.03, 0.06)
    scatters: tuple[float, ...] = (0.005, 0.02, 0.05)


ALL = SetConditions()


@dataclass(frozen=True, slots=True)
class Order:
    """One set that is wanted: kind and names of what is hidden.

    Attributes:
        kind: clean, drift, single, pair, absorbed, off or faint (a small effect, as it comes).
        names: of the effects. size: of them. seed: of everything else.
    """

    kind: str
    names: tuple[str, ...]
    size: str
    seed: int


@dataclass(frozen=True, slots=True)
class HiddenSet:
    """One set: a log, a configured model, and the truth.

    Attributes:
        order: what was wanted. design, noise, scatter: how it was driven and measured.
        columns: of the drive log. configured: [braking] coefficients of the model file.
        truth: the world. hidden: what is in it. stops: what was driven. worth: what can be known.
    """

    order: Order
    design: str
    noise: float
    scatter: float
    columns: sensing.Columns
    configured: dict[str, float]
    truth: Physics
    hidden: tuple[HiddenTerm, ...]
    stops: Stops
    worth: Worth

    @property
    def base(self) -> Physics:
        """The world without what is hidden in it."""
        changed = {key for term in self.hidden for key in term.fields}
        return self.truth._replace(**{key: Physics._field_defaults[key] for key in changed})

    @property
    def identifiable(self) -> bool:
        """What is to be said of it can be known."""
        return self.worth.shaped if self.order.kind == "off" else self.worth.named


def orders(share: float, seed: int = 1) -> list[Order]:
    """All kinds in random order, each kind spread evenly over it.

    Args:
        share: 1 for the whole benchmark, less for fewer of each kind. seed: of sets and order.
    """
    rng = np.random.default_rng((6, seed))
    found = [Order(*what, seed=int(rng.integers(2**31))) for what in _wanted(share)]
    return spread(found, lambda o: (o.kind, o.names, o.size), rng)


def spread(
    items: Sequence[T], family: Callable[[T], Hashable], rng: np.random.Generator
) -> list[T]:
    """In random order, so that every first part of it holds a fair share of each family."""
    members: dict[Hashable, list[T]] = {}
    for item in items:
        members.setdefault(family(item), []).append(item)
    places = [
        ((i + begin) / len(own), item)
        for own, begin in zip(members.values(), rng.random(len(members)), strict=True)
        for i, item in enumerate(own)
    ]
    return [item for _, item in sorted(places, key=lambda placed: placed[0])]


def _wanted(share: float) -> Iterator[tuple[str, tuple[str, ...], str]]:
    def times(whole: int) -> range:
        return range(max(round(share * whole), 1))

    for _ in times(300):
        yield "clean", (), ""
    for _ in times(60):
        yield "drift", (), ""
    for name in NAMED:
        for size in SIZES:
            for _ in times(5):
                yield "single", (name,), size
    for pair in PAIRS:
        for size in ("medium", "large"):
            for _ in times(2):
                yield "pair", pair, size
    for name in ABSORBED:
        for _ in times(6):
            yield "absorbed", (name,), "medium"
    for name in OFF_LIBRARY:
        for size in ("medium", "large"):
            for _ in times(4):
                yield "off", (name,), size
    for name in NAMED:
        for _ in times(2):
            yield "faint", (name,), "small"


def make(order: Order, conditions: SetConditions = ALL) -> HiddenSet:
    """Drive and measure one set.

    Args:
        order: what is wanted. conditions: to draw from.

    Where an effect is to be named, all is drawn anew until it can be, a few times at most.
    """
    rng = np.random.default_rng(order.seed)
    wanted = order.kind in ("single", "pair", "off")
    for _ in range(_TRIES if wanted else 1):
        candidate = drawn(order, rng, conditions)
        if not wanted or candidate.identifiable:
            break
    return measured(candidate, rng)


def sampled_late(stops: Stops, rng: np.random.Generator) -> Stops:
    """The command comes somewhere between two samples; the log has it at the later one."""
    phase = rng.uniform(0.0, 1.0 / sensing.RATE, len(stops.delay))
    return stops._replace(delay=stops.delay - phase)


def drawn(order: Order, rng: np.random.Generator, conditions: SetConditions = ALL) -> HiddenSet:
    """One set as it comes, not yet measured."""
    c = conditions
    design, scatter = str(rng.choice(c.designs)), float(rng.choice(c.scatters))
    count, noise = int(rng.choice(c.counts)), float(rng.choice(c.noises))
    base = _draw_base(rng)
    name = order.names[0] if order.names else ""
    absorbed = order.kind == "absorbed"
    stops = draw("one-way" if absorbed and "one way" in name else design, count, scatter, rng)
    configured = _configured(base, rng, drifted=order.kind == "drift")
    if order.kind == "clean":
        configured = {key: float(getattr(base, key)) for key in configured}
    # Logs show a command half a sample late, and so do logs that were calibrated from.
    configured["dead_time"] -= 0.5 / sensing.RATE
    if absorbed:
        hidden, stops = _absorbed(name, base, stops, rng)
        found = Worth(0.0, "", 0.0)
        truth = base._replace(**hidden.fields)
        return HiddenSet(
            order, design, noise, scatter, {}, configured, truth, (hidden,), stops, found
        )
    hiddens = tuple(draw_hidden(n, order.size, base, stops, rng) for n in order.names)
    truth = base
    for hidden in hiddens:
        truth = truth._replace(**hidden.fields)
    found = Worth(0.0, "", 0.0)
    if hiddens:
        found = worth(truth, base, stops, noise, scatter, order.names)
    return HiddenSet(order, design, noise, scatter, {}, configured, truth, hiddens, stops, found)


def _draw_base(rng: np.random.Generator) -> Physics:
    return Physics(
        m_m=float(rng.uniform(-0.03, 0.02)),
        b_m=float(rng.uniform(-0.40, -0.05)),
        m_b=float(rng.uniform(-0.006, 0.015)),
        b_b=float(rng.uniform(0.40, 0.52)),
        dead_time=float(rng.uniform(0.15, 0.40)),
    )


def _configured(base: Physics, rng: np.random.Generator, *, drifted: bool) -> dict[str, float]:
    """What an earlier calibration found, or what it was before the vehicle changed."""
    spread = 6.0 if drifted else 1.0
    wide = {"m_m": 0.002, "b_m": 0.01, "m_b": 0.001, "b_b": 0.006, "dead_time": 0.008}
    values = {
        key: float(getattr(base, key)) + spread * std * float(rng.standard_normal())
        for key, std in wide.items()
    }
    if drifted:
        # At least the level force or the dead time is clearly another one.
        change = float(rng.choice([-1.0, 1.0])) * float(rng.uniform(0.04, 0.08))
        key = str(rng.choice(["b_b", "dead_time"]))
        values[key] = float(getattr(base, key)) + change * (1.0 if key == "b_b" else 1.5)
    return values


def _absorbed(
    name: str, base: Physics, stops: Stops, rng: np.random.Generator
) -> tuple[HiddenTerm, Stops]:
    """Effects that these stops cannot show: the base takes them up."""
    if name == "grade_bias":
        return HiddenTerm(name, {}), stops
    if name == "furrows one way":
        same = stops._replace(
            heading=np.full_like(stops.heading, 0.4), curvature=np.zeros_like(stops.speed)
        )
        fields = {"furrow": 0.05, "furrow_direction": float(rng.uniform(0.0, 0.3))}
        return HiddenTerm(name, fields), same
    if name == "uphill only":
        up = stops._replace(grade=np.abs(stops.grade) + 0.03)
        return HiddenTerm(name, {"asymmetry": float(rng.uniform(0.2, 0.4))}), up
    same = stops._replace(roll=np.full_like(stops.roll, 0.1))
    return HiddenTerm(name, {"cross_slope": float(rng.uniform(0.2, 0.4))}), same


def measured(found: HiddenSet, rng: np.random.Generator) -> HiddenSet:
    """The set with its log."""
    late = sampled_late(found.stops, rng)
    motion = drive(found.truth, late, sensing.sample_times(11.0))
    columns = sensing.log(motion, late, found.noise, rng)
    if found.order.names[:1] == ("grade_bias",):
        columns["pitch"] = columns["pitch"] + _BIAS
    return replace(found, columns=columns)
