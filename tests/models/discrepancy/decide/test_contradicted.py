"""Names that stops held out contradict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import Gaps
from slopewise.models.discrepancy.decide.held_out import held_to_account
from slopewise.models.discrepancy.decide.verdict import Decision
from slopewise.models.discrepancy.findings import Gap, Verdict
from slopewise.models.discrepancy.likelihood.axes import Axis
from slopewise.models.discrepancy.likelihood.refit import Known
from slopewise.models.discrepancy.likelihood.residual_axes import ResidualAxis
from slopewise.models.discrepancy.likelihood.resolvable import Resolvable
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.parameters import Effect
from tests.world.logs import refit_of, table

FURROWS = Effect(name="directional_surface", parameters={"k": 0.15, "direction": 0.0})


def wrong_for_certain(stops: StopTable) -> Decision:
    """A name whose numbers no stop can move."""
    fit = refit_of(stops, FURROWS)
    wrong = replace(fit.hypothesis, added=(FURROWS,))
    fit = replace(fit, hypothesis=wrong, known=Known(1e6 * np.eye(7), wrong.free))
    return Decision(Verdict.MISSING_EFFECT, fit, confidence=(0.9,), named=(0,))


@pytest.mark.parametrize(("p_value", "verdict"), [(0.5, Verdict.NONE), (1e-4, Verdict.UNKNOWN)])
def test_a_contradicted_name_is_none_only_if_no_axis_says_otherwise(
    p_value: float, verdict: Verdict
) -> None:
    stops = table("clean")
    shapes = np.sin(stops.grade)[:, :, None]
    axis = ResidualAxis(Axis("grade", "rad", stops.grade, (shapes,)), p_value, 20.0, shapes, 0.01)
    seen, settings = Resolvable({}, 0.0, frozenset(), {}), DiscrepancySettings()
    wrong = wrong_for_certain(stops)
    decision, _ = held_to_account(stops, refit_of(stops), wrong, [axis], seen, settings)
    assert decision.verdict is verdict
    assert (decision.axis is None) == (verdict is Verdict.NONE)
    assert "directional_surface" in decision.notes[0]


@pytest.mark.parametrize(
    ("speed", "distance", "refit", "harmful"),
    [
        (0.08, 0.07, 0.15, False),
        (0.09, 0.07, 0.15, True),
        (0.06, 0.09, 0.15, True),
        (0.06, 0.05, 0.15, False),
        (0.07, 0.07, 0.06, True),
    ],
)
def test_a_name_is_contradicted_by_speeds_and_by_distances(
    speed: float, distance: float, refit: float, harmful: bool
) -> None:
    """Better than bad coefficients is not enough: the model as configured may be better still."""
    before, floor = 0.08, 0.05
    in_speed, in_distance = (
        Gap("", "", before, refit, after, floor, None, None) for after in (speed, distance)
    )
    gaps = Gaps(in_speed, in_distance, np.empty(0), (0.0, 0.0))
    assert gaps.harmful is harmful
