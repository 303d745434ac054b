"""Check reported columns against what follows from positions, speeds and map."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.services.check.check_report import ViolationLog
from slopewise.services.check.external_plan import STANDSTILL_SPEED, ExternalPlan
from slopewise.services.check.path_ground import LineGround
from slopewise.services.check.plan_line import Line
from slopewise.services.check.stop_ends import CheckedStops

_NOTHING = -np.inf
_NOTED = 0.1  # [m] longer reported stops are worth a note: ten times the tolerance of stations
_UNEVEN = 0.025  # share of a stop that grades between rows change, most where brakes are weak
_EVEN = 0.02  # share of the step between rows: rounding in files


def check_columns(log: ViolationLog, plan: ExternalPlan, line: Line, ground: LineGround) -> None:
    """Note where stations, heights, slopes, turns, accelerations and times contradict the rest.

    Sizes are shares of what is allowed, see :data:`slopewise.services.check.tolerances.TOLERANCES`.
    """
    rows = line.at_row
    station, known = ground.station[rows], ground.known[rows]
    grown = station - station[0]
    comparison = _ColumnComparison(log, rows)
    if plan.station is not None:
        # A row put between two others takes its height from the map, not from their chord.
        chord = 0.0 if _even_steps(line).all() else 0.03
        comparison.compare("station", plan.station, station, 0.01 + chord + 0.002 * grown)
    if plan.z is not None:
        comparison.compare("z", plan.z, ground.z[rows], np.full(len(rows), 0.02), known)
    even = _evenly_between(line)
    for name, expected in (("grade", ground.grade[rows]), ("roll", ground.roll[rows])):
        given = getattr(plan, name)
        if given is not None:
            comparison.compare(
                name, given, expected, np.full(len(rows), np.deg2rad(0.6)), known & even
            )
    if plan.curvature is not None:
        expected = line.curvature[rows]
        tolerance = 0.02 + 0.1 * np.abs(expected)
        comparison.compare("curvature", plan.curvature, expected, tolerance, even)
    step = np.diff(station)
    if plan.accel is not None:
        expected = 0.5 * np.diff(plan.speed**2) / step
        comparison.compare("accel", plan.accel[:-1], expected, 0.03 + 0.03 * np.abs(expected))
    if plan.time is not None:
        speed_sum = plan.speed[1:] + plan.speed[:-1]
        moves = speed_sum > STANDSTILL_SPEED
        duration = np.divide(2.0 * step, speed_sum, out=np.zeros_like(step), where=moves)
        reported, tolerance = np.diff(plan.time), 0.02 + 0.005 * duration
        comparison.compare("time", reported, duration, tolerance, moves, "time to the next")


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


class _ColumnComparison:
    """Adds comparisons at rows to the log of samples."""

    def __init__(self, log: ViolationLog, rows: np.ndarray) -> None:
        self.log, self.rows = log, rows

    def compare(
        self,
        name: str,
        given: Floats,
        expected: Floats,
        allowed: Floats,
        used: Bools | None = None,
        noun: str = "",
    ) -> None:
        """Note rows (n <= N) where a column is farther off than is allowed."""
        excess = np.abs(given - expected) / allowed
        if used is not None:
            excess = np.where(used, excess, _NOTHING)
        rows = self.rows[: len(excess)]
        samples = len(self.log.row)

        def spread(values: Floats, fill: float = 0.0) -> Floats:
            out = np.full(samples, fill)
            out[rows] = values
            return out

        self.log.add(
            "columns",
            spread(excess, _NOTHING),
            f"{noun or name} is {{0:.4g}} in the plan, {{1:.4g}} by positions, speeds and map",
            spread(given),
            spread(expected),
        )


def check_reported_stops(
    log: ViolationLog, plan: ExternalPlan, line: Line, nominal: CheckedStops, moving: Bools
) -> None:
    """Note where the plan reports shorter stops, or more rear load, than the model gives.

    Longer ones are right: a plan with margins allows for surfaces, crests and scatter.
    """
    rows = line.at_row
    used = moving[rows] & (plan.speed > 0.0)
    samples = len(log.row)
    for kind, reported, expected, sign in (
        ("stop_distance", plan.stop_distance, nominal.distance, 1.0),
        ("rear_load", plan.rear_load, nominal.rear, -1.0),
    ):
        if reported is None:
            continue
        excess, numbers = np.full(samples, _NOTHING), np.zeros((2, samples))
        uneven = _UNEVEN * expected if kind == "stop_distance" else 0.0
        excess[rows] = np.where(used, sign * (expected - reported) - uneven, _NOTHING)
        numbers[:, rows] = reported, expected
        sentence = f"{kind} is {{0:.3f}} in the plan, {{1:.3f}} by the model"
        log.add(kind, excess, sentence, *numbers)
    if plan.stop_distance is not None:
        longer = np.where(used, plan.stop_distance - nominal.distance, 0.0)
        if longer.max() > _NOTED:
            log.notes.append(
                f"reported stopping distances are up to {longer.max():.2f} m longer than by the "
                "model's mean, as in a plan with margins"
            )
