"""`[tracking]` from poses of simulated trackers whose law is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from slopewise.models.calibration.tracking_fit import TrackingFit, fit_tracking
from slopewise.models.calibration.tracking_samples import TrackingSamples, tracking_samples
from slopewise.models.input_errors import Tracking, input_errors

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
