"""The planned motion itself: speeds, turns, drive, brakes, friction and loads while driving."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.effects import registry
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.services.check.check_report import ViolationLog
from slopewise.services.check.loads import (
    BodyAttitude,
    braking_cap,
    shares_of,
    utilisation,
)
from slopewise.services.check.path_force import NO_LIMIT, PathForce
from slopewise.services.check.plan_line import Line, Motion
from slopewise.services.check.steering_checks import Turning
from slopewise.services.check.tolerances import TOLERANCES

_HARD = 0.9
"""Share of full braking from which a plan brakes as hard as it can [1]: slopes between rows."""

_TINY_TURN = 0.1
"""Share of the lateral limit that v²|κ| has to reach: below it the path is straight."""


def check_driving(
    checks: DrivingChecks, speed_limit: Floats | None, *, too_fast: bool = False
) -> None:
    """Note what the driven motion breaks; ``speed_limit`` (N,) is that of the path [m/s].

    A plan that says that it starts ``too_fast`` may break limits of comfort, not of safety, for as
    long as it brakes as hard as it can.
    """
    motion = checks.motion
    if too_fast:
        checks = checks._replace(free=motion.moving & ~checks.braking_down())
    checks.speeds(speed_limit)
    for accel in (motion.accel, motion.accel_before):
        checks.drive(accel)
        checks.brakes_at(accel)
        checks.loads(accel)
        checks.friction(accel)


class DrivingChecks(NamedTuple):
    """Checks of the motion at M samples."""

    log: ViolationLog
    model: Model
    line: Line
    pose: BodyAttitude
    brakes: PathForce
    motion: Motion
    turning: Turning
    free: Bools  # samples that move, and do not only brake down from a start that was too fast

    def braking_down(self) -> Bools:
        """(M,) samples from the start to the row after the last one that brakes fully."""
        line, accel = self.line, self.motion.accel
        full = np.minimum(self.model.limits.decel, self.braking_deceleration(self.motion.speed))
        hard = np.minimum.accumulate((-accel >= _HARD * full)[line.at_row])
        # Within the row's step it reaches the speed from which service braking suffices.
        hard[1:] |= hard[:-1]
        down: Bools = hard[line.row] & ((accel < 0.0) | (line.share == 0.0))
        return down

    def braking_deceleration(self, speed: Floats) -> Floats:
        """Deceleration by the brakes [m/s²]; drag helps but is no reserve, and wind may push."""
        model = self.model
        cap = braking_cap(model.vehicle, self.pose, self.brakes.friction, speed**2)
        force = np.minimum(self.brakes.force(speed), cap)
        terms = registry.motion(model.effect)
        pushed = registry.motion_deceleration(speed, self.line.curvature, self.line.heading, terms)
        given: Floats = GRAVITY * (force + self.pose.sine) + np.minimum(pushed, 0.0)
        return given

    def thrust_and_resistance(self) -> tuple[Floats, Floats]:
        """Highest thrust, and what slope, rolling and turning take of it [m/s²]."""
        vehicle, terrain = self.model.vehicle, self.model.terrain
        drags = 0.5 * terrain.lateral_resistance * vehicle.wheelbase
        skids = vehicle.drive == "skid_steer"
        turning = drags * np.abs(self.line.curvature) if skids else 0.0
        resistance = (terrain.motion_resistance + turning) * self.pose.normal_ratio
        speed = np.maximum(self.motion.speed, 1e-6)
        thrust = np.minimum(vehicle.max_drive_force, vehicle.max_drive_power / speed) / vehicle.mass
        return thrust, GRAVITY * (self.pose.sine + resistance)

    def speeds(self, speed_limit: Floats | None) -> None:
        line, speed = self.line, self.motion.speed
        allowed = np.minimum(self.model.limits.speed, self.brakes.trained_speed_max)
        if speed_limit is not None:
            # A limit holds from its row to its neighbours: between rows the higher one may be due.
            here = speed_limit[line.row]
            ahead = speed_limit[np.minimum(line.row + 1, len(speed_limit) - 1)]
            due = np.where(line.share > 0.0, np.maximum(here, ahead), here)
            allowed = np.minimum(allowed, due)
        sentence = "{0:.3f} m/s where {1:.3f} m/s is the highest"
        self.log.add("speed_limit", speed - allowed, sentence, speed, allowed, where=self.free)

        self._turns()
        max_rate = self.model.steering_geometry.max_rate
        needed = speed * self.turning.rate
        sentence = f"the steering turns at {{0:.2f}} rad/s, {max_rate:.2f} rad/s is its most"
        moving = self.motion.moving
        self.log.add("steering_rate", needed / max_rate - 1.0, sentence, needed, where=moving)

    def _turns(self) -> None:
        vehicle, limits, speed = self.model.vehicle, self.model.limits, self.motion.speed
        turn = speed**2 * np.abs(self.pose.turn)
        outward = GRAVITY * self.pose.cross_slope_ratio * np.sign(self.line.curvature)
        lateral, limit = turn + outward, limits.lateral_accel
        beyond = np.minimum(lateral / limit - 1.0, turn / limit - _TINY_TURN)
        sentence = "lateral acceleration of {0:.2f} m/s², {1:.2f} of it by the bank"
        self.log.add("lateral", beyond, sentence, lateral, outward, where=self.free)
        pressed = speed**2 * self.pose.vertical_curvature
        excess, sentence = (
            pressed / limits.vertical_accel - 1.0,
            "vertical acceleration of {0:.2f} m/s²",
        )
        self.log.add("dip", excess, sentence, pressed, where=self.free)
        skids = vehicle.drive == "skid_steer"
        track = self.model.terrain.slip_track if skids else vehicle.track_width
        rim = speed * (1.0 + 0.5 * np.abs(self.line.curvature) * track)
        excess, sentence = (
            rim / vehicle.max_wheel_speed - 1.0,
            "the outer wheels turn at {0:.2f} m/s",
        )
        self.log.add("wheel_speed", excess, sentence, rim, where=self.free)

    def drive(self, accel: Floats) -> None:
        (thrust, taken), moving = self.thrust_and_resistance(), self.motion.moving
        needed = accel + taken
        sentence = "needs {0:.2f} m/s² of the drive, which gives {1:.2f} m/s²"
        self.log.add("traction", needed - thrust, sentence, needed, thrust, where=moving)
        excess = accel - self.model.limits.accel
        self.log.add("accel", excess, "speeds up at {0:.2f} m/s²", accel, where=moving)

    def brakes_at(self, accel: Floats) -> None:
        given = self.braking_deceleration(self.motion.speed)
        slows = self.motion.moving & (accel < 0.0)
        sentence = "slows down at {0:.2f} m/s²"
        by_brakes = f"{sentence}, the brakes give {{1:.2f}} m/s²"
        self.log.add("decel", -accel - given, by_brakes, -accel, given, where=slows)
        self.log.add("decel", -accel - self.model.limits.decel, sentence, -accel, where=self.free)

    def friction(self, accel: Floats) -> None:
        if (self.brakes.friction < NO_LIMIT).any():
            along, speed_sq = accel / GRAVITY + self.pose.sine, self.motion.speed**2
            used = utilisation(self.pose, self.brakes.friction, speed_sq, along)
            sentence = "needs {0:.0%} of what friction gives"
            self.log.add("friction", used - 1.0, sentence, used, where=self.motion.moving)

    def loads(self, accel: Floats) -> None:
        """Loads while driving as planned; the front axle is checked under drive only."""
        crest, even = (
            shares_of(self.model.vehicle, self.pose, self.motion.speed**2, -accel, crest=crest)
            for crest in (True, False)
        )
        moving, min_load = self.motion.moving, self.model.limits.min_load
        for kind, noun, name, used in (
            ("tip_over", "rear axle", "rear", moving),
            ("tip_over", "front axle", "front", moving & (accel > 0.0)),
            ("rollover", "lighter side", "side", moving),
            ("rollover", "lightest wheel", "wheel", moving),
        ):
            shares = getattr(crest, name), getattr(even, name)
            add_load(self.log, kind, f"the {noun} keeps", shares, min_load, where=used)


def add_load(
    log: ViolationLog,
    kind: str,
    subject: str,
    shares: tuple[Floats, Floats],
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
