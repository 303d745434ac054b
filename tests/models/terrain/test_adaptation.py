"""Changes of terrain, and adaptation of its classes."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from slopewise.models.errors import ParameterError
from slopewise.models.terrain.adaptation import (
    AdaptationSettings,
    AdaptiveClassifier,
    class_of,
    classes_of,
)
from slopewise.models.terrain.change import ChangeDetector, ChangeSettings
from slopewise.models.terrain.classes import TerrainClasses
from slopewise.models.terrain.classifier import NONE, TerrainClassifier
from slopewise.models.terrain.windows import SteadySecond, summarise, usual_spread
from slopewise.services.io.terrain_file import find_terrains, read_terrains
from tests.models.terrain.paper import MEANS, STDS

# ---------------------------------------------------------------------------------- change


STRAIGHT = ("straight", -2)
LEVEL = (-0.9, 0.0, 0.0)  # logarithm of the speed, share of turning, slope


def windows(random, count, shift=0.0, condition=STRAIGHT, rates=1, scale=1.0, driving=LEVEL):
    spread = usual_spread(rates) * scale
    return [
        SteadySecond(condition, shift + spread * random.normal(size=len(spread)), np.array(driving))
        for _ in range(count)
    ]


def first_alarm(detector, given):
    for index, window in enumerate(given):
        if detector.update(window):
            return index
    return None


def test_a_lasting_change_is_found_within_five_seconds():
    random = np.random.default_rng(1)
    late = []
    for _ in range(50):
        detector = ChangeDetector(1)
        assert first_alarm(detector, windows(random, 20)) is None
        late.append(first_alarm(detector, windows(random, 5, shift=1.0)))
    assert None not in late
    assert np.mean(late) < 4.0


def test_no_change_no_alarm():
    # an hour of seconds that are independent: real ones are not, so real alarms are more
    random = np.random.default_rng(2)
    detector = ChangeDetector(3)
    alarms = sum(detector.update(w) is not None for w in windows(random, 3600, rates=3))
    assert alarms <= 6


def test_one_bump_is_no_change():
    random = np.random.default_rng(3)
    detector = ChangeDetector(1)
    given = windows(random, 30) + windows(random, 1, shift=5.0) + windows(random, 30)
    assert first_alarm(detector, given) is None


def test_another_way_of_driving_is_no_change_of_ground():
    random = np.random.default_rng(4)
    detector = ChangeDetector(1)
    given = windows(random, 20) + windows(random, 20, shift=2.0, condition=("turn", -2))
    assert first_alarm(detector, given) is None
    # back on the straight it still knows how straights were
    assert first_alarm(detector, windows(random, 10)) is None
    assert first_alarm(detector, windows(random, 10, shift=1.0)) is not None


def test_after_a_change_the_new_ground_is_the_reference():
    random = np.random.default_rng(5)
    detector = ChangeDetector(1)
    first_alarm(detector, windows(random, 20))
    assert first_alarm(detector, windows(random, 10, shift=1.0)) is not None
    assert first_alarm(detector, windows(random, 30, shift=1.0)) is None
    assert first_alarm(detector, windows(random, 10)) is not None


def test_channels_that_are_missing_are_passed_over():
    random = np.random.default_rng(6)
    detector = ChangeDetector(1)
    given = windows(random, 20) + windows(random, 10, shift=1.0)
    for window in given:
        window.channels[-1] = np.nan
    assert first_alarm(detector, given) is not None


def test_a_higher_threshold_is_slower_to_report():
    random = np.random.default_rng(7)
    strict = ChangeDetector(1, ChangeSettings(threshold=40.0))
    given = windows(random, 20) + windows(random, 10, shift=0.6)
    assert first_alarm(strict, given) is None
    assert first_alarm(ChangeDetector(1), given) is not None


def test_a_steep_slope_excuses_a_difference_and_level_ground_does_not():
    random = np.random.default_rng(8)
    given = windows(random, 20)
    steep = (LEVEL[0], 0.0, 0.3)
    assert first_alarm(ChangeDetector(1), given + windows(random, 10, 0.8, driving=steep)) is None
    assert first_alarm(ChangeDetector(1), given + windows(random, 10, 0.8)) is not None


def test_a_patch_is_reported_once_and_the_return_after_a_while():
    random = np.random.default_rng(9)
    for stay, reported in ((6, False), (40, True)):
        detector = ChangeDetector(1)
        first_alarm(detector, windows(random, 20))
        assert first_alarm(detector, windows(random, 10, shift=1.2)) is not None
        assert first_alarm(detector, windows(random, stay, shift=1.2)) is None
        assert (first_alarm(detector, windows(random, 6)) is not None) is reported


def samples(v_left, v_right, *, count=100, vibration=((10.0, 0.02),), rate=0.0, seed=0, pitch=0.0):
    random = np.random.default_rng(seed)
    t = np.arange(count) / count
    yaw = rate + sum(a * np.sin(2 * np.pi * f * t) for f, a in vibration)
    current = 2.0 + 0.1 * random.normal(size=count)
    columns = (
        np.full(count, v_left),
        np.full(count, v_right),
        current,
        current,
        np.full(count, pitch),
        yaw,
    )
    return np.stack(columns, axis=1)


def test_vibration_appears_in_its_band_and_scales():
    low = summarise(samples(0.4, 0.4, vibration=((4.0, 0.02),)), 0.03, 0.04)
    middle = summarise(samples(0.4, 0.4, vibration=((12.0, 0.02),)), 0.03, 0.04)
    double = summarise(samples(0.4, 0.4, vibration=((12.0, 0.04),)), 0.03, 0.04)
    assert low.channels[3] - low.channels[4] > 1.0
    assert middle.channels[4] - middle.channels[3] > 1.0
    assert double.channels[4] - middle.channels[4] == pytest.approx(np.log(2.0), abs=0.02)
    assert low.condition == ("straight", round(1.5 * np.log2(0.4)))


def test_turning_is_the_inverse_of_the_slip_track():
    window = summarise(samples(-0.3, 0.3, rate=0.5), 0.03, 0.04)
    assert window.condition[0] == "spot"
    assert window.channels[2] == pytest.approx(0.5 / 0.6)
    assert summarise(samples(0.2, 0.5, rate=0.3), 0.03, 0.04).condition[0] == "turn"


def test_driving_is_speed_curvature_and_slope_in_the_direction_of_travel():
    down = summarise(samples(0.4, 0.4, pitch=0.1), 0.03, 0.04)
    np.testing.assert_allclose(down.driving, [np.log(0.4), 0.0, -0.1])
    backwards = summarise(samples(-0.4, -0.4, pitch=0.1), 0.03, 0.04)
    assert backwards.driving[2] == pytest.approx(0.1)
    assert summarise(samples(-0.3, 0.3), 0.03, 0.04).driving[1] == pytest.approx(1.0)


def test_slow_logs_have_fewer_bands():
    window = summarise(samples(0.4, 0.4, count=20), 0.03, 0.04)
    assert np.isfinite(window.channels[:4]).all()
    assert np.isnan(window.channels[4:]).all()


def test_standing_and_speeding_up_say_nothing():
    assert summarise(samples(0.0, 0.0), 0.03, 0.04) is None
    ramp = samples(0.4, 0.4)
    ramp[:, 0] = ramp[:, 1] = np.linspace(0.1, 0.6, 100)
    assert summarise(ramp, 0.03, 0.04) is None
    assert summarise(ramp[:3], 0.03, 0.04) is None


# ------------------------------------------------------------------------------ adaptation


HUSKY = read_terrains(find_terrains("husky")).classes
EXACT = (0.0, 0.0, 0.0)
NAN = float("nan")


def draws(mean, std, count, seed=0):
    rows = np.random.default_rng(seed).normal(mean, std, (count, 3))
    return [tuple(row) for row in rows.tolist()]


def test_unseen_ground_is_none_of_these_and_then_a_class_of_its_own():
    pytest.importorskip("sklearn", reason="the learn extra is not installed")
    memory = AdaptiveClassifier(HUSKY)
    ice = draws((0.02, 0.05, 0.85), (0.005, 0.01, 0.03), 30)
    answers = [memory.observe(row, EXACT).name for row in ice]
    assert "new_1" not in answers[:6]
    assert answers[-20:].count("new_1") >= 19
    memory.rename("new_1", "ice")
    assert memory.observe(ice[0], EXACT).name == "ice"
    learned = {known.name: known for known in memory.classes.terrain}["ice"]
    assert learned.lateral_resistance.mean == pytest.approx(0.05, abs=0.01)
    # the others are as good as before
    for name, mean in MEANS.items():
        rows = draws(mean, STDS[name], 200, seed=1)
        right = np.mean([memory.observe(row, EXACT).name == name for row in rows])
        assert right > 0.9, name


def test_scattered_unknown_signatures_make_no_class():
    pytest.importorskip("sklearn", reason="the learn extra is not installed")
    memory = AdaptiveClassifier(HUSKY)
    random = np.random.default_rng(2)
    for _ in range(8):
        memory.observe(tuple(random.uniform((0.5, 0.5, 2.5), (1.0, 1.0, 8.0)).tolist()), EXACT)
    assert {known.name for known in memory.classes.terrain} == {*MEANS}
    assert memory.aside


def test_a_gross_error_is_answered_but_not_learned():
    memory = AdaptiveClassifier(HUSKY)
    before = memory.classes
    assert memory.observe((0.91, 0.26, 0.90), EXACT).name == "asphalt"
    assert memory.classes is before
    assert memory.aside == [(0.91, 0.26, 0.90)]
    assert memory.observe((0.9, 0.9, 5.0), EXACT).name == NONE


def test_a_season_is_followed():
    # dirt road changes slowly into what is nothing that the old classes know
    memory, fixed = AdaptiveClassifier(HUSKY), TerrainClassifier(HUSKY)
    random = np.random.default_rng(3)
    start, end = np.array(MEANS["dirt_road"]), np.array((0.22, 0.30, 1.05))
    adaptive, static = [], []
    for share in np.linspace(0.0, 1.0, 300):
        row = random.normal(start + share * (end - start), np.array(STDS["dirt_road"]))
        adaptive.append(memory.observe(tuple(row.tolist()), EXACT).name == "dirt_road")
        static.append(fixed.classify(tuple(row.tolist())).name == "dirt_road")
    assert np.mean(adaptive[-50:]) > np.mean(static[-50:]) + 0.3


def test_confident_answers_do_not_narrow_a_class_away():
    memory = AdaptiveClassifier(HUSKY)
    for row in draws(MEANS["asphalt"], np.array(STDS["asphalt"]) * 0.05, 300):
        memory.observe(row, EXACT)
    asphalt = memory.classes.terrain[0]
    assert [f.std for f in asphalt.features] == pytest.approx(
        [0.7 * std for std in STDS["asphalt"]]
    )


def test_labels_train_another_vehicle():
    memory = AdaptiveClassifier(TerrainClasses(name="other"))
    for i, (name, mean) in enumerate(MEANS.items()):
        for row in draws(np.array(mean) * (2.0, 2.5, 0.7), np.array(STDS[name]), 20, seed=i):
            memory.learn(name, row)
    right = [
        memory.observe(row, EXACT).name == name
        for i, (name, mean) in enumerate(MEANS.items())
        for row in draws(np.array(mean) * (2.0, 2.5, 0.7), np.array(STDS[name]), 50, seed=9 + i)
    ]
    assert np.mean(right) > 0.95


def test_running_moments_are_the_moments():
    rows = draws((0.1, 0.2, 1.1), (0.02, 0.02, 0.05), 40)
    memory = AdaptiveClassifier(TerrainClasses(name="x"), AdaptationSettings(memory=1000.0))
    for row in rows:
        memory.learn("dirt", row)
    expected = class_of("dirt", np.array(rows))
    for ours, theirs in zip(memory.classes.terrain[0].features, expected.features, strict=True):
        assert ours.mean == pytest.approx(theirs.mean, rel=1e-9)
        assert ours.std == pytest.approx(theirs.std, rel=1e-9)
        assert ours.samples == 40.0


def test_features_that_were_never_measured_are_left_out():
    rows = np.array([(0.1, NAN, NAN), (0.12, NAN, 1.0), (0.11, 0.2, NAN)])
    learned = classes_of("x", ["a", "a", "a"], rows).terrain[0]
    assert learned.motion_resistance.samples == 3.0
    assert learned.lateral_resistance is None
    assert learned.slip_track is None


def test_without_scikit_learn_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.cluster", None)
    memory = AdaptiveClassifier(TerrainClasses(name="x"))
    *rows, last = draws((0.1, 0.2, 1.1), (0.02, 0.02, 0.05), 6)
    for row in rows:
        memory.observe(row, EXACT)
    with pytest.raises(ParameterError, match=r"pip install '.\[learn\]'"):
        memory.observe(last, EXACT)


def test_renaming_what_is_not_there():
    with pytest.raises(ParameterError, match="asphalt"):
        AdaptiveClassifier(HUSKY).rename("new_7", "ice")
