from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.terrain.change import ChangeDetector, ChangeSettings
from slopewise.models.terrain.windows import SteadySecond, summarise, usual_spread

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
