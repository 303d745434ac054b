"""Summary of the findings of many vehicles: which lack which effect, and with what confidence."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from slopewise.services.fleet.finding_row import DONE, Row

NAMED, AMBIGUOUS = "missing_effect", "ambiguous"


@dataclass(frozen=True, slots=True)
class EffectPrevalence:
    """One effect over all vehicles.

    Attributes:
        name: its name. vehicles: in which it is named, highest confidence first.
        ambiguous_in: vehicles in which it is one of several that would explain the log.
        confidence: minimum, mean and maximum over `vehicles`, 0 … 1.
        expected_true: expected number of correct names in `vehicles`, the sum of confidences.
        parameters: name -> (unit, minimum, median, maximum) over `vehicles`.
    """

    name: str
    vehicles: tuple[str, ...]
    ambiguous_in: tuple[str, ...]
    confidence: tuple[float, float, float] | None
    expected_true: float
    parameters: dict[str, tuple[str, float, float, float]]


@dataclass(frozen=True, slots=True)
class FleetSummary:
    """All vehicles together.

    Attributes:
        examined: vehicles with a finding. verdicts: number of each.
        failed: vehicles without a finding -> reason. effects: most frequent first.
        expected_false: expected number of false alarms if no vehicle lacked an effect.
    """

    examined: int
    verdicts: dict[str, int]
    failed: dict[str, str]
    effects: tuple[EffectPrevalence, ...]
    expected_false: float


def summarise_fleet(rows: Sequence[Row], false_alarm: float) -> FleetSummary:
    """Summarise the rows of all vehicles; false_alarm is the rate that each was tested with."""
    done = [row for row in rows if row["status"] == DONE]
    verdicts = Counter(str(row["verdict"]) for row in done)
    named: dict[str, list[tuple[Row, Row]]] = {}
    ambiguous: dict[str, dict[str, None]] = {}
    for row in done:
        for effect in row["effects"]:
            if row["verdict"] == NAMED:
                named.setdefault(effect["name"], []).append((row, effect))
            elif row["verdict"] == AMBIGUOUS:
                for name in (effect["name"], *effect["alternatives"]):
                    ambiguous.setdefault(name, {})[row["vehicle"]] = None
    effects = [
        _prevalence(name, named.get(name, []), tuple(ambiguous.get(name, {})))
        for name in dict.fromkeys((*named, *ambiguous))
    ]
    effects.sort(key=lambda effect: (-len(effect.vehicles), -len(effect.ambiguous_in), effect.name))
    return FleetSummary(
        len(done),
        dict(sorted(verdicts.items(), key=lambda item: (-item[1], item[0]))),
        {row["vehicle"]: row["reason"] for row in rows if row["status"] != DONE},
        tuple(effects),
        false_alarm * len(done),
    )


def _prevalence(
    name: str, matches: list[tuple[Row, Row]], ambiguous_in: tuple[str, ...]
) -> EffectPrevalence:
    matches = sorted(matches, key=lambda pair: (-pair[1]["confidence"], pair[0]["vehicle"]))
    confidence = [effect["confidence"] for _, effect in matches]
    values: dict[str, list[Row]] = {}
    for _, effect in matches:
        for parameter in effect["parameters"]:
            values.setdefault(parameter["name"], []).append(parameter)
    return EffectPrevalence(
        name,
        tuple(row["vehicle"] for row, _ in matches),
        ambiguous_in,
        (min(confidence), statistics.fmean(confidence), max(confidence)) if confidence else None,
        sum(confidence),
        {key: _range(parameters) for key, parameters in values.items()},
    )


def _range(parameters: list[Row]) -> tuple[str, float, float, float]:
    values = [parameter["value"] for parameter in parameters]
    return parameters[0]["unit"], min(values), statistics.median(values), max(values)
