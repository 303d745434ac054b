"""Summary of the findings of many vehicles: which lack which effect, and with what confidence."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Sequence

import msgspec

from slopewise.models.discrepancy.report.text import confidence_text
from slopewise.services.fleet.vehicle_finding import DONE, Row
from slopewise.services.jobs.summary import Summary

NAMED, AMBIGUOUS = "missing_effect", "ambiguous"


class ParameterRange(Summary, frozen=True):
    """One parameter of an effect over the vehicles that lack it."""

    unit: str
    minimum: float = msgspec.field(name="least")
    median: float
    maximum: float = msgspec.field(name="most")


class EffectPrevalence(Summary, frozen=True):
    """One effect over all vehicles."""

    name: str
    vehicles: tuple[str, ...]  # in which it is named, highest confidence first
    # in which it is one of several that would explain the log
    ambiguous_in: tuple[str, ...] = msgspec.field(name="perhaps")
    confidence: tuple[float, float, float] | None  # minimum, mean and maximum, 0 … 1
    # expected number of correct names, the sum of confidences
    expected_true: float = msgspec.field(name="expected_right")
    parameters: dict[str, ParameterRange]

    def cells(self, examined: int) -> tuple[str, str, str, str, str]:
        """Row of a table: vehicles, confidence, expected correct names, ambiguous ones, parameters.

        Confidence and parameters are ranges over the vehicles; a parameter has its median as well.
        """
        ambiguous = str(len(self.ambiguous_in)) if self.ambiguous_in else ""
        if self.confidence is None:
            return "", "", "", ambiguous, ""
        low, _, high = map(confidence_text, self.confidence)
        confidence = low if low == high else f"{low} … {high}"
        parts = []
        for name, p in self.parameters.items():
            spread = "" if p.minimum == p.maximum else f" ({p.minimum:.3g} … {p.maximum:.3g})"
            unit = "" if p.unit == "1" else f" {p.unit}"
            parts.append(f"{name} = {p.median:.3g}{spread}{unit}")
        vehicles = f"{len(self.vehicles)} of {examined}"
        return vehicles, confidence, f"{self.expected_true:.1f}", ambiguous, ", ".join(parts)


class FleetSummary(Summary, frozen=True):
    """Output of `fleet discrepancy --json`; findings.jsonl has the findings of each vehicle."""

    vehicles: int
    examined: int = msgspec.field(name="looked_at")
    verdicts: dict[str, int]  # number of vehicles by verdict
    failed: dict[str, str] = msgspec.field(name="without_answer")
    effects: tuple[EffectPrevalence, ...]  # most frequent first
    expected_false: float = msgspec.field(name="by_chance")
    resumed: int  # vehicles that an earlier run had examined
    unexpected: int = msgspec.field(name="strays")
    seconds: float

    @property
    def false_alarms(self) -> str:
        """Sentence with the expected number of false alarms."""
        return (
            f"Expected false alarms: {self.expected_false:.2g} of {self.examined} vehicles if "
            "none lacked an effect."
        )

    def list_failed(self, max_count: int) -> list[str]:
        """Vehicles without a finding, with the reason; beyond max_count only their number."""
        lines = [f"{name} is excluded: {reason}" for name, reason in self.failed.items()]
        if (more := len(lines) - max_count) <= 0:
            return lines
        return [*lines[:max_count], f"{more} more are excluded; findings.jsonl has the reasons"]


def summarise_fleet(
    rows: Sequence[Row], false_alarm: float, *, resumed: int, unexpected: int, seconds: float
) -> FleetSummary:
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
        len(rows),
        len(done),
        dict(sorted(verdicts.items(), key=lambda item: (-item[1], item[0]))),
        {row["vehicle"]: row["reason"] for row in rows if row["status"] != DONE},
        tuple(effects),
        false_alarm * len(done),
        resumed,
        unexpected,
        seconds,
    )


def _prevalence(
    name: str, matches: list[tuple[Row, Row]], ambiguous_in: tuple[str, ...]
) -> EffectPrevalence:
    matches = sorted(matches, key=lambda pair: (-pair[1]["confidence"], pair[0]["vehicle"]))
    confidence = [effect["confidence"] for _, effect in matches]
    by_name: dict[str, list[Row]] = {}
    for _, effect in matches:
        for parameter in effect["parameters"]:
            by_name.setdefault(parameter["name"], []).append(parameter)
    ranges = {}
    for key, parameters in by_name.items():
        values = [parameter["value"] for parameter in parameters]
        unit, median = parameters[0]["unit"], statistics.median(values)
        ranges[key] = ParameterRange(unit, min(values), median, max(values))
    return EffectPrevalence(
        name,
        tuple(row["vehicle"] for row, _ in matches),
        ambiguous_in,
        (min(confidence), statistics.fmean(confidence), max(confidence)) if confidence else None,
        sum(confidence),
        ranges,
    )


def sort_by_prediction_error(rows: Sequence[Row]) -> list[Row]:
    """Rows with a finding, largest error of the stopping distance first."""
    done = [row for row in rows if row["status"] == DONE]
    return sorted(done, key=lambda row: (-(row["stop_distance_before"] or 0.0), row["vehicle"]))


def format_effects(row: Row) -> str:
    """Effects of a vehicle with their confidence and alternatives."""
    parts = []
    for effect in row["effects"]:
        alternatives = "".join(f" or {name}" for name in effect["alternatives"])
        parts.append(f"{effect['name']} {confidence_text(effect['confidence'])}{alternatives}")
    return ", ".join(parts)
