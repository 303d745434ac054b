"""Plans on public elevation models pass the checker, as files hold them, without one violation."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from slopewise.planner.plan import SpeedPlan
from slopewise.services.check.check_report import Violation
from slopewise.services.check.external_plan import plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.io.model_file import read_model, shipped_models
from slopewise.services.io.plan_file import driven
from tests.planner.test_real_terrain import CASES, SHARE, ground_of, plans_on


def violations_of(plans: list[SpeedPlan], place: str, vehicle: str, data: Path) -> list[Violation]:
    model, ground = read_model(shipped_models()[vehicle]), ground_of(place, data)
    violations: list[Violation] = []
    stops = 0
    for plan in plans:
        report = check_plan_on_map(plan_of_columns(driven(plan)), model, ground)
        stops += report.stops
        violations += report.violations
    kinds = Counter(violation.kind for violation in violations)
    print(f"{vehicle} on {place}: {len(plans)} plans, {stops} stops, {dict(kinds)}")
    return violations


@pytest.mark.parametrize(("place", "vehicle"), CASES)
def test_a_share_of_plans_is_sound(place: str, vehicle: str, data: Path) -> None:
    plans = plans_on(place, vehicle, data)[:: 2 * SHARE]
    violations = violations_of(plans, place, vehicle, data)
    assert not violations, violations[:5]


@pytest.mark.nightly
@pytest.mark.timeout(3600)
@pytest.mark.parametrize(("place", "vehicle"), CASES)
def test_every_plan_is_sound(place: str, vehicle: str, data: Path) -> None:
    violations = violations_of(plans_on(place, vehicle, data), place, vehicle, data)
    assert not violations, violations[:5]
