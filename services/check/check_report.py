"""Result of the checker: violations by station, kind and size."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.services.check.tolerances import TOLERANCES


@dataclass(frozen=True, slots=True)
class Violation:
    """One rule broken at one row of a plan, where it is worst between that row and the next."""

    candidate: str
    row: int  # index of the plan's row, from 0
    station: float  # metres along the ground
    kind: str  # of :data:`slopewise.services.check.tolerances.TOLERANCES`
    size: float  # by how much the limit is passed, in ``unit``
    unit: str
    sentence: str


@dataclass(frozen=True, slots=True, eq=False)
class CheckReport:
    """Result of one plan with N rows at different places."""

    candidate: str
    status: str
    # by station; empty if the plan keeps every rule that could be judged
    violations: tuple[Violation, ...]
    notes: tuple[str, ...]
    station: Floats  # (N,) own stations [m]
    # (N,) nominal emergency stops, with the safety offset, 0 at rest [m]: speed held in the dead
    # time, force as learned. Of a stop that was not followed to its end, the distance up to there.
    stop_distance: Floats
    rear_load: Floats  # (N,) least rear load on them, as a share of the level static one
    stops: int
    # columns of the plan that agree with positions, speeds, map and model, or are among the
    # violations; its other columns
    verified: tuple[str, ...] = ()
    unverified: tuple[str, ...] = ()

    @property
    def valid(self) -> bool:
        """Return True if the plan keeps every rule that was checked."""
        return not self.violations

    @property
    def refused_for(self) -> str | None:
        """The violation that is most times its tolerance, as text; None without one."""
        if not self.violations:
            return None
        v = max(self.violations, key=lambda v: v.size / TOLERANCES[v.kind].value)
        return f"{v.kind} at {v.station:.2f} m: {v.sentence}"

    def worst(self) -> dict[str, Violation]:
        """The largest violation of each kind."""
        largest: dict[str, Violation] = {}
        for violation in self.violations:
            known = largest.get(violation.kind)
            if known is None or violation.size > known.size:
                largest[violation.kind] = violation
        return largest


@dataclass(slots=True)
class ViolationLog:
    """Collects violations of one plan."""

    candidate: str
    row: Ints  # (M,) row of the plan that each sample belongs to
    station: Floats  # (M,) of the samples [m]
    _worst: dict[tuple[int, str], Violation] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    sparse: set[int] = field(default_factory=set)  # rows too far from the next to judge anything

    def add(
        self,
        kind: str,
        excess: Floats,
        sentence: str,
        *values: Floats,
        where: Bools | bool = True,
        at: Ints | None = None,
    ) -> None:
        """Note every row where something goes beyond its limit by more than the tolerance.

        Args:
            excess: by how much, at each sample (M,), or at those of ``at``.
            sentence: with ``{0:…}`` for the first of ``values`` at the sample, and so on.
            where: the samples to which the rule applies.
            at: samples of ``excess``, ``values`` and ``where``; all without.
        """
        tolerance = TOLERANCES[kind]
        for i in np.flatnonzero(where & ~(excess <= tolerance.value)).tolist():
            k, size = (i if at is None else int(at[i])), float(excess[i])
            key = (int(self.row[k]), kind)
            if key[0] in self.sparse:
                continue
            known = self._worst.get(key)
            if known is None or size > known.size:
                message = sentence.format(*(float(v[i]) for v in values))
                place = (self.candidate, key[0], float(self.station[k]))
                self._worst[key] = Violation(*place, kind, size, tolerance.unit, message)

    def kinds(self, count: int) -> list[set[str]]:
        """Kinds of violations at each of ``count`` rows."""
        kinds: list[set[str]] = [set() for _ in range(count)]
        for row, kind in self._worst:
            kinds[row].add(kind)
        return kinds

    def violations(self) -> tuple[Violation, ...]:
        """All of them, by station."""
        return tuple(sorted(self._worst.values(), key=lambda v: (v.row, v.kind)))
