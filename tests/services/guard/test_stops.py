"""The guard's own stops: against closed forms, against the checker's, and against themselves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.path_force import path_force
from slopewise.services.check.path_ground import ground_under
from slopewise.services.check.plan_line import line_of
from slopewise.services.check.stop_dynamics import StopDynamics
from slopewise.services.check.stop_integration import worst_case_stops
from slopewise.services.guard.arc import ArcAhead, PlanarPose, arc_ahead
from slopewise.services.guard.ground import GuardGround
from slopewise.services.guard.model_reader import GuardModel, read_guard_model, rows_of
from slopewise.services.guard.plain import plainly_fine
from slopewise.services.guard.stops import stops_along
from slopewise.services.io.model_file import find_model, read_model

G = 9.80665
ATV = find_model("atv")
CELL = 0.25


@pytest.fixture(scope="module")
def model() -> GuardModel:
    return read_guard_model(ATV)


def slope(grade: float, roll: float = 0.0) -> GuardGround:
    """Even ground that rises along x, its left side up."""
    y, x = CELL * np.mgrid[0:200, 0:200]
    return GuardGround(np.tan(grade) * x + np.tan(roll) * y, CELL, (-10.0, -25.0))


def hills(seed: int) -> GuardGround:
    rng = np.random.default_rng(seed)
    y, x = CELL * np.mgrid[0:240, 0:240]
    z = np.zeros_like(x)
    for _ in range(6):
        kx, ky, phase = rng.uniform(-0.25, 0.25), rng.uniform(-0.25, 0.25), rng.uniform(0, 7)
        z += rng.uniform(0.1, 0.6) * np.sin(kx * x + ky * y + phase)
    return GuardGround(z, CELL, (0.0, 0.0))


def look(
    model: GuardModel, ground: GuardGround, pose: PlanarPose, curvature: float = 0.0
) -> ArcAhead:
    return arc_ahead(model, rows_of(model), ground, pose, curvature, forward=True, length=15.0)


def stop(model: GuardModel, way: ArcAhead, speed: float, held: float = 0.0) -> float:
    found = stops_along(model, (rows_of(model),), way, np.array([speed]), np.array([held]), 0.0)
    return float(found.distance[0])


@pytest.mark.parametrize("grade", [-0.2, -0.1, 0.0, 0.1, 0.2])
@pytest.mark.parametrize("speed", [0.5, 1.0, 2.5, 4.0])
def test_stops_on_even_slopes_are_those_in_closed_form(
    model: GuardModel, grade: float, speed: float
) -> None:
    """Braking (2), (7), (8), (12) by hand, the drive cut in the dead time where that is worse."""
    dead, rolls = 0.30, 0.13
    gain = max(-np.sin(grade) - rolls, 0.0)
    onset = np.sqrt(speed**2 + 2.0 * G * gain * speed * dead)
    v = max(onset, 1.0)
    force = (-0.03 * v - 0.35) * grade + 0.015 * v + 0.40
    by_hand = speed * dead + onset**2 / (2.0 * G * (force + np.sin(grade))) + 0.20
    found = stop(model, look(model, slope(grade), PlanarPose(0.0, 0.0, 0.0)), speed)
    assert by_hand - 1e-6 <= found <= by_hand * 1.02 + 0.01


@pytest.mark.parametrize("seed", range(12))
def test_no_stop_is_shorter_than_the_checkers(model: GuardModel, seed: int) -> None:
    """The checker integrates in time, over grades of its own; on hills it is the same stop."""
    rng = np.random.default_rng(seed)
    ground, heading = hills(seed), rng.uniform(-3.0, 3.0)
    pose, speed = PlanarPose(30.0, 30.0, heading), float(rng.uniform(0.8, 4.0))
    way = look(model, ground, pose)
    if way.ends < 48:
        pytest.skip("steeper than trained")
    along = np.linspace(0.0, 14.0, 120)
    plan = ExternalPlan(
        name="p",
        x=30.0 + along * np.cos(heading),
        y=30.0 + along * np.sin(heading),
        speed=np.full(120, speed),
    )
    whole = read_model(ATV)
    heights = ElevationMap(elevation=ground.elevation, resolution=CELL, origin=(0.0, 0.0))
    line = line_of(plan, 0.3)
    under = ground_under(heights, line, whole.vehicle)
    brakes = path_force(whole, under, line, heights.class_names)
    field = StopDynamics.along(whole, line, under, brakes)
    judged = worst_case_stops(field, np.zeros(1), np.array([speed]), np.array([0.30]), 14.0)
    theirs, ours = float(judged.end[0]) + 0.20, stop(model, way, speed)
    # Stations of the checker lie along the slope, those of the guard on the map.
    assert theirs / 1.04 - 0.02 <= ours <= theirs * 1.15 + 0.15


@pytest.mark.parametrize("seed", range(40))
def test_what_is_plainly_fine_is_fine_at_a_close_look(model: GuardModel, seed: int) -> None:
    rng = np.random.default_rng((7, seed))
    ground = hills(seed % 8)
    tables = (rows_of(model),)
    pose = PlanarPose(*rng.uniform(15.0, 45.0, 2), rng.uniform(-3.0, 3.0))
    curvature = float(rng.uniform(-0.3, 0.3))
    speed, held, end = float(rng.uniform(0.2, 4.0)), 0.15, float(rng.uniform(1.0, 12.0))
    way = look(model, ground, pose, curvature)
    plain = plainly_fine(model, tables, way, speed, held, 0.05, end)
    speeds = speed * np.arange(1, 9) / 8.0
    stops = stops_along(model, tables, way, speeds, np.full(8, held), 0.05)
    close = (stops.distance <= end) & stops.loaded & stops.cornering
    assert not plain or close.all()


def test_longer_held_steeper_or_faster_is_never_shorter(model: GuardModel) -> None:
    ways = [look(model, slope(g), PlanarPose(0.0, 0.0, 0.0)) for g in (0.2, 0.1, 0.0, -0.1, -0.2)]
    assert np.all(np.diff([stop(model, way, 3.0) for way in ways]) > 0.0)
    assert np.all(np.diff([stop(model, ways[2], v) for v in np.linspace(0.2, 4.0, 30)]) > 0.0)
    assert np.all(np.diff([stop(model, ways[2], 2.0, h) for h in np.linspace(0, 1, 9)]) > 0.0)


def test_a_slope_that_brakes_do_not_hold_has_no_stop(model: GuardModel) -> None:
    weak = model._replace(
        surfaces={"": model.surfaces[""]._replace(b_b=0.1, m_b=0.0, b_m=0.0, m_m=0.0)}
    )
    assert stop(weak, look(weak, slope(-0.2), PlanarPose(0.0, 0.0, 0.0)), 1.0) == np.inf


def test_what_the_guard_does_not_understand_it_does_not_guard(tmp_path: Path) -> None:
    text = ATV.read_text()
    for old, new, words in (
        ("[braking] ", "[braking]\nboost = 2.0\n#", "braking.boost"),
        ("b_b = 0.40", "b_b = 'strong'", "braking.b_b"),
        ("b_b = 0.40", "b_b = nan", "braking.b_b"),
        ("dead_time = 0.30", "dead_time = -1.0", "braking.dead_time"),
        ("[limits]", "[limit]", "limits"),
        ("speed_range = [1.0, 4.0]", "speed_range = [4.0, 1.0]", "speed_range"),
    ):
        file = tmp_path / "model.toml"
        assert old in text
        file.write_text(text.replace(old, new, 1))
        with pytest.raises(InputError, match=words):
            read_guard_model(file)
    file.write_text(text + '\n[[effect]]\nname = "ghost"\nparameters = {}\n')
    with pytest.raises(InputError, match="effect"):
        read_guard_model(file)


def test_spread_and_lag_make_stops_longer(tmp_path: Path) -> None:
    text, file = ATV.read_text(), tmp_path / "model.toml"
    found = []
    for more in ("", "force_std = 0.02\n", "dead_time_std = 0.1\n", "speed_error = 0.3\n"):
        file.write_text(text.replace("dead_time = 0.30", f"{more}dead_time = 0.30", 1))
        other = read_guard_model(file)
        found.append(stop(other, look(other, slope(0.0), PlanarPose(0.0, 0.0, 0.0)), 3.0))
    file.write_text(text + '\n[[effect]]\nname = "brake_lag"\nparameters = { tau = 0.3 }\n')
    other = read_guard_model(file)
    found.append(stop(other, look(other, slope(0.0), PlanarPose(0.0, 0.0, 0.0)), 3.0))
    assert min(found[1:]) > found[0]
    assert found[-1] == pytest.approx(found[0] + 0.9)
