from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from slopewise.models.calibration.fleet import (
    FleetCalibration,
    VehicleStops,
    learn_fleet,
    vehicle_stops,
)
from slopewise.models.calibration.force_fit import fit_force
from slopewise.models.calibration.learn import measure_log
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from tests.models.calibration.plant import Plant, Truth, allowed, drive, predicted

KNOWN = Braking(
    m_m=0.0,
    b_m=0.0,
    m_b=0.0,
    b_b=0.3,
    dead_time=0.2,
    speed_range=(1.0, 4.0),
    grade_range=(-0.26, 0.26),
)
VEHICLES, THIN = 8, (1, 4, 6)
ONE_STOP = Truth(np.array([3.0]), np.zeros(1), np.zeros(1), np.zeros(1), np.zeros((1000, 1)))


def plant(seed: int) -> Plant:
    rng = np.random.default_rng(1000 + seed)
    return Plant(
        b_m=-0.35 + 0.06 * rng.standard_normal(),
        b_b=0.40 + 0.03 * rng.standard_normal(),
        dead_time=0.3 + 0.02 * rng.standard_normal(),
    )


@pytest.fixture(scope="module")
def vehicles() -> list[VehicleStops]:
    share = []
    for i in range(VEHICLES):
        columns, runs, _ = drive(plant(i), 6 if i in THIN else 60, i)
        # The pitch of the plant is the ground's: mounted straight, without dive.
        log = measure_log(columns, runs, KNOWN, ground=-columns["pitch"], fewest=2)
        share.append(vehicle_stops(f"v{i}", log, mapped=True))
    return [*share, VehicleStops("new", note="no stops")]


@pytest.fixture(scope="module")
def learned(vehicles: list[VehicleStops]) -> FleetCalibration:
    return learn_fleet(vehicles, KNOWN)


def test_no_unseen_stop_of_any_vehicle_is_longer_than_predicted(learned: FleetCalibration) -> None:
    for i in range(VEHICLES):
        _, _, truth = drive(plant(i), 60, 500 + i)
        braking = learned.braking[f"v{i}"]
        way = allowed(braking, truth)
        assert np.all(truth.distance <= way)
        assert np.median(way - truth.distance) < 0.45
        assert braking.dead_time == pytest.approx(plant(i).dead_time, abs=0.015)


def test_each_vehicle_has_its_coefficients(learned: FleetCalibration) -> None:
    true = np.array([plant(i).b_b + 2.5 * plant(i).m_b for i in range(VEHICLES)])
    share = np.array(
        [b.b_b + 2.5 * b.m_b for b in (learned.braking[f"v{i}"] for i in range(VEHICLES))]
    )
    assert np.sqrt(np.mean((share - true) ** 2)) < 0.25 * np.std(true)


def test_few_stops_make_a_longer_margin_and_none_the_longest(learned: FleetCalibration) -> None:
    def margin(braking: Braking) -> float:
        """How much longer than by its mean a stop from 3 m/s on level ground may be [m]."""
        coefficients = np.array([braking.m_m, braking.b_m, braking.m_b, braking.b_b])
        return float(
            allowed(braking, ONE_STOP)[0] - predicted(coefficients, braking.dead_time, ONE_STOP)[0]
        )

    margins = {name: margin(braking) for name, braking in learned.braking.items()}
    thin = [margins[f"v{i}"] for i in THIN]
    rest = [margins[f"v{i}"] for i in range(VEHICLES) if i not in THIN]
    assert min(thin) > np.median(rest)
    assert margins["new"] > max(thin)
    assert learned.braking["new"].dead_time > learned.dead_time.value


def test_surfaces_are_distinguished(vehicles: list[VehicleStops]) -> None:
    named = []
    for vehicle in vehicles:
        stops = tuple(
            dataclasses.replace(
                stop,
                surface="gravel" if j % 2 else "",
                force_ratio=stop.force_ratio - (0.1 if j % 2 else 0.0),
            )
            for j, stop in enumerate(vehicle.stops)
        )
        named.append(dataclasses.replace(vehicle, stops=stops))
    learned = learn_fleet(named, KNOWN)
    assert set(learned.surfaces) == {"", "gravel"}
    for i in range(VEHICLES):
        coefficients = learned.braking[f"v{i}"]
        assert coefficients.level_force(2.5) - coefficients.on("gravel").level_force(
            2.5
        ) == pytest.approx(0.1, abs=0.03)


def test_a_fleet_of_one_is_refused(vehicles: list[VehicleStops]) -> None:
    with pytest.raises(ParameterError, match="2 vehicles"):
        learn_fleet([vehicles[0], vehicles[-1]], KNOWN)
    with pytest.raises(ParameterError, match="got none"):
        learn_fleet([vehicles[-1]], KNOWN)


@pytest.mark.nightly
def test_fifty_vehicles_with_two_hundred_stops() -> None:
    count = np.where(np.arange(50) % 4 == 0, 5 + np.arange(50) % 13, 200)
    plants = [plant(i) for i in range(50)]
    vehicles = []
    for i, (true, stops) in enumerate(zip(plants, count.tolist(), strict=True)):
        columns, runs, _ = drive(dataclasses.replace(true, scatter=0.012), stops, i)
        log = measure_log(columns, runs, KNOWN, ground=-columns["pitch"], fewest=2)
        vehicles.append(vehicle_stops(f"v{i}", log, mapped=True))
    learned = learn_fleet(vehicles, KNOWN)
    spread = np.sqrt(np.diag(learned.surfaces[""].spread))
    sample_std = np.std([p.coefficients for p in plants], axis=0, ddof=1)
    np.testing.assert_allclose(spread[[1, 3]], sample_std[[1, 3]], rtol=0.25)
    drawn_time = np.std([p.dead_time for p in plants], ddof=1)
    assert learned.dead_time.between_stops == pytest.approx(drawn_time, rel=0.25)
    v, theta = (g.ravel() for g in np.meshgrid(np.linspace(1, 4, 7), np.linspace(-0.2, 0.2, 7)))
    pooled, alone = [], []
    for i in np.flatnonzero(count < 20).tolist():
        stops = vehicles[i].stops
        coefficients = fit_force(
            *(np.array([getattr(s, n) for s in stops]) for n in ("onset_speed", "grade")),
            *(np.array([getattr(s, n) for s in stops]) for n in ("force_ratio", "force_std")),
            np.array([KNOWN.m_m, KNOWN.b_m, KNOWN.m_b, KNOWN.b_b]),
        )
        b = learned.braking[f"v{i}"]
        true = plants[i].force(theta, v)
        pooled += ((b.m_m * v + b.b_m) * theta + b.m_b * v + b.b_b - true).tolist()
        alone += (coefficients.force_ratio(v, theta) - true).tolist()
    assert np.std(pooled) < 0.7 * np.std(alone)
    assert np.sqrt(np.mean(np.square(pooled))) < 0.7 * np.sqrt(np.mean(np.square(alone)))
