"""Grade under a log: dive of the body and mount offset of the pitch sensor."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.stop_logs import mount_offset
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


MOUNT = np.deg2rad(1.0)


def drive(headings: np.ndarray, seed: int = 0) -> dict[str, np.ndarray]:
    """Straight drives over one tilted, bumpy field in some headings, all through its middle."""
    rng = np.random.default_rng(seed)
    parts = []
    for heading in headings:
        s = np.arange(-15.0, 15.0, 0.1)
        side = rng.uniform(-2.0, 2.0)
        x = s * np.cos(heading) - side * np.sin(heading)
        y = s * np.sin(heading) + side * np.cos(heading)
        gx, gy = 0.1 + 0.05 * np.sin(x / 4.0), -0.05 + 0.05 * np.cos(y / 5.0)
        grade = gx * np.cos(heading) + gy * np.sin(heading)
        pitch = -grade + MOUNT + np.deg2rad(0.3) * rng.standard_normal(len(s))
        parts.append((x, y, np.full(len(s), heading), pitch, grade))
    names = ("x", "y", "heading", "pitch", "grade")
    return dict(zip(names, map(np.concatenate, zip(*parts, strict=True)), strict=True))


def from_headings(d: dict[str, np.ndarray]) -> mount_offset.Mount:
    use = np.ones(len(d["x"]), bool)
    return mount_offset.from_headings(d["pitch"], d["x"], d["y"], d["heading"], use)


@pytest.mark.parametrize("kind", ["out and back", "all over"])
def test_ground_driven_in_several_directions_determines_it(kind: str) -> None:
    some = {"out and back": [0.0, np.pi] * 6, "all over": np.linspace(0, 6, 12)}[kind]
    mount = from_headings(drive(np.array(some)))
    assert mount.known
    assert mount.offset == pytest.approx(MOUNT, abs=max(3.0 * mount.std, np.deg2rad(0.1)))
    assert mount.std < np.deg2rad(0.2)


def test_one_direction_is_not_enough() -> None:
    mount = from_headings(drive(np.zeros(12)))
    assert not mount.known
    assert mount.offset == 0.0
    assert mount.std == mount_offset.TYPICAL_MOUNTING_STD


def test_known_grade_determines_it_and_gaps_do_not_matter() -> None:
    d = drive(np.linspace(0, 6, 5))
    grade = d["grade"].copy()
    grade[::7] = np.nan
    mount = mount_offset.from_grade(d["pitch"], grade, np.ones(len(grade), bool), "map")
    assert mount.source == "map"
    assert mount.offset == pytest.approx(MOUNT, abs=np.deg2rad(0.05))
    nothing = mount_offset.from_grade(d["pitch"], grade * np.nan, np.ones(len(grade), bool), "map")
    assert not nothing.known


def test_heights_give_the_grade() -> None:
    station = np.linspace(0.0, 50.0, 501)
    grade = mount_offset.from_heights(station, station * np.sin(0.1))
    np.testing.assert_allclose(grade, 0.1, atol=1e-9)
    standing = mount_offset.from_heights(np.zeros(10), np.zeros(10))
    assert np.isnan(standing).all()


def test_steady_driving_only() -> None:
    t = np.arange(0.0, 6.0, 0.02)
    v = np.clip(2.0 - 3.0 * (t - 4.0), 0.0, 2.0)
    use = mount_offset.steady(t, v)
    assert use[(t > 0.5) & (t < 3.5)].all()
    assert not use[(t > 4.05) & (t < 4.6)].any()
    assert not use[t > 5.2].any()


def test_the_course_follows_positions_where_there_are_any() -> None:
    s = np.concatenate((np.linspace(0.0, 10.0, 200), np.full(50, 10.0)))
    mount = mount_offset.course(s, s * np.cos(2.0), s * np.sin(2.0))
    np.testing.assert_allclose(mount[:200], 2.0, atol=1e-9)
    assert np.isnan(mount_offset.course(np.zeros(9), np.zeros(9), np.zeros(9))).all()
