"""`slopewise doctor`: settings and recordings of a robot that do not fit together."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from slopewise.models.errors import InputError
from slopewise.services.cli import options
from slopewise.services.cli.command import ExitStatus, print_result
from slopewise.services.cli.options import argument, option
from slopewise.services.cli.tables import line, notes

if TYPE_CHECKING:
    from slopewise.services.doctor.robot_facts import ConfigIssue, RobotFacts


def doctor(
    map_file: Annotated[Path | None, argument("An elevation map to examine.", "[MAP]")] = None,
    model: Annotated[
        str, option("Model file, or shipped vehicle.", "M.toml", "--model", "-m")
    ] = "",
    nav2: Annotated[
        list[Path] | None, option("Parameters of Nav2 or a base; repeat.", "PARAMS.yaml", "--nav2")
    ] = None,
    bag: Annotated[Path | None, option("A recording of the robot.", "BAG", "--bag")] = None,
    config: Annotated[
        Path | None, option("Settings of slopewise ros.", "ros.toml", "--config", "-c")
    ] = None,
    live: Annotated[
        float, option("Listen to the robot for this duration.", "SECONDS", "--live")
    ] = 0.0,
    as_json: options.AsJson = False,
) -> ExitStatus | None:
    """Examine a robot, a recording or parameter files, and report settings that do not fit.

    Decelerations along the chain against the brakes learned, limits that are not obeyed, clocks,
    frames, rates, map age, footprint; of a map, what its cells and its noise do not show. Status 3:
    an error was found.

    [bold]Example[/]  slopewise doctor --nav2 nav2_params.yaml --model mine.toml --bag drive.mcap
    [bold]Example[/]  slopewise doctor map.npz --model mine.toml
    """
    from slopewise.services.doctor.examine import CHECKS, absent, examine
    from slopewise.services.doctor.robot_facts import IssueSeverity

    facts = _facts(map_file, model, nav2 or [], bag, config, live)
    sources = {
        "model": model,
        "edge": config,
        "parameters": nav2,
        "messages": bag or live > 0.0,
        "map": map_file,
    }
    names = [name for name, given in sources.items() if given]
    issues = examine(facts)
    findings = [
        {"check": i.check, "severity": i.severity.value, "words": i.message, "remedy": i.fix}
        for i in issues
    ]
    missing = absent(facts)
    summary = {"looked_at": names, "checks": len(CHECKS), "findings": findings, "absent": missing}
    print_result(as_json, summary, _tables(names, len(CHECKS), issues, missing))
    has_errors = any(issue.severity is IssueSeverity.ERROR for issue in issues)
    return ExitStatus.NOT_ADMISSIBLE if has_errors else None


def _facts(
    map_file: Path | None,
    model: str,
    nav2: list[Path],
    bag: Path | None,
    config: Path | None,
    live: float,
) -> RobotFacts:
    """Read the sources; InputError without one."""
    from slopewise.services.doctor.message_collector import live_traffic, recorded_traffic
    from slopewise.services.doctor.nav2_file import read_nav2
    from slopewise.services.doctor.robot_facts import Nav2Facts, ObservedTraffic, RobotFacts
    from slopewise.services.io.map_file import read_map
    from slopewise.services.io.model_file import find_model, read_model
    from slopewise.services.ros.settings import read_settings

    if not (map_file or nav2 or bag or live > 0.0 or (config and model)):
        sources = "a map, --nav2, --bag or --live, or --config with --model"
        raise InputError("doctor", "", f"expected {sources}: a source to examine")
    ground = read_map(map_file) if map_file else None
    if map_file and not model:
        raise InputError("--model", "", "expected a model: whose wheels a map is examined for")
    edge = None if config is None else read_settings(config)
    if live > 0.0 and edge is None:
        raise InputError("--live", "", "expected --config ros.toml: where the robot is")
    traffic = ObservedTraffic() if bag is None else recorded_traffic(bag)
    if live > 0.0 and edge is not None:
        traffic = live_traffic(edge, live)
    robot = read_model(find_model(model)) if model else None
    return RobotFacts(robot, edge, read_nav2(nav2) if nav2 else Nav2Facts(), traffic, ground)


def _tables(
    names: list[str], check_count: int, issues: list[ConfigIssue], missing: list[str]
) -> Iterator[Any]:
    from rich.text import Text

    yield line(f"examined {', '.join(names)} with {check_count} checks")
    for issue in issues:
        severity = issue.severity.value
        colour = "red" if severity == "error" else "yellow"
        yield Text.assemble((severity, colour), " ", (issue.check, "bold"), f": {issue.message}")
        yield line(f"  → {issue.fix}")
    if not issues:
        yield line("everything that could be checked fits", "green")
    yield from notes(missing, "absent")
