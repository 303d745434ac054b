"""Every rule bites: 10 % within it nothing is reported, 10 % beyond it the right kind is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.check.tolerances import TOLERANCES
from tests.services.check.drives import (
    Scene,
    at,
    constant_force,
    driven,
    ground,
    hill,
    model_with,
    slope,
    straight,
    trapezoid,
)

G = 9.80665


def level_stop(speed: np.ndarray) -> np.ndarray:
    """Closed form of the quad's stop on level ground, v t_d + v²/2a + offset [m]."""
    decel = G * (0.015 * np.maximum(speed, 1.0) + 0.40)
    return np.where(speed > 0.0, 0.30 * speed + speed**2 / (2.0 * decel) + 0.20, 0.0)


def furthest(s: np.ndarray, speed: np.ndarray, share: float = 1.0) -> float:
    """Station before which stops end that use a share of the way they have [m]."""
    return float(np.max((s + level_stop(speed) / share)[speed > 0.0]))


def lateral_on_a_bank(u: float) -> Scene:
    """The turn leads straight downhill at first, and across the slope, which pushes outward."""
    return driven(
        np.sqrt(4.0 * 2.0 * u),
        slope(0.0, 0.05),
        radius=4.0,
        shape={"length": 3.0, "stop_at": 2.8, "accel": 20.0},
        limits={"lateral_accel": 2.0 + G * np.sin(0.05), "accel": 50.0, "decel": 50.0},
        vehicle={"max_drive_force": 50000.0, "max_drive_power": 500000.0},
    )


def front_axle_under_drive(u: float) -> Scene:
    """Uphill the front is light, and weak brakes leave the rear alone."""
    front = np.cos(0.2) - 0.55 / 0.6 * (np.sin(0.2) + 0.9 / G)
    braking = constant_force(0.25)
    limits = {"min_load": u * front}
    return driven(1.0, slope(0.2), shape={"decel": 0.1}, braking=braking, limits=limits)


def slalom(u: float, reference: str) -> Scene:
    """Curvature grows by 0.05 1/m a metre: straight ahead the wheels turn by 0.06 rad a metre."""
    s, v = trapezoid(1.0, length=10.0, stop_at=9.0)
    heading = 0.025 * (s[:-1] + 0.05) ** 2
    x, y = (np.append(0.0, np.cumsum(0.1 * part)) for part in (np.cos(heading), np.sin(heading)))
    steering = {"kind": "ackermann", "reference": reference, "max_rate": 0.06 / u}
    plan = ExternalPlan(name="slalom", x=x, y=y, speed=v)
    return Scene(plan, model_with(vehicle=CAR, steering=steering), ground())


def late(share: float) -> float:
    """Station before which stops end that begin late, and use a share of the way they have [m]."""
    s, speed = SOFT
    distance = level_stop(speed) + speed * (0.2 + Z * 0.05) + Z * 0.1
    return float(np.max((s + distance / share)[speed > 0.0]))


def rear_share(speed: np.ndarray | float) -> np.ndarray:
    """Rear load of the quad on level ground under full brakes, a share of the static one."""
    return 1.0 - 0.55 / 0.6 * (0.015 * np.maximum(speed, 1.0) + 0.40)


HARD, SOFT = trapezoid(3.0, decel=3.0), trapezoid(3.0)
FRONT = 0.60 + 0.28  # [m] of the vehicle ahead of its middle: the path has to be free for it
HULL = {"speed_by_grade": [[-0.26, 3.0], [0.0, 3.0], [0.26, 2.0]]}  # 2.5 m/s on 0.13 rad
NEEDED_FORCE = 500.0 * (0.9 + 0.13 * G)  # [N] that the drive has to give
BRAKES_DOWNHILL = G * (0.40 + 0.38 * 0.2 - np.sin(0.2))
CAR = {"drive": "ackermann"}
REAR = {"reference": "rear_axle"}
Z = 2.0  # standard deviations: one-sided at a quantile of 0.97725, two-sided at 0.9545
LATE = {"along_track_std": 0.1, "latency": 0.2, "latency_std": 0.05}
OFF_LINE = {"cross_track_std": 0.1, "heading_std": 0.03}
BAND = 0.598 + Z * 0.1 + FRONT * np.sin(Z * 0.03)  # [m] to the side of the front corners
SIDE = 1.0 - 1.1 * 9.0 / (8.0 * G)

SCENES: dict[str, tuple[str, Callable[[float], Scene]]] = {
    "speed limit": ("speed_limit", lambda u: driven(3.0 * u, limits={"speed": 3.0})),
    "trained speed": (
        "speed_limit",
        lambda u: driven(3.0 * u, braking={"speed_range": [1.0, 3.0]}),
    ),
    "speed driven on the grade": (
        "speed_limit",
        lambda u: driven(2.5 * u, slope(0.13), braking=HULL),
    ),
    "speed limit of the path": (
        "speed_limit",
        lambda u: driven(2.0 * u, columns=lambda s, _: {"speed_limit": np.full_like(s, 2.0)}),
    ),
    "clear path": ("stopping_path", lambda u: driven(3.0, clear=furthest(*SOFT, u) + FRONT)),
    "clear distance": (
        "stopping_path",
        lambda u: driven(
            3.0, columns=lambda s, v: {"clear_distance": np.full_like(s, furthest(s, v, u))}
        ),
    ),
    "unknown below the body": (
        "unknown_terrain",
        lambda u: driven(
            2.0, at(lambda x, y: (y > 0.598 / u + 0.025) & (x > 5.0), np.nan), resolution=0.05
        ),
    ),
    "unknown where a stop ends": (
        "unknown_terrain",
        lambda u: driven(
            3.0,
            at(lambda x, _: x > furthest(*HARD, u) + FRONT + 0.05, np.nan),
            resolution=0.05,
            shape={"decel": 3.0},
        ),
    ),
    "steeper than trained": (
        "model_validity",
        lambda u: driven(1.0, slope(0.26 * u), shape={"accel": 0.3}),
    ),
    "more roll than trained": (
        "model_validity",
        lambda u: driven(1.0, slope(0.0, 0.15 * u), braking={"roll_range": (-0.15, 0.15)}),
    ),
    "tip over": ("tip_over", lambda u: driven(3.0, limits={"min_load": rear_share(3.0) * u})),
    "front axle under drive": ("tip_over", front_axle_under_drive),
    "rollover": (
        "rollover",
        lambda u: driven(3.0, radius=8.0, limits={"min_load": (SIDE + rear_share(3.0) - 1.0) * u}),
    ),
    "crest": ("crest", lambda u: driven(3.0, hill, resolution=0.1, limits={"min_load": 0.4 * u})),
    "dip": (
        "dip",
        lambda u: driven(
            3.0, lambda x, y: -hill(x, y), resolution=0.1, limits={"vertical_accel": 1.5 / u**3}
        ),
    ),
    "lateral": ("lateral", lambda u: driven(np.sqrt(8.0 * u), radius=4.0)),
    "lateral on a bank": ("lateral", lateral_on_a_bank),
    "wheel speed": (
        "wheel_speed",
        lambda u: driven(
            2.0, radius=4.0, vehicle={"max_wheel_speed": 2.0 * (1.0 + 0.5 * 1.15 / 4.0) / u}
        ),
    ),
    "accel": ("accel", lambda u: driven(2.0, shape={"accel": 1.0 * u, "decel": 0.5})),
    "traction": ("traction", lambda u: driven(2.0, vehicle={"max_drive_force": NEEDED_FORCE / u})),
    "power": (
        "traction",
        lambda u: driven(2.0, vehicle={"max_drive_power": 2.0 * NEEDED_FORCE / u}),
    ),
    "decel": ("decel", lambda u: driven(2.0, shape={"accel": 0.5, "decel": 1.5 * u})),
    "brakes downhill": (
        "decel",
        lambda u: driven(
            2.0,
            slope(-0.2),
            shape={"accel": 0.5, "decel": u * BRAKES_DOWNHILL},
            braking=constant_force(0.40, -0.38),
            limits={"decel": 9.0},
        ),
    ),
    "friction": (
        "friction",
        lambda u: driven(
            2.5, radius=4.0, braking={"sliding_friction": np.hypot(2.5**2 / 4.0, 0.9) / G / u}
        ),
    ),
    "holding": (
        "holding",
        lambda u: driven(1.0, slope(0.2), braking=constant_force(np.sin(0.2) / u)),
    ),
    "holding by friction": (
        "holding",
        lambda u: driven(
            0.5, slope(0.2), shape={"accel": 0.1}, braking={"sliding_friction": np.tan(0.2) / u}
        ),
    ),
    "step": (
        "step",
        lambda u: driven(1.0, at(lambda x, _: x > 8.0, 0.28 / 3.0 * u**2), resolution=0.05),
    ),
    "hole": (
        "step",
        lambda u: driven(
            1.0,
            at(lambda x, y: (np.abs(x - 8.0) < 0.4) & (np.abs(y - 0.5) < 0.15), -0.28 / 3.0 * u**2),
            resolution=0.05,
        ),
    ),
    "clearance": (
        "clearance",
        lambda u: driven(
            1.0,
            at(lambda x, y: (np.abs(x - 8.0) < 0.2) & (np.abs(y) < 0.2), 0.21 * u**2),
            resolution=0.05,
        ),
    ),
    "body": (
        "body",
        lambda u: driven(
            1.0, at(lambda x, y: (np.abs(x - 8.0) < 0.2) & (y > 0.59), 0.21 * u**2), resolution=0.05
        ),
    ),
    "a tight turn": (
        "turning",
        lambda u: driven(
            1.0, radius=4.0, vehicle=CAR, steering={"kind": "ackermann", "min_radius": 4.0 * u}
        ),
    ),
    "a tight turn of the rear axle": (
        "turning",
        lambda u: driven(
            1.0,
            radius=4.0,
            vehicle=CAR,
            steering={"kind": "ackermann", "max_angle": np.arctan(0.3 / u), **REAR},
        ),
    ),
    "a sudden turn": ("steering_rate", lambda u: slalom(u, "mid")),
    "a sudden turn of the rear axle": ("steering_rate", lambda u: slalom(u, "rear_axle")),
    "late": (
        "stopping_path",
        lambda u: driven(3.0, clear=late(u) + FRONT, quantile=0.97725, tracking=LATE),
    ),
    "wall next to the band": (
        "body",
        lambda u: driven(
            1.0,
            at(lambda x, y: (np.abs(x - 8.0) < 0.2) & (y > BAND / u), 0.5),
            resolution=0.05,
            quantile=0.9545,
            tracking=OFF_LINE,
        ),
    ),
    "step within the band": (
        "step",
        lambda u: driven(
            1.0,
            at(lambda x, y: (x > 8.0) & (y > 0.65), 0.28 / 3.0 * u**2),
            resolution=0.05,
            quantile=0.9545,
            tracking=OFF_LINE,
        ),
    ),
    "edge within the band": (
        "step",
        lambda u: driven(
            1.0,
            at(lambda x, y: y > 0.6, -0.28 / 3.0 * u**2),
            resolution=0.05,
            quantile=0.9545,
            tracking=OFF_LINE,
        ),
    ),
    "stop distance": (
        "stop_distance",
        lambda u: driven(3.0, columns=lambda _, v: {"stop_distance": level_stop(v) / u}),
    ),
    "rear load": (
        "rear_load",
        lambda u: driven(3.0, columns=lambda _, v: {"rear_load": rear_share(v) * u}),
    ),
    "side load": (
        "side_load",
        lambda u: driven(3.0, columns=lambda s, _: {"side_load": np.full_like(s, u)}),
    ),
    "clear distance beyond the rows": (
        "clear_distance",
        lambda u: driven(3.0, columns=lambda s, _: {"clear_distance": np.full_like(s, 20.0 * u)}),
    ),
    "bound above the limit": (
        "speed_bound",
        lambda u: driven(
            2.0,
            limits={"speed": 3.0},
            columns=lambda s, v: {"speed_bound": np.where(s < 9.0, 3.0 * u**2, v)},
        ),
    ),
    "another rule": (
        "limiting",
        lambda u: driven(
            3.0,
            limits={"speed": 3.0},
            columns=lambda s, _: {"limiting": ("speed_limit" if u < 1.0 else "lateral",) * len(s)},
        ),
    ),
    "infeasible": (
        "status",
        lambda u: driven(
            3.0, columns=lambda *_: {"status": "blocked" if u < 1.0 else "infeasible"}
        ),
    ),
    "rows apart": ("spacing", lambda u: driven(1.0, shape={"spacing": 2.0 * FRONT * u})),
    "columns": (
        "columns",
        lambda u: driven(3.0, columns=lambda s, _: {"station": s * (1.1 if u > 1.0 else 1.001)}),
    ),
}


def kinds(scene: Scene) -> set[str]:
    plan, model, heights, clear, quantile = scene
    report = check_plan_on_map(plan, model, heights, clear=clear, quantile=quantile)
    return {violation.kind for violation in report.violations}


@pytest.mark.parametrize("name", SCENES)
def test_every_rule_bites(name: str) -> None:
    kind, scene = SCENES[name]
    assert kind not in kinds(scene(0.9))
    assert kind in kinds(scene(1.12))


def test_every_kind_has_a_scene() -> None:
    assert {kind for kind, _ in SCENES.values()} == set(TOLERANCES)


def test_a_sound_plan_has_no_violation() -> None:
    s, v = trapezoid(3.0, spacing=0.25)
    for surface in (None, slope(0.15), slope(-0.15), slope(0.0, 0.15), slope(-0.1, -0.1)):
        report = check_plan_on_map(straight(s, v), model_with(), ground(surface))
        assert report.valid, report.violations[:3]
        assert report.stops > 4 * np.count_nonzero(v) - 4
