"""Whether a model covers a log, stop by stop; and when a calibration is of no use."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.calibration.stop_plant import PlantVehicle, drive_log
from slopewise.models.calibration.coverage import covered
from slopewise.models.calibration.learn import learn
from slopewise.models.errors import ParameterError
from tests.models.models_for_tests import BASE

VEHICLE = PlantVehicle(name="v", stops=40, scatter=0.03, late=0.02)


def test_a_model_covers_another_log_of_its_vehicle_and_not_of_weaker_brakes() -> None:
    columns, runs, ground = drive_log(VEHICLE, np.random.default_rng(1))
    model = replace(BASE, braking=learn(columns, runs, BASE.braking, ground=ground).braking)
    for vehicle, covers in ((VEHICLE, True), (replace(VEHICLE, b_b=0.25), False)):
        columns, runs, ground = drive_log(vehicle, np.random.default_rng(2))
        found = covered(columns, runs, model, ground=ground)
        assert len(found.records) == 40
        assert found.covers() is covers
        assert (np.sum(found.excess < 0.0) > 1) is not covers
        assert len(set(found.session.tolist())) == 40


def test_one_stop_is_enough_and_none_is_not() -> None:
    columns, runs, ground = drive_log(replace(VEHICLE, stops=1), np.random.default_rng(3))
    assert len(covered(columns, runs, BASE, ground=ground).records) == 1
    with pytest.raises(ParameterError, match="at least 1 usable stop"):
        covered(columns | {"v_cmd": columns["v"]}, runs, BASE, ground=ground)


def test_margins_as_long_as_the_stops_are_no_success() -> None:
    rng = np.random.default_rng(4)
    wild = replace(VEHICLE, stops=14, scatter=0.3, b_b=0.5)
    learned = learn(*_of(wild, rng))
    assert any("times the length" in w or "would not allow" in w for w in learned.objections)
    assert learn(*_of(VEHICLE, rng)).objections == ()


def test_a_dead_time_that_no_brakes_have_is_said() -> None:
    learned = learn(*_of(replace(VEHICLE, dead_time=2.0), np.random.default_rng(5)))
    assert any("dead time of 1.99" in words for words in learned.objections)


def _of(vehicle: PlantVehicle, rng: np.random.Generator) -> tuple:
    columns, runs, _ = drive_log(vehicle, rng)
    return columns, runs, BASE.braking
