"""All checks, in the order in which their findings are shown."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from slopewise.services.doctor import chain, motion, vehicle
from slopewise.services.doctor.facts import Facts, Misfit, MisfitSeverity

CHECKS: tuple[Callable[[Facts], Iterator[Misfit]], ...] = (
    motion.check_silence,
    motion.check_obedience,
    motion.check_limits,
    chain.check_chain,
    chain.check_smoother,
    chain.check_speed_limit,
    vehicle.check_footprint,
    vehicle.check_edge,
    vehicle.check_times,
    motion.check_clock,
    motion.check_rates,
    motion.check_map,
    motion.check_frames,
    motion.check_odometry,
)


def examine(facts: Facts) -> list[Misfit]:
    """What does not fit, errors first."""
    found = [finding for check in CHECKS for finding in check(facts)]
    return sorted(found, key=lambda finding: finding.severity is not MisfitSeverity.ERROR)
