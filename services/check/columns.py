"""What a plan says of itself beside positions and speeds, against what follows from them."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.services.check.given_plan import STANDS, GivenPlan
from slopewise.services.check.ground import LineGround
from slopewise.services.check.line import Line
from slopewise.services.check.report import Ledger
from slopewise.services.check.standing import JudgedStops

_NOTHING = -np.inf
_MUCH = 0.1  # [m]
_UNEVEN = 0.025  # of a stop, where brakes hardly slow it the ground between rows counts most
_EVEN = 0.02  # of the step between rows


def judge_columns(ledger: Ledger, plan: GivenPlan, line: Line, ground: LineGround) -> None:
    """Note where stations, heights, slopes, turns, accelerations and times contradict the rest.

    Sizes are shares of what is allowed, see :data:`slopewise.services.check.tolerances.TOLERANCES`.
    """
    rows = line.at_row
    station, known = ground.station[rows], ground.known[rows]
    grown = station - station[0]
    book = _Book(ledger, rows)
    if plan.station is not None:
        # A row put between two others takes its height from the map, not from their chord.
        chord = 0.0 if _even_steps(line).all() else 0.03
        book.compare("station", plan.station, station, 0.01 + chord + 0.002 * grown)
    if plan.z is not None:
        book.compare("z", plan.z, ground.z[rows], np.full(len(rows), 0.02), known)
    even = _evenly_between(line)
    for name, own in (("grade", ground.grade[rows]), ("roll", ground.roll[rows])):
        given = getattr(plan, name)
        if given is not None:
            book.compare(name, given, own, np.full(len(rows), np.deg2rad(0.6)), known & even)
    if plan.curvature is not None:
        own = line.curvature[rows]
        book.compare("curvature", plan.curvature, own, 0.02 + 0.1 * np.abs(own), even)
    step = np.diff(station)
    if plan.accel is not None:
        own = 0.5 * np.diff(plan.speed**2) / step
        book.compare("accel", plan.accel[:-1], own, 0.03 + 0.03 * np.abs(own))
    if plan.time is not None:
        both = plan.speed[1:] + plan.speed[:-1]
        moves = both > STANDS
        lasts = np.divide(2.0 * step, both, out=np.zeros_like(step), where=moves)
        told, close = np.diff(plan.time), 0.02 + 0.005 * lasts
        book.compare("time", told, lasts, close, moves, "time to the next")


def _evenly_between(line: Line) -> Bools:
    """(N,) rows with even steps around: neither an end, nor put between two others to rest there.

    Such a row lies on the chord of its neighbours, with the mean of their slopes.
    """
    around = np.concatenate(([True, False], _even_steps(line), [False, True]))
    found: Bools = around[:-3] & around[1:-2] & around[2:-1] & around[3:]
    return found


def _even_steps(line: Line) -> Bools:
    steps = np.diff(line.flat[line.at_row])
    even: Bools = np.abs(steps / np.median(steps) - 1.0) < _EVEN
    return even


class _Book:
    """Puts comparisons at rows into the ledger of samples."""

    def __init__(self, ledger: Ledger, rows: np.ndarray) -> None:
        self.ledger, self.rows = ledger, rows

    def compare(
        self,
        name: str,
        given: Floats,
        own: Floats,
        allowed: Floats,
        counts: Bools | None = None,
        words: str = "",
    ) -> None:
        """Note rows (n <= N) where a column is farther off than is allowed."""
        off = np.abs(given - own) / allowed
        if counts is not None:
            off = np.where(counts, off, _NOTHING)
        rows = self.rows[: len(off)]
        samples = len(self.ledger.row)

        def spread(values: Floats, fill: float = 0.0) -> Floats:
            out = np.full(samples, fill)
            out[rows] = values
            return out

        self.ledger.add(
            "columns",
            spread(off, _NOTHING),
            f"{words or name} is {{0:.4g}} in the plan, {{1:.4g}} by positions, speeds and map",
            spread(given),
            spread(own),
        )


def judge_told_stops(
    ledger: Ledger, plan: GivenPlan, line: Line, judged: JudgedStops, moving: Bools
) -> None:
    """Note where the plan tells shorter stops, or more rear load, than the model gives.

    Stops may be told longer: surfaces, crests and scatter are met with margins by careful plans.
    """
    rows = line.at_row
    counts = moving[rows] & (plan.speed > 0.0)
    samples = len(ledger.row)
    for kind, told, own, sign in (
        ("stop_distance", plan.stop_distance, judged.distance, 1.0),
        ("rear_load", plan.rear_load, judged.rear, -1.0),
    ):
        if told is None:
            continue
        excess, numbers = np.full(samples, _NOTHING), np.zeros((2, samples))
        uneven = _UNEVEN * own if kind == "stop_distance" else 0.0
        excess[rows] = np.where(counts, sign * (own - told) - uneven, _NOTHING)
        numbers[:, rows] = told, own
        words = f"{kind} is {{0:.3f}} in the plan, {{1:.3f}} by the model"
        ledger.add(kind, excess, words, *numbers)
    if plan.stop_distance is not None:
        longer = np.where(counts, plan.stop_distance - judged.distance, 0.0)
        if longer.max() > _MUCH:
            ledger.notes.append(
                f"stopping distances are told up to {longer.max():.2f} m longer than the model's "
                "mean gives, as a plan with margins does"
            )
