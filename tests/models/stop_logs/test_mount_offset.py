from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.stop_logs import mount_offset

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
def test_ground_driven_in_several_directions_tells_it(kind: str) -> None:
    some = {"out and back": [0.0, np.pi] * 6, "all over": np.linspace(0, 6, 12)}[kind]
    found = from_headings(drive(np.array(some)))
    assert found.known
    assert found.offset == pytest.approx(MOUNT, abs=max(3.0 * found.std, np.deg2rad(0.1)))
    assert found.std < np.deg2rad(0.2)


def test_one_direction_tells_nothing() -> None:
    found = from_headings(drive(np.zeros(12)))
    assert not found.known
    assert found.offset == 0.0
    assert found.std == mount_offset.TYPICAL_MOUNTING_STD


def test_known_grade_tells_it_and_gaps_do_not_matter() -> None:
    d = drive(np.linspace(0, 6, 5))
    grade = d["grade"].copy()
    grade[::7] = np.nan
    found = mount_offset.from_grade(d["pitch"], grade, np.ones(len(grade), bool), "map")
    assert found.source == "map"
    assert found.offset == pytest.approx(MOUNT, abs=np.deg2rad(0.05))
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


def test_the_course_comes_from_positions_where_there_are_any() -> None:
    s = np.concatenate((np.linspace(0.0, 10.0, 200), np.full(50, 10.0)))
    found = mount_offset.course(s, s * np.cos(2.0), s * np.sin(2.0))
    np.testing.assert_allclose(found[:200], 2.0, atol=1e-9)
    assert np.isnan(mount_offset.course(np.zeros(9), np.zeros(9), np.zeros(9))).all()
