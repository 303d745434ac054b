"""Calibration of a fleet: vehicles, surfaces, and the hierarchical fit."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from slopewise.models.calibration import hierarchy
from slopewise.models.calibration.coverage import allowed_distance
from slopewise.models.calibration.fleet import (
    FleetCalibration,
    VehicleStops,
    learn_fleet,
    vehicle_stops,
)
from slopewise.models.calibration.force_fit import fit_force
from slopewise.models.calibration.learn import measure_log
from slopewise.models.errors import ParameterError
from slopewise.models.force_design import design
from slopewise.models.parameters import Braking
from slopewise.models.stop_logs.stop_record import StopRecord
from tests.models.calibration.plant import Plant, Truth, allowed, drive, predicted
from tests.world.shared import once

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


def stops_of(name: str, true: Plant, count: int, seed: int) -> VehicleStops:
    columns, runs, _ = drive(true, count, seed)
    # The pitch of the plant is the ground's: mounted straight, without dive.
    log = measure_log(columns, runs, KNOWN, ground=-columns["pitch"], min_stops=2)
    return vehicle_stops(name, log, mapped=True)


@pytest.fixture(scope="module")
def vehicles() -> list[VehicleStops]:
    def measured() -> list[VehicleStops]:
        return [stops_of(f"v{i}", plant(i), 6 if i in THIN else 60, i) for i in range(VEHICLES)]

    return [*once("fleet-stops", measured), VehicleStops("new", note="no stops")]


@pytest.fixture(scope="module")
def learned(vehicles: list[VehicleStops]) -> FleetCalibration:
    return once("fleet-learned", lambda: learn_fleet(vehicles, KNOWN))


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


def test_a_vehicle_that_contradicts_the_others_is_named_and_never_planned_faster() -> None:
    plants = {f"v{i}": Plant() for i in range(5)}
    plants |= {"weak": Plant(b_b=0.25), "late": Plant(dead_time=0.6), "strong": Plant(b_b=0.65)}
    counts = {"weak": 3, "late": 3}
    fleet = [
        stops_of(name, true, counts.get(name, 20), 40 + i)
        for i, (name, true) in enumerate(plants.items())
    ]
    learned = learn_fleet(fleet, KNOWN)
    for i, (name, true) in enumerate(plants.items()):
        _, _, truth = drive(true, 60, 700 + i, grades=(-0.15, 0.2))
        way = allowed(learned.braking[name], truth)
        assert np.all(truth.distance <= way), name
        if name != "strong":
            assert np.median(way / truth.distance) < 1.35, name
    assert set(learned.notes) == {"weak", "strong"}
    assert "less braking force" in learned.notes["weak"][0]
    assert "more braking force" in learned.notes["strong"][0]
    strong, ordinary = learned.braking["strong"], learned.braking["v0"]
    assert strong.level_force(2.5) < ordinary.level_force(2.5) + 0.01
    assert allowed(strong, ONE_STOP)[0] > allowed(ordinary, ONE_STOP)[0]


def test_a_promise_holds_for_rejected_stops_too(vehicles: list[VehicleStops]) -> None:
    def wet(stop: StopRecord) -> StopRecord:
        longer = dataclasses.replace(stop.samples, distance=1.7 * stop.samples.distance)
        return dataclasses.replace(stop, samples=longer, force_ratio=0.5 * stop.force_ratio)

    first, *rest = vehicles
    stops = (*map(wet, first.stops[:2]), *first.stops[2:])
    learned = learn_fleet([dataclasses.replace(first, stops=stops), *rest], KNOWN)
    assert not learned.surfaces[""].inliers[:2].any()
    for stop in stops:
        assert stop.samples.distance <= allowed_distance(learned.braking["v0"], stop, 0.999)
    assert f"2 of its {len(stops)} stops fit no other" in learned.notes["v0"]


def test_surfaces_are_distinguished(vehicles: list[VehicleStops]) -> None:
    named = []
    for vehicle in vehicles:
        stops = tuple(
            dataclasses.replace(
                stop,
                samples=dataclasses.replace(stop.samples, terrain="gravel" if j % 2 else ""),
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


def test_logs_that_no_vehicle_drives_are_rejected(learned: FleetCalibration) -> None:
    assert learned.objections == {}  # of sound logs
    sound, mirrored = [], []
    for i in range(4):
        columns, runs, _ = drive(plant(i), 40, i)
        late = {**columns, "v_cmd": np.roll(columns["v_cmd"], -130)} if i == 1 else columns
        for vehicles, sign in ((sound, -1.0), (mirrored, 1.0)):
            log = measure_log(late, runs, KNOWN, ground=sign * columns["pitch"], min_stops=2)
            vehicles.append(vehicle_stops(f"v{i}", log, mapped=True))
    assert set(learn_fleet(sound, KNOWN).objections) == {"v1"}
    rejected = learn_fleet(mirrored, KNOWN).objections
    assert set(rejected) == {"v0", "v1", "v2", "v3"}
    assert all("the grade of the log has the wrong sign" in v[-1] for v in rejected.values())
    assert "a dead time of 1." in rejected["v1"][0]


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
        log = measure_log(columns, runs, KNOWN, ground=-columns["pitch"], min_stops=2)
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


MEAN = np.array([-0.03, -0.35, 0.015, 0.40])
SPREAD = np.array([0.015, 0.10, 0.008, 0.035])
SCATTER = 0.012


class Fleet:
    """Vehicles drawn around a mean; every third one has few stops."""

    def __init__(self, seed: int, vehicles: int = 50, stops: int = 200, wild: float = 0.0) -> None:
        rng = np.random.default_rng(seed)
        self.true = MEAN + SPREAD * rng.standard_normal((vehicles, 4))
        count = np.where(np.arange(vehicles) % 3 == 0, rng.integers(5, 20, vehicles), stops)
        self.vehicle = np.repeat(np.arange(vehicles), count)
        self.thin = np.flatnonzero(count < 20)
        n = len(self.vehicle)
        self.speed, self.grade = rng.uniform(1.0, 4.0, n), rng.uniform(-0.25, 0.25, n)
        self.noise = rng.uniform(0.004, 0.012, n)
        x = np.column_stack((self.speed * self.grade, self.grade, self.speed, np.ones(n)))
        error = np.hypot(self.noise, SCATTER) * rng.standard_normal(n)
        self.wild = rng.random(n) < wild
        error[self.wild] += rng.choice([-0.25, 0.25], int(self.wild.sum()))
        self.force = np.einsum("np,np->n", x, self.true[self.vehicle]) + error

    def fit(self) -> hierarchy.Hierarchy:
        x = design(self.speed, self.grade)
        return hierarchy.fit(x, self.force, self.noise, self.vehicle, len(self.true))

    def alone(self, i: int) -> np.ndarray:
        mine = self.vehicle == i
        columns = (c[mine] for c in (self.speed, self.grade, self.force, self.noise))
        return fit_force(*columns, MEAN).coefficients


def force_error(coefficients: np.ndarray, true: np.ndarray) -> float:
    """Root mean square error of F_b/W over trained speeds and grades."""
    v, theta = (g.ravel() for g in np.meshgrid(np.linspace(1, 4, 9), np.linspace(-0.25, 0.25, 9)))
    shift = np.column_stack((v * theta, theta, v, np.ones_like(v))) @ (coefficients - true)
    return float(np.sqrt(np.mean(shift**2)))


@pytest.fixture(scope="module")
def fitted() -> list[tuple[Fleet, hierarchy.Hierarchy]]:
    return [(fleet, fleet.fit()) for fleet in map(Fleet, range(4))]


def test_spread_and_scatter_are_recovered(fitted: list[tuple[Fleet, hierarchy.Hierarchy]]) -> None:
    for fleet, estimate in fitted:
        # Against what was drawn: fifty draws alone differ from their law by a tenth.
        sample_std = np.std(fleet.true, axis=0, ddof=1)
        np.testing.assert_allclose(np.sqrt(np.diag(estimate.spread)), sample_std, rtol=0.2)
        shift = (estimate.mean - MEAN) / np.sqrt(np.diag(estimate.mean_covariance))
        assert np.all(np.abs(shift) < 4.0)
        assert estimate.scatter == pytest.approx(SCATTER, rel=0.05)
    mean = np.mean([np.sqrt(np.diag(estimate.spread)) for _, estimate in fitted], axis=0)
    np.testing.assert_allclose(mean, SPREAD, rtol=0.15)


def test_thin_vehicles_err_a_third_less_than_by_separate_fits(
    fitted: list[tuple[Fleet, hierarchy.Hierarchy]],
) -> None:
    # The separate fits even know the fleet's true mean, as a weak prior. How much pooling helps
    # depends on how alike the vehicles are and which were drawn: all fleets are taken together.
    pooled, alone = [], []
    for fleet, estimate in fitted:
        pooled += [force_error(estimate.coefficients[i], fleet.true[i]) for i in fleet.thin]
        alone += [force_error(fleet.alone(i), fleet.true[i]) for i in fleet.thin]
    assert np.sqrt(np.mean(np.square(pooled))) < 0.7 * np.sqrt(np.mean(np.square(alone)))


def test_covariances_are_honest(fitted: list[tuple[Fleet, hierarchy.Hierarchy]]) -> None:
    squares = [
        (b - t) @ np.linalg.solve(c, b - t)
        for fleet, estimate in fitted
        for b, c, t in zip(estimate.coefficients, estimate.covariance, fleet.true, strict=True)
    ]
    assert np.mean(squares) == pytest.approx(4.0, rel=0.15)
    assert np.mean(np.array(squares) > 13.28) < 0.03  # chi-squared, 4 degrees, 1 %


def test_one_way_layout_is_that_of_the_analysis_of_variance() -> None:
    rng = np.random.default_rng(5)
    vehicles, each = 12, 9
    level = 0.3 * rng.standard_normal(vehicles)
    y = level[:, None] + 0.1 * rng.standard_normal((vehicles, each)) + 2.0
    between = each * np.var(y.mean(axis=1), ddof=1)
    within = float(np.mean(np.var(y, axis=1, ddof=1)))
    estimate = hierarchy.fit(
        np.ones((y.size, 1)),
        y.ravel(),
        np.full(y.size, 1e-6),
        np.repeat(np.arange(vehicles), each),
        vehicles,
        typical_spread=(1.0,),
        imagined=0.0,
    )
    assert estimate.inliers.all()
    assert estimate.scatter**2 == pytest.approx(within, rel=5e-3)
    assert estimate.spread[0, 0] == pytest.approx((between - within) / each, rel=5e-3)
    assert estimate.mean[0] == pytest.approx(y.mean(), abs=1e-9)
    share = (between - within) / between
    shrunk = y.mean() + share * (y.mean(axis=1) - y.mean())
    np.testing.assert_allclose(estimate.coefficients[:, 0], shrunk, atol=1e-3)


def test_a_vehicle_without_stops_is_the_mean_with_the_whole_spread() -> None:
    fleet = Fleet(7, vehicles=12, stops=40)
    x = design(fleet.speed, fleet.grade)
    estimate = hierarchy.fit(x, fleet.force, fleet.noise, fleet.vehicle, 13)
    np.testing.assert_allclose(estimate.coefficients[12], estimate.mean, atol=1e-12)
    np.testing.assert_allclose(
        estimate.covariance[12], estimate.spread + estimate.mean_covariance, rtol=1e-9, atol=1e-15
    )


def test_gross_errors_are_left_out() -> None:
    clean, dirty = Fleet(9, vehicles=20, stops=60), Fleet(9, vehicles=20, stops=60, wild=0.03)
    estimate = dirty.fit()
    assert not estimate.inliers[dirty.wild].any()
    assert np.mean(estimate.inliers[~dirty.wild]) > 0.995
    assert estimate.scatter == pytest.approx(clean.fit().scatter, rel=0.2)


def test_too_little_is_refused() -> None:
    fleet = Fleet(1, vehicles=3, stops=10)
    x = design(fleet.speed, fleet.grade)
    first = fleet.vehicle == 0
    with pytest.raises(ParameterError, match="2 vehicles, got 1"):
        hierarchy.fit(x[first], fleet.force[first], fleet.noise[first], fleet.vehicle[first], 3)
    with pytest.raises(ParameterError, match="more than 4"):
        hierarchy.fit(x[:4], fleet.force[:4], fleet.noise[:4], fleet.vehicle[:4], 3)
    with pytest.raises(ParameterError, match="finite"):
        hierarchy.fit(np.nan * x, fleet.force, fleet.noise, fleet.vehicle, 3)
