"""Which sets of the multi-body car there are, and what is counted; needs no such car."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import cycle, islice

import numpy as np

from .catalogue import spread
from .metrics import Metric, share
from .world_outcomes import CLEAN, STRENGTHS, WorldOrder, WorldOutcome, common_metrics

NAMES: dict[str, tuple[tuple[str, ...], ...]] = {
    "heavier body": (("step_change",),),
    "weaker brakes": (("step_change",),),
    "air": (("aerodynamic_drag",),),
    "wind": (("headwind",), ("headwind", "aerodynamic_drag")),
    "fading pads": (("brake_fade",),),
    "slippery area": (("surface_patch",),),
    "two slippery areas": (("surface_patch",),),
    "viscous driveline": (("viscous_resistance",),),
    "slow hydraulics": (("brake_lag",),),
    "glazing pads": (("session_drift",),),
    "locking wheels": (("wheel_lockup",),),
    "furrows": (("directional_surface",),),
}
"""What each is called in the vocabulary; a wind on a body is also a drag on it."""

HALVES = ("tuning", "sealed")
"""Odd seeds, for whoever improves the workflow; even ones, for reports alone."""

_CLEAN, _EACH = 60, 15
_ORDER = ("medium", "large", "small")  # in which strengths are taken where not all are


def multibody_orders(share_of_all: float, half: str = "sealed", seed: int = 1) -> list[WorldOrder]:
    """Effects and clean sets in random order, each spread evenly over it.

    Args:
        share_of_all: of five seeds of each effect in each strength, and of 60 clean sets; each
            effect once at least. half: one of :data:`HALVES`. seed: of the choice of seeds.

    Raises:
        ValueError: there is no such half.
    """
    odd = 1 - HALVES.index(half)
    rng = np.random.default_rng((11, seed, odd))
    found = [
        WorldOrder(what, 2 * int(rng.integers(2**30)) + odd, strength)
        for what, strength in _wanted(share_of_all)
    ]
    return spread(found, lambda order: order.what, rng)


def _wanted(share_of_all: float) -> Iterator[tuple[str, str]]:
    for what in NAMES:
        for strength in islice(cycle(_ORDER), max(round(_EACH * share_of_all), 1)):
            yield what, strength
    for _ in range(max(round(_CLEAN * share_of_all), 1)):
        yield "", STRENGTHS[0]


def multibody_metrics(outcomes: Sequence[WorldOutcome]) -> list[Metric]:
    """The table of these sets."""
    clean = [o for o in outcomes if o.what == CLEAN]
    hidden = [o for o in outcomes if o.what != CLEAN]
    marked = [o for o in hidden if o.strength != "small"]
    small = [o for o in hidden if o.strength == "small"]
    return [
        share("right name, medium and large", ">=", 0.90, [o.right for o in marked]),
        share("right name, small", ">=", 0.75, [o.right for o in small]),
        share(
            "right name, or it and the build-up that is there, all",
            "",
            0.0,
            [o.right or _beside_build_up(o) for o in hidden],
        ),
        share("wrong name given with confidence", "<=", 0.01, [o.wrong for o in hidden]),
        share("a name on clean sets", "<=", 0.0, [o.verdict == "missing_effect" for o in clean]),
        share("nothing found on clean sets", "", 0.0, [o.verdict == "none" for o in clean]),
        *common_metrics(outcomes, 0.90),
    ]


def _beside_build_up(o: WorldOutcome) -> bool:
    """The names are the right ones and `brake_lag`: brakes of this car take 30 ms, as brakes do."""
    return o.verdict == "missing_effect" and set(o.named) - {"brake_lag"} in map(set, NAMES[o.what])
