"""Classes, rules and agreement; and what is measured of the ground in the braking model."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.stops.simulation import GroundTrack, force_law, simulate_stop
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.models.terrain.agreement import agreement, name_of
from slopewise.models.terrain.classes import FeatureOfClass, TerrainClass, TerrainClasses, by_rules
from slopewise.models.terrain.description import ThresholdSettings
from slopewise.models.terrain.evidence import EvidenceWindow
from slopewise.models.terrain.learn import LabelledRun, classes_of, thresholds_of
from slopewise.models.terrain.observation import Features, TerrainEstimate
from slopewise.models.terrain.surfaces import model_on, with_surface
from slopewise.services.io.terrain_file import find_terrains, read_terrains
from tests.models.terrain.paper import MEANS, OBSERVATIONS, STDS
from tests.models.terrain.vehicles import MODEL, observation_of
from tests.world.vehicles import BASE

NAN = math.nan
HUSKY = read_terrains(find_terrains("husky")).classes


def test_the_shipped_classes_are_those_of_table_2():
    for known in HUSKY.terrain:
        assert tuple(f.mean for f in known.features) == MEANS[known.name]
        assert tuple(f.std for f in known.features) == STDS[known.name]
        assert known.days == 1.0


@pytest.mark.parametrize(("values", "name"), OBSERVATIONS)
def test_table_5_by_rules(values, name):
    assert by_rules(HUSKY, values) == name


def test_rules_by_hand():
    # (0.21, 0.22, 1.29): plowed meets f_r (low, 1) and B_s (medium, 2) of 1 + 2 + 2; dirt road
    # meets μ_t (high, 3) of 3 + 3 + 1; sand f_r (medium, 2) of 2 + 3; asphalt nothing
    met = {known.name: known.share_met((0.21, 0.22, 1.29)) for known in HUSKY.terrain}
    assert met == {
        "asphalt": 0.0,
        "dirt_road": pytest.approx(3 / 7),
        "plowed_terrain": pytest.approx(3 / 5),
        "beach_sand": pytest.approx(2 / 5),
    }
    assert by_rules(HUSKY, (NAN, NAN, NAN)) == ""
    assert by_rules(HUSKY, (0.195, 0.23, 1.0)) == "dirt_road"
    assert by_rules(HUSKY, (0.195, 0.1, 0.9)) == ""


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: FeatureOfClass(mean=1, std=0, samples=6), "std: expected a finite number > 0"),
        (lambda: FeatureOfClass(mean=1, std=1, samples=1), "samples: expected"),
        (lambda: FeatureOfClass(mean=1, std=1, samples=6, rule=(2.0, 1.0)), "rule: expected"),
        (lambda: TerrainClass(name=" "), "name: expected"),
        (lambda: TerrainClass(name="a", days=0), "days: expected"),
        (lambda: TerrainClasses(name="x", terrain=HUSKY.terrain[:1] * 2), "asphalt twice"),
    ],
)
def test_classes_that_make_no_sense(make, message):
    with pytest.raises(ParameterError, match=message):
        make()


def window_of(*features):
    """Window of stretches (f_r, μ_t, B_s), NaN where not measured, at 0.3 m/s and 0.5 % error."""
    window = EvidenceWindow(12.0)
    for i, values in enumerate(features):
        window.add(observation_of(*values, end=float(i)))
    return window


def test_agreement_of_one_feature_is_students_t():
    # one class of six runs, ln std 0.1: t = 0.3/(0.1 √(1 + 1/6) ⊕ 0.005), two-sided, 5 degrees
    feature = FeatureOfClass(mean=0.2, std=0.02, samples=6)
    only = TerrainClasses(name="x", terrain=(TerrainClass(name="a", motion_resistance=feature),))
    p_value = agreement(only, window_of((0.2 * math.exp(0.3), NAN, NAN)))["a"]
    from scipy import stats

    t = 0.3 / math.sqrt(0.01 * 7 / 6 + 0.005**2)
    assert p_value == pytest.approx(2.0 * stats.t.sf(t, 5), rel=1e-6)


def test_a_class_rejects_its_share_of_its_own_runs():
    # runs and class from one distribution: 5 % are rejected, for each kind of motion
    random = np.random.default_rng(3)
    rejected = []
    for i in range(400):
        logs = np.log((0.2, 0.3, 1.1)) + random.normal(0, (0.15, 0.1, 0.05), (7, 3))
        runs = [
            LabelledRun("a", "", (observation_of(f, NAN, NAN), observation_of(NAN, m, b)))
            for f, m, b in np.exp(logs[:6])
        ]
        f, m, b = np.exp(logs[6])
        asked = [(f, NAN, NAN), (NAN, m, b), (f, m, b)][i % 3]
        rejected.append(agreement(classes_of("x", runs), window_of(asked))["a"] < 0.05)
    assert np.mean(rejected) == pytest.approx(0.05, abs=0.035)


def test_a_single_name_needs_three_days_and_both_kinds_of_motion():
    asphalt = (0.03, 0.26, 1.0)
    many = tuple(replace(t, days=3.0) for t in HUSKY.terrain)
    for terrain, values, name in (
        (HUSKY.terrain, asphalt, ""),
        (many, asphalt, "asphalt"),
        (many, (0.03, NAN, NAN), ""),
        (many, (2.0, 2.0, 0.1), ""),
    ):
        classes, window = TerrainClasses(name="x", terrain=terrain), window_of(values)
        assert name_of(classes, window, agreement(classes, window)) == name
    assert agreement(HUSKY, window_of()) == dict.fromkeys(MEANS, 1.0)


def test_with_three_days_the_spread_is_that_of_days():
    def run(f_r, site):
        return LabelledRun("a", site, (observation_of(f_r, NAN, NAN),))

    same = [run(0.1 * math.exp(x), "") for x in (-0.1, 0.0, 0.1)]
    three = [run(0.1 * math.exp(x), site) for x, site in ((-0.4, "1"), (0.0, "2"), (0.4, "3"))]
    (one_day,), (days,) = classes_of("x", same).terrain, classes_of("x", same + three).terrain
    assert (one_day.days, one_day.motion_resistance.samples) == (1.0, 3.0)
    assert one_day.motion_resistance.std / 0.1 == pytest.approx(0.1)
    assert (days.days, days.motion_resistance.samples) == (4.0, 4.0)  # no site is a fourth
    assert days.motion_resistance.std / 0.1 == pytest.approx(np.std([0, -0.4, 0, 0.4], ddof=1))
    (single,) = classes_of("x", same[:1]).terrain
    assert single.motion_resistance.samples == 2.0
    assert single.motion_resistance.std == pytest.approx(0.17 * single.motion_resistance.mean)


def test_thresholds_lie_midway_in_the_widest_gap():
    runs = [
        LabelledRun(name, "", (observation_of(f_r, mu_t, NAN),))
        for name, f_r, mu_t in (("a", 0.1, 0.1), ("b", 0.12, 0.5), ("c", 0.24, 0.55))
    ]
    settings = thresholds_of(classes_of("x", runs), 1.0, ThresholdSettings())
    assert settings.soft_above == pytest.approx(math.sqrt(0.12 * 0.24))
    assert settings.slippery_below == pytest.approx(math.sqrt(0.2 * 0.62))
    close = thresholds_of(classes_of("x", runs[:2]), 1.0, ThresholdSettings())
    assert close.soft_above is None


def test_unknown_ground_that_rolls_easily_still_weakens_partial_brakes():
    slippery, known = features(0.02, 0.005), with_level(0.5)
    unknown = model_on(known, slippery, valid=False)
    assert unknown.terrain.motion_resistance == known.terrain.motion_resistance
    assert unknown.terrain.rolling_while_braking == pytest.approx(0.02)
    assert stop(unknown) >= stop(model_on(known, slippery)) > stop(known)


def test_the_model_on_the_ground_driven_now_has_the_upper_ends_of_the_intervals():
    known = Features(
        TerrainEstimate(0.2, 0.02), TerrainEstimate(0.25, 0.01), TerrainEstimate(1.3, 0.1)
    )
    terrain = model_on(MODEL, known).terrain
    assert terrain.motion_resistance == pytest.approx(0.2 + 1.645 * 0.02)
    assert terrain.lateral_resistance == pytest.approx(0.25 + 1.645 * 0.01)
    assert terrain.slip_track == pytest.approx(1.3 + 1.645 * 0.1)
    assert model_on(MODEL, Features()).terrain == MODEL.terrain
    narrow = Features(slip_track=TerrainEstimate(0.3, 0.01))
    assert model_on(MODEL, narrow).terrain.slip_track == MODEL.vehicle.track_width


def test_ground_that_is_undecided_makes_nothing_faster():
    def known(f_r, mu_t, b_s):
        return Features(*(TerrainEstimate(value, 0.01) for value in (f_r, mu_t, b_s)))

    old = MODEL.terrain
    easy = known(0.01, 0.01, MODEL.vehicle.track_width)
    assert model_on(MODEL, easy).terrain.motion_resistance < old.motion_resistance
    undecided = model_on(MODEL, easy, valid=False).terrain
    assert undecided.rolling_while_braking < 0.01  # slower, where the drive is cut downhill
    assert replace(undecided, braking_resistance=None) == old
    hard = known(0.4, 0.5, 2.5)
    assert model_on(MODEL, hard, valid=False) == model_on(MODEL, hard)
    mixed = model_on(MODEL, known(0.01, 0.5, 2.5), valid=False).terrain
    assert mixed.motion_resistance == old.motion_resistance
    assert mixed.lateral_resistance == pytest.approx(0.51645)


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
    """At half the brakes 0.13 ± 0.10 counted as rolling, and stopped the vehicle sooner."""
    model = with_level(0.5)
    assert BASE.terrain.motion_resistance == 0.13
    vague = model_on(model, features(0.13, 0.10))
    assert stop(vague) == stop(model)
    assert vague.terrain.motion_resistance == pytest.approx(0.13 + 0.1645)
    assert vague.braking.force_std == pytest.approx(0.08225)
    assert vague.braking.on("ice").force_std == pytest.approx(np.hypot(0.01, 0.08225))
    assert vague.braking.on("sand").force_std == pytest.approx(0.08225)


def test_what_is_open_counts_once() -> None:
    once = model_on(with_level(0.5), features(0.10, 0.04))
    assert model_on(once, features(0.10, 0.04)) == once
    more = model_on(once, features(0.10, 0.08))
    assert more.braking.force_std == pytest.approx(0.0658)


def test_full_brakes_count_on_it_for_rolling_alone() -> None:
    known = model_on(BASE, features(0.05, 0.02))
    assert known.braking == BASE.braking
    assert known.terrain.braking_resistance == pytest.approx(0.05 - 0.0329)
    assert model_on(known, features(0.05, 0.02)) == known


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
            force_law(m, m.braking.on(name), speed)(place) for m in (before, precise, vague)
        )
        assert vague_std == precise_std <= was + 1e-12
        precise_force_std, vague_force_std = (
            m.braking.on(name).force_std for m in (precise, vague)
        )
        assert before.braking.on(name).force_std <= precise_force_std <= vague_force_std
    assert vague.terrain.motion_resistance >= precise.terrain.motion_resistance
