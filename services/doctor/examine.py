"""All checks, in the order in which their issues are shown."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from slopewise.services.doctor import command_chain_checks as chain
from slopewise.services.doctor import map_checks as ground
from slopewise.services.doctor import observed_motion_checks as observed
from slopewise.services.doctor import vehicle_checks as vehicle
from slopewise.services.doctor.robot_facts import ConfigIssue, IssueSeverity, RobotFacts

CHECKS: tuple[Callable[[RobotFacts], Iterator[ConfigIssue]], ...] = (
    observed.check_silence,
    observed.check_speed_limit_obeyed,
    observed.check_limits,
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
    ground.check_noise,
    ground.check_stated_error,
)


def examine(facts: RobotFacts) -> list[ConfigIssue]:
    """Issues of all checks, errors first."""
    issues = [issue for check in CHECKS for issue in check(facts)]
    return sorted(issues, key=lambda issue: issue.severity is not IssueSeverity.ERROR)
