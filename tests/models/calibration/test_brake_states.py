"""Weak stops and brake levels: separate states, dead band, slope and saturation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.calibration.margin_coverage import allowed_distance, check_margins
from benchmarks.calibration.stop_plant import PlantVehicle, conditions, distances, drive_log
from slopewise.models.calibration.brake_states import weaker_members, weaker_state
from slopewise.models.calibration.learn import Calibration, learn, with_learned
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from slopewise.models.stop_logs.find_stops import StopSettings, find_stops
from slopewise.services.io.model_file import model_from_dict, model_to_dict
from tests.world.vehicles import BASE

# ---------------------------------------------------------------------------- brake states


def shares(count: int, weak: int, ratio: float, scatter: float, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    share = scatter * rng.standard_normal(count)
    share[:weak] = ratio * (1.0 + share[:weak]) - 1.0
    return share


@pytest.mark.parametrize(("weak", "ratio"), [(5, 0.7), (15, 0.7), (30, 0.6)])
def test_stops_of_one_weaker_state_are_found(weak: int, ratio: float) -> None:
    share = shares(100, weak, ratio, 0.03, weak)
    noise = np.full(100, 0.005)
    members = weaker_members(share, noise)
    assert members.tolist() == [True] * weak + [False] * (100 - weak)
    state = weaker_state(share, noise, members, 0.03)
    assert state.ratio == pytest.approx(ratio, abs=0.04)
    assert abs(state.ratio - ratio) < 3.0 * state.ratio_std


@pytest.mark.parametrize("freedom", [0, 3, 5])
def test_no_state_is_seen_where_there_is_none(freedom: int) -> None:
    rng = np.random.default_rng(freedom)
    seen = 0
    for _ in range(30):
        draw = rng.standard_t(freedom, 100) if freedom else rng.standard_normal(100)
        seen += bool(weaker_members(0.03 * draw, np.full(100, 0.005)).any())
    assert seen <= 1


def test_few_dissimilar_stops_make_a_wider_state() -> None:
    noise = np.full(60, 0.005)
    alone, dissimilar = shares(60, 0, 1.0, 0.02, 1), shares(60, 0, 1.0, 0.02, 1)
    alone[0], dissimilar[:2] = -0.3, (-0.2, -0.4)
    first, weak = np.zeros(60, bool), np.zeros(60, bool)
    first[0], weak[:2] = True, True
    assert weaker_state(alone, noise, first, 0.02).ratio == pytest.approx(0.7, abs=1e-9)
    state = weaker_state(dissimilar, noise, weak, 0.02)
    assert state.scatter > weaker_state(alone, noise, first, 0.02).scatter
    assert state.ratio_std > 0.0


@pytest.mark.parametrize(("weak", "ratio"), [(0.08, 0.7), (0.25, 0.6)])
def test_the_quantile_holds_for_brakes_with_a_weak_state(weak: float, ratio: float) -> None:
    vehicle = PlantVehicle(
        name="weak", stops=96, scatter=0.03, late=0.02, weak=weak, ratio=ratio, b_b=0.6
    )
    held, learned = check_margins(vehicle, 3)
    assert all(h.beyond <= 1.5 * h.promised for h in held)
    assert set(learned.braking.terrain) == {"weaker"}
    assert learned.braking.states_of("") == ("weaker",)
    assert any("state of its own" in text for text in learned.warnings)  # words: ok
    # Reading back what was written keeps the state one.
    model = replace(BASE, braking=learned.braking)
    again = model_from_dict(model_to_dict(model), "M.toml")
    assert again.braking.states_of("") == ("weaker",)
    assert again == model


def test_a_single_weak_stop_is_allowed_for() -> None:
    vehicle = PlantVehicle(name="one", stops=50, scatter=0.01, weak=1e-9)
    rng = np.random.default_rng(5)
    columns, runs, ground = drive_log(vehicle, rng)
    weak, _, weak_ground = drive_log(replace(vehicle, stops=1, weak=1.0, ratio=0.75), rng)
    weak["t"] = weak["t"] + columns["t"][-1] + 10.0
    weak["run"] = np.full(len(weak["t"]), "weak")
    joined = {name: np.concatenate((columns[name], weak[name])) for name in columns}
    runs = [*runs, slice(len(columns["t"]), len(joined["t"]))]
    learned = learn(joined, runs, BASE.braking, ground=np.concatenate((ground, weak_ground)))
    assert all(r.bound_distance >= r.samples.distance for r in learned.surfaces[0].records)
    speed, grade = conditions(2000, rng)
    force = 0.75 * vehicle.forces(speed, grade, rng)
    late = vehicle.delays(2000, rng)
    short = allowed_distance(learned.braking, speed, grade, 0.999) < distances(
        speed, grade, force, late
    )
    assert np.mean(short) < 0.05


# ---------------------------------------------------------------------------- brake levels


BAND, FULL, ROLLING = 0.08, 0.7, 0.05
MODEL = replace(
    BASE, terrain=replace(BASE.terrain, motion_resistance=0.08, braking_resistance=0.06)
)


def log(stops: int, seed: int, levels: tuple[float, float] = (0.1, 1.0)) -> tuple[Any, ...]:
    """A log of stops, each at a different application."""
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


def test_the_force_is_recovered_at_every_level(learned: Calibration) -> None:
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
    refit = learn(columns, runs, MODEL.braking, ground=ground, beside=MODEL)
    assert refit.levels is None
    assert (refit.braking.dead_band, refit.braking.saturation) == (0.0, 1.0)


def test_an_application_that_is_not_held_is_left_out() -> None:
    columns, runs, _, _ = log(2, 3, levels=(0.5, 0.6))
    brake = columns["brake"].copy()
    n = runs[0].stop
    brake[:n] *= np.linspace(0.6, 1.4, n)
    usable = np.ones(len(brake), np.bool_)
    settings = StopSettings(partial=True)
    refit = [find_stops(columns | {"brake": brake}, run, usable, settings)[0] for run in runs]
    assert refit[0].verdict.name == "PARTIAL"
    assert "not held" in refit[0].reason
    assert refit[1].usable
    assert not find_stops(columns, runs[1], usable)[0].usable


def test_a_line_without_width_is_refused() -> None:
    assert replace(BASE.braking, dead_band=0.1, saturation=0.6).share_at(0.35) == pytest.approx(0.5)
    with pytest.raises(ParameterError, match="saturation"):
        replace(BASE.braking, dead_band=0.5, saturation=0.4)
    assert Braking.share_at(BASE.braking, 1.0) == 1.0
