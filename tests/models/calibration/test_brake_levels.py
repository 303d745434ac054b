"""Stops at a part of the brakes teach as well: dead band, slope, saturation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.calibration.stop_plant import PlantVehicle, drive_log
from slopewise.models.calibration.learn import Calibration, learn, with_learned
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from slopewise.models.stop_logs.find_stops import StopSettings, find_stops
from tests.models.models_for_tests import BASE

BAND, FULL, ROLLING = 0.08, 0.7, 0.05
MODEL = replace(
    BASE, terrain=replace(BASE.terrain, motion_resistance=0.08, braking_resistance=0.06)
)


def log(stops: int, seed: int, levels: tuple[float, float] = (0.1, 1.0)) -> tuple[Any, ...]:
    """A log of stops, each at an application of its own."""
    rng = np.random.default_rng(seed)
    level = rng.uniform(*levels, stops)
    share = np.clip((level - BAND) / (FULL - BAND), 0.0, 1.0)
    vehicle = PlantVehicle(
        name="partial", stops=stops, scatter=0.01, late=0.01, level=tuple(share), rolling=ROLLING
    )
    columns, runs, ground = drive_log(vehicle, rng)
    brake = np.concatenate([np.full(r.stop - r.start, u) for r, u in zip(runs, level, strict=True)])
    columns["brake"] = np.where(columns["v_cmd"] > 0.0, 0.0, brake)
    return columns, runs, ground, level


@pytest.fixture(scope="module")
def learned() -> Calibration:
    columns, runs, ground, _ = log(200, 1)
    return learn(columns, runs, MODEL.braking, ground=ground, beside=MODEL)


def test_the_force_comes_back_at_every_level(learned: Calibration) -> None:
    model = with_learned(MODEL, learned)
    rolling = model.terrain.rolling_while_braking
    vehicle = PlantVehicle(name="true", stops=1, scatter=0.0)
    rng = np.random.default_rng(0)
    for level in np.linspace(0.1, 1.0, 10):
        true = float(np.clip((level - BAND) / (FULL - BAND), 0.0, 1.0))
        share = model.braking.share_at(float(level))
        for speed in (1.5, 3.5):
            full = float(vehicle.forces(np.array(speed), np.zeros(()), rng))
            force = rolling + share * (model.braking.level_force(speed) - rolling)
            assert force == pytest.approx(ROLLING + true * (full - ROLLING), rel=0.03)


def test_all_stops_are_used_and_covered(learned: Calibration) -> None:
    assert learned.verdicts["usable"] >= 195
    assert "partial" not in learned.verdicts
    records = learned.surfaces[0].records
    beyond = [r.samples.distance > r.bound_distance for r in records]
    assert sum(beyond) <= 1
    assert learned.objections == ()


def test_full_stops_alone_leave_the_line_as_it_was() -> None:
    columns, runs, ground, _ = log(20, 2, levels=(0.99, 1.0))
    found = learn(columns, runs, MODEL.braking, ground=ground, beside=MODEL)
    assert found.levels is None
    assert (found.braking.dead_band, found.braking.saturation) == (0.0, 1.0)


def test_an_application_that_is_not_held_is_left_out() -> None:
    columns, runs, _, _ = log(2, 3, levels=(0.5, 0.6))
    brake = columns["brake"].copy()
    n = runs[0].stop
    brake[:n] *= np.linspace(0.6, 1.4, n)
    good = np.ones(len(brake), np.bool_)
    settings = StopSettings(partial=True)
    found = [find_stops(columns | {"brake": brake}, run, good, settings)[0] for run in runs]
    assert found[0].verdict.name == "PARTIAL"
    assert "not held" in found[0].reason
    assert found[1].usable
    assert not find_stops(columns, runs[1], good)[0].usable


def test_a_line_without_width_is_refused() -> None:
    assert replace(BASE.braking, dead_band=0.1, saturation=0.6).share_at(0.35) == pytest.approx(0.5)
    with pytest.raises(ParameterError, match="saturation"):
        replace(BASE.braking, dead_band=0.5, saturation=0.4)
    assert Braking.share_at(BASE.braking, 1.0) == 1.0
