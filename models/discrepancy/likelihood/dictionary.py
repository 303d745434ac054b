"""Every explanation that is tried: columns of named effects, patches, and axes without a name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.axes import COOLING, causes_of, unit_range
from slopewise.models.discrepancy.likelihood.onset import Integrated
from slopewise.models.discrepancy.likelihood.trace import (
    WAVES,
    base_shares,
    projected,
    size_of,
    spread_of,
)
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import stops_seen
from slopewise.models.effects.effect_law import Enters
from slopewise.models.effects.registry import LAWS
from slopewise.models.effects.surface_patch import holds_stops, share_inside
from slopewise.models.parameters import Model

_NEAREST = (4, 6, 9, 13, 18, 26)
"""Stops that circles around one of them hold: from a small place to nearly half of a log."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One explanation: columns of a dictionary with a normal prior.

    Attributes:
        name: effect or axis. named: whether it is an effect. first, count: columns.
        std: (count,) prior deviations. centre: mean of the prior. one_sided: never negative.
        inner: parameters next to the strength. log_prior: ln of its prior odds.
    """

    name: str
    named: bool
    first: int
    count: int
    std: Floats
    centre: float = 0.0
    one_sided: bool = False
    inner: dict[str, float] = field(default_factory=dict)
    log_prior: float = 0.0

    @property
    def index(self) -> list[int]:
        """Columns."""
        return list(range(self.first, self.first + self.count))

    def can_join(self, candidate: Candidate) -> bool:
        """Whether both may be in a set: a shape along an axis can be any effect along it.

        An effect in one place can be in another one, too.
        """
        if self.named == candidate.named:
            return self.name != candidate.name or "radius" in self.inner
        axes = [LAWS[c.name].axis if c.named else c.name for c in (self, candidate)]
        return axes[0] != axes[1]


def prior_of(chosen: Sequence[Candidate]) -> tuple[Floats, Floats]:
    """(P,) deviations and means of the columns of some candidates."""
    std = [c.std for c in chosen]
    centre = [np.full(c.count, c.centre) for c in chosen]
    return np.concatenate([np.empty(0), *std]), np.concatenate([np.empty(0), *centre])


@dataclass(frozen=True)
class Dictionary:
    """Candidates, and (…, Q) their columns."""

    candidates: tuple[Candidate, ...]
    columns: Integrated

    @cached_property
    def groups(self) -> list[slice]:
        """Candidates of each name, which stand together."""
        names = [(c.name, c.named) for c in self.candidates]
        new = [i for i, name in enumerate(names) if i == 0 or name != names[i - 1]]
        return [slice(a, b) for a, b in pairwise([*new, len(names)])]

    def plus(self, table: StopTable, candidate: Candidate, share: Floats) -> Dictionary:
        """With one more candidate of a name that is in it, and (S, M, 1) its column by brakes."""
        group = next(g for g in self.groups if self.candidates[g.start].name == candidate.name)
        added = replace(candidate, first=self.columns.shares.shape[2])
        every = (*self.candidates[: group.stop], added, *self.candidates[group.stop :])
        column = Integrated.of(table, share, np.ones(1, np.bool_))
        return Dictionary(every, self.columns.joined(column))


def spikes_of(table: StopTable, model: Model) -> tuple[Floats, Floats]:
    """(S, M, Q) shares of one smooth form of every effect, and (Q,) whether brakes bring them."""
    seen = stops_seen(table, Hypothesis.configured(model))
    v, constant = table.speed, np.ones_like(table.speed)
    clock = table.session_time[:, None] * constant
    brakes = [np.fmax(table.grade, 0.0), table.grade * np.abs(table.grade), np.abs(table.roll)]
    brakes += [clock, seen.built * seen.heat(COOLING)]
    brakes += [np.cos(table.yaw), np.sin(table.yaw), np.cos(2 * table.yaw), np.sin(2 * table.yaw)]
    brakes += [np.maximum(seen.given - np.quantile(seen.given, 0.7) * np.cos(table.grade), 0.0)]
    if {"x", "y"} <= table.logged:
        x, y = (unit_range(c) for c in (table.x, table.y))
        brakes += [x, y, x * y, x * x, y * y]
    columns = [*brakes, v, v * v, np.abs(table.yaw_rate)]
    keep = [i for i, c in enumerate(columns) if np.ptp(c) > 1e-9]
    through = np.array([i < len(brakes) for i in keep])
    return np.stack([columns[i] for i in keep], axis=2), through


def dictionary_of(
    table: StopTable, model: Model, used: Floats, force: float, odds: float
) -> Dictionary:
    """Everything that is tried on a log; odds as for :func:`.weigh.weighed`."""
    every = [*_effects(table, model, used, force), *_causes(table, used, force)]
    first = np.cumsum([0, *(c.count for c, _, _ in every)])
    candidates = tuple(
        replace(c, first=int(at), log_prior=c.log_prior + float(np.log(odds)))
        for (c, _, _), at in zip(every, first[:-1], strict=True)
    )
    through = np.repeat([brakes for _, _, brakes in every], [c.count for c in candidates])
    shares = np.concatenate([columns for _, columns, _ in every], axis=2)
    return Dictionary(candidates, Integrated.of(table, shares, through))


def _effects(
    table: StopTable, model: Model, used: Floats, force: float
) -> Iterator[tuple[Candidate, Floats, bool]]:
    """Named effects: candidate, (S, M, Q) columns, and whether brakes bring them."""
    taken = {effect.name for effect in model.effect}
    seen = stops_seen(table, Hypothesis.configured(model))
    for name, law in LAWS.items():
        how = law.search
        if how is None or not law.channels <= table.logged:
            continue
        if name in taken and (law.once or law.enters is Enters.CAP):
            continue
        group = [*how.columns(seen), *(circles(table) if how.placed else ())]
        group = [g for g in group if np.any(np.ptp(g[1], axis=(0, 1)) > 1e-9)]
        for inner, share in group:
            columns = share if share.ndim == 3 else share[:, :, None]
            size = np.maximum(spread_of(columns, used), 1e-9)
            std, centre = (np.full(len(size), 0.5), 1.0)
            if not how.is_complete:
                std, centre = prior.SLAB * force / size / np.sqrt(len(size)), 0.0
            candidate = Candidate(
                *(name, True, 0, len(size), std, centre),
                one_sided=how.one_sided,
                inner=inner,
                log_prior=float(np.log(prior.NAME / len(group))),
            )
            yield candidate, columns, law.enters is not Enters.MOTION


def _causes(
    table: StopTable, used: Floats, force: float
) -> Iterator[tuple[Candidate, Floats, bool]]:
    """Causes without a name: candidate, (S, M, Q) columns, and whether brakes bring them."""
    base = base_shares(table)
    for axis in causes_of(table):
        log_prior = float(np.log(prior.AXIS / len(axis.shapes)))
        for shapes in axis.shapes:
            flat = projected(shapes, base, used)
            sizes, count = np.maximum(size_of(flat, used), 1e-3), shapes.shape[2]
            falling = 1.0 / np.arange(1.0, count + 1.0) if count == WAVES else np.ones(count)
            std = prior.SLAB * force * falling / sizes / np.sqrt(np.sum(falling**2))
            cause = Candidate(axis.name, False, 0, count, std, log_prior=log_prior)
            yield cause, flat, axis.name != "speed"


def circles(table: StopTable) -> Iterator[tuple[dict[str, float], Floats]]:
    """Around each stop, with as many others inside: small where stops lie close."""
    x, y = table.x.mean(axis=1), table.y.mean(axis=1)
    for i in range(len(table)):
        away = np.sort(np.hypot(x - x[i], y - y[i]))
        for count in _NEAREST:
            if count < len(away) // 2 and away[count] > away[count - 1] + 0.5:
                radius = 0.5 * float(away[count] + away[count - 1])
                at = {"x": float(x[i]), "y": float(y[i]), "radius": radius}
                inside = share_inside(table.x, table.y, at["x"], at["y"], radius)
                if holds_stops(inside):
                    yield at, inside
