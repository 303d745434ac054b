"""Plans of generated scenes pass the checker: surfaces, effects, friction, holes, fast starts."""

from __future__ import annotations

import pytest
from hypothesis import Phase, given, settings

from slopewise.planner.plan import Status
from slopewise.services.check.check_report import Violation
from slopewise.services.check.external_plan import plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.io.plan_file import driven
from tests.planner import generated
from tests.planner.scenes import model_of


def violations(scene: generated.Scene) -> list[Violation]:
    plan = scene.plan()
    report = check_plan_on_map(
        plan_of_columns(driven(plan)),
        model_of(scene.tables),
        scene.ground,
        clear=scene.options["clear"],
    ).violations
    if plan.status is Status.DEGRADED and plan.reason.startswith("starts at"):
        # What a turn takes of friction is counted up to the highest planned speed, not beyond it.
        report = tuple(v for v in report if v.kind not in ("decel", "friction"))
    # Under drive the front axle is bounded, and each side; a wheel that is on both is not.
    return [v for v in report if not v.sentence.startswith("the lightest wheel")]


@settings(max_examples=60)
@given(generated.scenes())
def test_generated_plans_are_sound(scene: generated.Scene) -> None:
    assert not violations(scene)


@pytest.mark.nightly
@settings(settings.get_profile("nightly"), max_examples=2000, phases=[Phase.generate])
@given(generated.scenes())
def test_many_generated_plans_are_sound(scene: generated.Scene) -> None:
    assert not violations(scene)
