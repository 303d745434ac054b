"""The promise of a session: its posterior, how fast it follows stops, what it never does."""

from __future__ import annotations

import dataclasses
import math
from statistics import NormalDist

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from slopewise.models.calibration.learned_force import LearnedForce, braking_in_use
from slopewise.models.calibration.online import OnlineBraking
from slopewise.models.calibration.session_offset import SessionOffset, SessionStop
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from slopewise.models.stop_distance import StopDistance
from slopewise.models.stop_logs.stop_stream import StreamedStop

G, FORCE, DELAY = 9.80665, 0.45, 0.3
LAW = np.array([0.0, 0.0, 0.0, FORCE])
SESSION, WITHIN, MEDIAN = 0.10, 0.04, 1.02
QUANTILES = (0.5, 0.9, 0.99, 0.999)
Z = np.array([NormalDist().inv_cdf(q) for q in QUANTILES])
AT_ONCE = 10.0


def table(session_std: float = SESSION) -> StopDistance:
    factors = MEDIAN * np.exp(Z * math.hypot(SESSION, WITHIN))
    return StopDistance(
        quantiles=QUANTILES,
        speeds=(1.0, 5.0),
        grades=(0.0,),
        levels=(1.0,),
        stop_factor=tuple((f, f) for f in factors.tolist()),
        session_std=session_std,
    )


def stop(offset: float, speed: float = 3.0) -> SessionStop:
    """One that is longer than the median by a factor e^offset."""
    predicted = speed * DELAY + speed**2 / (2.0 * G * FORCE)
    return SessionStop(speed, 0.0, predicted * MEDIAN * math.exp(offset))


def session_of(offsets: list[float], max_fall: float = AT_ONCE) -> SessionOffset:
    session = SessionOffset(table(), LAW)
    for offset in offsets:
        session.take(stop(offset), LAW, DELAY, max_fall)
    return session


def factors(session: SessionOffset) -> np.ndarray:
    return np.array([row[0] for row in session.table.stop_factor])


def test_quantiles_are_those_of_the_posterior() -> None:
    """Compared with a grid over δ, summed numerically."""
    offsets = [0.11, 0.07]
    delta = np.linspace(-1.0, 1.0, 20_001)
    density = stats.norm.pdf(delta, 0.0, SESSION)
    for offset in offsets:
        density = density * stats.norm.pdf(offset - delta, 0.0, WITHIN)
    density /= density.sum()
    quantiles = np.log(factors(session_of(offsets)) / MEDIAN)
    for q, offset in zip(QUANTILES, quantiles, strict=True):
        assert float(density @ stats.norm.cdf(offset - delta, 0.0, WITHIN)) == pytest.approx(
            q, abs=2e-4
        )


def test_a_session_that_stops_longer_is_allowed_more_at_once() -> None:
    session = session_of([0.0] * 30)
    before = factors(session)
    for offset in (0.25, 0.25):
        session.take(stop(offset), LAW, DELAY, 0.001)
    assert np.all(np.log(factors(session) / before) > 0.15)


def test_a_session_that_confirms_is_allowed_less_by_a_rate() -> None:
    rate, last = 0.02, factors(SessionOffset(table(), LAW))
    session = SessionOffset(table(), LAW)
    for _ in range(30):
        session.take(stop(0.0), LAW, DELAY, rate)
        now = factors(session)
        assert np.all(np.log(now / last) >= -rate - 1e-12)
        last = now
    assert last[2] < 0.9 * factors(SessionOffset(table(), LAW))[2]


def test_no_reported_distance_removes_the_scatter_of_a_session() -> None:
    shortest = MEDIAN * np.exp(Z * WITHIN - SESSION)
    assert np.all(factors(session_of([-2.0] * 50)) >= shortest * (1.0 - 1e-9))
    zero = SessionOffset(table(), LAW)
    zero.take(SessionStop(3.0, 0.0, 0.0), LAW, DELAY, AT_ONCE)
    assert np.all(factors(zero) >= shortest * (1.0 - 1e-9))


def test_another_session_has_the_table_of_the_file() -> None:
    session = session_of([0.0] * 40)
    tight = factors(session)
    session.restart()
    session.take(stop(0.0), LAW, DELAY, 0.0)
    assert np.all(factors(session)[1:] > tight[1:])
    session.restart()
    session.age(1.0)
    np.testing.assert_allclose(factors(session), factors(SessionOffset(table(), LAW)))


@settings(max_examples=60, deadline=None)
@given(
    offsets=st.lists(st.floats(-0.8, 1.5), min_size=1, max_size=60),
    speeds=st.lists(st.floats(0.3, 8.0), min_size=60, max_size=60),
    share=st.floats(0.0, 1.0),
)
def test_any_stops_leave_a_valid_table(
    offsets: list[float], speeds: list[float], share: float
) -> None:
    session = SessionOffset(table(), LAW)
    for offset, speed in zip(offsets, speeds, strict=False):
        session.take(stop(offset, speed), LAW, DELAY, 0.02)
        assert np.all(np.diff(factors(session)) >= 0.0)
    aged = factors(session)
    session.age(share)
    assert np.all(factors(session) >= aged)


def known(distance: StopDistance | None) -> Braking:
    return Braking(
        m_m=0.0,
        b_m=0.0,
        m_b=0.0,
        b_b=FORCE,
        dead_time=DELAY,
        speed_range=(1.0, 5.0),
        grade_range=(-0.15, 0.15),
        covariance=tuple(tuple(row) for row in np.diag([1e-6, 1e-4, 1e-6, 1e-4]).tolist()),
        distance=distance,
    )


def drive(online: OnlineBraking, forces: list[float], surface: str = "") -> None:
    for k, force in enumerate(forces):
        speed = 2.0 + (k % 3)
        measured = StreamedStop(float(k), speed, 0.0, force, 0.003, DELAY)
        distance = MEDIAN * (speed * DELAY + speed**2 / (2.0 * G * force))
        online.take(measured, surface, distance=distance)


def test_brakes_that_lose_a_fifth_are_planned_with_from_the_third_stop_on() -> None:
    online = OnlineBraking(known(table()))
    drive(online, [FORCE] * 40)
    drive(online, [0.8 * FORCE] * 2)
    used = braking_in_use(known(table()), online.learned())
    assert used.distance is not None
    speed = 4.0
    predicted = speed * DELAY + speed**2 / (2.0 * G * used.b_b)
    actual = MEDIAN * (speed * DELAY + speed**2 / (2.0 * G * 0.8 * FORCE))
    assert predicted * used.distance.worst(0.99) > actual


def test_a_session_outlives_the_process() -> None:
    first = OnlineBraking(known(table()))
    drive(first, [0.97 * FORCE] * 12, "clay")
    stored = msgspec.json.encode(first.learned()["clay"])
    second = OnlineBraking(known(table()))
    second.restore(msgspec.json.decode(stored, type=LearnedForce), "clay")
    for online in (first, second):
        drive(online, [0.97 * FORCE] * 3, "clay")
    assert first.learned()["clay"].session == second.learned()["clay"].session
    assert first.learned()["clay"].distance == second.learned()["clay"].distance


def test_a_table_of_another_shape_is_refused() -> None:
    narrower = dataclasses.replace(table(), quantiles=QUANTILES[:2], stop_factor=((1.0, 1.0),) * 2)
    with pytest.raises(ParameterError, match="distance"):
        SessionOffset(table(), LAW, narrower)


@pytest.mark.parametrize("distance", [None, table(0.0)])
def test_without_variances_of_sessions_the_file_holds(distance: StopDistance | None) -> None:
    online = OnlineBraking(known(distance))
    drive(online, [FORCE] * 12)
    assert braking_in_use(known(distance), online.learned()).distance == distance


def test_a_change_of_ground_ends_the_session() -> None:
    online = OnlineBraking(known(table()))
    drive(online, [FORCE] * 40)
    tight = online.learned()[""].distance
    online.inflate()
    assert tight.worst(0.99) < table().worst(0.99)
    assert online.learned()[""].distance == table()
    assert online.learned()[""].session == ()


@pytest.mark.parametrize(
    "session", [((math.nan, 0.0, 1.0),), ((0.0, 0.0, 1.0),), ((1.0, 0.0, -1.0),)]
)
def test_stored_stops_that_are_no_stops_are_refused(
    session: tuple[tuple[float, float, float], ...],
) -> None:
    law = tuple(LAW.tolist())
    matrix = tuple((0.0,) * 4 for _ in range(4))
    with pytest.raises(ParameterError, match="session"):
        LearnedForce(law, matrix, law, True, 9, 0, session=session)


def test_a_quantile_above_the_table_is_promised_more_than_its_last() -> None:
    spread = math.hypot(SESSION, WITHIN)
    expected = MEDIAN * math.exp(NormalDist().inv_cdf(0.99999) * spread)
    assert table().worst(0.99999) == pytest.approx(expected, rel=1e-9)


def test_an_invalid_estimate_has_the_promise_of_the_file() -> None:
    online = OnlineBraking(known(table()))
    drive(online, [FORCE] * 40)
    assert online.learned()[""].valid
    assert online.learned()[""].distance != table()
    drive(online, [0.6 * FORCE, 1.5 * FORCE] * 3)
    assert not online.learned()[""].valid
    distance = online.learned()[""].distance
    assert distance.worst(0.99) >= table().worst(0.99)
