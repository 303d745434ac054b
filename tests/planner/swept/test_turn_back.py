"""Speeds of the turn back to the line against the integrated law of pure pursuit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.ground.terrain_profile import terrain_profile
from slopewise.planner.path import batch
from slopewise.planner.swept.convergence import Departure, convergence
from tests.world.vehicles import ATV, model_of

MODEL, STEP = model_of(ATV), 0.2


@pytest.mark.parametrize(
    ("offset", "turned", "speed"), [(0.3, 0.0, 4.0), (0.3, 0.2, 4.0), (-0.4, 0.3, 2.0)]
)
def test_a_turn_back_keeps_to_the_lateral_limit(offset: float, turned: float, speed: float) -> None:
    flat = ElevationMap(elevation=np.zeros((100, 300)), resolution=STEP, origin=(0.0, 0.0))
    paths = batch([CandidatePath("straight", np.array([[2.0, 10.0], [50.0, 10.0]]))], STEP)
    profile = terrain_profile(
        flat, paths.x, paths.y, paths.count, MODEL.vehicle, MODEL.steering_geometry
    )
    at = Departure(np.array([2]), np.array([0.5]), np.array([offset]), turned, speed, 0.0)
    back = convergence(profile, at, MODEL, 0.0)
    assert back is not None
    lookahead = max(2.0 * MODEL.vehicle.wheelbase, speed)

    def law(_: float, state: Floats) -> list[float]:
        e, slope = state
        return [slope, -2.0 / lookahead * slope - 2.0 / lookahead**2 * e]

    distance = paths.x[:, 0] - 2.5
    ahead = np.flatnonzero(distance[: len(back.speed)] > STEP + 1e-9)
    solved = solve_ivp(
        law, (0.0, 60.0), [offset, turned], t_eval=distance[ahead], rtol=1e-9, atol=1e-12
    )
    turn = np.abs([law(0.0, state)[1] for state in solved.y.T])
    assert np.all(back.speed[ahead, 0] ** 2 * turn <= 1.001 * MODEL.limits.lateral_accel)
    # Where this course is the sharpest, the speed is what it allows.
    allowed = np.sqrt(MODEL.limits.lateral_accel / turn[0])
    assert back.speed[ahead[0], 0] == pytest.approx(allowed, rel=0.02)
    assert np.isinf(back.speed[:4, 0]).all()
