"""Settings of the planner: one place for every number, each validated."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.errors import ParameterError
from slopewise.planner.settings import PlannerSettings
from tests.planner.scenes import ATV, plan_one, plane, straight


def test_station_spacing_is_at_most_that_of_settings_and_map() -> None:
    settings = PlannerSettings(spacing=0.4)
    assert settings.spacing_on(5.0) == 0.4
    assert settings.spacing_on(0.05) <= 0.1
    for resolution in (0.05, 0.1, 1.0):
        plan = plan_one(ATV, plane(resolution=resolution), straight(10.0), settings)
        assert np.diff(plan.station).max() <= settings.spacing_on(resolution) + 1e-9


@pytest.mark.parametrize("spacing", [0.0, -0.1, np.inf, np.nan])
def test_impossible_spacings_are_refused(spacing: float) -> None:
    with pytest.raises(ParameterError) as caught:
        PlannerSettings(spacing=spacing)
    assert caught.value.field == "spacing"


def test_a_negative_charge_for_what_is_not_reached_is_refused() -> None:
    with pytest.raises(ParameterError) as caught:
        PlannerSettings(horizon_penalty=-1.0)
    assert caught.value.field == "horizon_penalty"
