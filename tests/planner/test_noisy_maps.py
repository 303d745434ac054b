"""Noise of a map neither stops nor slows a vehicle; obstacles above it do, and limits are noted."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import slopewise
from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.smallest_seen import careful_speed, hides_steps, sight_notes, smallest_seen
from slopewise.planner.explain.explain import explain
from slopewise.planner.ground.sight import within_sight
from slopewise.planner.horizon.answer import PlanarState
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.settings import PlannerSettings

VEHICLES = ("atv", "husky", "ugv")
EDGE = 0.1
X, Y = (EDGE * np.arange(n) - offset for n, offset in ((300, 5.0), (80, 4.0)))
SWELL = 0.12 * np.sin(2.0 * np.pi * X / 25.0)[None, :] * np.cos(0.2 * Y)[:, None]
STRAIGHT = np.column_stack([np.linspace(0.0, 20.0, 41), np.zeros(41)])


def measured(std: float, heights: Floats = SWELL, seed: int = 1, **stated: object) -> ElevationMap:
    """Heights as a robot measures them, with the error stated unless something else is."""
    noise = std * np.random.default_rng(seed).standard_normal(heights.shape)
    facts: dict[str, object] = {"height_std": std} | stated
    return ElevationMap(
        elevation=heights + noise,
        resolution=EDGE,
        origin=(float(X[0]), float(Y[0])),
        **facts,  # type: ignore[arg-type]
    )


def planned(model: Model, ground: ElevationMap, **settings: object) -> SpeedPlan:
    paths = [CandidatePath(name="straight", points=STRAIGHT)]
    chosen = PlannerSettings(**settings)  # type: ignore[arg-type]
    return slopewise.plan(model, ground, paths, settings=chosen)[0]


@pytest.mark.parametrize("vehicle", VEHICLES)
@pytest.mark.parametrize("std", [pytest.param(0.01, marks=pytest.mark.nightly), 0.02])
def test_noise_neither_stops_nor_slows(vehicle: str, std: float) -> None:
    model = slopewise.read_model(vehicle)
    exact = planned(model, measured(0.0))
    for stated in ({}, {"height_std": 0.025, "height_std_is_assumed": True}):
        ground = measured(std, **stated)
        plan = planned(model, ground, unseen_steps="report")
        assert plan.status.value == "ok", plan.reason
        assert plan.travel_time < exact.travel_time / 0.9
        assert abs(plan.station[-1] - exact.station[-1]) < 0.01 * exact.station[-1]
        assert slopewise.check_plan(plan, model, ground).valid


@pytest.mark.parametrize("seed", [2, 9, 31])
def test_a_plan_that_stops_before_a_drop_does_not_creep(seed: int) -> None:
    drop = np.where(X > 8.0, -1.0, 0.0) + np.zeros_like(SWELL)
    plan = planned(slopewise.read_model("atv"), measured(0.01, drop, seed, height_std=0.0))
    assert plan.status.value == "blocked"
    assert plan.speed.max() > 0.8
    assert np.diff(plan.time).max() < 3.0


def test_noise_that_neighbours_share_is_ground_unless_it_is_stated() -> None:
    rng = np.random.default_rng(3)
    waves = np.fft.fft2(rng.standard_normal(SWELL.shape))
    away = np.hypot(*np.meshgrid(*(2.0 * np.pi * np.fft.fftfreq(n, EDGE) for n in (300, 80))))
    shared = np.fft.ifft2(waves * np.exp(-((away * 0.3) ** 2) / 4.0)).real
    heights = SWELL + 0.02 / shared.std() * shared
    model = slopewise.read_model("husky")
    silent = planned(model, measured(0.0, heights, height_std=0.02))
    stated = planned(model, measured(0.0, heights, height_std=0.02, correlation_length=0.3))
    assert silent.status.value == "blocked"
    assert stated.status.value == "ok", stated.reason


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_what_the_map_says_to_show_is_found(vehicle: str) -> None:
    model = slopewise.read_model(vehicle)
    seen = smallest_seen(measured(0.01), model.vehicle)
    assert seen is not None
    for seed in range(5):
        ahead = X[None, :] - 8.0 + 0.2 * Y[:, None] > 0.0
        for height in (seen.step, -seen.step):
            plan = planned(model, measured(0.01, SWELL + height * ahead, seed))
            assert plan.status.value == "blocked"
            assert plan.clear_distance < 8.5


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_so_is_what_shows_where_the_error_is_overstated(vehicle: str) -> None:
    """With little noise on the ramp that averaging makes of a step, tyres notice less of it."""
    model = slopewise.read_model(vehicle)
    for turn in (0.0, 0.2, 1.0):
        ahead = X[None, :] - 8.0 + turn * Y[:, None] > 0.0
        for std in (0.0, 0.01):
            seen = smallest_seen(measured(std, height_std=0.05), model.vehicle)
            assert seen is not None
            plan = planned(model, measured(std, SWELL + seen.step * ahead, height_std=0.05))
            assert plan.status.value == "blocked", (turn, std, plan.speed.max())


def test_a_map_that_is_too_noisy_is_driven_carefully_or_only_noted() -> None:
    model, noisy = slopewise.read_model("husky"), measured(0.04)
    assert hides_steps(noisy, model.vehicle)
    fast = dataclasses.replace(model, limits=dataclasses.replace(model.limits, speed=3.0))
    careful = careful_speed(model.vehicle.wheel_radius, model.limits.vertical_accel)
    slower = within_sight(fast, noisy, "slow")
    assert slower.limits.speed == pytest.approx(careful)
    assert slower is within_sight(fast, noisy, "slow")
    assert within_sight(fast, noisy, "report") is fast
    assert within_sight(fast, measured(0.002), "slow") is fast
    level = measured(0.04, np.zeros_like(SWELL))
    assert planned(fast, level).speed.max() <= careful + 1e-9
    path = CandidatePath(name="straight", points=STRAIGHT)
    assert explain(fast, level, path).plan.speed.max() <= careful + 1e-9
    answer = slopewise.Horizon(fast).step(
        PlanarState(x=0.0, y=0.0, heading=0.0, speed=0.0), [path], level
    )
    assert answer.chosen.speed.max() <= careful + 1e-9


def test_what_may_be_missed_and_what_is_misstated_is_noted() -> None:
    vehicle = slopewise.read_model("atv").vehicle
    assert sight_notes(measured(0.0), vehicle) == ()
    (note,) = sight_notes(measured(0.03), vehicle)
    assert "noise of the map 0.030 m (stated)" in note
    assert "the highest step is 0.0933 m" in note
    assert (
        "from the heights"
        in sight_notes(measured(0.02, height_std=0.03, height_std_is_assumed=True), vehicle)[0]
    )
    assert "a larger error than stated" in sight_notes(measured(0.026, height_std=0.02), vehicle)[1]
    assert "neighbouring cells share" in sight_notes(measured(0.014, height_std=0.02), vehicle)[1]
