"""What a map that has not been renewed for long allows: slower plans, then none.

Up to `max_map_age` plans are as fast as they may be. Beyond it the highest speed falls evenly with
the age, from the limit of the model to rest at twice that age; from then on the answer is a stop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from services.planning.map_store import KnownGround
from services.planning.plan_questions import Usable

_CREEP = 0.05
"""No cap is below that: it is as good as rest, and the stop follows [m/s]."""


@dataclass(frozen=True, slots=True)
class MapAge:
    """How old the map is against what it may be.

    Attributes:
        over: by what share of `max_map_age` it is older, 0 while it is not. most: that age [s].
        speed: highest that plans may have on it [m/s].
    """

    over: float
    most: float
    speed: float

    @classmethod
    def of(cls, ground: KnownGround, most: float, limit: float) -> MapAge:
        """Of a map now. most: `max_map_age` [s]; limit: of the speed by the model [m/s]."""
        over = 0.0 if ground.fixed else max(ground.age() / most - 1.0, 0.0)
        return cls(over, most, max((1.0 - over) * limit, min(_CREEP, limit)))

    @property
    def ends(self) -> bool:
        """The map is too old to be driven on."""
        return self.over >= 1.0

    def words(self) -> list[str]:
        """Why plans are slower than they need be."""
        if self.ends:
            return [f"the map is older than {2.0 * self.most:g} s, twice max_map_age: no plans"]
        if self.over > 0.0:
            limit = f"at most {self.speed:.2f} m/s"
            return [f"the map is older than max_map_age, {self.most:g} s: {limit}"]
        return []

    def slowed(self, usable: Sequence[Usable]) -> list[Usable]:
        """Candidates on even stations, no faster anywhere than the map allows."""
        if self.over <= 0.0:
            return [*usable]
        slower: list[Usable] = []
        for one in usable:
            limit = np.full(len(one.path.points), self.speed)
            if one.path.speed_limit is not None:
                limit = np.minimum(limit, one.path.speed_limit)
            slower.append(replace(one, path=replace(one.path, speed_limit=limit)))
        return slower
