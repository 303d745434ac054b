"""Learned ground in the model: always to the slower side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.stops.simulation import GroundTrack, force_ratio, simulate_stop
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.models.terrain.observation import Features
from slopewise.models.terrain.resistances import TerrainEstimate
from slopewise.models.terrain.surfaces import model_on, with_surface
from tests.models.models_for_tests import BASE
from tests.models.terrain.test_monitor import MODEL


def test_unknown_ground_that_rolls_easily_still_weakens_partial_brakes():
    slippery, known = features(0.02, 0.005), with_level(0.5)
    unknown = model_on(known, slippery, valid=False)
    assert unknown.terrain.motion_resistance == known.terrain.motion_resistance
    assert unknown.terrain.rolling_while_braking == pytest.approx(0.02)
    assert stop(unknown) >= stop(model_on(known, slippery)) > stop(known)


def test_the_model_on_the_ground_driven_now_is_rounded_towards_slower():
    known = Features(
        TerrainEstimate(0.2, 0.02), TerrainEstimate(0.25, 0.01), TerrainEstimate(1.3, 0.1)
    )
    terrain = model_on(MODEL, known).terrain
    assert terrain.motion_resistance == pytest.approx(0.22)
    assert terrain.lateral_resistance == pytest.approx(0.26)
    assert terrain.slip_track == pytest.approx(1.4)
    assert model_on(MODEL, Features()).terrain == MODEL.terrain
    narrow = Features(slip_track=TerrainEstimate(0.3, 0.01))
    assert model_on(MODEL, narrow).terrain.slip_track == MODEL.vehicle.track_width


def test_ground_of_no_valid_class_makes_nothing_faster():
    def known(f_r, mu_t, b_s):
        return Features(*(TerrainEstimate(value, 0.01) for value in (f_r, mu_t, b_s)))

    old = MODEL.terrain
    easy = known(0.01, 0.01, MODEL.vehicle.track_width)
    assert model_on(MODEL, easy).terrain.motion_resistance < old.motion_resistance
    assert model_on(MODEL, easy, valid=False).terrain == old
    hard = known(0.4, 0.5, 2.5)
    assert model_on(MODEL, hard, valid=False) == model_on(MODEL, hard)
    mixed = model_on(MODEL, known(0.01, 0.5, 2.5), valid=False).terrain
    assert mixed.motion_resistance == old.motion_resistance
    assert mixed.lateral_resistance == pytest.approx(0.51)


def test_a_surface_brakes_less_where_it_rolls_more_easily_and_never_more():
    easy = with_surface(MODEL, "asphalt", TerrainEstimate(0.03, 0.01), 0.13)
    assert easy.braking.on("asphalt").b_b == pytest.approx(0.25 - (0.13 - 0.02))
    hard = with_surface(easy, "sand", TerrainEstimate(0.40, 0.05), 0.13)
    assert hard.braking.on("sand").b_b == 0.25
    assert {t.class_id for t in hard.braking.terrain.values()} == {1, 2}
    again = with_surface(hard, "asphalt", TerrainEstimate(0.0, 0.0), 0.13)
    assert again is hard  # stops knew better
    with pytest.raises(ParameterError, match=r"f_r is 0\.30 less"):
        with_surface(MODEL, "ice", TerrainEstimate(0.0, 0.0), 0.30)


def with_level(level: float) -> Model:
    terrain = {"ice": SurfaceBraking(b_b=0.3, force_std=0.01), "sand": SurfaceBraking(b_b=0.5)}
    return replace(BASE, braking=replace(BASE.braking, level=level, terrain=terrain))


def features(value: float, std: float) -> Features:
    return Features(motion_resistance=TerrainEstimate(value, std))


def stop(model: Model) -> float:
    zero = np.zeros(1)
    return simulate_stop(model, GroundTrack(zero, zero - 0.1, *[zero] * 5), 3.0).distance


def test_a_vague_resistance_is_no_brake() -> None:
    """At half the brakes 0.13 ± 0.10 counted as 0.23 of rolling, and stopped the vehicle sooner."""
    model = with_level(0.5)
    assert BASE.terrain.motion_resistance == 0.13
    vague = model_on(model, features(0.13, 0.10))
    assert stop(vague) == stop(model)
    assert vague.terrain.motion_resistance == pytest.approx(0.23)
    assert vague.braking.force_std == pytest.approx(0.05)
    assert vague.braking.on("ice").force_std == pytest.approx(np.hypot(0.01, 0.05))
    assert vague.braking.on("sand").force_std == pytest.approx(0.05)


def test_what_is_open_counts_once() -> None:
    once = model_on(with_level(0.5), features(0.10, 0.04))
    assert model_on(once, features(0.10, 0.04)) == once
    more = model_on(once, features(0.10, 0.08))
    assert more.braking.force_std == pytest.approx(0.04)


def test_full_brakes_know_nothing_of_it() -> None:
    assert model_on(BASE, features(0.05, 0.02)).braking == BASE.braking
    assert model_on(BASE, features(0.05, 0.02)).terrain.braking_resistance is None


@given(
    level=st.floats(0.1, 1.0),
    value=st.floats(-0.05, 0.6),
    std=st.floats(0.0, 0.3),
    more=st.floats(0.0, 0.3),
    grade=st.floats(-0.26, 0.26),
    speed=st.floats(0.0, 4.0),
)
def test_less_certainty_never_brakes_better(
    level: float, value: float, std: float, more: float, grade: float, speed: float
) -> None:
    before = with_level(level)
    precise, vague = (model_on(before, features(value, s)) for s in (std, std + more))
    place = {"grade": grade, "roll": 0.0, "x": 0.0, "y": 0.0, "yaw": 0.0}
    for name in ("", "ice", "sand"):
        was, precise_std, vague_std = (
            force_ratio(m, m.braking.on(name), place, speed) for m in (before, precise, vague)
        )
        assert vague_std == precise_std <= was + 1e-12
        precise_force_std, vague_force_std = (
            m.braking.on(name).force_std for m in (precise, vague)
        )
        assert before.braking.on(name).force_std <= precise_force_std <= vague_force_std
    assert vague.terrain.motion_resistance >= precise.terrain.motion_resistance
