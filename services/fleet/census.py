"""What the findings of many vehicles say together: who lacks which effect, and how sure that is."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from slopewise.services.fleet.finding import DONE, Row

NAMED, RIVALS = "missing_effect", "ambiguous"


@dataclass(frozen=True, slots=True)
class Lacked:
    """One effect over all vehicles.

    Attributes:
        name: of the effect. vehicles: in which it is named, by confidence, the surest first.
        perhaps: vehicles in which it is one of several that would explain the log.
        confidence: least, mean and most of `vehicles`, 0 … 1. right: of `vehicles`, how many are to
            be expected to be named rightly: the sum of their confidences.
        parameters: name -> (unit, least, median, most) over `vehicles`.
    """

    name: str
    vehicles: tuple[str, ...]
    perhaps: tuple[str, ...]
    confidence: tuple[float, float, float] | None
    right: float
    parameters: dict[str, tuple[str, float, float, float]]


@dataclass(frozen=True, slots=True)
class Census:
    """All vehicles together.

    Attributes:
        looked_at: vehicles with an answer. verdicts: how many of each.
        without: vehicles without an answer, and why. lacked: most frequent first.
        by_chance: vehicles that would be said to lack something if none did.
    """

    looked_at: int
    verdicts: dict[str, int]
    without: dict[str, str]
    lacked: tuple[Lacked, ...]
    by_chance: float


def census(rows: Sequence[Row], false_alarm: float) -> Census:
    """Count.

    Args:
        rows: of all vehicles, with or without an answer. false_alarm: that each was asked with.
    """
    done = [row for row in rows if row["status"] == DONE]
    verdicts = Counter(str(row["verdict"]) for row in done)
    named: dict[str, list[tuple[Row, Row]]] = {}
    perhaps: dict[str, dict[str, None]] = {}
    for row in done:
        for effect in row["effects"]:
            if row["verdict"] == NAMED:
                named.setdefault(effect["name"], []).append((row, effect))
            elif row["verdict"] == RIVALS:
                for name in (effect["name"], *effect["alternatives"]):
                    perhaps.setdefault(name, {})[row["vehicle"]] = None
    lacked = [
        _lacked(name, named.get(name, []), tuple(perhaps.get(name, {})))
        for name in dict.fromkeys((*named, *perhaps))
    ]
    lacked.sort(key=lambda one: (-len(one.vehicles), -len(one.perhaps), one.name))
    return Census(
        len(done),
        dict(sorted(verdicts.items(), key=lambda item: (-item[1], item[0]))),
        {row["vehicle"]: row["reason"] for row in rows if row["status"] != DONE},
        tuple(lacked),
        false_alarm * len(done),
    )


def _lacked(name: str, found: list[tuple[Row, Row]], perhaps: tuple[str, ...]) -> Lacked:
    found = sorted(found, key=lambda pair: (-pair[1]["confidence"], pair[0]["vehicle"]))
    sure = [effect["confidence"] for _, effect in found]
    values: dict[str, list[Row]] = {}
    for _, effect in found:
        for parameter in effect["parameters"]:
            values.setdefault(parameter["name"], []).append(parameter)
    return Lacked(
        name,
        tuple(row["vehicle"] for row, _ in found),
        perhaps,
        (min(sure), statistics.fmean(sure), max(sure)) if sure else None,
        sum(sure),
        {key: _spread(several) for key, several in values.items()},
    )


def _spread(several: list[Row]) -> tuple[str, float, float, float]:
    numbers = [one["value"] for one in several]
    return several[0]["unit"], min(numbers), statistics.median(numbers), max(numbers)
