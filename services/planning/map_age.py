"""Speed limits on a map that is not renewed.

Up to `max_map_age` the age has no effect. Beyond it the highest speed falls linearly with the age,
from the limit of the model to rest at twice that age; from then on the answer is a stop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from slopewise.services.planning.map_store import MapSnapshot
from slopewise.services.planning.request_validation import PlanCandidate

_MIN_LIMIT = 0.05
"""Lowest speed limit before the stop [m/s]: profiles need a limit above standstill."""


@dataclass(frozen=True, slots=True)
class MapAge:
    """Age of the map relative to `max_map_age`."""

    excess: float  # age beyond `max_map_age` as a share of it [1], 0 while it is younger
    max_age: float  # `max_map_age` [s]
    speed: float  # highest speed of plans on it [m/s]

    @classmethod
    def of(cls, snapshot: MapSnapshot, max_age: float, limit: float) -> MapAge:
        """Age now; max_age: `max_map_age` [s]; limit: speed limit of the model [m/s]."""
        excess = 0.0 if snapshot.fixed else max(snapshot.age() / max_age - 1.0, 0.0)
        return cls(excess, max_age, max((1.0 - excess) * limit, min(_MIN_LIMIT, limit)))

    @property
    def is_too_old(self) -> bool:
        """Return True if no plan may be driven on the map."""
        return self.excess >= 1.0

    def reasons(self) -> list[str]:
        """Reasons for slower plans, empty while the map is recent enough."""
        if self.is_too_old:
            return [f"the map is older than {2.0 * self.max_age:g} s, twice max_map_age: no plans"]
        if self.excess > 0.0:
            limit = f"at most {self.speed:.2f} m/s"
            return [f"the map is older than max_map_age, {self.max_age:g} s: {limit}"]
        return []

    def limit_speed(self, candidates: Sequence[PlanCandidate]) -> list[PlanCandidate]:
        """Resampled candidates, at most as fast as the map allows."""
        if self.excess <= 0.0:
            return [*candidates]
        limited: list[PlanCandidate] = []
        for candidate in candidates:
            path = candidate.path
            limit = np.full(len(path.points), self.speed)
            if path.speed_limit is not None:
                limit = np.minimum(limit, path.speed_limit)
            limited.append(replace(candidate, path=replace(path, speed_limit=limit)))
        return limited
