"""Signatures: features of seconds, classes and strangeness of runs that took no part, changes."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.errors import InputError, ParameterError
from slopewise.models.terrain.class_change import ClassChange
from slopewise.models.terrain.classifier import NONE
from slopewise.models.terrain.reliability import expected_calibration_error, reliability_curve
from slopewise.models.terrain.resistances import Drivetrain
from slopewise.models.terrain.signature import (
    BANDS,
    DRIVING_FEATURES,
    FEATURE_NAMES,
    SENSORS,
    GroundSecond,
    SecondSettings,
    Signature,
    second_of,
    signature_of,
)
from slopewise.models.terrain.signature_fit import fit, running_mean
from slopewise.models.terrain.signature_memory import SignatureMemory
from slopewise.services.io.signature_file import read_signatures, write_signatures

SETTINGS = SecondSettings(Drivetrain(20.0, 0.5, 700.0), 0.6, 0.03, 0.04)


def samples(left: float, right: float, **values: float) -> np.ndarray:
    """A second at 100 Hz, still except for the given channels."""
    table = np.zeros((100, 11))
    table[:, 0], table[:, 1] = left, right
    table[:, 2:4] = values.get("current", 2.0)
    table[:, 4] = values.get("pitch", 0.0)
    table[:, 5] = values.get("yaw_rate", 0.0)
    table[:, 10] = values.get("shake", 0.0) * np.sin(2 * np.pi * 10.0 * np.arange(100) / 100)
    return table


def value(signature: Signature, name: str) -> float:
    return float(signature.features[FEATURE_NAMES.index(name)])


def test_a_straight_uphill_by_hand() -> None:
    # 2 A a side are 80 N of 700 N; idle 20 N, and 5 % uphill, leave 1/35
    second = second_of(samples(0.5, 0.5, pitch=-0.05), SETTINGS)
    assert second is not None
    assert second.thrust == pytest.approx(80 / 700)
    assert second.rolling == pytest.approx(60 / 700 - 0.05)
    signature = signature_of([second] * 3)
    assert signature is not None
    assert value(signature, "thrust_straight") == pytest.approx(60 / 700 - 0.05)
    assert np.isnan(value(signature, "turning_spot"))
    assert signature_of([second] * 2) is None


def test_on_the_spot_and_where_nothing_is_measured() -> None:
    second = second_of(samples(-0.3, 0.3, yaw_rate=0.7), SETTINGS)
    assert second is not None
    assert second.turned == pytest.approx(0.7)
    signature = signature_of([second] * 3)
    assert signature is not None
    assert value(signature, "turning_spot") == pytest.approx(0.7)
    silent = second_of(samples(0.5, 0.5, current=0.1), SETTINGS)
    assert silent is not None
    assert np.isnan([silent.thrust, silent.ripple, silent.unlike]).all()
    assert second_of(samples(0.0, 0.0), SETTINGS) is None
    lost = samples(0.5, 0.5)
    lost[:, 8:] = np.nan
    half = second_of(lost, SETTINGS)
    assert half is not None
    assert np.isnan(half.shaking.reshape(len(SENSORS), -1)[3:]).all()


def test_vibration_appears_in_its_band_and_sensor() -> None:
    calm, shaken = (second_of(samples(0.5, 0.5, shake=s), SETTINGS) for s in (0.0, 1.0))
    assert calm is not None
    assert shaken is not None
    change = (shaken.shaking - calm.shaking).reshape(len(SENSORS), -1)
    assert np.unravel_index(change.argmax(), change.shape) == (5, 2)  # 10 Hz lies in 8 … 14 Hz
    assert np.abs(change[:5]).max() == pytest.approx(0.0, abs=1e-9)
    slow = second_of(samples(0.5, 0.5)[::5], SETTINGS)  # 20 Hz resolve nothing beyond 10 Hz
    assert slow is not None
    resolved = np.isfinite(slow.shaking.reshape(len(SENSORS), -1)[0])
    assert resolved.tolist() == [2 * high <= 21 for _, high in BANDS]


COUNT, WHERE = len(FEATURE_NAMES), {"a": 0.0, "b": 1.0, "c": -1.0}


def sampled(name: str, run: int, many: int = 10, *, separation: float = 3.0) -> list[Signature]:
    """Signatures of a synthetic run: classes differ in vibration, runs and driving a little."""
    random = np.random.default_rng(1000 * run + ord(name[0]))
    offset = random.normal(0.0, 0.4, COUNT)
    signatures = []
    for _ in range(many):
        speed = random.normal()
        x = offset + random.normal(0.0, 1.0, COUNT) + 0.5 * speed
        x[10:20] += separation * WHERE.get(name, 0.0)
        if name == "stranger":
            x[30:40] += 3.0
        x[: len(DRIVING_FEATURES)][np.array([1, 2, 4, 5, 6, 7])] = np.nan
        signatures.append(Signature(x, np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0])))
    return signatures


def trained(names: str = "abc", runs: int = 8, **kwargs: float):
    pytest.importorskip("sklearn", reason="the learn extra is not installed")
    rows = [(s, n, f"{n}{r}") for n in names for r in range(runs) for s in sampled(n, r, **kwargs)]
    return fit(*zip(*rows, strict=True))


@pytest.fixture(scope="module")
def model():
    return trained()


def answers(model, name: str, run: int):
    memory = SignatureMemory(model)
    return [memory.update(signature) for signature in sampled(name, run, 12)]


def test_held_out_runs_are_classified_and_unknown_ones_are_not(model) -> None:
    known = [(n, a) for n in "abc" for run in range(50, 56) for a in answers(model, n, run)]
    assert np.mean([a.name == n for n, a in known]) > 0.9
    refused = np.mean([a.name == NONE for _, a in known])
    assert refused < 0.12
    assert model.known_refused == pytest.approx(0.05, abs=0.02)
    strange = [a for run in range(50, 56) for a in answers(model, "stranger", run)]
    assert np.mean([a.name == NONE for a in strange]) > 0.9
    assert all(sum(a.probabilities.values()) == pytest.approx(1.0) for a in strange)


def test_probabilities_of_overlapping_classes_mean_what_they_say() -> None:
    near = trained(separation=0.35)
    labels, right = [], []
    for name in "abc":
        for run in range(60, 80):
            for signature in sampled(name, run, 6, separation=0.35):
                share = np.exp(near.look(signature)[0])
                labels.append(share.max())
                right.append(near.classes[int(share.argmax())] == name)
    assert 0.5 < np.mean(right) < 0.97
    assert expected_calibration_error(np.array(labels), np.array(right)) < 0.1


def test_without_some_channels_the_rest_classifies(model) -> None:
    half = [Signature(s.features.copy(), s.driving) for s in sampled("b", 70)]
    for signature in half:
        signature.features[20:] = np.nan
    memory = SignatureMemory(model)
    assert [memory.update(s).name for s in half][-1] == "b"
    nothing = Signature(np.full(COUNT, np.nan), np.zeros(6))
    assert SignatureMemory(model).update(nothing).name == NONE


def test_too_few_runs_and_no_scikit_learn(monkeypatch) -> None:
    import sys

    rows = [(s, n, n) for n in "ab" for s in sampled(n, 0)]
    with pytest.raises(ParameterError, match="a in 1, b in 1"):
        fit(*zip(*rows, strict=True))
    monkeypatch.setitem(sys.modules, "sklearn.discriminant_analysis", None)
    rows = [(s, n, f"{n}{r}") for n in "ab" for r in range(4) for s in sampled(n, r)]
    with pytest.raises(ParameterError, match=r"pip install '.\[learn\]'"):
        fit(*zip(*rows, strict=True))


def test_two_classes_answer_as_three_do() -> None:
    two = trained("ab", runs=4)
    assert answers(two, "a", 50)[-1].name == "a"
    assert answers(two, "b", 50)[-1].name == "b"


def test_a_file_has_the_same_answers_and_bad_ones_are_named(model, tmp_path) -> None:
    path = tmp_path / "mine.signatures.json"
    write_signatures(model, path)
    again = read_signatures(path)
    for signature in sampled("c", 80):
        before, after = model.look(signature), again.look(signature)
        assert after[0] == pytest.approx(before[0])
        assert after[1] == pytest.approx(before[1])
    text = path.read_text()
    for wrong, key in (
        (text.replace('"threshold": ', '"threshold": NaN, "old": '), "threshold"),
        (text.replace('"thrust_straight"', '"thrust"'), "features"),
        (text.replace('"version": 1', '"version": 9'), "version"),
        ("{", "JSON"),
    ):
        path.write_text(wrong)
        with pytest.raises(InputError, match=key):
            read_signatures(path)


def second_like(signature: Signature) -> GroundSecond:
    """A straight second whose signature is (nearly) the given one."""
    f = signature.features
    return GroundSecond(
        0,
        float(np.exp(signature.driving[0])),
        0.0,
        0.1,
        float(f[0]),
        max(float(np.exp(f[3])) - 0.01, 1e-6),
        0.0,
        np.nan,
        f[len(DRIVING_FEATURES) :],
    )


def test_a_change_of_class_is_reported_within_five_seconds_and_no_other(model) -> None:
    late, alarms = [], 0
    for run in range(90, 96):
        watch = ClassChange(model)
        for k, signature in enumerate([*sampled("b", run, 30), *sampled("c", run, 10)]):
            change = watch.update(second_like(signature))
            if change is not None and k < 30:
                alarms += 1
            elif change is not None:
                assert change[:2] == ("b", "c")
                late.append(k - 29)
    assert alarms == 0
    assert len(late) == 6
    assert max(late) <= 5


def test_running_means_keep_to_their_run() -> None:
    signatures = running_mean(np.array([1.0, 10.0, 3.0, 5.0, 20.0]), np.array([0, 1, 0, 0, 1]), 2)
    assert signatures == pytest.approx([1.0, 10.0, 2.0, 4.0, 15.0])


def test_reliability_by_hand() -> None:
    labels, right = np.array([0.95, 0.95, 0.55, 1.0]), np.array([True, False, True, True])
    curve = reliability_curve(labels, right)
    assert [(point.count, point.right) for point in curve] == [(1, 1.0), (3, pytest.approx(2 / 3))]
    expected = 0.25 * 0.45 + 0.75 * abs(2.9 / 3 - 2 / 3)
    assert expected_calibration_error(labels, right) == pytest.approx(expected)
    assert np.isnan(expected_calibration_error(np.array([]), np.array([], bool)))
