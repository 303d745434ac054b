"""Check reported columns against what follows from positions, speeds and map."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.services.check.check_report import ViolationLog
from slopewise.services.check.external_plan import STANDSTILL_SPEED, ExternalPlan
from slopewise.services.check.path_ground import LineGround
from slopewise.services.check.plan_line import Line
from slopewise.services.check.stop_ends import CheckedStops

_NOTED = 0.1  # [m] longer reported stops are worth a note: ten times the tolerance of stations
_UNEVEN = 0.025  # share of a stop that grades between rows change, most where brakes are weak
_EVEN = 0.02  # share of the step between rows: rounding in files


def check_columns(log: ViolationLog, plan: ExternalPlan, line: Line, ground: LineGround) -> None:
    """Note where stations, heights, slopes, turns, accelerations and times contradict the rest.

    Sizes are shares of what is allowed, see :data:`slopewise.services.check.tolerances.TOLERANCES`.
    """
    rows = line.at_row
    station, known, even = ground.station[rows], ground.known[rows], _evenly_between(line)

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
    chord = 0.0 if _even_steps(line).all() else 0.03
    compare("station", plan.station, station, 0.01 + chord + 0.002 * (station - station[0]))
    compare("z", plan.z, ground.z[rows], 0.02, known)
    compare("grade", plan.grade, ground.grade[rows], np.deg2rad(0.6), known & even)
    compare("roll", plan.roll, ground.roll[rows], np.deg2rad(0.6), known & even)
    curvature = line.curvature[rows]
    compare("curvature", plan.curvature, curvature, 0.02 + 0.1 * np.abs(curvature), even)
    step = np.diff(station)
    accel = 0.5 * np.diff(plan.speed**2) / step
    compare("accel", plan.accel, accel, 0.03 + 0.03 * np.abs(accel))
    speed_sum = plan.speed[1:] + plan.speed[:-1]
    moves = speed_sum > STANDSTILL_SPEED
    duration = np.divide(2.0 * step, speed_sum, out=np.zeros_like(step), where=moves)
    reported = None if plan.time is None else np.diff(plan.time)
    compare("time", reported, duration, 0.02 + 0.005 * duration, moves, "time to the next")


def _evenly_between(line: Line) -> Bools:
    """(N,) rows with even steps around: neither an end, nor put between two others to rest there.

    Such a row lies on the chord of its neighbours, with the mean of their slopes.
    """
    around = np.concatenate(([True, False], _even_steps(line), [False, True]))
    is_even: Bools = around[:-3] & around[1:-2] & around[2:-1] & around[3:]
    return is_even


def _even_steps(line: Line) -> Bools:
    steps = np.diff(line.flat[line.at_row])
    even: Bools = np.abs(steps / np.median(steps) - 1.0) < _EVEN
    return even


def check_reported_stops(
    log: ViolationLog, plan: ExternalPlan, line: Line, nominal: CheckedStops, moving: Bools
) -> None:
    """Note where the plan reports shorter stops, or more rear load, than the model gives.

    Longer ones are right: a plan with margins allows for surfaces, crests and scatter.
    """
    rows = line.at_row
    used = moving[rows] & (plan.speed > 0.0)
    uneven = _UNEVEN * nominal.distance
    for kind, reported, expected, sign, slack in (
        ("stop_distance", plan.stop_distance, nominal.distance, 1.0, uneven),
        ("rear_load", plan.rear_load, nominal.rear, -1.0, 0.0),
    ):
        if reported is not None:
            excess = sign * (expected - reported) - slack
            sentence = f"{kind} is {{0:.3f}} in the plan, {{1:.3f}} by the model"
            log.add(kind, excess, sentence, reported, expected, where=used, at=rows)
    if plan.stop_distance is not None:
        longer = np.where(used, plan.stop_distance - nominal.distance, 0.0)
        if longer.max() > _NOTED:
            log.notes.append(
                f"reported stopping distances are up to {longer.max():.2f} m longer than by the "
                "model's mean, as in a plan with margins"
            )
