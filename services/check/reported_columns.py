"""Check reported columns against what follows from positions, speeds and map."""

from __future__ import annotations

import re

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.services.check.check_report import ViolationLog
from slopewise.services.check.checked_drive import CheckedDrive
from slopewise.services.check.external_plan import COLUMNS, STANDSTILL_SPEED, TEXT, ExternalPlan
from slopewise.services.check.plan_line import (
    CURVATURE,
    CURVATURE_SHARE,
    even_steps,
    evenly_between,
)
from slopewise.services.check.speed_claims import MOTION
from slopewise.services.check.stop_ends import CheckedStops

_NOTED = 0.1  # [m] longer reported stops are worth a note: ten times the tolerance of stations
_UNEVEN = 0.025  # share of a stop that grades between rows change, most where brakes are weak
_STATION, _STATION_SHARE = 0.01, 0.002  # [m], [1] of stations: heights between rows
_TURNED = np.deg2rad(2.0)  # [rad] of slopes where a body trails: its first heading is assumed
_MORE, _MORE_DISTANCE, _MORE_LOAD = 1.0, 0.5, 0.3  # [1], [m], [1] margins beyond the worst stop
_SHORT = 3.0  # [m] before the end of its path where a plan may rest, next to the offset of stops
_PLACE = 0.2  # [m] of a place in a reason: a digit after the point, and stations
_STATUSES = ("ok", "blocked", "degraded", "infeasible")


def check_columns(log: ViolationLog, drive: CheckedDrive) -> None:
    """Note where stations, heights, slopes, turns, accelerations and times contradict the rest.

    Slopes count up to the clear distance: those beyond may be next to unknown ground.
    Sizes are shares of what is allowed, see :data:`slopewise.services.check.tolerances.TOLERANCES`.
    """
    plan, line, ground = drive.plan, drive.line, drive.ground
    rows = line.at_row
    steps = np.diff(line.flat[rows])
    station, known, even = ground.station[rows], ground.known[rows], evenly_between(steps)

    def compare(
        name: str,
        given: Floats | None,
        expected: Floats,
        allowed: Floats | float,
        where: Bools | bool = True,
        noun: str = "",
    ) -> None:
        """Note rows (n <= N) where a column is farther off than is allowed."""
        if given is None:
            return
        sentence = (
            f"{noun or name} is {{0:.4g}} in the plan, {{1:.4g}} by positions, speeds and map"
        )
        given = given[: len(expected)]
        excess, at = np.abs(given - expected) / allowed, rows[: len(expected)]
        log.add("columns", excess, sentence, given, expected, where=where, at=at)

    # A row put between two others takes its height from the map, not from their chord.
    chord = 0.0 if even_steps(steps).all() else 0.03
    allowed = _STATION + _STATION_SHARE * (station - station[0])
    compare("station", plan.station, station, allowed + chord)
    compare("z", plan.z, ground.z[rows], 0.02, known)
    slopes = np.deg2rad(0.6) + _TURNED * line.body.start_error[rows]
    level = known & even & (plan.clear_distance is None or station <= plan.clear_distance)
    compare("grade", plan.grade, ground.grade[rows], slopes, level)
    compare("roll", plan.roll, ground.roll[rows], slopes, level)
    allowed = CURVATURE + CURVATURE_SHARE * np.abs(line.curvature[rows])
    compare("curvature", plan.curvature, line.curvature[rows], allowed, even)
    step = np.diff(station)
    accel = 0.5 * np.diff(plan.speed**2) / step
    compare("accel", plan.accel, accel, 0.03 + 0.03 * np.abs(accel))
    speed_sum = plan.speed[1:] + plan.speed[:-1]
    moves = speed_sum > STANDSTILL_SPEED
    duration = np.divide(2.0 * step, speed_sum, out=np.zeros_like(step), where=moves)
    reported = None if plan.time is None else np.diff(plan.time)
    compare("time", reported, duration, 0.02 + 0.005 * duration, moves, "time to the next")


def check_reported_stops(
    log: ViolationLog, drive: CheckedDrive, stops: CheckedStops, moving: Bools
) -> None:
    """Note reported stops and loads that the model does not give, between its mean and the worst.

    A plan with margins allows for surfaces, crests and scatter: it reports more than the mean stop.
    """
    plan, rows = drive.plan, drive.line.at_row
    used = moving[rows] & (plan.speed > 0.0)
    nominal, worst, gone = stops.nominal, stops.worst, 0.0
    if plan.status == "infeasible":  # It brakes already: the remainder of the stop from its start.
        gone, used = drive.ground.station[rows] - drive.ground.station[0], used & used[0]
        nominal, worst = (np.repeat(of[:, :1], len(rows), axis=1) for of in (nominal, worst))
    distance, (shortest, rear, side) = plan.stop_distance, nominal
    longest, (lightest_rear, lightest_side) = worst[0], -_highest_around(-worst[1:])
    uneven = _UNEVEN * shortest
    more = _MORE_DISTANCE + _offset_beyond(drive) + plan.speed * _later_onset(drive)
    shortest, longest = shortest - gone, longest * (1.0 + _MORE) + more - gone
    for kind, reported, min_value, max_value, slack in (
        ("stop_distance", distance, shortest, longest, uneven),
        ("rear_load", plan.rear_load, lightest_rear - _MORE_LOAD, rear, 0.0),
        ("side_load", plan.side_load, lightest_side - _MORE_LOAD, side, 0.0),
    ):
        if reported is None:
            continue
        expected = np.where(reported < min_value, min_value, max_value)
        excess = np.where(reported < min_value, min_value - reported, reported - max_value) - slack
        sentence = f"{kind} is {{0:.3f}} in the plan, {{1:.3f}} by the model"
        log.add(kind, excess, sentence, reported, expected, where=used, at=rows)
    if distance is not None:
        longer = np.where(used, distance - shortest, 0.0)
        if longer.max() > _NOTED:
            log.notes.append(
                f"reported stopping distances are up to {longer.max():.2f} m longer than by the "
                "model's mean, as in a plan with margins"
            )


def _later_onset(drive: CheckedDrive) -> Floats:
    """By how much the dead time of a row before or behind is longer, which plans count, too [s]."""
    times = drive.field.brakes.dead_time[drive.line.at_row]
    return _highest_around(times) - times


def _highest_around(values: Floats) -> Floats:
    """Of rows (…, N), each with the one before and the one behind it."""
    rows = np.concatenate((values[..., :1], values, values[..., -1:]), axis=-1)
    highest: Floats = np.maximum(np.maximum(rows[..., :-2], rows[..., 2:]), values)
    return highest


def _offset_beyond(drive: CheckedDrive) -> float:
    """By how much the safety offset of a surface behind the rows may be longer than theirs [m].

    A plan counts the longest of its whole path, and its rows end at the clear distance.
    """
    braking = drive.field.model.braking
    longest = max(table.distance_offset for table in (braking, *map(braking.on, braking.terrain)))
    return max(longest - drive.field.brakes.offset, 0.0)


def check_clear_distance(
    log: ViolationLog,
    drive: CheckedDrive,
    blocked: Bools,
    steps: Bools,
    cell: float,
    step_length: float,
) -> None:
    """Note clear distances beyond the first blocked sample, or beyond the rows.

    Args:
        log: receives them. drive: the plan on its ground.
        blocked, steps: (M,) samples that must not be driven, and those where a wheel meets a step.
        cell: edge of a cell of the map [m].
        step_length: over which a step rises, so that its place is known to a half of it [m].
    """
    plan, ground, rows = drive.plan, drive.ground, drive.line.at_row
    if plan.clear_distance is None:
        return
    clear = plan.clear_distance
    station = ground.station[rows]
    # A plan that is blocked may end up to two rows, or a cell, before the clear distance does.
    step = 0.0 if plan.status == "ok" else max(2.0 * float(np.diff(station).max()), cell)
    allowed = _STATION + _STATION_SHARE * (station[-1] - station[0])
    first = min(
        float(np.where(blocked, ground.station, np.inf).min()),
        float(np.where(steps, ground.station, np.inf).min()) + 0.5 * step_length,
    )
    end = min(float(station[-1]) + step, first) + allowed
    cause = "rows end" if end - allowed < first else "known ground without obstacles ends"
    sentence = f"clear_distance is {{0:.2f}} m in the plan, where {cause} at {end - allowed:.2f} m"
    log.add("clear_distance", clear - end, sentence, clear, at=rows)


def check_status(log: ViolationLog, drive: CheckedDrive) -> None:
    """Note a status or reason that rows, and each other, contradict; infeasible is never driven."""
    plan, ground, rows = drive.plan, drive.ground, drive.line.at_row
    status, reason = plan.status, plan.reason
    moving = np.flatnonzero(plan.speed > 0.0)
    rest = min(int(moving[-1]) + 1, len(rows) - 1) if len(moving) else 0
    at_rest, end = (float(ground.station[rows[k]]) for k in (rest, -1))
    named = set() if plan.limiting is None else set(plan.limiting[rest:])
    place = re.search(r"stops at ([\d.]+) m of ([\d.]+) m", reason or "")
    wrong = {
        "even full braking from the start speed needs more room than there is": (
            status == "infeasible"
        ),
        "the plan is at rest well before its rows end": (
            status == "ok" and end - at_rest > drive.field.brakes.offset + _SHORT
        ),
        f"limiting is {', '.join(sorted(named))} where it rests": (
            status == "ok" and not named <= {"stopping_path", *MOTION}
        ),
        "there is a reason not to be": status == "ok" and bool(reason),
        "there is no reason": status in _STATUSES[1:] and reason == "",
        "the place of the reason is not where the rows end": (
            place is not None
            and (
                abs(float(place[1]) - at_rest + ground.station[0]) > _PLACE
                or float(place[2]) + _PLACE < end - ground.station[0]
                or float(place[1]) > float(place[2])
            )
        ),
    }
    for cause, false in wrong.items():
        sentence = f"status is {status}: {cause}"
        log.add("status", np.full(1, 1.0 * false), sentence, at=rows[rest : rest + 1])


def verified_columns(plan: ExternalPlan) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Columns of a plan that were verified, and the others that it has."""
    given = [name for name in COLUMNS if getattr(plan, name) is not None]
    given += [name for name in TEXT if getattr(plan, name)]
    trusted = {
        "speed_limit",
        "path_deviation",
        *(() if plan.status in _STATUSES else ("status", "reason")),
    }
    verified = tuple(name for name in given if name not in trusted)
    return verified, (*(name for name in given if name in trusted), *plan.unread)
