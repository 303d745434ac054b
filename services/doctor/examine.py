"""All checks, in the order in which their issues are shown."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from slopewise.services.doctor import command_chain_checks as chain
from slopewise.services.doctor import map_checks as ground
from slopewise.services.doctor import observed_motion_checks as observed
from slopewise.services.doctor import vehicle_checks as vehicle
from slopewise.services.doctor.robot_facts import ConfigIssue, IssueSeverity, RobotFacts
from slopewise.services.io.bags import GRID_MAP, PATH, SPEED_LIMIT
from slopewise.services.ros.conversions import ODOMETRY, TRANSFORMS

CHECKS: tuple[Callable[[RobotFacts], Iterator[ConfigIssue]], ...] = (
    observed.check_silence,
    observed.check_speed_limit_obeyed,
    observed.check_limits,
    chain.check_numbers,
    chain.check_chain,
    chain.check_smoother,
    chain.check_speed_limit,
    vehicle.check_footprint,
    vehicle.check_edge,
    vehicle.check_times,
    observed.check_clock,
    observed.check_rates,
    observed.check_map,
    observed.check_frames,
    observed.check_odometry,
    ground.check_cells,
    ground.check_heights,
    ground.check_noise,
    ground.check_stated_error,
)


def examine(facts: RobotFacts) -> list[ConfigIssue]:
    """Issues of all checks, errors first."""
    issues = [issue for check in CHECKS for issue in check(facts)]
    return sorted(issues, key=lambda issue: issue.severity is not IssueSeverity.ERROR)


def absent(facts: RobotFacts) -> list[str]:
    """Topics that traffic lacks, and what was not checked without them."""
    topics, seen = facts.topics, facts.seen.topics
    checks = (
        ((topics.odometry,), ODOMETRY, "rate, frame", "scale, whether limits are obeyed"),
        ((topics.speed_limit,), SPEED_LIMIT, "rate", "whether limits are obeyed"),
        (topics.paths, PATH, "frame", ""),
        ((topics.map,), GRID_MAP, "age, frame", ""),
        ((topics.tf, topics.tf_static), TRANSFORMS, "", "connections of frames"),
    )
    texts = []
    for names, kind, by_name, by_kind in checks:
        expected = [facts.full_name(name) for name in names if name]
        if not seen or not expected or any(name in seen for name in expected):
            continue
        elsewhere = sorted(name for name, topic in seen.items() if topic.kind == kind)
        skipped = ", ".join(filter(None, (by_name, "" if elsewhere else by_kind)))
        if skipped:
            text = f"no {kind} on {' or '.join(expected)}, not checked: {skipped}"
            hint = f"; --config names the topic, as one of {', '.join(elsewhere)}"
            texts.append(text + hint * bool(elsewhere))
    return texts
