"""The closed form of a stop without effects is the simulation's, wherever a sheet may ask."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.parameters import Effect
from slopewise.models.stops.simulation import GroundTrack, simulate_stop
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.report.even_stop import even_stop

MODEL = read_model(find_model("atv"))


@pytest.mark.parametrize("friction", [None, 0.35])
@pytest.mark.parametrize("grade", np.deg2rad([-14.0, -9.5, 0.0, 14.0]).tolist())
def test_it_is_what_the_simulation_drives(grade: float, friction: float | None) -> None:
    """To what a sheet prints and well beyond: half a micrometre."""
    on = replace(MODEL.braking, sliding_friction=friction)
    for force in (0.28, 0.5):
        for speed in (0.5, 4.0):
            found = even_stop(replace(MODEL, effect=()), on, force, speed, grade, 0.3)
            brake = replace(on, m_m=0.0, b_m=0.0, m_b=0.0, b_b=force, dead_time=0.0, level=1.0)
            bare = replace(MODEL, effect=(), braking=brake)
            driven = simulate_stop(bare, GroundTrack.of_grade(grade), speed).distance
            assert found == pytest.approx(driven, abs=5e-7)
            assert math.isinf(found) == math.isinf(driven)


def test_a_stop_that_takes_too_long_is_none() -> None:
    bare = replace(MODEL, effect=())
    ice = replace(MODEL.braking, sliding_friction=0.16)
    assert math.isinf(even_stop(bare, ice, 0.5, 0.5, -0.2, 0.0))
    slide = replace(bare, braking=replace(ice, m_m=0.0, b_m=0.0, m_b=0.0, b_b=0.5))
    assert math.isinf(simulate_stop(slide, GroundTrack.of_grade(-0.2), 0.5).distance)
    assert math.isinf(even_stop(bare, MODEL.braking, 0.003, 4.0, 0.0, 0.0))
    assert math.isinf(even_stop(bare, MODEL.braking, 0.2, 4.0, -0.25, 0.0))


def test_effects_are_driven() -> None:
    held = even_stop(replace(MODEL, effect=()), MODEL.braking, 0.4, 4.0, 0.0, 0.0)
    lag = replace(MODEL, effect=(Effect(name="brake_lag", parameters={"tau": 0.2}),))
    assert even_stop(lag, MODEL.braking, 0.4, 4.0, 0.0, 0.0) > held + 0.5
