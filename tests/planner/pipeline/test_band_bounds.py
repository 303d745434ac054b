"""Ground next to the path, within the band of tracking errors, bounds a plan as well."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import Tracking
from slopewise.models.parameters import Model
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from tests.world.ground import straight
from tests.world.vehicles import ATV, model_of

QUANTILE, LATERAL = 0.9, 0.2  # [1]; [m] of the band
STD = LATERAL / 1.6448536  # the normal quantile of 0.95: a band has two sides
CELL = 0.1  # [m]


def tracked(model: Model, std: float = STD) -> Model:
    return replace(model, tracking=Tracking(cross_track_std=std))


def trough(model: Model, share: float) -> ElevationMap:
    """Two planes that meet along the x axis, y = 0: level across on it alone.

    The wheels stand at |lateral ± width/2| from the fold: their heights differ by twice that
    distance times the slope, which is a share of the trained roll.
    """
    roll, width = share * model.braking.trained_roll[1], model.vehicle.track_width
    y, _ = np.mgrid[-6.0:6.0:CELL, -4.0:30.0:CELL]
    heights = 0.5 * width / LATERAL * math.tan(roll) * np.abs(y)
    return ElevationMap(elevation=heights, resolution=CELL, origin=(-4.0, -6.0))


def plan_on(
    ground: ElevationMap, model: Model, start_speed: float = 0.0, length: float = 20.0
) -> SpeedPlan:
    planner = CandidatePlanner(model, uncertainty=Uncertainty(quantile=QUANTILE))
    return planner.plan(ground, [straight(length)], start_speed=start_speed)[0]


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_a_roll_at_the_side_of_the_path_counts_as_one_on_it(share: float) -> None:
    model = model_of(ATV)
    ground = trough(model, share)
    exact, band = plan_on(ground, model), plan_on(ground, tracked(model))
    assert abs(exact.roll).max() < 1e-6
    assert exact.status is Status.OK
    if share < 1.0:
        assert band.status is Status.OK
    else:
        assert band.progress == 0.0
        assert band.status is Status.BLOCKED
        assert "next to the path, within the band of tracking errors" in band.reason


def test_a_vehicle_too_fast_for_ground_next_to_its_path_brakes() -> None:
    model = model_of(ATV)
    plan = plan_on(trough(model, 1.1), tracked(model), start_speed=2.0)
    assert plan.status is Status.DEGRADED
    assert np.all(np.diff(plan.speed) <= 0.0)


def rough(seed: int) -> ElevationMap:
    """Smooth ground at random, with slopes of some 8°."""
    heights = np.random.default_rng(seed).standard_normal((120, 340))
    heights = ndimage.gaussian_filter(heights, 10.0)
    return ElevationMap(
        elevation=heights * (0.2 / heights.std()), resolution=CELL, origin=(-4.0, -6.0)
    )


def test_a_band_never_makes_a_plan_faster() -> None:
    model = model_of(ATV)
    slower = 0
    for seed in range(6):
        ground = rough(seed)
        exact, narrow, wide = (
            plan_on(ground, m, length=8.0) for m in (model, tracked(model, 1e-4), tracked(model))
        )
        speed = np.interp(exact.station, wide.station, wide.speed)
        assert np.all(speed <= exact.speed + 1e-6)
        assert narrow.speed == pytest.approx(exact.speed, abs=0.02)
        slower += bool(np.any(speed < exact.speed - 1e-3))
    assert slower > 0
