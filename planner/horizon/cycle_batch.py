"""All candidates of a cycle, planned and judged together."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.planner.horizon.answer import Ranked
from slopewise.planner.path import PathBatch
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch
from slopewise.planner.verify.verifier import Violations, screen


@dataclass(frozen=True, slots=True)
class CycleBatch:
    """Time-optimal profiles of M candidates, with the verdicts of the verifier.

    Attributes:
        paths: the candidates.
        solved: their profiles; one more may be the path on which the previous plan continues.
        violation: (M, kinds) the worst breach of each kind, as in
            :class:`slopewise.planner.verify.verifier.Violations`.
        too_fast: (M,) service braking cannot bring down the speed at the start.
    """

    paths: PathBatch
    solved: TimeOptimalBatch
    violation: Floats
    too_fast: Bools

    @classmethod
    def verified(
        cls, paths: PathBatch, solved: TimeOptimalBatch, before: CycleBatch | None, changed: Ints
    ) -> CycleBatch:
        """The first M candidates of a batch.

        Args:
            paths, solved: see the attributes.
            before: verdicts on the batch before the profiles of some candidates changed.
            changed: their indices, at first those of all.
        """
        violation = screen(
            solved.profile,
            solved.ground,
            solved.bounds,
            solved.speed_sq,
            solved.model,
            solved.speed_limit,
            solved.hazards.rough_speed,
            changed,
        )
        if before is not None:
            verdicts, violation = violation, before.violation.copy()
            violation[changed] = verdicts
        return cls(paths, solved, violation, ~solved.reachable[: len(paths.names)])

    def passed(self, j: int) -> bool:
        """Return True if the verifier has no objection to the profile of candidate j."""
        return not self.violation[j].max() > 0.0

    def fronts(self, clear: Floats) -> Floats:
        """Where candidates are no longer known to be free before they end, (n, 3).

        Args:
            clear: (M,) distance from the vehicle up to which each is known to be free [m].

        Returns:
            Positions, and distances from the vehicle [m].
        """
        profile, fronts = self.solved.profile, []
        for j, free in enumerate(np.maximum(clear, 0.0).tolist()):
            n = int(profile.count[j])
            station = profile.station[:n, j]
            if free < station[-1]:
                x, y = (float(np.interp(free, station, a[:n, j])) for a in (profile.x, profile.y))
                fronts.append((x, y, free))
        return np.array(fronts).reshape(-1, 3)

    def order(self, previous: int | None, gain: float) -> list[int]:
        """Indices of all candidates by cost, those that the verifier objects to last.

        Args:
            previous: index of the candidate that is the previous plan's path, if any is.
            gain: by how much another one has to be better than it [s].
        """
        cost = self.solved.cost[: len(self.paths.names)]
        is_previous = np.arange(len(cost)) == previous
        order: list[int] = np.lexsort((cost - gain * is_previous, self._invalid)).tolist()
        return order

    def ranked(self, order: list[int]) -> tuple[Ranked, ...]:
        """All candidates in this order."""
        names, costs, is_invalid = self.paths.names, self.solved.cost.tolist(), self._invalid
        return tuple(
            Ranked(names[j], costs[j], not wrong, self._objection(j) if wrong else "")
            for j, wrong in zip(order, is_invalid[order].tolist(), strict=True)
        )

    @property
    def _invalid(self) -> Bools:
        invalid: Bools = (self.violation.max(axis=1) > 0.0) | self.too_fast
        return invalid

    def _objection(self, j: int) -> str:
        """Objections of the verifier to a time-optimal profile."""
        if self.too_fast[j]:
            return "starts faster than service braking can bring down"
        kind = int(np.argmax(self.violation[j]))
        return f"{Violations._fields[kind]} by {self.violation[j, kind]:.3g}"


class BestCandidates:
    """The candidates that are finished, and the path of the previous plan.

    Attributes:
        expected: indices of those that were best before.
        batch: the last one. order: indices of its candidates, the best at first.
    """

    expected: Ints
    batch: CycleBatch
    order: list[int]

    def __init__(
        self,
        paths: PathBatch,
        planned: int,
        previous: int | None,
        gain: float,
        count: int,
        before: Collection[str],
    ) -> None:
        """Begin.

        Args:
            paths: the candidates. previous, gain: see `CycleBatch.order`.
            planned: paths of the batch, one more where it has that on which the plan continues.
            count: plans that are finished. before: names of those that were best before.
        """
        self._paths, self._previous, self._gain, self._count = paths, previous, gain, count
        driven = [] if previous is None else [previous]
        self._driven = [*driven, *range(len(paths.names), planned)]
        best = [j for j, name in enumerate(paths.names) if name in before and j != previous]
        self.expected = np.array([*self._driven, *best], np.int64)
        self._last: CycleBatch | None = None
        self._asked, self._calls = set(best), 0
        self._changed: Ints = np.arange(len(paths.names))

    def of(self, solved: TimeOptimalBatch) -> Ints:
        """Indices of those in a batch."""
        self.batch = CycleBatch.verified(self._paths, solved, self._last, self._changed)
        self.order = self.batch.order(self._previous, self._gain)
        by_cost = [j for j in self.order if j != self._previous]
        best = by_cost[: self._count]
        if not self._asked.issuperset(best):
            # Twice as many each time, so that a few times are enough where most ways are blocked.
            best = by_cost[: self._count << self._calls]
            self._calls += 1
        self._asked.update(best)
        lanes = np.array([*self._driven, *best], np.int64)
        self._last, self._changed = self.batch, lanes[lanes < len(self._paths.names)]
        return lanes
