"""How many stops it takes to tell rivals apart: those that are proposed against any.

Each case is a log in which the effect can be seen and not be told from its nearest rival. The
workflow proposes stops; the plant says from how many of them on, and from how many of the log's own
kind, truth and all rivals differ by enough. Then the proposed ones are driven, and it is asked
again.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from . import catalogue
from .catalogue import HiddenSet, Order
from .designs import FIELD, draw
from .metrics import Metric, figure, record, share
from .model_tables import tables_of
from .physics import Floats, Stops
from .sealed import Inquiry, InquiryFinding, SealedLog
from .worth import SEEN, TOLD_APART, worth

_NEARLY = (1.0, 12.0)  # expected χ² to the nearest rival of a case
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
_LADDER = (6, 12, 18, 24, 36, 48, 72, 96, 144, 192)
_TRIES = 60


@dataclass(frozen=True, slots=True)
class Resolved:
    """One case.

    Attributes:
        effect, rival: the truth, and what it could be taken for. verdict: before.
        proposed, random: stops that are needed, twice the last rung where that does not do.
        after: verdict on the log with the proposed stops. right: with the true name.
    """

    effect: str
    rival: str
    seed: int
    verdict: str
    proposed: int
    random: int
    after: str
    right: bool


def case(number: int) -> HiddenSet | None:
    """A log in which an effect shows and two names fit; None if none such comes up."""
    rng = np.random.default_rng((8, number))
    for attempt in range(_TRIES):
        name = _EFFECTS[(number + attempt) % len(_EFFECTS)]
        size = str(rng.choice(["small", "medium"]))
        order = Order("single", (name,), size, int(rng.integers(2**31)))
        own = np.random.default_rng(order.seed)
        drawn = catalogue.drawn(order, own)
        if (
            len(drawn.stops.speed) <= 100
            and drawn.worth.gap >= SEEN
            and (_NEARLY[0] <= drawn.worth.apart <= _NEARLY[1])
        ):
            return catalogue.measured(drawn, own)
    return None


def resolve(hidden: HiddenSet, inquiry: Inquiry) -> Resolved | None:
    """Ask, drive what is proposed, ask again; None where no rivals are named."""
    finding = inquiry.ask(SealedLog(hidden.columns, tables_of(hidden.configured)))
    if finding.verdict != "ambiguous" or not finding.design:
        return None  # it proposes other stops then, or none
    return _resolve(hidden, finding, inquiry)


def result_of(cases: Sequence[Resolved | None]) -> dict[str, Any]:
    """All cases together."""
    resolved = [one for one in cases if one is not None]
    return {
        "ambiguity": [record(m) for m in _metrics(resolved, len(cases) - len(resolved))],
        "ambiguity_cases": [asdict(one) for one in resolved],
    }


def _resolve(hidden: HiddenSet, finding: InquiryFinding, inquiry: Inquiry) -> Resolved:
    rng = np.random.default_rng((hidden.order.seed, 4))

    def proposed(count: int) -> Stops:
        return planned(hidden, finding.design, count, np.random.default_rng(hidden.order.seed))

    def random(count: int) -> Stops:
        return draw(hidden.design, count, hidden.scatter, np.random.default_rng(hidden.order.seed))

    fewest = _needed(hidden, proposed)
    more = joined(hidden.stops, proposed(min(fewest, _LADDER[-1])))
    longer = catalogue.measured(replace(hidden, stops=more), rng)
    again = inquiry.ask(SealedLog(longer.columns, tables_of(hidden.configured)))
    right = again.verdict == "missing_effect" and set(again.names) == set(hidden.order.names)
    return Resolved(
        hidden.order.names[0],
        hidden.worth.nearest,
        hidden.order.seed,
        finding.verdict,
        fewest,
        _needed(hidden, random),
        again.verdict,
        right,
    )


def _needed(hidden: HiddenSet, more: Callable[[int], Stops]) -> int:
    """Fewest further stops after which no rival is near."""

    def told(count: int) -> bool:
        stops = joined(hidden.stops, more(count))
        found = worth(
            hidden.truth,
            hidden.base,
            stops,
            hidden.noise,
            hidden.scatter,
            hidden.order.names,
            weighed=len(stops.speed),
        )
        return found.apart >= TOLD_APART

    # More stops tell more, so halving the ladder will do.
    rung = bisect_left(_LADDER, True, key=told)
    return _LADDER[rung] if rung < len(_LADDER) else 2 * _LADDER[-1]


def planned(
    hidden: HiddenSet,
    design: Sequence[dict[str, float | None]],
    count: int,
    rng: np.random.Generator,
) -> Stops:
    """Proposed stops, again and again up to a count; what is left open is as in the log."""
    any_stop = draw(hidden.design, count, hidden.scatter, rng)
    cycle = [design[i % len(design)] for i in range(count)]

    def told(key: str, otherwise: Floats) -> Floats:
        values = [stop.get(key) for stop in cycle]
        return np.array([o if v is None else v for v, o in zip(values, otherwise, strict=True)])

    speed = told("speed", any_stop.speed)
    rate = told("yaw_rate", any_stop.curvature * any_stop.speed)
    pauses = told("pause", np.diff(any_stop.clock, prepend=0.0))
    return any_stop._replace(
        speed=speed,
        grade=told("grade", any_stop.grade),
        heading=told("heading", any_stop.heading),
        roll=told("roll", any_stop.roll),
        curvature=rate / np.maximum(speed, 0.3),
        x=np.clip(told("x", any_stop.x), 0.0, FIELD[0]),
        y=np.clip(told("y", any_stop.y), 0.0, FIELD[1]),
        clock=np.cumsum(pauses + 8.0),
    )


def joined(first: Stops, second: Stops) -> Stops:
    """One session: the second ones a minute after the first."""
    later = second._replace(clock=second.clock + first.clock[-1] + 60.0)
    return Stops(*(np.concatenate(pair) for pair in zip(first, later, strict=True)))


def _metrics(resolved: Sequence[Resolved], silent: int) -> list[Metric]:
    # Where neither does within the longest ladder, nothing is told; where only the proposed ones
    # do, the ratio is an upper bound.
    told = [one for one in resolved if min(one.proposed, one.random) <= _LADDER[-1]]
    ratios = [one.proposed / one.random for one in told]
    return [
        share(
            "called ambiguous, with stops proposed",
            "",
            0.0,
            [True] * len(resolved) + [False] * silent,
        ),
        figure("stops to tell apart, proposed over any, median", "<=", 0.5, ratios, unit="×"),
        share("cases with half the stops or fewer", "", 0.0, [r <= 0.5 for r in ratios]),
        share("right name with the proposed stops", "", 0.0, [one.right for one in resolved]),
    ]
