"""Load lost over a crest, against free bodies written out here."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws.crest import load_loss
from tests.world.vehicles import G


@given(radius=st.floats(5.0, 100.0), speed=st.floats(0.5, 6.0))
def test_on_a_round_hill_the_load_loss_is_the_centripetal_force(
    radius: float, speed: float
) -> None:
    """A point that slides over the top of a circle: acceleration by differences."""
    dt = 1e-4
    angle = speed * np.array([-dt, 0.0, dt]) / radius
    height = radius * np.cos(angle)
    falling = (height[0] - 2.0 * height[1] + height[2]) / dt**2
    pressing = (G + falling) / G
    assert 1.0 - load_loss(speed, -1.0 / radius) == pytest.approx(pressing, abs=1e-4)
