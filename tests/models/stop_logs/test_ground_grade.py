from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.stop_logs.ground_grade import (
    Dive,
    StopPitch,
    estimate_dive,
    felt_deceleration,
    shrunk,
)

PER = np.deg2rad(0.3)  # [rad s²/m]


def stops(dive: float, settling: float, seed: int = 0, noise: float = 0.3) -> list[StopPitch]:
    """Bodies that dive on ground that bends; the suspension by small steps, not by the formula."""
    rng = np.random.default_rng(seed)
    stops_list = []
    for _ in range(40):
        held, a = rng.uniform(1.5, 4.0), rng.uniform(2.5, 4.5)
        onset = 0.3
        rest = onset + held / a
        t = np.arange(-1.0, rest + 1.5, 0.01)
        v = np.clip(held - a * (t - onset), 0.0, held)
        s = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * 0.01)))
        q, dive_angle = np.zeros(len(t)), 0.0
        for k, at in enumerate(t):
            now = a if onset < at <= rest else 0.0
            dive_angle += (
                (now - dive_angle) * min(0.01 / settling, 1.0) if settling > 0 else now - dive_angle
            )
            q[k] = dive_angle
        ground = rng.uniform(-0.2, 0.2) + 0.02 * np.sin(s / 2.0 + rng.uniform(0, 6))
        pitch = -ground + dive * q + np.deg2rad(noise) * rng.standard_normal(len(t)) + 0.02
        stops_list.append(StopPitch(t, s, pitch, onset, rest, a))
    return stops_list


@pytest.mark.parametrize("settling", [0.0, 0.1])
@pytest.mark.parametrize("dive", [0.0, PER, -0.5 * PER])
def test_the_dive_is_recovered(dive: float, settling: float) -> None:
    estimate = estimate_dive(stops(dive, settling))
    assert estimate.per_deceleration == pytest.approx(dive, abs=max(3.0 * estimate.std, 0.07 * PER))
    assert estimate.std < 0.1 * PER


def test_felt_deceleration_builds_up_and_fades() -> None:
    t = np.array([-1.0, 0.3, 0.4, 5.0, 5.1, 9.0])
    np.testing.assert_allclose(felt_deceleration(t, 0.3, 5.0, 4.0, 0.0), [0, 0, 4, 4, 0, 0])
    soft = felt_deceleration(t, 0.3, 5.0, 4.0, 0.1)
    np.testing.assert_allclose(soft, [0, 0, 4 * (1 - np.exp(-1)), 4, 4 * np.exp(-1), 0], atol=1e-9)
    assert Dive(PER, 0.0, 0.1).pitch(t, 0.3, 5.0, 4.0)[3] == pytest.approx(4.0 * PER)


def test_nothing_to_see_is_no_dive() -> None:
    assert estimate_dive([]) == Dive()


def test_grades_are_used_as_far_as_they_exceed_their_noise() -> None:
    rng = np.random.default_rng(0)
    slopes = rng.uniform(-0.2, 0.2, 50)
    np.testing.assert_allclose(shrunk(slopes, np.full(50, 0.001)), slopes, atol=1e-4)
    level = 0.01 + 0.002 * rng.standard_normal(50)
    np.testing.assert_allclose(shrunk(level, np.full(50, 0.002)), np.mean(level), atol=5e-4)
    np.testing.assert_allclose(shrunk(level, np.zeros(50)), level, rtol=1e-9)
