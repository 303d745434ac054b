"""Sets of the two worlds of physics, their outcomes and metrics; needs neither of the engines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle, islice
from typing import Any

import numpy as np

from .catalogue import spread
from .discrepancy_metrics import Metric, effect_row, figure, share, workflow_metrics

CLEAN = "clean"
STRENGTHS = ("", "small", "medium", "large")
"""In ascending order; sets of the engine, and clean ones, have no strength."""

HALVES = ("tuning", "sealed")
"""Sets of odd seeds, for tuning the workflow; of even ones, for reports alone."""

Names = dict[str, tuple[tuple[str, ...], ...]]

_BOTH_WORLDS: Names = {
    "heavier body": (("step_change",),),
    "weaker brakes": (("step_change",),),
    "air": (("aerodynamic_drag",),),
    "wind": (("headwind",), ("headwind", "aerodynamic_drag")),
}
ENGINE_NAMES: Names = {
    **_BOTH_WORLDS,
    "fading brakes": (("brake_fade",),),
    "slippery area": (("surface_patch",),),
    "viscous bearings": (("viscous_resistance",),),
    "slow hydraulics": (("brake_lag",),),
    "glazing pads": (("session_drift",),),
}
CAR_NAMES: Names = {
    **_BOTH_WORLDS,
    "fading pads": (("brake_fade",),),
    "slippery area": (("surface_patch",),),
    "two slippery areas": (("surface_patch",),),
    "viscous driveline": (("viscous_resistance",),),
    "slow hydraulics": (("brake_lag",),),
    "glazing pads": (("session_drift",),),
    "locking wheels": (("wheel_lockup",),),
    "furrows": (("directional_surface",),),
}
"""Right names of each effect; wind on a body is also drag on it."""

_ENGINE_EACH, _ENGINE_CLEAN = 4, 12  # sets of each effect, clean sets
_CAR_EACH, _CAR_CLEAN = 15, 60  # five seeds of three strengths
_CAR_STRENGTHS = ("medium", "large", "small")  # in which a share of the sets is taken


@dataclass(frozen=True, slots=True)
class WorldSpec:
    """One requested set: hidden effect ("" for none), seed, strength where there is one."""

    what: str
    seed: int
    strength: str = ""


@dataclass(frozen=True, slots=True)
class WorldOutcome:
    """One set with its scored finding; fields as of :class:`.score.SetOutcome`."""

    what: str
    seed: int
    noise: float
    scatter: float
    verdict: str
    named: tuple[str, ...]
    right: bool
    wrong: bool
    before: float
    after: float
    floor: float
    closed: float | None
    told: float | None  # words: ok, a key of results
    seconds: float
    text: str
    strength: str = ""
    worse: float = 0.0


def engine_specs(share_of_all: float, seed: int = 1) -> list[WorldSpec]:
    """Sets of the engine in random order, each effect spread evenly over it."""
    rng = np.random.default_rng((7, seed))
    each, clean = (max(round(n * share_of_all), 1) for n in (_ENGINE_EACH, _ENGINE_CLEAN))
    effects = [name for name in ENGINE_NAMES for _ in range(each)] + [""] * clean
    specs = [WorldSpec(what, int(rng.integers(2**31))) for what in effects]
    return spread(specs, lambda spec: spec.what, rng)


def multibody_specs(share_of_all: float, half: str = "sealed", seed: int = 1) -> list[WorldSpec]:
    """Sets of the car in random order, each effect spread evenly over it.

    Args:
        share_of_all: share of five seeds of each effect in each strength, and of 60 clean sets;
            each effect is drawn at least once.
        half: one of :data:`HALVES`.
        seed: determines the choice of seeds.

    Raises:
        ValueError: there is no such half.
    """
    odd = 1 - HALVES.index(half)
    rng = np.random.default_rng((11, seed, odd))
    each, clean = (max(round(n * share_of_all), 1) for n in (_CAR_EACH, _CAR_CLEAN))
    effects = [
        (what, strength) for what in CAR_NAMES for strength in islice(cycle(_CAR_STRENGTHS), each)
    ]
    effects += [("", STRENGTHS[0])] * clean
    specs = [
        WorldSpec(what, 2 * int(rng.integers(2**30)) + odd, strength) for what, strength in effects
    ]
    return spread(specs, lambda spec: spec.what, rng)


def by_what(kind: str, outcomes: Sequence[WorldOutcome]) -> list[dict[str, Any]]:
    """Counts effect by effect, as of :func:`.discrepancy_campaign.by_effect`."""
    groups: dict[tuple[str, str], list[WorldOutcome]] = {}
    for o in sorted(outcomes, key=lambda o: (o.what, STRENGTHS.index(o.strength))):
        groups.setdefault((o.what, o.strength), []).append(o)
    rows = []
    for key, group in groups.items():
        name = ", ".join(filter(None, key))
        rows.append(effect_row(kind, name, group, group, [o.closed for o in group], None))
    return rows


def engine_metrics(outcomes: Sequence[WorldOutcome]) -> list[Metric]:
    """Metrics of the engine's sets."""
    clean = [o.verdict for o in outcomes if o.what == CLEAN]
    hidden = [o for o in outcomes if o.what != CLEAN]
    return [
        share("right name", ">=", 0.85, [o.right for o in hidden]),
        share("wrong name given with confidence", "<=", 0.01, [o.wrong for o in hidden]),
        share("a name on clean sets", "<=", 0.0, [v == "missing_effect" for v in clean]),
        share("something unknown on clean sets", "", 0.0, [v == "unknown" for v in clean]),
        *_common_metrics(outcomes, 0.80),
    ]


def multibody_metrics(outcomes: Sequence[WorldOutcome]) -> list[Metric]:
    """Metrics of the car's sets."""
    clean = [o.verdict for o in outcomes if o.what == CLEAN]
    hidden = [o for o in outcomes if o.what != CLEAN]
    large = [o.right for o in hidden if o.strength != "small"]
    with_lag = [o.right or _is_right_with_lag(o) for o in hidden]
    return [
        share("right name, medium and large", ">=", 0.90, large),
        share("right name, small", ">=", 0.75, [o.right for o in hidden if o.strength == "small"]),
        share("right name, or it and the build-up that is there, all", "", 0.0, with_lag),
        share("wrong name given with confidence", "<=", 0.01, [o.wrong for o in hidden]),
        share("a name on clean sets", "<=", 0.0, [v == "missing_effect" for v in clean]),
        share("nothing found on clean sets", "", 0.0, [v == "none" for v in clean]),
        *_common_metrics(outcomes, 0.90),
    ]


def _is_right_with_lag(o: WorldOutcome) -> bool:
    """Whether the right names and `brake_lag` were given: brakes of this car take 30 ms."""
    names = set(o.named) - {"brake_lag"}
    return o.verdict == "missing_effect" and names in map(set, CAR_NAMES[o.what])


def _common_metrics(outcomes: Sequence[WorldOutcome], gap_target: float) -> list[Metric]:
    closed = [o.closed for o in outcomes if o.what != CLEAN and o.closed is not None]
    return [
        figure("closable gap closed, fresh stops, median", ">=", gap_target, closed, unit="share"),
        figure("time per 100 stops, median", "<=", 5.0, [o.seconds for o in outcomes], unit="s"),
        *workflow_metrics(outcomes),
    ]
