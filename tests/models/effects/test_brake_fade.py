"""Columns of the search against the law."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import stops_seen
from slopewise.models.effects.brake_fade import EFFECT, remaining_share
from tests.world.logs import table
from tests.world.vehicles import BASE


@pytest.mark.parametrize("lost", [0.0, 0.5, 5.0 / 6.0])
def test_a_column_is_the_law_where_the_hottest_brakes_lose_that_share(lost: float) -> None:
    seen = stops_seen(table("clean"), Hypothesis.configured(BASE))
    assert EFFECT.search is not None
    columns = [column for inner, column in EFFECT.search.columns(seen) if inner["tau"] == 100.0]
    heat = seen.heat(100.0)
    k = lost / (1.0 - lost) / heat.max()
    by_law = (1.0 - remaining_share(heat, k, 100.0)) / k if k > 0.0 else heat
    errors = [np.abs(column + seen.built * by_law * seen.passes).max() for column in columns]
    assert min(errors) < 1e-9 * heat.max()
