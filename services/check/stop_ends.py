"""Where stops end: before the clear distance, on ground that is known, where brakes hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.services.check.check_report import ViolationLog
from slopewise.services.check.checked_drive import CheckedDrive
from slopewise.services.check.driving_checks import LOADS, add_load
from slopewise.services.check.path_ground import LineGround
from slopewise.services.check.plan_line import Motion
from slopewise.services.check.stop_dynamics import StopDynamics
from slopewise.services.check.stop_integration import (
    StopEnds,
    StopStarts,
    nominal_stops,
    worst_case_stops,
)
from slopewise.services.physics.loads import braking_cap

_TRAINED = np.deg2rad(0.6)  # [rad] beyond the trained range: slopes between two rows
_OVERRUN = 2.0  # [m] that a stop is followed beyond the clear distance, for the size of a violation
_NOTHING = -np.inf


class CheckedStops(NamedTuple):
    """Stops from the N rows: distance with the safety offset [m], least rear and side load [1].

    Where the plan rests they are 0 and 1.
    """

    nominal: Floats  # (3, N)
    worst: Floats  # (3, N)
    lanes: int  # stops from all samples


def worst_stops(drive: CheckedDrive, motions: Sequence[Motion]) -> list[StopEnds]:
    """Emergency stops at worst from every sample that moves on known ground, of each motion."""
    lanes = [_lanes(drive.ground, motion) for motion in motions]
    together = np.concatenate(lanes)
    speed = np.concatenate([m.speed[at] for m, at in zip(motions, lanes, strict=True)])
    stops = worst_case_stops(drive.field, _starts(drive, together, speed))
    ends = np.cumsum([len(at) for at in lanes])
    parts = [np.split(values, ends[:-1], axis=-1) for values in stops]
    return [StopEnds(*columns) for columns in zip(*parts, strict=True)]


def _lanes(ground: LineGround, motion: Motion) -> Ints:
    return np.flatnonzero(motion.moving & ground.known)


def _starts(drive: CheckedDrive, lanes: Ints, speed: Floats) -> StopStarts:
    """Stops from samples (L,) at speeds (L,)."""
    give_up = float(drive.clear.max()) + _OVERRUN
    dead_time = drive.field.brakes.dead_time[lanes]
    return StopStarts(drive.ground.station[lanes], speed, dead_time, give_up)


def check_stops(log: ViolationLog, drive: CheckedDrive, motion: Motion, stops: StopEnds) -> None:
    """Note what the stops of a motion break."""
    ground, field, lanes = drive.ground, drive.field, _lanes(drive.ground, motion)
    start = ground.station[lanes]
    end, speed = stops.end + field.brakes.offset + field.errors.along_track, motion.speed[lanes]
    longest, free = end - start, drive.clear[lanes]
    excess = np.where(stops.ended, end - free, np.maximum(end - free, _OVERRUN))
    sentence = "a stop from {0:.2f} m/s ends {1:.2f} m on"
    far = f"{sentence}, {{2:.2f}} m are clear"
    log.add("stopping_path", excess, far, speed, longest, free - start, at=lanes)
    for kind, blocked, noun in blocking_ground(drive):
        ahead = _next_blocked(blocked, ground.station)[lanes]
        beyond = f"{sentence}, beyond {noun} {{2:.2f}} m ahead"
        log.add(kind, end - ahead, beyond, speed, longest, ahead - start, at=lanes)
    nouns = ("rear axle", "lighter side", "lightest wheel")
    for noun, *shares in zip(nouns, stops.min_loads, stops.even, strict=True):
        kind, subject = LOADS[noun], f"on a stop the {noun} keeps"
        add_load(log, kind, subject, shares, field.model.limits.min_load, at=lanes)
    _hold_at(log, field, stops, lanes)


def stops_at_rows(drive: CheckedDrive, motion: Motion, worst: StopEnds) -> CheckedStops:
    """Nominal stops from the rows, and those of ``worst`` that begin there."""
    ground, rows = drive.ground, drive.line.at_row
    moving = motion.moving & ground.known
    moves = moving[rows]
    first = rows[moves]
    start = ground.station[first]
    field = replace(drive.field, brakes=drive.field.brakes.on_rows(drive.line))
    stops = nominal_stops(field, _starts(drive, first, motion.speed[first]))
    lane = (np.cumsum(moving) - 1)[first]

    def at_rows(end: Floats, min_loads: Floats) -> Floats:
        out = np.tile([[0.0], [1.0], [1.0]], len(rows))
        out[:, moves] = end + drive.field.brakes.offset - start, *min_loads[:2]
        return out

    worst_case = at_rows(worst.end[lane], worst.min_loads[:, lane])
    return CheckedStops(at_rows(stops.end, stops.min_loads), worst_case, int(moving.sum()))


def check_places(log: ViolationLog, drive: CheckedDrive, motion: Motion) -> None:
    """Note where the plan drives on ground that blocks it."""
    for kind, blocked, noun in blocking_ground(drive):
        length = _run_length(motion.moving & blocked, drive.ground.station)
        log.add(kind, length, f"drives {{0:.2f}} m on {noun}", length)


def blocking_ground(drive: CheckedDrive) -> list[tuple[str, Bools, str]]:
    """Kinds of violations by ground that must not be driven: (M,) where, and a noun."""
    ground, brakes = drive.ground, drive.field.brakes
    kinds = [
        ("unknown_terrain", ~ground.known, "unknown ground"),
        ("unknown_terrain", ~ground.body_known, "unknown ground below the body"),
    ]
    if drive.field.model.braking.extrapolate:
        return kinds
    return [
        *kinds,
        ("model_validity", brakes.roll_excess > _TRAINED, "side slopes that it was not trained on"),
        ("model_validity", brakes.grade_excess > _TRAINED, "grades that it was not trained on"),
    ]


def _next_blocked(blocked: Bools, station: Floats) -> Floats:
    """(M,) station of the first blocked sample after each sample, inf without one."""
    ahead = np.where(blocked, station, np.inf)
    nearest = np.minimum.accumulate(ahead[::-1])[::-1]
    return np.append(nearest[1:], np.inf)


def _run_length(mask: Bools, station: Floats) -> Floats:
    """(M,) length of the stretch of marked samples that each is in, −inf where it is in none."""
    length = np.full(len(mask), _NOTHING)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int64), [0]))))
    for first, behind in edges.reshape(-1, 2).tolist():
        last = min(behind, len(station) - 1)
        length[first:behind] = station[last] - station[first]
    return length


def _hold_at(log: ViolationLog, field: StopDynamics, stops: StopEnds, lanes: Ints) -> None:
    """Note where brakes or friction do not hold the vehicle where its stops end."""
    here = field.at(stops.end)
    zero = np.zeros(len(stops.end))
    cap = braking_cap(field.model.vehicle, here.pose, here.friction, zero)
    for noun, pull, held in (
        ("brakes hold", np.abs(here.pose.sine), np.minimum(field.force(here, zero), cap)),
        (
            "friction holds",
            np.hypot(here.pose.sine, here.pose.cross_slope_ratio),
            here.friction * here.pose.normal_ratio,
        ),
    ):
        sentence = f"a stop ends where {{0:.3f}} of the weight has to be held, {noun} {{1:.3f}}"
        log.add("holding", pull - held, sentence, pull, held, where=stops.ended, at=lanes)
