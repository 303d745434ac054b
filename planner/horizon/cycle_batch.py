"""All candidates of a cycle, planned and judged together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Bools, Floats
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
    def verified(cls, paths: PathBatch, solved: TimeOptimalBatch) -> CycleBatch:
        """The first M candidates of a batch."""
        violation = screen(
            solved.profile,
            solved.ground,
            solved.bounds,
            solved.speed_sq,
            solved.model,
            solved.speed_limit,
            solved.hazards.rough_speed,
        )
        m = len(paths.names)
        return cls(paths, solved, violation[:m], ~solved.reachable[:m])

    def passed(self, j: int) -> bool:
        """Return True if the verifier has no objection to the profile of candidate j."""
        return not self.violation[j].max() > 0.0

    def ranked(self, previous: int | None, gain: float) -> tuple[tuple[Ranked, ...], list[int]]:
        """All candidates by cost, those that the verifier objects to last; and their indices.

        Args:
            previous: index of the candidate that is the previous plan's path, if any is.
            gain: by how much another one has to be better than it [s].
        """
        invalid = (self.violation.max(axis=1) > 0.0) | self.too_fast
        names = self.paths.names
        cost = self.solved.cost[: len(names)]
        is_previous = np.arange(len(names)) == previous
        order: list[int] = np.lexsort((cost - gain * is_previous, invalid)).tolist()
        costs, is_invalid = cost.tolist(), invalid.tolist()
        ranking = tuple(
            Ranked(
                names[j], costs[j], not is_invalid[j], self._objection(j) if is_invalid[j] else ""
            )
            for j in order
        )
        return ranking, order

    def _objection(self, j: int) -> str:
        """Objections of the verifier to a time-optimal profile."""
        if self.too_fast[j]:
            return "starts faster than service braking can bring down"
        kind = int(np.argmax(self.violation[j]))
        return f"{Violations._fields[kind]} by {self.violation[j, kind]:.3g}"
