"""Plans at a quantile pass the checker at the same one; plans by the mean do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.parameters import Model
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan
from slopewise.services.check.external_plan import ExternalPlan, plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.io.model_file import read_model, shipped_models
from slopewise.services.io.plan_file import driven
from tests.services.check.sound_plans import hills


def scattering_model() -> Model:
    """The quad with scatter, and no constant offset to hide behind."""
    model = read_model(shipped_models()["atv"])
    scatter = {"force_std": 0.03, "dead_time_std": 0.03, "speed_error": 0.05}
    return replace(model, braking=replace(model.braking, distance_offset=0.0, **scatter))


GROUND = hills(4, size=60.0)


def path(course: float) -> CandidatePath:
    s = np.linspace(0.0, 18.0, 37)
    points = np.column_stack((30.0 + np.cos(course) * s, 30.0 + np.sin(course) * s))
    return CandidatePath(f"{course:.1f}", points)


def plans(model: Model, quantile: float | None) -> list[SpeedPlan]:
    uncertainty = None if quantile is None else Uncertainty(quantile=quantile)
    planner = CandidatePlanner(model, uncertainty=uncertainty)
    return planner.plan(GROUND, [path(c) for c in (0.3, 1.7, 3.0, 4.4)], clear=12.0)


def given(plan: SpeedPlan) -> ExternalPlan:
    return plan_of_columns(driven(plan))


@pytest.fixture(scope="module")
def relative() -> Model:
    model = scattering_model()
    b = replace(model.braking, force_std=0.0, force_scatter=0.06)
    weaker = SurfaceBraking(
        m_m=0.8 * b.m_m,
        b_m=0.8 * b.b_m,
        m_b=0.8 * b.m_b,
        b_b=0.8 * b.b_b,
        force_scatter=0.05,
        class_id=2_000_000,
        state_of="",
    )
    return replace(model, braking=replace(b, terrain={"weaker": weaker}))


def test_plans_at_the_quantile_pass(relative: Model) -> None:
    for model in (scattering_model(), relative):
        for plan in plans(model, 0.999):
            report = check_plan_on_map(given(plan), model, GROUND, clear=12.0, quantile=0.999)
            assert report.valid, report.violations


def test_plans_by_the_mean_do_not(relative: Model) -> None:
    for model in (scattering_model(), relative):
        reports = [
            check_plan_on_map(given(p), model, GROUND, clear=12.0, quantile=0.999)
            for p in plans(model, None)
        ]
        kinds = {v.kind for r in reports for v in r.violations}
        assert "stopping_path" in kinds


def test_a_state_counts_by_the_mean_as_well(relative: Model) -> None:
    alone = replace(relative, braking=replace(relative.braking, terrain={}))
    kinds = {
        v.kind
        for p in plans(alone, None)
        for v in check_plan_on_map(given(p), relative, GROUND, clear=12.0).violations
    }
    assert "stop_distance" in kinds
    for plan in plans(relative, None):
        assert check_plan_on_map(given(plan), relative, GROUND, clear=12.0).valid
