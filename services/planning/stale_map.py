"""Plans on a map that is not renewed: slower ones, then none.

Up to `max_map_age` plans are as fast as they may be. Beyond it the highest speed falls evenly with
the age, from the limit of the model to rest at twice that age; from then on the answer is a stop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from slopewise.services.planning.map_store import KnownGround
from slopewise.services.planning.plan_questions import Usable

_CREEP = 0.05
"""No cap is below that: it is as good as rest, and the stop follows [m/s]."""


@dataclass(frozen=True, slots=True)
class MapAge:
    """Age of the map against `max_map_age`.

    Attributes:
        over: by what share of `max_map_age` it is older, 0 while it is not. max_age: that age [s].
        speed: highest that plans may have on it [m/s].
    """

    over: float
    max_age: float
    speed: float

    @classmethod
    def of(cls, ground: KnownGround, max_age: float, limit: float) -> MapAge:
        """Of a map now. max_age: `max_map_age` [s]; limit: speed limit of the model [m/s]."""
        over = 0.0 if ground.fixed else max(ground.age() / max_age - 1.0, 0.0)
        return cls(over, max_age, max((1.0 - over) * limit, min(_CREEP, limit)))

    @property
    def ends(self) -> bool:
        """The map is too old to be driven on."""
        return self.over >= 1.0

    def reasons(self) -> list[str]:
        """Reasons for slower plans, none while the map is young enough."""
        if self.ends:
            return [f"the map is older than {2.0 * self.max_age:g} s, twice max_map_age: no plans"]
        if self.over > 0.0:
            limit = f"at most {self.speed:.2f} m/s"
            return [f"the map is older than max_map_age, {self.max_age:g} s: {limit}"]
        return []

    def slowed(self, usable: Sequence[Usable]) -> list[Usable]:
        """Candidates on even stations, no faster anywhere than the map allows."""
        if self.over <= 0.0:
            return [*usable]
        slower: list[Usable] = []
        for candidate in usable:
            path = candidate.path
            limit = np.full(len(path.points), self.speed)
            if path.speed_limit is not None:
                limit = np.minimum(limit, path.speed_limit)
            slower.append(replace(candidate, path=replace(path, speed_limit=limit)))
        return slower
