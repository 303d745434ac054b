"""Fits of the force and of tracking errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from slopewise.models.calibration.force_fit import by_mount, fit_force, fit_two_stages
from slopewise.models.calibration.margins import normal_bound, offset_for
from slopewise.models.calibration.tracking_fit import TrackingFit, fit_tracking
from slopewise.models.calibration.tracking_samples import TrackingSamples, tracking_samples
from slopewise.models.calibration.uphill import Asymmetry, asymmetry
from slopewise.models.input_errors import Tracking, input_errors

TRUTH = np.array([-0.03, -0.35, 0.015, 0.40])


def observations(
    n: int, seed: int, noise: float = 0.004, level: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    v = rng.uniform(1.0, 4.0, n)
    theta = np.zeros(n) if level else rng.uniform(-0.25, 0.25, n)
    m_m, b_m, m_b, b_b = TRUTH
    force = (m_m * v + b_m) * theta + m_b * v + b_b
    return v, theta, force + noise * rng.standard_normal(n)


def test_without_noise_it_is_exact() -> None:
    v, theta, force = observations(30, 0, noise=0.0)
    fit = fit_force(v, theta, force, np.full(30, 1e-4), np.zeros(4))
    np.testing.assert_allclose(fit.coefficients, TRUTH, atol=1e-4)
    np.testing.assert_allclose(fit.force_ratio(v, theta), force, atol=1e-5)
    two = fit_two_stages(v, theta, force)
    np.testing.assert_allclose(two[1], TRUTH[1], atol=0.1)


def test_one_stage_is_closer_than_the_papers_two() -> None:
    joint, staged = [], []
    for seed in range(60):
        v, theta, force = observations(40, seed)
        fit = fit_force(v, theta, force, np.full(40, 0.004), np.zeros(4))
        two = fit_two_stages(v, theta, force)
        assert two is not None
        joint.append(fit.coefficients - TRUTH)
        staged.append(two - TRUTH)
    assert np.all(np.std(joint, axis=0) < np.std(staged, axis=0))


def test_level_ground_says_nothing_about_slopes() -> None:
    v, theta, force = observations(50, 1, level=True)
    known = np.array([0.01, -0.2, 0.0, 0.5])
    fit = fit_force(v, theta, force, np.full(50, 0.004), known)
    np.testing.assert_allclose(fit.coefficients[:2], known[:2], atol=1e-9)
    np.testing.assert_allclose(fit.coefficients[2:], TRUTH[2:], atol=0.01)
    assert np.all(fit.learned[:2] < 0.01)
    assert np.all(fit.learned[2:] > 0.9)
    assert fit.force_std(2.0, 0.2)[0] > 10 * fit.force_std(2.0, 0.0)[0]


def test_an_error_that_all_stops_share_widens_the_covariance() -> None:
    v, theta, force = observations(60, 2)
    alone = fit_force(v, theta, force, np.full(60, 0.004), np.zeros(4))
    shared = fit_force(
        v, theta, force, np.full(60, 0.004), np.zeros(4), common=(np.full(60, 1.0), 0.01)
    )
    grown = np.diag(shared.covariance - alone.covariance)
    assert grown[3] == pytest.approx(0.01**2, rel=0.05)
    assert np.all(np.abs(grown[:3]) < 1e-6)
    # Refitting on grades that are all off by 0.01 shows what the covariance claims.
    shifted = fit_force(
        v, theta + 0.01, force - 0.01 * np.cos(theta), np.full(60, 0.004), np.zeros(4)
    )
    claimed = np.sqrt(np.diag(by_mount(alone.coefficients, 0.01)))
    np.testing.assert_allclose(
        np.abs(shifted.coefficients - alone.coefficients)[2:], claimed[2:], rtol=0.1, atol=2e-5
    )


def test_two_stages_need_two_grades_and_speeds() -> None:
    v, theta, force = observations(20, 3, level=True)
    assert fit_two_stages(v, theta, force) is None
    v, theta, force = observations(20, 3)
    assert fit_two_stages(np.full(20, 2.0), theta, force) is None
    assert fit_two_stages(v[:6], theta[:6], force[:6]) is None


def stops(k: float, n: int = 80, seed: int = 0, low: float = -0.25) -> Asymmetry | None:
    rng = np.random.default_rng(seed)
    v, theta = rng.uniform(1.0, 4.0, n), rng.uniform(low, 0.25, n)
    force = (-0.03 * v - 0.35) * theta + 0.015 * v + 0.4 + k * np.maximum(theta, 0.0)
    force += 0.005 * rng.standard_normal(n)
    return asymmetry(v, theta, force, np.full(n, 0.003))


@pytest.mark.parametrize("k", [-0.3, 0.2])
def test_it_is_found_with_its_size(k: float) -> None:
    logged = stops(k)
    assert logged.clear
    assert logged.value == pytest.approx(k, abs=4.0 * logged.std)
    assert logged.std < 0.03


def test_symmetric_brakes_are_not_suspected() -> None:
    logged = [stops(0.0, seed=seed) for seed in range(100)]
    scaled = np.array([f.value / f.std for f in logged if f is not None])
    assert len(scaled) == 100
    assert np.std(scaled) == pytest.approx(1.0, abs=0.25)
    assert sum(f.clear for f in logged if f is not None) <= 1


def test_one_side_says_nothing() -> None:
    assert stops(0.3, low=0.0) is None
    assert stops(0.3, n=12) is None


@pytest.mark.parametrize("n", [12, 40, 150])
@pytest.mark.parametrize("kind", ["normal", "heavy"])
def test_the_requested_share_of_future_stops_is_covered(n: int, kind: str) -> None:
    rng = np.random.default_rng(n)
    covered = []
    for _ in range(200):
        draw = rng.standard_normal(n) if kind == "normal" else rng.standard_t(5, n)
        bound = offset_for(0.995, 0.1 * draw) / 0.1
        covered.append(stats.norm.cdf(bound) if kind == "normal" else stats.t.cdf(bound, 5))
    assert np.mean(covered) > (0.995 if kind == "normal" else 0.99)
    if kind == "normal":
        assert np.mean(np.array(covered) >= 0.995) > 0.93


def test_the_tolerance_factor_is_the_tabulated_one() -> None:
    # k for n = 10, 95 % confidence, 95 % of the population, one-sided: 2.911 (NIST handbook).
    data = np.array([-1.0, 1.0] * 5)
    assert normal_bound(0.95, data) / np.std(data, ddof=1) == pytest.approx(2.911, abs=2e-3)


def test_large_logs_pass_smoothly_into_the_approximation() -> None:
    rng = np.random.default_rng(0)
    data = rng.standard_normal(101)
    unit = (data - data.mean()) / data.std(ddof=1)
    exact = unit[:100] - unit[:100].mean()
    exact /= exact.std(ddof=1)
    assert normal_bound(0.995, unit) == pytest.approx(normal_bound(0.995, exact), rel=0.01)
    assert np.isfinite(normal_bound(0.995, rng.standard_normal(5000)))


def test_the_longest_shortfall_counts_and_offsets_are_not_negative() -> None:
    shortfall = np.concatenate((np.full(30, -0.5), [0.8]))
    assert offset_for(0.995, shortfall) >= 0.8
    assert offset_for(0.995, np.linspace(-1.0, -0.9, 50)) == 0.0


def test_a_few_stops_are_not_enough() -> None:
    with pytest.raises(ValueError, match="at least 5 stops"):
        offset_for(0.9, np.zeros(4))


Columns = dict[str, NDArray[np.generic]]
PERIOD, MEMORY = 0.1, 1.5
"""Of the samples [s]; of the errors [m]."""


def course(length: float, turn: float) -> NDArray[np.float64]:
    """x, y, heading, curvature of bends that swell and fade, each 0.02 m (n, 4)."""
    s = np.arange(0.0, length, 0.02)
    curvature = turn * np.sin(2.0 * np.pi * s / 30.0)
    heading = np.cumsum(curvature) * 0.02
    return np.column_stack(
        [np.cumsum(np.cos(heading)) * 0.02, np.cumsum(np.sin(heading)) * 0.02, heading, curvature]
    )


def drift(rng: np.random.Generator, way: NDArray[np.float64], heavy: bool) -> NDArray[np.float64]:
    """Errors of unit spread that are forgotten over MEMORY; heavy: t law with 4 degrees."""
    stay = np.exp(-np.diff(way, prepend=way[0]) / MEMORY)
    error, new = np.empty(len(way)), rng.standard_normal(len(way))
    error[0] = new[0]
    for n in range(1, len(way)):
        error[n] = stay[n] * error[n - 1] + np.sqrt(1.0 - stay[n] ** 2) * new[n]
    if heavy:
        blocks = (way // 10.0).astype(int)
        error /= np.sqrt(rng.chisquare(4.0, blocks.max() + 1) / 2.0)[blocks]
    return error


def drives(
    rng: np.random.Generator,
    sessions: int,
    *,
    level: float = 0.06,
    per_curvature: float = 0.3,
    between: float = 0.03,
    heading: float = 0.03,
    length: float = 250.0,
    heavy: bool = False,
) -> tuple[Columns, list[slice]]:
    """A log of sessions with one run each."""
    parts, runs, begin = [], [], 0
    for session in range(sessions):
        line = course(length, rng.uniform(0.05, 0.25))
        speed = rng.uniform(0.5, 2.5)
        k = np.arange(0, len(line) - 100, max(int(speed * PERIOD / 0.02), 1))
        x, y, ahead, curvature = line[k].T
        way = 0.02 * k
        std = level + per_curvature * np.abs(curvature)
        across = between * rng.standard_normal() + std * drift(rng, way, heavy)
        turned = heading * drift(rng, way, heavy)
        parts.append(
            {
                "x": x - across * np.sin(ahead),
                "y": y + across * np.cos(ahead),
                "yaw": np.remainder(ahead + turned + np.pi, 2.0 * np.pi) - np.pi,
                "path_x": x,
                "path_y": y,
                "v": np.full(len(k), speed),
                "run": np.full(len(k), f"r{session}"),
                "session": np.full(len(k), f"s{session}"),
            }
        )
        runs.append(slice(begin, begin + len(k)))
        begin += len(k)
    return {name: np.concatenate([p[name] for p in parts]) for name in parts[0]}, runs


def samples_of(log: tuple[Columns, list[slice]]) -> TrackingSamples:
    samples = tracking_samples(*log)
    assert samples is not None
    return samples


def fitted(log: tuple[Columns, list[slice]], quantile: float = 0.99) -> TrackingFit:
    return fit_tracking(samples_of(log), None, 2.5, quantile)


def test_errors_are_measured_on_curves_as_they_were_generated() -> None:
    rng = np.random.default_rng(1)
    columns, runs = drives(rng, 1, level=0.1, per_curvature=0.0, between=0.2)
    samples = samples_of((columns, runs))
    assert len(samples.cross_track) > 0.9 * len(columns["x"])
    away = np.hypot(columns["x"] - columns["path_x"], columns["y"] - columns["path_y"])
    assert np.abs(samples.cross_track).max() == pytest.approx(away.max(), abs=0.01)
    assert np.std(samples.heading) == pytest.approx(0.03, rel=0.25)
    assert np.abs(samples.curvature).max() == pytest.approx(0.2, abs=0.06)


@pytest.mark.parametrize("vehicles", [3, pytest.param(12, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("heavy", [False, True])
def test_the_band_covers_sessions_that_were_not_learned_from(heavy: bool, vehicles: int) -> None:
    """Over vehicles of 8 sessions: shares beyond the quantile in 8 new ones of each."""
    quantile, beyond, widths = 0.99, [], []
    for seed in range(vehicles):
        rng = np.random.default_rng(seed)
        fit = fitted(drives(rng, 8, heavy=heavy), quantile)
        assert fit.tracking is not None
        new = samples_of(drives(rng, 8, heavy=heavy))
        errors = input_errors(fit.tracking, quantile)
        band = errors.cross_track + errors.cross_track_per_curvature * np.abs(new.curvature)
        beyond.append(np.mean(np.abs(new.cross_track) > band))
        beyond.append(np.mean(np.abs(new.heading) > errors.heading))
        widths.append(errors.cross_track)
    assert np.mean(beyond) <= 1.0 - quantile
    if not heavy:
        # The band that is right: 2.58 standard deviations of level and mean together, or added.
        assert np.median(widths) <= 1.7 * 2.58 * np.hypot(0.06, 0.03)


def test_an_absurd_session_and_a_lost_position_do_not_shrink_or_burst_the_band() -> None:
    rng = np.random.default_rng(4)
    columns, runs = drives(rng, 8)
    plain = fitted((columns, runs)).tracking
    lost = {**columns, "y": columns["y"].copy()}
    lost["y"][runs[2].start + 200 : runs[2].start + 230] += 40.0
    shifted = fitted((lost, runs))
    assert plain is not None
    assert shifted.tracking is not None
    assert "samples were too far from a path" in shifted.note
    for name in ("cross_track_std", "heading_std"):
        assert getattr(shifted.tracking, name) == pytest.approx(getattr(plain, name), rel=0.2)


def test_too_few_sessions_leave_the_table_and_say_so() -> None:
    known = Tracking(cross_track_std=0.2)
    fit = fit_tracking(samples_of(drives(np.random.default_rng(2), 3)), known, 2.0, 0.99)
    assert fit.tracking is known
    assert "is unchanged: the log has 3 sessions with at least 100 m" in fit.note
    fit = fitted(drives(np.random.default_rng(2), 8, length=60.0))
    assert fit.tracking is None
    assert "is not set: vehicles follow their lines exactly" in fit.note


def test_keys_that_poses_do_not_determine_are_unchanged() -> None:
    known = Tracking(latency=0.3, along_track_std=0.1, lookahead=3.0)
    columns, runs = drives(np.random.default_rng(3), 6)
    del columns["yaw"]
    fit = fit_tracking(samples_of((columns, runs)), known, 2.0, 0.99)
    expected = replace(
        known,
        cross_track_std=fit.tracking.cross_track_std,
        cross_track_per_curvature=fit.tracking.cross_track_per_curvature,
    )
    assert fit.tracking == expected
    assert fit.tracking.cross_track_std > 0.05
    assert tracking_samples({"x": columns["x"], "run": columns["run"]}, runs) is None
