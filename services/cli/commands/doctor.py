"""`slopewise doctor`: what does not fit on a robot."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from slopewise.models.errors import InputError
from slopewise.services.doctor.examine import CHECKS, examine
from slopewise.services.doctor.message_collector import live_traffic, recorded_traffic
from slopewise.services.doctor.nav2_file import read_nav2
from slopewise.services.doctor.robot_facts import ConfigIssue, IssueSeverity, RobotFacts
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.ros.settings import read_settings


class DoctorResult(NamedTuple):
    """What was looked at, and what does not fit."""

    looked_at: list[str]
    findings: list[ConfigIssue]


def run(
    model: str, nav2: list[Path], bag: Path | None, config: Path | None, seconds: float
) -> DoctorResult:
    """Look at whatever is given.

    Args:
        model: model file or shipped vehicle; "" for none. nav2: parameter files. bag: recording.
        config: settings of the edge. seconds: for how long to listen to a robot that runs; 0: not.

    Raises:
        InputError: nothing is given, or a file cannot be used.
    """
    if not (nav2 or bag or seconds > 0.0):
        raise InputError("doctor", "", "expected --nav2, --bag or --live: something to look at")
    edge = None if config is None else read_settings(config)
    if seconds > 0.0 and edge is None:
        raise InputError("--live", "", "expected --config ros.toml: where the robot is")
    seen = None if bag is None else recorded_traffic(bag)
    if seconds > 0.0 and edge is not None:
        seen = live_traffic(edge, seconds)
    facts = RobotFacts(
        None if not model else read_model(find_model(model)),
        edge,
        read_nav2(nav2) if nav2 else None,
        seen,
    )
    names = {"model": facts.model, "edge": edge, "parameters": facts.nav2, "messages": seen}
    return DoctorResult([n for n, fact in names.items() if fact is not None], examine(facts))


def has_errors(result: DoctorResult) -> bool:
    """Whether something does not fit that plans depend on."""
    return any(f.severity is IssueSeverity.ERROR for f in result.findings)


def as_json(result: DoctorResult) -> dict[str, Any]:
    """For machines."""
    return {
        "looked_at": result.looked_at,
        "checks": len(CHECKS),
        "findings": [
            {"check": f.check, "severity": f.severity.value, "words": f.message, "remedy": f.fix}
            for f in result.findings
        ],
    }


def show(result: DoctorResult, console: Any) -> None:
    """For people."""
    console.print(f"looked at {', '.join(result.looked_at)} with {len(CHECKS)} checks")
    for finding in result.findings:
        colour = "red" if finding.severity is IssueSeverity.ERROR else "yellow"
        console.print(f"[{colour}]{finding.severity.value}[/] [bold]{finding.check}[/]: ", end="")
        console.print(finding.message, markup=False)
        console.print(f"  → {finding.fix}", markup=False)
    if not result.findings:
        console.print("[green]everything that could be looked at fits[/]")
