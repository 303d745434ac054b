"""Friction that caps the force: which stops it caps depends on what all other columns say.

Where the cap holds, brakes that would pull more change nothing: there the force is μ cos θ cos φ,
and every column that brakes bring is zero, that of the scatter between stops among them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.likelihood.onset import Integrated
from slopewise.models.discrepancy.likelihood.trace import WAVES
from slopewise.models.effects.effect_law import Enters
from slopewise.models.effects.registry import LAWS

if TYPE_CHECKING:
    from slopewise.models.discrepancy.likelihood.dictionary import Candidate
    from slopewise.models.discrepancy.likelihood.trace import Trace

_SPREAD = 0.03  # prior deviation of μ about the value found so far [1]
_GROUND_SCATTER = 0.3  # of the scatter of brakes: what friction differs by between stops [1]


@dataclass(frozen=True, slots=True)
class Cap:
    """Where a cap holds, (S, M) in `held`; its friction; (S, M) F_b/W that brakes would bring."""

    held: Floats
    free: Floats
    friction: float
    upright: Floats


def cap_of(chosen: tuple[Candidate, ...]) -> tuple[int, float] | None:
    """Index of the cap among the columns of an explanation, and its friction; None without."""
    place = 0
    for c in chosen:
        if c.named and LAWS[c.name].enters is Enters.CAP:
            return place, c.inner["mu"]
        place += c.count
    return None


def free_force(trace: Trace, extra: Integrated, mean: Floats, cap: int) -> Floats:
    """(S, M) F_b/W that brakes would bring without the cap."""
    first = len(mean) - extra.shares.shape[2]
    always = first - trace.always.shares.shape[2]
    beside = np.arange(extra.shares.shape[2]) != cap
    through = trace.always.through
    force = trace.expected.shares[:, :, 0].copy()
    force += trace.always.shares[:, :, through] @ mean[always:first][through]
    brakes = extra.through & beside
    force += extra.shares[:, :, brakes] @ mean[first:][brakes]
    return np.asarray(force, np.float64)


def under_cap(
    trace: Trace, extra: Integrated, chosen: tuple[Candidate, ...], cap: int, found: Cap
) -> tuple[Trace, Integrated, tuple[Candidate, ...]]:
    """Columns where a cap holds at some places."""
    table, held = trace.table, found.held[:, :, None]

    def passed(columns: Integrated, kept: float = 0.0, but: slice = slice(0)) -> Integrated:
        left = np.where(columns.through, 1.0 - (1.0 - kept) * held, 1.0)
        left[:, :, but] = 1.0
        return Integrated.of(table, columns.shares * left, columns.through)

    expected = trace.expected.shares.copy()
    at_cap = found.friction * found.upright
    expected[:, :, 0] = np.where(found.held > 0.5, at_cap, expected[:, :, 0])
    own = passed(extra)
    shares = own.shares.copy()
    shares[:, :, cap] = found.held * found.upright
    again = tuple(
        replace(c, std=np.array([_SPREAD]), centre=0.0, inner={"mu": found.friction})
        if c.named and LAWS[c.name].enters is Enters.CAP
        else c
        for c in chosen
    )
    # Brakes that build up to r times the cap reach it sooner: the same missing impulse, see below.
    changed = replace(
        trace,
        quicker=quicker(found),
        expected=Integrated.of(table, expected, trace.expected.through),
        always=passed(trace.always, but=slice(4, 4 + WAVES)),
        waves=passed(trace.waves, kept=_GROUND_SCATTER),
    )
    return changed, Integrated.of(table, shares, extra.through), again


def quicker(found: Cap) -> Floats:
    """(S, 1) build-up of each stop over that of the brakes.

    Brakes that build up to r μ reach the cap after u = τ ln(r/(r − 1)); what is missing until then
    is μ τ (1 − (r − 1) ln(r/(r − 1))).
    """
    most = np.maximum(found.free / np.maximum(found.friction * found.upright, 1e-3), 1.0 + 1e-6)
    share = 1.0 - (most - 1.0) * np.log(most / (most - 1.0))
    first = np.argmax(found.held, axis=1)
    rows = np.arange(len(first))
    result: Floats = np.where(found.held.any(axis=1), share[rows, first], 1.0)[:, None]
    return np.maximum(result, 0.05)
