"""Names that stops held out contradict, and their successors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import Gaps
from slopewise.models.discrepancy.decide.no_harm import held_to_account
from slopewise.models.discrepancy.decide.verdict import Decision
from slopewise.models.discrepancy.findings import Gap, Verdict
from slopewise.models.discrepancy.likelihood.axes import Axis
from slopewise.models.discrepancy.likelihood.refit import Known, Refit
from slopewise.models.discrepancy.likelihood.residual_axes import ResidualAxis
from slopewise.models.discrepancy.likelihood.resolvable import Resolvable
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.parameters import Effect
from tests.world.logs import refit_of, table

STEP = Effect(name="step_change", parameters={"scale": 0.85, "run": 25.0})
FURROWS = Effect(name="directional_surface", parameters={"k": 0.15, "direction": 0.0})


def named(fit: Refit) -> Decision:
    return Decision(Verdict.MISSING_EFFECT, fit, confidence=(0.9,), named=(0,))


def wrong_for_certain(stops: StopTable) -> Decision:
    """A name whose numbers no stop can move."""
    fit = refit_of(stops, FURROWS)
    wrong = replace(fit.hypothesis, added=(FURROWS,))
    return named(replace(fit, hypothesis=wrong, known=Known(1e6 * np.eye(7), wrong.free)))


def accounted(stops: StopTable, base: Refit, follower: Decision, p_value: float) -> Decision:
    def next_to(contradicted: Sequence[frozenset[str]]) -> Decision:
        assert contradicted == [frozenset({"directional_surface"})]
        return follower

    shapes = np.sin(stops.grade)[:, :, None]
    axis = ResidualAxis(Axis("grade", "rad", stops.grade, (shapes,)), p_value, 20.0, shapes, 0.01)
    seen, settings = Resolvable({}, frozenset(), {}), DiscrepancySettings()
    wrong = wrong_for_certain(stops)
    return held_to_account(stops, base, wrong, [axis], seen, settings, next_to)[0]


def test_the_next_name_is_used_instead_of_a_contradicted_one() -> None:
    stops = table("step")
    decision = accounted(stops, refit_of(stops), named(refit_of(stops, STEP)), 1e-9)
    assert decision.names == ("step_change",)


@pytest.mark.parametrize(("p_value", "verdict"), [(0.5, Verdict.NONE), (1e-4, Verdict.UNKNOWN)])
def test_none_is_used_only_if_no_axis_says_otherwise(p_value: float, verdict: Verdict) -> None:
    stops = table("clean")
    base = refit_of(stops)
    decision = accounted(stops, base, Decision(Verdict.NONE, base), p_value)
    assert decision.verdict is verdict
    assert (decision.axis is None) == (verdict is Verdict.NONE)
    assert "directional_surface" in decision.notes[0]


@pytest.mark.parametrize(
    ("speed", "distance", "harmful"),
    [(0.08, 0.07, False), (0.09, 0.07, True), (0.06, 0.09, True), (0.06, 0.05, False)],
)
def test_a_name_is_contradicted_by_speeds_and_by_distances(
    speed: float, distance: float, harmful: bool
) -> None:
    """Better than bad coefficients is not enough: the model as configured may be better still."""
    before, refit, floor = 0.08, 0.15, 0.05
    in_speed, in_distance = (
        Gap("", "", before, refit, after, floor, None, None, -5.0) for after in (speed, distance)
    )
    gaps = Gaps(in_speed, in_distance, np.empty(0), (0.0, 0.0))
    assert gaps.harmful is harmful
