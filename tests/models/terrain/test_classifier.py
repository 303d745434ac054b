"""Classifier of terrain, and its results in the braking model."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.stops.simulation import GroundTrack, force_ratio, simulate_stop
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.models.terrain.classes import FeatureOfClass, TerrainClass, TerrainClasses, by_rules
from slopewise.models.terrain.classifier import NONE, ClassifierSettings, TerrainClassifier
from slopewise.models.terrain.observation import Features
from slopewise.models.terrain.resistances import TerrainEstimate
from slopewise.models.terrain.surfaces import model_on, with_surface
from slopewise.services.io.terrain_file import find_terrains, read_terrains
from tests.models.models_for_tests import BASE
from tests.models.terrain.paper import MEANS, OBSERVATIONS, STDS
from tests.models.terrain.test_monitor import MODEL

# ------------------------------------------------------------------------------ classifier


NAN = math.nan
HUSKY = read_terrains(find_terrains("husky")).classes
CLASSIFIER = TerrainClassifier(HUSKY)


def test_the_shipped_classes_are_those_of_table_2():
    for known in HUSKY.terrain:
        assert tuple(f.mean for f in known.features) == MEANS[known.name]
        assert tuple(f.std for f in known.features) == STDS[known.name]


@pytest.mark.parametrize(("values", "name"), OBSERVATIONS)
def test_table_5_by_rules_and_by_probability(values, name):
    assert by_rules(HUSKY, values).name == name
    assert CLASSIFIER.classify(values).name == name


def test_rules_by_hand():
    # (0.21, 0.22, 1.29): plowed meets f_r (low, 1) and B_s (medium, 2) of 1 + 2 + 2; dirt road
    # meets μ_t (high, 3) of 3 + 3 + 1; sand f_r (medium, 2) of 2 + 3; asphalt nothing
    met = by_rules(HUSKY, (0.21, 0.22, 1.29)).met
    assert met == {
        "asphalt": 0.0,
        "dirt_road": pytest.approx(3 / 7),
        "plowed_terrain": pytest.approx(3 / 5),
        "beach_sand": pytest.approx(2 / 5),
    }
    assert by_rules(HUSKY, (NAN, NAN, NAN)).name == ""
    assert by_rules(HUSKY, (0.195, 0.23, 1.0)).name == "dirt_road"
    assert by_rules(HUSKY, (0.195, 0.1, 0.9)).name == ""


def draws(count):
    random = np.random.default_rng(5)
    for name, mean in MEANS.items():
        yield name, random.normal(mean, STDS[name], (count, 3))


def test_draws_from_table_2():
    right = by_rule = 0.0
    names = [*MEANS, NONE]
    for name, rows in draws(4000):
        answers = CLASSIFIER.probabilities(rows, np.zeros_like(rows)).argmax(axis=1)
        right += np.mean(answers == names.index(name)) / 4
        by_rule += np.mean([by_rules(HUSKY, tuple(row)).name == name for row in rows[:1000]]) / 4
    assert right >= 0.97
    assert right == pytest.approx(0.986, abs=0.005)
    assert by_rule == pytest.approx(0.82, abs=0.02)  # the rules' own figure


def test_probabilities_mean_what_they_say():
    # of answers given with probability p, about p are right
    answers, right = [], []
    names = [*MEANS, NONE]
    for name, rows in draws(4000):
        table = CLASSIFIER.probabilities(rows, np.zeros_like(rows))
        answers.append(table.max(axis=1))
        right.append(table.argmax(axis=1) == names.index(name))
    answers, right = np.concatenate(answers), np.concatenate(right)
    middle = (answers > 0.5) & (answers < 0.9)
    assert np.mean(right[middle]) > np.mean(answers[middle]) - 0.1
    assert np.mean(right[answers > 0.95]) > 0.95


def test_ground_of_no_known_class():
    for values in ((0.6, 0.6, 0.7), (0.02, 0.02, 3.0), (0.5, 0.4, 4.0)):
        answer = CLASSIFIER.classify(values)
        assert answer.name == NONE, (values, answer)
        assert sum(answer.probabilities.values()) == pytest.approx(1.0)
    assert TerrainClassifier(TerrainClasses(name="empty")).classify((0.1, 0.1, 1.0)).name == NONE


def test_what_is_not_known_says_nothing():
    assert CLASSIFIER.classify((0.03, NAN, NAN)).name == "asphalt"
    assert CLASSIFIER.classify((NAN, 0.11, NAN)).name == "beach_sand"
    nothing = CLASSIFIER.classify((NAN, NAN, NAN))
    assert nothing.name == ""
    assert [*nothing.probabilities.values()] == pytest.approx([0.245] * 4 + [0.02])


def test_a_poor_measurement_is_less_confident():
    sharp = CLASSIFIER.classify((0.03, 0.26, 1.0), (0.001, 0.001, 0.001))
    poor = CLASSIFIER.classify((0.03, 0.26, 1.0), (0.3, 0.3, 1.0))
    assert sharp.probability > 0.99
    assert poor.probability < 0.6


def test_one_feature_against_quadrature():
    # the posterior predictive of a normal with unknown mean and variance, integrated by scipy
    mean, std, n, x = 0.2, 0.05, 6, 0.31

    def joint(log_s, m, value=None):
        s = math.exp(log_s)
        log = -(n - 1) * log_s - 0.5 * ((n - 1) * std**2 + n * (m - mean) ** 2) / s**2 - log_s
        if value is not None:
            log += -0.5 * ((value - m) / s) ** 2 - log_s - 0.5 * math.log(2 * math.pi)
        return math.exp(log)

    box = (mean - 0.4, mean + 0.4, math.log(0.01), math.log(0.6))
    below = integrate.dblquad(joint, *box)[0]
    above = integrate.dblquad(lambda a, m: joint(a, m, x), *box)[0]
    feature = FeatureOfClass(mean=mean, std=std, samples=n)
    classes = TerrainClasses(
        name="one", terrain=(TerrainClass(name="only", motion_resistance=feature),)
    )
    settings = ClassifierSettings(gross_error=1e-12, unknown_ground=0.5)
    answer = TerrainClassifier(classes, settings).classify((x, NAN, NAN)).probabilities
    width = 3.0 * std * math.sqrt(7 / 6)  # of the Cauchy background of a single class
    anywhere = 1.0 / (math.pi * width * (1.0 + ((x - mean) / width) ** 2))
    assert answer["only"] / answer[NONE] == pytest.approx(above / below / anywhere, rel=1e-3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: FeatureOfClass(mean=1, std=0, samples=6), "std: expected a finite number > 0"),
        (lambda: FeatureOfClass(mean=1, std=1, samples=1), "samples: expected"),
        (lambda: FeatureOfClass(mean=1, std=1, samples=6, rule=(2.0, 1.0)), "rule: expected"),
        (lambda: TerrainClass(name=" "), "name: expected"),
        (lambda: TerrainClasses(name="x", terrain=HUSKY.terrain[:1] * 2), "asphalt twice"),
    ],
)
def test_classes_that_make_no_sense(make, message):
    with pytest.raises(ParameterError, match=message):
        make()


# -------------------------------------------------------------------------------- surfaces


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
