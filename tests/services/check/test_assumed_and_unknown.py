"""A plan is not refused for what it assumes: its first heading, and ground behind obstacles."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.plan_checker import check_plan_on_map
from tests.services.check.drives import (
    Scene,
    ground,
    model_with,
    round_turn,
    slope,
    straight,
    trapezoid,
)


def kinds(scene: Scene) -> set[str]:
    report = check_plan_on_map(scene.plan, scene.model, scene.heights)
    return {violation.kind for violation in report.violations}


@pytest.mark.parametrize(("spoilt_from", "is_refused"), [(14.0, False), (10.0, True)])
def test_slopes_are_compared_up_to_the_clear_distance(spoilt_from: float, is_refused: bool) -> None:
    s, v = trapezoid(2.0, stop_at=9.0)
    roll = np.where(s < spoilt_from, 0.1, 0.0)
    plan = straight(s, v, roll=roll, clear_distance=np.full_like(s, 12.0))
    assert ("columns" in kinds(Scene(plan, model_with(), ground(slope(0.0, 0.1))))) is is_refused


@pytest.mark.parametrize(("decel", "is_refused"), [(4.0, False), (0.0, True)])
def test_bank_counts_from_the_first_row_on(decel: float, is_refused: bool) -> None:
    """Half a step behind the first row, where the turn alone is too fast no more."""
    s = np.linspace(0.0, 6.0, 61)
    speed = np.sqrt(np.maximum(6.4 - 2.0 * decel * s, 0.0))
    model = model_with(limits={"lateral_accel": 2.0, "decel": 50.0})
    plan: ExternalPlan = round_turn(s, speed, 4.0)
    assert ("lateral" in kinds(Scene(plan, model, ground(slope(0.0, 0.06))))) is is_refused
