"""Finding that blocks a pose, as the core notes it."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from slopewise.planner.limiting import Limiting


class Kind(IntEnum):
    """Kind of hazard; :data:`LIMITING_OF_KIND` lists the bound of each."""

    NOTHING = 0
    UNKNOWN = 1
    RISE = 2
    DROP = 3
    TWIST = 4
    UNDERSIDE = 5
    FRONT = 6
    REAR = 7
    SIDE = 8


LIMITING_OF_KIND: dict[Kind, Limiting] = {
    Kind.UNKNOWN: Limiting.UNKNOWN_TERRAIN,
    Kind.RISE: Limiting.STEP,
    Kind.DROP: Limiting.STEP,
    Kind.TWIST: Limiting.STEP,
    Kind.UNDERSIDE: Limiting.CLEARANCE,
    Kind.FRONT: Limiting.BODY,
    Kind.REAR: Limiting.BODY,
    Kind.SIDE: Limiting.BODY,
}


class Finding(NamedTuple):
    """Finding that blocks a pose.

    Attributes:
        kind: of :class:`Kind`.
        height: of what is met [m].
        ahead, aside: where, from the middle of the wheelbase [m].
    """

    kind: int
    height: float
    ahead: float
    aside: float


class Pose(NamedTuple):
    """Middle of the wheelbase [m], unit vector of travel."""

    x: float
    y: float
    heading_x: float
    heading_y: float
