"""Which sets of the physics engine there are, and what became of them; needs no engine."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .catalogue import spread
from .metrics import Metric, share
from .world_outcomes import CLEAN, WorldOrder, WorldOutcome, common_metrics

NAMES: dict[str, tuple[tuple[str, ...], ...]] = {
    "heavier body": (("step_change",),),
    "weaker brakes": (("step_change",),),
    "air": (("aerodynamic_drag",),),
    "wind": (("headwind",), ("headwind", "aerodynamic_drag")),
    "fading brakes": (("brake_fade",),),
    "slippery area": (("surface_patch",),),
    "viscous bearings": (("viscous_resistance",),),
    "slow hydraulics": (("brake_lag",),),
    "glazing pads": (("session_drift",),),
}
"""What each is called in the vocabulary; a wind on a body is also a drag on it."""


def engine_orders(share_of_all: float, seed: int = 1) -> list[WorldOrder]:
    """Effects and clean sets in random order, each spread evenly over it."""
    rng = np.random.default_rng((7, seed))
    each, clean = max(round(4 * share_of_all), 1), max(round(12 * share_of_all), 1)
    wanted = [name for name in NAMES for _ in range(each)] + [""] * clean
    found = [WorldOrder(what, int(rng.integers(2**31))) for what in wanted]
    return spread(found, lambda order: order.what, rng)


def engine_metrics(outcomes: Sequence[WorldOutcome]) -> list[Metric]:
    """The table of the engine's sets."""
    clean = [o for o in outcomes if o.what == CLEAN]
    hidden = [o for o in outcomes if o.what != CLEAN]
    return [
        share("right name", ">=", 0.85, [o.right for o in hidden]),
        share("wrong name given with confidence", "<=", 0.01, [o.wrong for o in hidden]),
        share("a name on clean sets", "<=", 0.0, [o.verdict == "missing_effect" for o in clean]),
        share("something unknown on clean sets", "", 0.0, [o.verdict == "unknown" for o in clean]),
        *common_metrics(outcomes, 0.80),
    ]
