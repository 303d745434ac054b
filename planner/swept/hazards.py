"""Hazards along candidates: where body or wheels must not be, and where rough ground slows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from models.arrays import Floats, Ints


class HazardRows(NamedTuple):
    """What kernels read of :class:`Hazards`; (N, M) each, or (0, 0) where there is nothing."""

    code: Ints
    rough_speed: Floats


@dataclass(frozen=True, slots=True)
class Hazards:
    """What M candidates of up to N stations meet.

    Attributes:
        rows: ``code`` (N, M) is 0 where body and wheels may be, else what bars the pose, as
            :class:`planner.limiting.Limiting`; it holds for all poses from the station before on.
            ``rough_speed`` (N, M) is the highest speed that the ground's roughness allows [m/s].
        unseen: what the map is too coarse to show, a sentence; empty where it shows all.
        why: sentence for a barred station k of candidate j: what, where and how high.
    """

    rows: HazardRows
    unseen: str
    why: Callable[[int, int], str]


def _nothing_there(j: int, k: int) -> str:
    return f"nothing was looked for at station {k} of candidate {j}"


def nothing_looked_for() -> Hazards:
    """Ground taken as a plane under every pose, for what-if questions and tests of other bounds."""
    return Hazards(HazardRows(np.empty((0, 0), np.int64), np.empty((0, 0))), "", _nothing_there)
