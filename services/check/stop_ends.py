"""Where stops end: before the clear distance, on ground that is known, where brakes hold."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.parameters import Model
from slopewise.services.check.check_report import ViolationLog
from slopewise.services.check.driving_checks import add_load
from slopewise.services.check.friction import braking_cap
from slopewise.services.check.path_force import PathForce
from slopewise.services.check.path_ground import LineGround
from slopewise.services.check.planned_motion import Motion
from slopewise.services.check.stop_dynamics import StopDynamics
from slopewise.services.check.stop_integration import StopEnds, nominal_stops, worst_case_stops

_TRAINED = np.deg2rad(0.6)  # [rad] beyond the trained range: slopes between two rows
_OVERRUN = 2.0  # [m] that a stop is followed beyond the clear distance, for the size of a violation
_NOTHING = -np.inf


class CheckedStops(NamedTuple):
    """Nominal stops from the N rows: distances with the safety offset, and rear loads.

    Where the plan rests they are 0 and 1. ``lanes`` counts the stops from all samples.
    """

    distance: Floats
    rear: Floats
    lanes: int


def check_stops(
    log: ViolationLog,
    field: StopDynamics,
    ground: LineGround,
    motion: Motion,
    clear: Floats,
    rows: Ints,
) -> CheckedStops:
    """Drive an emergency stop from every sample that moves, and note what it breaks.

    Args:
        clear: (M,) station before which a stop from each sample has to end [m].
    """
    brakes, model = field.brakes, field.model
    lanes = np.flatnonzero(motion.moving & ground.known)
    if len(lanes) == 0:
        return CheckedStops(np.zeros(len(rows)), np.ones(len(rows)), 0)
    start = ground.station[lanes]
    give_up = float(clear[lanes].max()) + _OVERRUN
    stops = worst_case_stops(field, start, motion.speed[lanes], brakes.dead_time[lanes], give_up)
    end = stops.end + brakes.offset
    longest = np.zeros(len(clear))
    longest[lanes] = end - start

    def spread(values: Floats, fill: float = _NOTHING) -> Floats:
        out = np.full(len(clear), fill)
        out[lanes] = values
        return out

    excess = np.where(stops.ended, end - clear[lanes], np.maximum(end - clear[lanes], _OVERRUN))
    log.add(
        "stopping_path",
        spread(excess),
        "a stop from {0:.2f} m/s ends {1:.2f} m on, {2:.2f} m are clear",
        motion.speed,
        longest,
        clear - ground.station,
    )
    for kind, blocked, noun in _blocking_ground(ground, brakes, model):
        ahead = _next_blocked(blocked, ground.station)
        log.add(
            kind,
            spread(end - ahead[lanes]),
            f"a stop from {{0:.2f}} m/s ends {{1:.2f}} m on, beyond {noun} {{2:.2f}} m ahead",
            motion.speed,
            longest,
            ahead - ground.station,
        )
    _loads_on(log, model, stops, lanes, len(clear))
    _hold_at(log, field, stops, spread)
    return _nominal_at_rows(field, ground, motion, rows, give_up)._replace(lanes=len(lanes))


def _nominal_at_rows(
    field: StopDynamics, ground: LineGround, motion: Motion, rows: Ints, give_up: float
) -> CheckedStops:
    brakes = field.brakes
    distance, rear = np.zeros(len(rows)), np.ones(len(rows))
    moves = (motion.moving & ground.known)[rows]
    first = rows[moves]
    start = ground.station[first]
    stops = nominal_stops(field, start, motion.speed[first], brakes.dead_time[first], give_up)
    distance[moves], rear[moves] = stops.end + brakes.offset - start, stops.rear
    return CheckedStops(distance, rear, len(first))


def check_places(
    log: ViolationLog, model: Model, ground: LineGround, brakes: PathForce, motion: Motion
) -> None:
    """Note where the plan drives on ground that blocks it."""
    for kind, blocked, noun in _blocking_ground(ground, brakes, model):
        length = _run_length(motion.moving & blocked, ground.station)
        log.add(kind, length, f"drives {{0:.2f}} m on {noun}", length)


def _blocking_ground(
    ground: LineGround, brakes: PathForce, model: Model
) -> list[tuple[str, Bools, str]]:
    kinds = [
        ("unknown_terrain", ~ground.known, "unknown ground"),
        ("unknown_terrain", ~ground.body_known, "unknown ground below the body"),
        ("model_validity", brakes.roll_excess > _TRAINED, "side slopes that it was not trained on"),
    ]
    if not model.braking.extrapolate:
        noun = "grades that it was not trained on"
        kinds.append(("model_validity", brakes.grade_excess > _TRAINED, noun))
    else:
        del kinds[2]
    return kinds


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


def _loads_on(log: ViolationLog, model: Model, stops: StopEnds, lanes: Ints, count: int) -> None:
    used = np.zeros(count, np.bool_)
    used[lanes] = True
    loads = (
        ("tip_over", "rear axle", stops.rear, stops.rear_even),
        ("rollover", "lighter side", stops.side, stops.side_even),
        ("rollover", "lightest wheel", stops.wheel, stops.wheel_even),
    )
    for kind, what, share, even in loads:
        shares = np.ones((2, count))
        shares[:, lanes] = share, even
        subject = f"on a stop the {what} keeps"
        add_load(log, kind, subject, (shares[0], shares[1]), model.limits.min_load, used)


def _hold_at(log: ViolationLog, field: StopDynamics, stops: StopEnds, spread: object) -> None:
    """Note where brakes or friction do not hold the vehicle where its stops end."""
    assert callable(spread)
    here = field.at(stops.end)
    zero = np.zeros(len(stops.end))
    held = np.minimum(
        field.force(here, zero), braking_cap(field.model.vehicle, here.pose, here.friction, zero)
    )
    slope = np.abs(here.pose.sine)
    sentence = "a stop ends where {0:.3f} of the weight has to be held, {1} {2:.3f}"
    lack = np.where(stops.ended, slope - held, _NOTHING)
    log.add(
        "holding",
        spread(lack),
        sentence.replace("{1}", "brakes hold"),
        spread(slope, 0.0),
        spread(slope, 0.0),
        spread(held, 0.0),
    )
    pull = np.hypot(here.pose.sine, here.pose.cross_slope_ratio)
    grip = here.friction * here.pose.normal_ratio
    lack = np.where(stops.ended, pull - grip, _NOTHING)
    log.add(
        "holding",
        spread(lack),
        sentence.replace("{1}", "friction holds"),
        spread(pull, 0.0),
        spread(pull, 0.0),
        spread(grip, 0.0),
    )
