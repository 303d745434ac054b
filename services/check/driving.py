"""The planned motion itself: speeds, turns, drive, brakes, friction and loads while driving."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.effects import registry
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.services.check.brakes import NO_LIMIT, Brakes
from slopewise.services.check.friction import braking_cap, utilisation
from slopewise.services.check.ground import LineGround
from slopewise.services.check.line import Line
from slopewise.services.check.loads import Stance, pose_of, shares_of
from slopewise.services.check.motion import Motion
from slopewise.services.check.report import Ledger
from slopewise.services.check.tolerances import TOLERANCES

_TINY_TURN = 0.1
"""Share of the lateral limit that v²|κ| has to reach before the bank counts: else nothing turns."""

_NOTHING = -np.inf


def judge_driving(
    ledger: Ledger,
    model: Model,
    line: Line,
    ground: LineGround,
    brakes: Brakes,
    motion: Motion,
    speed_limit: Floats | None,
) -> None:
    """Note what the driven motion breaks.

    Args:
        speed_limit: (N,) of the path, None if there is none [m/s].
    """
    pose = pose_of(ground.grade, ground.roll, ground.bend, line.curvature)
    _speeds(ledger, model, line, brakes, motion, speed_limit)
    _turns(ledger, model, line, pose, motion)
    for accel in (motion.accel, motion.accel_before):
        _drive(ledger, model, line, pose, motion, accel)
        _brakes(ledger, model, line, pose, brakes, motion, accel)
        judge_loads(ledger, model, pose, motion, accel)
        if (brakes.friction < NO_LIMIT).any():
            along = accel / GRAVITY + pose.sine
            used = utilisation(pose, brakes.friction, motion.speed**2, along)
            ledger.add(
                "friction",
                np.where(motion.moving, used - 1.0, _NOTHING),
                "needs {0:.0%} of what friction gives",
                used,
            )


def _speeds(
    ledger: Ledger,
    model: Model,
    line: Line,
    brakes: Brakes,
    motion: Motion,
    speed_limit: Floats | None,
) -> None:
    free = motion.moving & ~motion.excused
    allowed = np.minimum(model.limits.speed, brakes.fastest)
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
    ledger.add(
        "speed_limit",
        np.where(free, motion.speed - allowed, _NOTHING),
        "{0:.3f} m/s where {1:.3f} m/s is the highest",
        motion.speed,
        allowed,
    )


def _turns(ledger: Ledger, model: Model, line: Line, pose: Stance, motion: Motion) -> None:
    vehicle, limit = model.vehicle, model.limits.lateral_accel
    free = motion.moving & ~motion.excused
    turn = motion.speed**2 * np.abs(pose.turn)
    outward = GRAVITY * pose.tilt * np.sign(line.curvature)
    found = turn + outward
    beyond = np.minimum(found / limit - 1.0, turn / limit - _TINY_TURN)
    ledger.add(
        "lateral",
        np.where(free, beyond, _NOTHING),
        "lateral acceleration of {0:.2f} m/s², {1:.2f} of it by the bank",
        found,
        outward,
    )
    pressed = motion.speed**2 * pose.bend
    ledger.add(
        "dip",
        np.where(free, pressed / model.limits.vertical_accel - 1.0, _NOTHING),
        "vertical acceleration of {0:.2f} m/s²",
        pressed,
    )
    skids = vehicle.drive == "skid_steer"
    track = model.terrain.slip_track if skids else vehicle.track_width
    rim = motion.speed * (1.0 + 0.5 * np.abs(line.curvature) * track)
    ledger.add(
        "wheel_speed",
        np.where(free, rim / vehicle.max_wheel_speed - 1.0, _NOTHING),
        "the outer wheels turn at {0:.2f} m/s",
        rim,
    )


def _drive(
    ledger: Ledger, model: Model, line: Line, pose: Stance, motion: Motion, accel: Floats
) -> None:
    vehicle, terrain = model.vehicle, model.terrain
    drags = 0.5 * terrain.lateral_resistance * vehicle.wheelbase
    turning = drags * np.abs(line.curvature) if vehicle.drive == "skid_steer" else 0.0
    resistance = (terrain.motion_resistance + turning) * pose.upright
    needed = accel + GRAVITY * (pose.sine + resistance)
    speed = np.maximum(motion.speed, 1e-6)
    thrust = np.minimum(vehicle.max_drive_force, vehicle.max_drive_power / speed) / vehicle.mass
    ledger.add(
        "traction",
        np.where(motion.moving, needed - thrust, _NOTHING),
        "needs {0:.2f} m/s² of the drive, which gives {1:.2f} m/s²",
        needed,
        thrust,
    )
    ledger.add(
        "accel",
        np.where(motion.moving, accel - model.limits.accel, _NOTHING),
        "speeds up at {0:.2f} m/s²",
        accel,
    )


def _brakes(
    ledger: Ledger,
    model: Model,
    line: Line,
    pose: Stance,
    brakes: Brakes,
    motion: Motion,
    accel: Floats,
) -> None:
    terms = registry.motion(model.effect)
    cap = braking_cap(model.vehicle, pose, brakes.friction, motion.speed**2)
    force = np.minimum(brakes.force(motion.speed), cap)
    # Drag helps to slow down, which is not counted on; wind may push.
    pushed = registry.motion_deceleration(motion.speed, line.curvature, line.heading, terms)
    given = GRAVITY * (force + pose.sine) + np.minimum(pushed, 0.0)
    ledger.add(
        "decel",
        np.where(motion.moving & (accel < 0.0), -accel - given, _NOTHING),
        "slows down at {0:.2f} m/s², the brakes give {1:.2f} m/s²",
        -accel,
        given,
    )
    free = motion.moving & ~motion.excused
    ledger.add(
        "decel",
        np.where(free, -accel - model.limits.decel, _NOTHING),
        "slows down at {0:.2f} m/s²",
        -accel,
    )


def judge_loads(ledger: Ledger, model: Model, pose: Stance, motion: Motion, accel: Floats) -> None:
    """Loads while driving as planned; the front axle counts under drive only."""
    least = model.limits.min_load
    both = [
        shares_of(model.vehicle, pose, motion.speed**2, -accel, crest=crest)
        for crest in (True, False)
    ]
    loads = [
        ("tip_over", "rear axle", [s.rear for s in both], motion.moving),
        ("tip_over", "front axle", [s.front for s in both], motion.moving & (accel > 0.0)),
        ("rollover", "lighter side", [s.side for s in both], motion.moving),
        ("rollover", "lightest wheel", [s.wheel for s in both], motion.moving),
    ]
    for kind, what, (share, even), counts in loads:
        add_load(ledger, kind, f"the {what} keeps", (share, even), least, counts)


def add_load(
    ledger: Ledger,
    kind: str,
    what: str,
    shares: tuple[Floats, Floats],
    least: float,
    counts: Bools,
) -> None:
    """Note loads that are too low, as those of a crest where an even slope would be all right.

    Args:
        shares: (M,) with the crest and without.
    """
    share, even = shares
    words = f"{what} {{0:.1%}} of its load, {least:.0%} is wanted"
    alone = even < least - TOLERANCES[kind].value
    ledger.add(kind, np.where(counts & alone, least - share, _NOTHING), words, share)
    ledger.add("crest", np.where(counts & ~alone, least - share, _NOTHING), words, share)
