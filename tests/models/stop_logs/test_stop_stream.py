"""Streamed stops against the plant that shares no code, and against what disturbs them."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.stop_logs.stop_stream import StopStream, StreamedStop
from tests.models.calibration.plant import Plant, drive


def stream(plant: Plant, stops: int = 60, seed: int = 0) -> tuple[list[StreamedStop], np.ndarray]:
    log, _, truth = drive(plant, stops, seed)
    feed = StopStream(plant.dead_time, mount=plant.mount, dive=plant.dive)
    rows = zip(*(log[name].tolist() for name in ("t", "v", "v_cmd", "pitch")), strict=True)
    streamed = [stop for row in rows if (stop := feed.feed(*row)) is not None]
    return streamed, truth.speed


@pytest.mark.parametrize("noise", [0.01, 0.03])
def test_every_stop_is_measured(noise: float) -> None:
    plant = Plant(speed_noise=noise, scatter=0.0, dive=np.deg2rad(0.3), mount=np.deg2rad(1.0))
    streamed, speed = stream(plant)
    assert len(streamed) == 60
    np.testing.assert_allclose([s.onset_speed for s in streamed], speed, atol=5 * noise)
    error = [s.force_ratio / plant.force(s.grade, s.onset_speed) - 1.0 for s in streamed]
    assert abs(np.mean(error)) < 0.01
    assert np.std(error) < 0.03
    assert np.mean([s.dead_time for s in streamed]) == pytest.approx(plant.dead_time, abs=0.01)


def test_its_noise_is_what_it_claims() -> None:
    plant = Plant(speed_noise=0.02, scatter=0.0, pitch_noise=1e-4, undulation=0.0)
    streamed, _ = stream(plant, 150)
    scaled = [(s.force_ratio - plant.force(s.grade, s.onset_speed)) / s.force_std for s in streamed]
    assert 0.7 < np.std(scaled) < 1.4


def rows(release: float = 9.0, gap: float = 0.0) -> list[tuple[float, float, float, float]]:
    t = np.arange(-1.0, 3.0, 0.02)
    v = np.clip(2.0 - 4.0 * (t - 0.3), 0.0, 2.0)
    command = np.where((t < 0.0) | (t > release), 2.0, 0.0)
    t = np.where(t > 0.5, t + gap, t)
    return list(zip(t.tolist(), v.tolist(), command.tolist(), [0.0] * len(t), strict=True))


def count(samples: list[tuple[float, float, float, float]]) -> int:
    feed = StopStream(0.3)
    return sum(feed.feed(*row) is not None for row in samples)


def test_aborted_stops_and_stops_with_gaps_are_none() -> None:
    assert count(rows()) == 1
    assert count(rows(release=0.5)) == 0
    assert count(rows(gap=1.0)) == 0


def test_bad_samples_are_ignored_or_end_the_stop() -> None:
    valid_rows = rows()
    doubled = [row for row in valid_rows for _ in range(2)]
    assert count(doubled) == 1
    late = [*valid_rows[:60], valid_rows[10], *valid_rows[60:]]
    assert count(late) == 1
    broken = list(valid_rows)
    broken[65] = (broken[65][0], float("nan"), 0.0, 0.0)
    assert count(broken) == 0
    no_pitch = [(t, v, c, float("nan")) for t, v, c, _ in valid_rows]
    assert count(no_pitch) == 0
