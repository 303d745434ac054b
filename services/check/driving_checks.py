"""The planned motion itself: speeds, turns, drive, brakes, friction and loads while driving."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.effects import registry
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.services.check.check_report import ViolationLog
from slopewise.services.check.checked_drive import CheckedDrive
from slopewise.services.check.path_force import PathForce
from slopewise.services.check.plan_line import Line, Motion
from slopewise.services.check.tolerances import TOLERANCES
from slopewise.services.physics.force import NO_FRICTION_LIMIT
from slopewise.services.physics.loads import BodyAttitude, braking_cap, shares_of, utilisation

_HARD = 0.9
"""Share of full braking from which a plan brakes as hard as it can [1]: slopes between rows."""

_TINY_TURN = 0.1
"""Share of the lateral limit that v²|κ| has to reach: below it the path is straight."""

LOADS = {
    "rear axle": "tip_over",
    "front axle": "tip_over",
    "lighter side": "rollover",
    "lightest wheel": "rollover",
}
"""Kinds of violations by what loses its load, in the order of load shares."""


def check_driving(log: ViolationLog, drive: CheckedDrive, motion: Motion) -> None:
    """Note what the driven motion breaks."""
    checks = _checks_of(log, drive, motion)
    checks.speeds()
    for accel in (motion.accel, motion.accel_before):
        checks.traction(accel)
        checks.brakes_at(accel)
        checks.loads(accel)
        checks.friction(accel)


def check_speeds_at_side(log: ViolationLog, edge: CheckedDrive, motion: Motion) -> None:
    """Note what held speeds break on ground at an end of the band."""
    checks, held = _checks_of(log, edge, motion), np.zeros_like(motion.accel)
    checks.speeds()
    checks.loads(held)
    checks.friction(held)


def _checks_of(log: ViolationLog, drive: CheckedDrive, motion: Motion) -> DrivingChecks:
    """Checks of a motion.

    A plan that says that it starts too fast may break limits of comfort, not of safety, for as long
    as it brakes as hard as it can.
    """
    checks = DrivingChecks(log, drive, motion, motion.moving)
    if drive.plan.status == "degraded":
        checks = checks._replace(free=motion.moving & ~checks.braking_down())
    return checks


class DrivingChecks(NamedTuple):
    """Checks of the motion at M samples."""

    log: ViolationLog
    drive: CheckedDrive
    motion: Motion
    free: Bools  # samples that move, and do not only brake down from a start that was too fast

    def braking_down(self) -> Bools:
        """(M,) samples from the start to the row after the last one that brakes fully."""
        line, accel = self.drive.line, self.motion.accel
        full = np.minimum(self.drive.field.model.limits.decel, self.braking_deceleration())
        hard = np.minimum.accumulate((-accel >= _HARD * full)[line.at_row])
        # Within that row's step it reaches the speed from which service braking suffices.
        hard = np.append(True, hard[:-1])
        down: Bools = hard[line.row] & ((accel < 0.0) | (line.share == 0.0))
        return down

    def braking_deceleration(self) -> Floats:
        """Deceleration by the brakes [m/s²]; drag helps but is no reserve, and wind may push."""
        model, line, pose, brakes = self._along()
        speed, terms = self.motion.speed, registry.motion(model.effect)
        cap = braking_cap(model.vehicle, pose, brakes.friction, speed**2)
        force = np.minimum(brakes.force(speed), cap)
        pushed = registry.motion_deceleration(speed, line.curvature, line.heading, terms)
        given: Floats = GRAVITY * (force + pose.sine) + np.minimum(pushed, 0.0)
        return given

    def thrust_and_resistance(self) -> tuple[Floats, Floats]:
        """Highest thrust, and what slope, rolling and turning take of it [m/s²]."""
        model, line, pose, _ = self._along()
        vehicle, terrain = model.vehicle, model.terrain
        drags = 0.5 * terrain.lateral_resistance * vehicle.wheelbase
        turning = drags * np.abs(line.curvature) if vehicle.drive == "skid_steer" else 0.0
        resistance = (terrain.motion_resistance + turning) * pose.normal_ratio
        speed = np.maximum(self.motion.speed, 1e-6)
        thrust = np.minimum(vehicle.max_drive_force, vehicle.max_drive_power / speed) / vehicle.mass
        return thrust, GRAVITY * (pose.sine + resistance)

    def _along(self) -> tuple[Model, Line, BodyAttitude, PathForce]:
        field = self.drive.field
        return field.model, self.drive.line, field.pose, field.brakes

    def speeds(self) -> None:
        """Speed limits, turns, dips, rim speed and steering."""
        model, line, pose, brakes = self._along()
        log, limits, vehicle, free = self.log, model.limits, model.vehicle, self.free
        speed, speed_limit = self.motion.speed, self.drive.plan.speed_limit
        allowed = np.minimum(limits.speed, brakes.trained_speed_max)
        if speed_limit is not None:
            # A limit holds from its row to its neighbours: between rows the higher one may be due.
            here = speed_limit[line.row]
            ahead = speed_limit[np.minimum(line.row + 1, len(speed_limit) - 1)]
            due = np.where(line.share > 0.0, np.maximum(here, ahead), here)
            allowed = np.minimum(allowed, due)
        sentence = "{0:.3f} m/s where {1:.3f} m/s is the highest"
        log.add("speed_limit", speed - allowed, sentence, speed, allowed, where=free)
        turn = speed**2 * np.abs(pose.turn)
        outward = GRAVITY * pose.cross_slope_ratio * np.sign(line.curvature) * ~self._assumed
        lateral, limit = turn + outward, limits.lateral_accel
        beyond = np.minimum(lateral / limit - 1.0, turn / limit - _TINY_TURN)
        sentence = "lateral acceleration of {0:.2f} m/s², {1:.2f} of it by the bank"
        log.add("lateral", beyond, sentence, lateral, outward, where=free)
        pressed = speed**2 * pose.vertical_curvature
        sentence = "vertical acceleration of {0:.2f} m/s²"
        log.add("dip", pressed / limits.vertical_accel - 1.0, sentence, pressed, where=free)
        skids = vehicle.drive == "skid_steer"
        track = model.terrain.slip_track if skids else vehicle.track_width
        rim = speed * (1.0 + 0.5 * np.abs(line.curvature) * track)
        sentence = "the outer wheels turn at {0:.2f} m/s"
        log.add("wheel_speed", rim / vehicle.max_wheel_speed - 1.0, sentence, rim, where=free)
        max_rate, needed = model.steering_geometry.max_rate, speed * self.drive.turning.rate
        sentence = f"the steering turns at {{0:.2f}} rad/s, {max_rate:.2f} rad/s is its most"
        moving = self.motion.moving
        log.add("steering_rate", needed / max_rate - 1.0, sentence, needed, where=moving)

    def traction(self, accel: Floats) -> None:
        """Thrust of the drive, and the limit of acceleration."""
        (thrust, taken), moving = self.thrust_and_resistance(), self.motion.moving
        needed = accel + taken
        sentence = "needs {0:.2f} m/s² of the drive, which gives {1:.2f} m/s²"
        self.log.add("traction", needed - thrust, sentence, needed, thrust, where=moving)
        excess = accel - self.drive.field.model.limits.accel
        self.log.add("accel", excess, "speeds up at {0:.2f} m/s²", accel, where=moving)

    def brakes_at(self, accel: Floats) -> None:
        """Force of the brakes, and the limit of deceleration."""
        given, sentence = self.braking_deceleration(), "slows down at {0:.2f} m/s²"
        slows = self.motion.moving & (accel < 0.0) & ~self._assumed
        by_brakes = f"{sentence}, the brakes give {{1:.2f}} m/s²"
        self.log.add("decel", -accel - given, by_brakes, -accel, given, where=slows)
        excess = -accel - self.drive.field.model.limits.decel
        self.log.add("decel", excess, sentence, -accel, where=self.free)

    @property
    def _assumed(self) -> Bools:
        """(M,) samples by the first row: how the vehicle is turned there is assumed."""
        assumed: Bools = (self.drive.line.row == 0) & (self.drive.line.share < 0.5)
        return assumed

    def friction(self, accel: Floats) -> None:
        """Friction under slope, turn and drive or brakes."""
        pose, friction = self.drive.field.pose, self.drive.field.brakes.friction
        if (friction < NO_FRICTION_LIMIT).any():
            along = accel / GRAVITY + pose.sine
            used = utilisation(pose, friction, self.motion.speed**2, along)
            sentence = "needs {0:.0%} of what friction gives"
            self.log.add("friction", used - 1.0, sentence, used, where=self.motion.moving)

    def loads(self, accel: Floats) -> None:
        """Loads while driving as planned; the front axle is checked under drive only."""
        model, _, pose, _ = self._along()
        speed_sq, moving = self.motion.speed**2, self.motion.moving
        crest, even = (
            shares_of(model.vehicle, pose, speed_sq, -accel, crest=crest) for crest in (True, False)
        )
        for (noun, kind), *shares in zip(LOADS.items(), crest, even, strict=True):
            used = moving & (accel > 0.0) if noun == "front axle" else moving
            subject = f"the {noun} keeps"
            add_load(self.log, kind, subject, shares, model.limits.min_load, where=used)


def add_load(
    log: ViolationLog,
    kind: str,
    subject: str,
    shares: Sequence[Floats],
    min_load: float,
    *,
    where: Bools | bool = True,
    at: Ints | None = None,
) -> None:
    """Note loads that are too low; as those of a crest where they suffice without it.

    ``shares`` are those with the crest and without, ``kind`` that of a violation without it.
    """
    share, even = shares
    sentence = f"{subject} {{0:.1%}} of its load, {min_load:.0%} is required"
    alone = even < min_load - TOLERANCES[kind].value
    log.add(kind, min_load - share, sentence, share, where=where & alone, at=at)
    log.add("crest", min_load - share, sentence, share, where=where & ~alone, at=at)
