"""The planned motion itself: speeds, turns, drive, brakes, friction and loads while driving."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.effects import registry
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.services.check.check_report import ViolationLog
from slopewise.services.check.friction import braking_cap, utilisation
from slopewise.services.check.loads import BodyAttitude, attitude_of, shares_of
from slopewise.services.check.path_force import NO_LIMIT, PathForce
from slopewise.services.check.path_ground import LineGround
from slopewise.services.check.plan_line import Line
from slopewise.services.check.planned_motion import Motion
from slopewise.services.check.tolerances import TOLERANCES

_TINY_TURN = 0.1
"""Share of the lateral limit that v²|κ| has to reach: below it the path is straight."""

_NOTHING = -np.inf


def check_driving(
    log: ViolationLog,
    model: Model,
    line: Line,
    ground: LineGround,
    brakes: PathForce,
    motion: Motion,
    speed_limit: Floats | None,
) -> None:
    """Note what the driven motion breaks.

    Args:
        speed_limit: (N,) speed limit of the path [m/s], None without one.
    """
    pose = attitude_of(ground.grade, ground.roll, ground.vertical_curvature, line.curvature)
    _speeds(log, model, line, brakes, motion, speed_limit)
    _turns(log, model, line, pose, motion)
    for accel in (motion.accel, motion.accel_before):
        _drive(log, model, line, pose, motion, accel)
        _brakes(log, model, line, pose, brakes, motion, accel)
        check_loads(log, model, pose, motion, accel)
        if (brakes.friction < NO_LIMIT).any():
            along = accel / GRAVITY + pose.sine
            used = utilisation(pose, brakes.friction, motion.speed**2, along)
            log.add(
                "friction",
                np.where(motion.moving, used - 1.0, _NOTHING),
                "needs {0:.0%} of what friction gives",
                used,
            )


def _speeds(
    log: ViolationLog,
    model: Model,
    line: Line,
    brakes: PathForce,
    motion: Motion,
    speed_limit: Floats | None,
) -> None:
    free = motion.moving & ~motion.excused
    allowed = np.minimum(model.limits.speed, brakes.trained_speed_max)
    if speed_limit is not None:
        ahead = np.minimum(line.row + 1, len(speed_limit) - 1)
        # A limit holds from its row to its neighbours: between two rows the higher one may be due.
        allowed = np.minimum(
            allowed,
            np.where(
                line.share > 0.0,
                np.maximum(speed_limit[line.row], speed_limit[ahead]),
                speed_limit[line.row],
            ),
        )
    log.add(
        "speed_limit",
        np.where(free, motion.speed - allowed, _NOTHING),
        "{0:.3f} m/s where {1:.3f} m/s is the highest",
        motion.speed,
        allowed,
    )


def _turns(log: ViolationLog, model: Model, line: Line, pose: BodyAttitude, motion: Motion) -> None:
    vehicle, limit = model.vehicle, model.limits.lateral_accel
    free = motion.moving & ~motion.excused
    turn = motion.speed**2 * np.abs(pose.turn)
    outward = GRAVITY * pose.cross_slope_ratio * np.sign(line.curvature)
    lateral = turn + outward
    beyond = np.minimum(lateral / limit - 1.0, turn / limit - _TINY_TURN)
    log.add(
        "lateral",
        np.where(free, beyond, _NOTHING),
        "lateral acceleration of {0:.2f} m/s², {1:.2f} of it by the bank",
        lateral,
        outward,
    )
    pressed = motion.speed**2 * pose.vertical_curvature
    log.add(
        "dip",
        np.where(free, pressed / model.limits.vertical_accel - 1.0, _NOTHING),
        "vertical acceleration of {0:.2f} m/s²",
        pressed,
    )
    skids = vehicle.drive == "skid_steer"
    track = model.terrain.slip_track if skids else vehicle.track_width
    rim = motion.speed * (1.0 + 0.5 * np.abs(line.curvature) * track)
    log.add(
        "wheel_speed",
        np.where(free, rim / vehicle.max_wheel_speed - 1.0, _NOTHING),
        "the outer wheels turn at {0:.2f} m/s",
        rim,
    )


def _drive(
    log: ViolationLog,
    model: Model,
    line: Line,
    pose: BodyAttitude,
    motion: Motion,
    accel: Floats,
) -> None:
    vehicle, terrain = model.vehicle, model.terrain
    drags = 0.5 * terrain.lateral_resistance * vehicle.wheelbase
    turning = drags * np.abs(line.curvature) if vehicle.drive == "skid_steer" else 0.0
    resistance = (terrain.motion_resistance + turning) * pose.normal_ratio
    needed = accel + GRAVITY * (pose.sine + resistance)
    speed = np.maximum(motion.speed, 1e-6)
    thrust = np.minimum(vehicle.max_drive_force, vehicle.max_drive_power / speed) / vehicle.mass
    log.add(
        "traction",
        np.where(motion.moving, needed - thrust, _NOTHING),
        "needs {0:.2f} m/s² of the drive, which gives {1:.2f} m/s²",
        needed,
        thrust,
    )
    log.add(
        "accel",
        np.where(motion.moving, accel - model.limits.accel, _NOTHING),
        "speeds up at {0:.2f} m/s²",
        accel,
    )


def _brakes(
    log: ViolationLog,
    model: Model,
    line: Line,
    pose: BodyAttitude,
    brakes: PathForce,
    motion: Motion,
    accel: Floats,
) -> None:
    terms = registry.motion(model.effect)
    cap = braking_cap(model.vehicle, pose, brakes.friction, motion.speed**2)
    force = np.minimum(brakes.force(motion.speed), cap)
    # Drag helps to slow down, which is no reserve; wind may push.
    pushed = registry.motion_deceleration(motion.speed, line.curvature, line.heading, terms)
    given = GRAVITY * (force + pose.sine) + np.minimum(pushed, 0.0)
    log.add(
        "decel",
        np.where(motion.moving & (accel < 0.0), -accel - given, _NOTHING),
        "slows down at {0:.2f} m/s², the brakes give {1:.2f} m/s²",
        -accel,
        given,
    )
    free = motion.moving & ~motion.excused
    log.add(
        "decel",
        np.where(free, -accel - model.limits.decel, _NOTHING),
        "slows down at {0:.2f} m/s²",
        -accel,
    )


def check_loads(
    log: ViolationLog, model: Model, pose: BodyAttitude, motion: Motion, accel: Floats
) -> None:
    """Loads while driving as planned; the front axle is checked under drive only."""
    crest_and_even = [
        shares_of(model.vehicle, pose, motion.speed**2, -accel, crest=crest)
        for crest in (True, False)
    ]
    loads = [
        ("tip_over", "rear axle", [s.rear for s in crest_and_even], motion.moving),
        (
            "tip_over",
            "front axle",
            [s.front for s in crest_and_even],
            motion.moving & (accel > 0.0),
        ),
        ("rollover", "lighter side", [s.side for s in crest_and_even], motion.moving),
        ("rollover", "lightest wheel", [s.wheel for s in crest_and_even], motion.moving),
    ]
    for kind, what, (share, even), used in loads:
        add_load(log, kind, f"the {what} keeps", (share, even), model.limits.min_load, used)


def add_load(
    log: ViolationLog,
    kind: str,
    what: str,
    shares: tuple[Floats, Floats],
    min_load: float,
    used: Bools,
) -> None:
    """Note loads that are too low, as those of a crest where an even slope would be all right.

    Args:
        kind: kind of the violation on an even slope.
        shares: (M,) with the crest and without.
    """
    share, even = shares
    sentence = f"{what} {{0:.1%}} of its load, {min_load:.0%} is required"
    alone = even < min_load - TOLERANCES[kind].value
    log.add(kind, np.where(used & alone, min_load - share, _NOTHING), sentence, share)
    log.add("crest", np.where(used & ~alone, min_load - share, _NOTHING), sentence, share)
