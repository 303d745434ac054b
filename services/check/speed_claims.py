"""Reported speed bounds, and the rules that a plan names: is what they say true?

Both are tried out: at a speed a little lower, or higher, than the plan's every rule is
judged again at the rows. Rules of comfort that are not checked, obstacles, and what holds a vehicle
that rests are not verified.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import minimum_filter1d

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.services.check.body_on_line import ON_LINE
from slopewise.services.check.check_report import ViolationLog
from slopewise.services.check.checked_drive import CheckedDrive
from slopewise.services.check.driving_checks import DrivingChecks
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.plan_line import Motion
from slopewise.services.check.stop_ends import check_stops
from slopewise.services.check.stop_integration import StopEnds

RULES: dict[str, set[str]] = {
    "speed_limit": {"speed_limit"},
    "stopping_path": {"stopping_path", "unknown_terrain", "model_validity", "holding"},
    "tip_over": {"tip_over", "crest"},
    "rollover": {"rollover", "crest"},
    "lateral": {"lateral"},
    "wheel_speed": {"wheel_speed"},
    "traction": {"traction"},
    "unknown_terrain": {"stopping_path", "unknown_terrain"},
    "model_validity": {"speed_limit", "stopping_path", "model_validity"},
    "crest": {"crest", "dip", "tip_over", "rollover"},
    "friction": {"friction", "stopping_path", "rollover", "holding"},
    "steering": {"steering_rate"},
}
"""Kinds of violations that each rule's name stands for."""

MOTION = ("accel", "decel", "jerk", "traction")
"""Names of what holds back how the speed changes."""

UNTRIED = ("step", "clearance", "body", "roughness", "holding")
"""Names that are not tried out."""

_LESS, _LESS_SPEED = 0.9, 0.05  # [1], [m/s] below a bound that is tried: slopes between rows
_NEAR, _NEAR_SPEED = 1.05, 0.02  # [1], [m/s] above a speed where a rule binds
_FAR, _FAR_SPEED = 2.0, 1.0  # [1], [m/s] above a speed where a rule that does not bind is slack
_AT_BOUND = 5e-4  # of v²: half of what is at its bound to a planner
_BELOW_BOUND = 0.5  # of v²: planners lower bounds where their verifier objects
_STILL = 0.05  # [m/s²] of the acceleration, as its tolerance of columns
_FULL = 0.99  # of the acceleration that is allowed: rounding
_SERVICE = 1.01  # of the deceleration that is allowed: who brakes harder brakes fully
_SOME, _HALF = 0.1, 0.5  # of how fast speed may fall, and rise: less is not held back by that


def tried_speeds(plan: ExternalPlan) -> list[Floats]:
    """(N,) speeds to try: below the reported bound, above the speed, and far above it [m/s]."""
    none = np.zeros(len(plan.speed))
    bound = none if plan.speed_bound is None else plan.speed_bound
    lower = _LESS * bound - _LESS_SPEED
    # Where the bound is the speed itself it is judged as that.
    tried = [np.where(lower > plan.speed, lower, 0.0), none, none]
    if plan.limiting is not None:
        here = (plan.speed > 0.0) & np.isin(plan.limiting, list(RULES))
        tried[1] = np.where(here, _NEAR * plan.speed + _NEAR_SPEED, 0.0)
        tried[2] = np.where(here, _FAR * plan.speed + _FAR_SPEED, 0.0)
    return tried


def held_at_rows(drive: CheckedDrive, speed: Floats) -> Motion:
    """Speeds (N,) that are held at the rows, and rest between them."""
    tried = np.zeros(len(drive.line.x))
    tried[drive.line.at_row] = speed
    still = np.zeros_like(tried)
    return Motion(tried, still, still, (tried > 0.0) & drive.ground.known)


def breaches(drive: CheckedDrive, motion: Motion, stops: StopEnds) -> list[set[str]]:
    """(N,) kinds of rules that a motion of :func:`held_at_rows` breaks."""
    log = ViolationLog(drive.plan.name, drive.line.row, drive.ground.station)
    checks = DrivingChecks(log, drive, motion, motion.moving)
    checks.speeds()
    checks.traction(motion.accel)
    checks.loads(motion.accel)
    checks.friction(motion.accel)
    check_stops(log, drive, motion, stops)
    return log.kinds(len(drive.plan.x))


def check_speed_bound(log: ViolationLog, drive: CheckedDrive, broken: list[set[str]]) -> None:
    """Note bounds below the speed, and those that a rule forbids; lower ones are right.

    ``broken`` has the rules that a speed a little below the bound breaks at each row.
    """
    plan, rows = drive.plan, drive.line.at_row
    if plan.speed_bound is None:
        return
    bound, speed = plan.speed_bound, plan.speed
    sentence = "speed_bound is {0:.3f} m/s, the speed is {1:.3f} m/s"
    log.add("speed_bound", speed - bound, sentence, bound, speed, at=rows)
    for kind in sorted(set().union(*broken)):
        there = np.array([kind in kinds for kinds in broken])
        sentence = f"speed_bound is {{0:.3f}} m/s, which breaks {kind}"
        log.add("speed_bound", bound - speed, sentence, bound, where=there, at=rows)


def check_limiting(
    log: ViolationLog,
    drive: CheckedDrive,
    motion: Motion,
    near: list[set[str]],
    far: list[set[str]],
) -> None:
    """Note rows where the named rule is plainly slack while another one holds.

    ``near`` and ``far`` have the rules that speeds above the plan's break at each row.
    """
    plan, rows, speed = drive.plan, drive.line.at_row, drive.plan.speed
    if plan.limiting is None:
        return
    names = np.array(plan.limiting)
    # Who starts too fast, and brakes fully, is held by no rule there.
    service = motion.accel[rows] >= -_SERVICE * drive.field.model.limits.decel
    moves = motion.moving[rows] & drive.ground.known[rows] & service
    # A bound of the row before or behind holds on the way there as well.
    wider = [set().union(*far[max(k - 1, 0) : k + 2]) for k in range(len(far))]
    slower, faster, steady = _against_motion(drive, motion)
    # A line that rounds the corners of its path may slow down for who follows the path itself.
    leaves = plan.path_deviation is not None and plan.path_deviation.max() > ON_LINE
    own_limit = leaves and plan.speed_limit is None
    for name in sorted(set(plan.limiting)):
        here = moves & (names == name)
        sentence = f"limiting is {name}, which still allows {{0:.2f}} m/s; another rule holds"
        if name in RULES and name not in MOTION and not (own_limit and name == "speed_limit"):
            named = RULES[name]
            slack = np.array(
                [bool(n - named) and not f & named for n, f in zip(near, wider, strict=True)]
            )
            _false(log, here & slack, sentence, _FAR * speed + _FAR_SPEED, rows)
        elif name not in (*RULES, *MOTION, *UNTRIED):
            _false(log, names == name, f"limiting is {name!r}, which is no rule", speed, rows)
        _against_bound(log, drive, name, here)
        if name in MOTION:
            wrong = {"decel": slower, "accel": faster, "jerk": steady}.get(name, ~moves)
            what = "slows down" if name == "decel" else "speeds up"
            sentence = f"limiting is {name}, at {{0:.2f}} m/s² nothing there {what} as that says"
            _false(log, here & wrong, sentence, motion.accel[rows], rows)


def _against_bound(log: ViolationLog, drive: CheckedDrive, name: str, here: Bools) -> None:
    """Note names of bounds below the plan's named bound, and of changes of speed at it."""
    plan = drive.plan
    if plan.speed_bound is None or name == "traction":
        return
    energy, max_energy = plan.speed**2, plan.speed_bound**2
    short = (max_energy - energy) / np.maximum(max_energy, 0.05)
    # A bound that is lower at the row before or behind holds on the way there as well.
    near = minimum_filter1d(max_energy, 3)
    far_below = (near - energy) / np.maximum(near, 0.05) > _BELOW_BOUND
    sentence = f"limiting is {name} at {{0:.3f}} m/s, where speed_bound is {{1:.3f}} m/s"
    lower = far_below & (plan.status not in ("degraded", "infeasible"))
    wrong = here & (short < _AT_BOUND if name in MOTION else lower)
    _false(log, wrong, sentence, plan.speed, drive.line.at_row, plan.speed_bound)


def _against_motion(drive: CheckedDrive, motion: Motion) -> tuple[Bools, Bools, Bools]:
    """(N,) rows that plainly do not slow down or speed up as is allowed, or steadily do so."""
    rows, limits = drive.line.at_row, drive.field.model.limits
    lowest = np.minimum(motion.accel, motion.accel_before)
    highest = np.maximum(motion.accel, motion.accel_before)
    checks = DrivingChecks(ViolationLog("", rows, motion.speed), drive, motion, motion.moving)
    thrust, taken = checks.thrust_and_resistance()
    max_decel = np.minimum(limits.decel, checks.braking_deceleration())
    max_accel = np.minimum(limits.accel, thrust - taken)
    smoothed = "jerk" in (drive.plan.limiting or ())
    slower = lowest > _STILL - smoothed * _SOME * np.maximum(max_decel, 0.0)
    faster = (lowest < -_STILL) | (highest < smoothed * _HALF * max_accel - _STILL)
    steady = np.abs(motion.accel - motion.accel_before) < _STILL
    steady &= (highest > _FULL * limits.accel) | (lowest < -_FULL * limits.decel)
    return slower[rows], faster[rows], steady[rows]


def _false(
    log: ViolationLog,
    where: Bools,
    sentence: str,
    value: Floats,
    rows: Ints,
    second: Floats | None = None,
) -> None:
    false = np.ones(len(rows))
    values = (value, false if second is None else second)
    log.add("limiting", false, sentence, *values, where=where, at=rows)
