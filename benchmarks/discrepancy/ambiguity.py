"""Stops that distinguish alternatives: the proposed ones compared with more of the log's own kind.

Each case is a log in which the effect is detectable but not distinct from its nearest alternative.
The workflow proposes stops; the plant states how many of them, and how many of the log's own kind,
make truth and all alternatives differ. Then the proposed ones are driven and the log investigated
again.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from . import catalogue
from .blind_run import BlindRun, Finding, SealedLog, tables_of
from .catalogue import HiddenSet, SetSpec
from .designs import FIELD, draw
from .discrepancy_metrics import Metric, figure, record, share
from .identifiability import DETECTABLE_CHI2, DISTINCT_CHI2, identifiability
from .plant_physics import Floats, Stops

_CASE_CHI2 = (1.0, 12.0)  # expected χ² to the nearest alternative of a case
_EFFECTS = (
    "headwind",
    "viscous_resistance",
    "aerodynamic_drag",
    "grade_asymmetry",
    "grade_nonlinearity",
    "step_change",
    "session_drift",
    "brake_fade",
)
_LADDER = (6, 12, 18, 24, 36, 48, 72, 96, 144, 192)  # stops
_MAX_DRAWS = 60  # of sets for a case
_MAX_STOPS = 100  # of a case, so that the ladder can change it


@dataclass(frozen=True, slots=True)
class Resolved:
    """One case.

    Attributes:
        effect, rival: truth, and its nearest alternative.
        seed: of the set.
        verdict: verdict before.
        proposed, random: stops that are needed, twice the last rung if that is not enough.
        after: verdict on the log with the proposed stops.
        right: whether exactly the true name was given then.
    """  # words: ok, keys of results

    effect: str
    rival: str  # words: ok
    seed: int
    verdict: str
    proposed: int
    random: int
    after: str
    right: bool


def case(number: int) -> HiddenSet | None:
    """Draw a log with a detectable effect that fits two names; None if none is drawn."""
    rng = np.random.default_rng((8, number))
    for attempt in range(_MAX_DRAWS):
        name = _EFFECTS[(number + attempt) % len(_EFFECTS)]
        size = str(rng.choice(["small", "medium"]))
        spec = SetSpec("single", (name,), size, int(rng.integers(2**31)))
        set_rng = np.random.default_rng(spec.seed)
        hidden = catalogue.draw_set(spec, set_rng)
        known = hidden.identifiability
        if (
            len(hidden.stops.speed) <= _MAX_STOPS
            and known.gap >= DETECTABLE_CHI2
            and _CASE_CHI2[0] <= known.apart <= _CASE_CHI2[1]
        ):
            return catalogue.measure(hidden, set_rng)
    return None


def resolve(hidden: HiddenSet, process: BlindRun) -> Resolved | None:
    """Investigate, drive the proposed stops, investigate again; None without alternatives."""
    finding = process.investigate(SealedLog(hidden.columns, tables_of(hidden.configured)))
    if finding.verdict != "ambiguous" or not finding.design:
        return None
    seed, spec = hidden.spec.seed, hidden.spec

    def proposed(count: int) -> Stops:
        return planned_stops(hidden, finding.design, count, np.random.default_rng(seed))

    def random(count: int) -> Stops:
        return draw(hidden.design, count, hidden.scatter, np.random.default_rng(seed))

    needed = stops_needed(hidden, proposed)
    more = joined(hidden.stops, proposed(min(needed, _LADDER[-1])))
    longer = catalogue.measure(replace(hidden, stops=more), np.random.default_rng((seed, 4)))
    again = process.investigate(SealedLog(longer.columns, tables_of(hidden.configured)))
    return Resolved(
        spec.names[0],
        hidden.identifiability.nearest,
        seed,
        finding.verdict,
        needed,
        stops_needed(hidden, random),
        again.verdict,
        _is_right(again, spec),
    )


def _is_right(finding: Finding, spec: SetSpec) -> bool:
    return finding.is_confident and set(finding.names) == set(spec.names)


def stops_needed(hidden: HiddenSet, more: Callable[[int], Stops]) -> int:
    """Smallest number of further stops after which no alternative is near."""

    def is_distinct(count: int) -> bool:
        stops = joined(hidden.stops, more(count))
        known = identifiability(
            hidden.truth,
            hidden.base,
            stops,
            hidden.noise,
            hidden.scatter,
            hidden.spec.names,
            max_stops=len(stops.speed),
        )
        return known.apart >= DISTINCT_CHI2

    # More stops add evidence, so bisection of the ladder suffices.
    rung = bisect_left(_LADDER, True, key=is_distinct)
    return _LADDER[rung] if rung < len(_LADDER) else 2 * _LADDER[-1]


def planned_stops(
    hidden: HiddenSet,
    design: Sequence[dict[str, float | None]],
    count: int,
    rng: np.random.Generator,
) -> Stops:
    """Repeat proposed stops up to a count; unspecified quantities are drawn as in the log."""
    any_stop = draw(hidden.design, count, hidden.scatter, rng)
    cycle = [design[i % len(design)] for i in range(count)]

    def specified(key: str, default: Floats) -> Floats:
        values = [stop.get(key) for stop in cycle]
        return np.array([d if v is None else v for v, d in zip(values, default, strict=True)])

    speed = specified("speed", any_stop.speed)
    rate = specified("yaw_rate", any_stop.curvature * any_stop.speed)
    pauses = specified("pause", np.diff(any_stop.clock, prepend=0.0))
    return any_stop._replace(
        speed=speed,
        grade=specified("grade", any_stop.grade),
        heading=specified("heading", any_stop.heading),
        roll=specified("roll", any_stop.roll),
        curvature=rate / np.maximum(speed, 0.3),
        x=np.clip(specified("x", any_stop.x), 0.0, FIELD[0]),
        y=np.clip(specified("y", any_stop.y), 0.0, FIELD[1]),
        clock=np.cumsum(pauses + 8.0),
    )


def joined(first: Stops, second: Stops) -> Stops:
    """Stops of one session, the second ones a minute after the first."""
    later = second._replace(clock=second.clock + first.clock[-1] + 60.0)
    return Stops(*(np.concatenate(pair) for pair in zip(first, later, strict=True)))


def result_of(cases: Sequence[Resolved | None]) -> dict[str, Any]:
    """Metrics and outcomes of all cases."""
    resolved = [outcome for outcome in cases if outcome is not None]
    return {
        "ambiguity": [record(m) for m in _metrics(resolved, len(cases) - len(resolved))],
        "ambiguity_cases": [asdict(outcome) for outcome in resolved],
    }


def _metrics(resolved: Sequence[Resolved], silent: int) -> list[Metric]:
    # Cases that neither design resolves are ignored; where only the proposed one does, the ratio
    # is an upper bound.
    decided = [r for r in resolved if min(r.proposed, r.random) <= _LADDER[-1]]
    ratios = [r.proposed / r.random for r in decided]
    ambiguous = [True] * len(resolved) + [False] * silent
    return [
        share("called ambiguous, with stops proposed", "", 0.0, ambiguous),
        figure("stops to distinguish, proposed over any, median", "<=", 0.5, ratios, unit="×"),
        share("cases with half the stops or fewer", "", 0.0, [r <= 0.5 for r in ratios]),
        share("right name with the proposed stops", "", 0.0, [r.right for r in resolved]),
    ]
