"""Weak stops: a state of their own, or in the margin; never forgotten."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.calibration.margin_coverage import allowed_distance, check_margins
from benchmarks.calibration.stop_plant import PlantVehicle, conditions, distances, drive_log
from slopewise.models.calibration.brake_states import weaker_members, weaker_state
from slopewise.models.calibration.learn import learn
from slopewise.services.io.model_file import model_from_dict, model_to_dict
from tests.models.models_for_tests import BASE


def shares(count: int, weak: int, ratio: float, scatter: float, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    share = scatter * rng.standard_normal(count)
    share[:weak] = ratio * (1.0 + share[:weak]) - 1.0
    return share


@pytest.mark.parametrize(("weak", "ratio"), [(5, 0.7), (15, 0.7), (30, 0.6)])
def test_stops_that_are_weak_alike_are_found(weak: int, ratio: float) -> None:
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


def test_few_stops_unlike_each_other_make_a_wider_state() -> None:
    noise = np.full(60, 0.005)
    one, unlike = shares(60, 0, 1.0, 0.02, 1), shares(60, 0, 1.0, 0.02, 1)
    one[0], unlike[:2] = -0.3, (-0.2, -0.4)
    first, both = np.zeros(60, bool), np.zeros(60, bool)
    first[0], both[:2] = True, True
    assert weaker_state(one, noise, first, 0.02).ratio == pytest.approx(0.7, abs=1e-9)
    told = weaker_state(unlike, noise, both, 0.02)
    assert told.scatter > weaker_state(one, noise, first, 0.02).scatter
    assert told.ratio_std > 0.0


@pytest.mark.parametrize(("weak", "ratio"), [(0.08, 0.7), (0.25, 0.6)])
def test_the_quantile_holds_for_brakes_with_a_weak_state(weak: float, ratio: float) -> None:
    vehicle = PlantVehicle(
        name="weak", stops=96, scatter=0.03, late=0.02, weak=weak, ratio=ratio, b_b=0.6
    )
    held, learned = check_margins(vehicle, 3)
    assert all(h.beyond <= 1.5 * h.promised for h in held)
    assert set(learned.braking.terrain) == {"weaker"}
    assert learned.braking.states_of("") == ("weaker",)
    assert any("state of its own" in words for words in learned.warnings)
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
    short = allowed_distance(learned.braking, speed, grade, 0.999) < distances(speed, grade, force, late)
    assert np.mean(short) < 0.05
