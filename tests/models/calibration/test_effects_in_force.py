"""Named effects stay in force: what they explain is not learned a second time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.calibration.coverage import covered
from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.calibration.learn import learn
from slopewise.models.calibration.surface_fit import CalibrationSettings
from slopewise.models.discrepancy.workflow import investigate
from slopewise.models.parameters import Effect, Model
from slopewise.models.stop_logs.find_stops import StopSettings
from slopewise.models.stops.simulation import GroundTrack, simulate_stop
from tests.world.plant import World, drive
from tests.world.vehicles import BASE

TRUE = np.array([-0.03, -0.35, 0.015, 0.42])
DEAD = 0.3


def log(
    stops: int, seed: int, **effects: dict[str, float]
) -> tuple[dict[str, np.ndarray], list[slice], np.ndarray]:
    """A log of stops with these effects, by separate code, and the grade of its ground."""
    world = World(
        effects=effects,
        coefficients=tuple(TRUE.tolist()),
        dead_time=DEAD,
        noise=0.02,
        scatter=0.01,
        pitch_noise=0.0,
        grades=(-0.2, 0.2),
        waves=0.0,
        turning=1.0 if "turning_resistance" in effects else 0.0,
    )
    columns, runs = drive(world, stops, seed)
    # Where the vehicle was is in no test here, and would say how its sensor is mounted.
    columns = {name: columns[name] for name in ("run", "t", "v", "v_cmd", "pitch", "yaw_rate")}
    return columns, runs, -columns["pitch"]


def with_effect(name: str, **parameters: float) -> Model:
    return replace(BASE, effect=(Effect(name=name, parameters=parameters),))


@pytest.mark.parametrize(
    ("hidden", "model"),
    [
        pytest.param(
            {"aerodynamic_drag": {"c": 0.08}},
            with_effect("aerodynamic_drag", c=0.08),
            marks=pytest.mark.nightly,
        ),
        ({"brake_lag": {"tau": 0.3}}, with_effect("brake_lag", tau=0.3)),
    ],
)
def test_calibrating_again_changes_nothing(
    hidden: dict[str, dict[str, float]], model: Model
) -> None:
    columns, runs, ground = log(24, 2, **hidden)
    first = learn(columns, runs, model.braking, ground=ground, effects_model=model)
    std = np.sqrt(np.diag(first.surfaces[0].fit.covariance))
    error = (first.surfaces[0].fit.coefficients - TRUE) / std
    assert np.all(np.abs(error) < 4.0)
    assert first.dead_time.value == pytest.approx(DEAD, abs=0.01)
    middle = first.braking.level_force(2.5)
    assert middle == pytest.approx(0.42 + 0.015 * 2.5, rel=0.025)
    model = replace(model, braking=first.braking)
    again = learn(columns, runs, model.braking, ground=ground, effects_model=model)
    moved = (again.surfaces[0].fit.coefficients - first.surfaces[0].fit.coefficients) / std
    assert np.all(np.abs(moved) < 1.0)
    ways = [np.array([r.predicted_distance for r in c.surfaces[0].records]) for c in (first, again)]
    actual = np.array([r.samples.distance for r in first.surfaces[0].records])
    assert np.max(np.abs(ways[1] - ways[0])) < 0.02
    assert abs(np.mean(ways[1] - actual)) < 0.02
    # As the coefficients alone are learned, the effect would be included twice.
    twice = learn(columns, runs, model.braking, ground=ground)
    assert abs(twice.braking.level_force(2.5) / middle - 1.0) > 0.02
    assert covered(columns, runs, replace(model, braking=again.braking), ground=ground).covers()


@pytest.mark.nightly  # by day with the effects given, test_calibrating_again_changes_nothing
@pytest.mark.parametrize("seed", [2, 11])
def test_what_discrepancy_finds_stays_when_it_is_calibrated_again(seed: int) -> None:
    """Calibrate, discrepancy, calibrate, calibrate: a fixed point, also where brakes build up."""
    columns, runs, ground = log(48, seed, brake_lag={"tau": 0.3})
    plain = learn(columns, runs, BASE.braking, ground=ground, effects_model=BASE)
    model = investigate(columns, runs, replace(BASE, braking=plain.braking), ground=ground).model
    assert [e.name for e in model.effect] == ["brake_lag"]
    for level in (1.0, 0.1):
        refit = learn(columns, runs, model.braking, ground=ground, effects_model=model)
        before, after = (
            np.array([getattr(b, n) for n in NAMES]) for b in (model.braking, refit.braking)
        )
        std = np.sqrt(np.diag(refit.surfaces[0].fit.covariance))
        assert np.all(np.abs(after - before) < level * std)
        again = replace(model, braking=refit.braking)
        ways = np.array(
            [
                [ahead(m, r.samples.window.held_speed, r.grade) for m in (model, again)]
                for r in refit.surfaces[0].records
            ]
        )
        assert np.max(np.abs(ways[:, 1] - ways[:, 0])) < 0.02 * level
        model = again
    assert np.all(np.abs(after - TRUE) < 3.0 * std)


def test_stops_in_curves_are_learned_from_where_the_model_knows_what_turning_costs() -> None:
    columns, runs, ground = log(36, 4, turning_resistance={"k": 0.15})
    model = with_effect("turning_resistance", k=0.15)
    straight = learn(columns, runs, BASE.braking, ground=ground, effects_model=BASE)
    refit = learn(columns, runs, model.braking, ground=ground, effects_model=model)
    assert straight.verdicts["turning"] > 12
    assert len(straight.surfaces[0].records) == 36 - straight.verdicts["turning"]
    assert len(refit.surfaces[0].records) == 36
    fit = refit.surfaces[0].fit
    error = (fit.coefficients - TRUE) / np.sqrt(np.diag(fit.covariance))
    assert np.all(np.abs(error) < 4.0)
    assert refit.braking.level_force(2.5) == pytest.approx(0.42 + 0.015 * 2.5, rel=0.025)
    # Taken as straight they would say that the brakes are stronger.
    fooled = learn(
        columns,
        runs,
        BASE.braking,
        ground=ground,
        effects_model=BASE,
        settings=CalibrationSettings(stops=StopSettings(partial=True, turn_rate=np.inf)),
    )
    assert fooled.braking.level_force(2.5) > 1.05 * refit.braking.level_force(2.5)


def ahead(model: Model, speed: float, grade: float) -> float:
    """Distance of a simulated stop on an even slope [m]."""
    station = np.linspace(0.0, 40.0, 5)
    level = np.zeros(5)
    track = GroundTrack(station, level + grade, level, level, level, level, level, None)
    return simulate_stop(model, track, speed).distance


def test_a_friction_that_caps_the_force_says_nothing_of_the_coefficients() -> None:
    columns, runs, ground = log(20, 3, wheel_lockup={"mu": 0.44})
    model = with_effect("wheel_lockup", mu=0.44)
    records = (
        learn(columns, runs, model.braking, ground=ground, effects_model=model).surfaces[0].records
    )
    capped = [r.force_std > 0.5 for r in records]
    assert 0 < sum(capped) < len(capped)


def test_without_effects_nothing_changes() -> None:
    columns, runs, ground = log(12, 4)
    plain = learn(columns, runs, BASE.braking, ground=ground)
    compensated = learn(columns, runs, BASE.braking, ground=ground, effects_model=BASE)
    assert plain.braking == compensated.braking
