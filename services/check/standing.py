"""Where stops end: before the clear distance, on ground that is known, where brakes hold."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.parameters import Model
from slopewise.services.check.brakes import Brakes
from slopewise.services.check.driving import add_load
from slopewise.services.check.friction import braking_cap
from slopewise.services.check.ground import LineGround
from slopewise.services.check.motion import Motion
from slopewise.services.check.report import Ledger
from slopewise.services.check.stop_field import StopField
from slopewise.services.check.stops import StopEnds, stops_as_told, stops_from

_TRAINED = np.deg2rad(0.6)  # beyond what was trained, between two rows
_ON = 2.0  # [m] that a stop is followed beyond the clear distance
_NOTHING = -np.inf


class JudgedStops(NamedTuple):
    """Stops from the N rows as plans tell them: distances with the safety offset, and rear loads.

    Where the plan rests they are 0 and 1. ``lanes`` counts the stops from all samples.
    """

    distance: Floats
    rear: Floats
    lanes: int


def judge_stops(
    ledger: Ledger,
    field: StopField,
    ground: LineGround,
    motion: Motion,
    clear: Floats,
    rows: Ints,
) -> JudgedStops:
    """Drive an emergency stop from every sample that moves, and note what it breaks.

    Args:
        clear: (M,) station before which a stop from each sample has to end [m].
        rows: (N,) samples of the plan's rows.
    """
    brakes, model = field.brakes, field.model
    moving = motion.moving & ground.known
    lanes = np.flatnonzero(moving)
    if len(lanes) == 0:
        return JudgedStops(np.zeros(len(rows)), np.ones(len(rows)), 0)
    start = ground.station[lanes]
    give_up = float(clear[lanes].max()) + _ON
    stops = stops_from(field, start, motion.speed[lanes], brakes.dead_time[lanes], give_up)
    end = stops.end + brakes.offset
    longest = np.zeros(len(clear))
    longest[lanes] = end - start

    def spread(values: Floats, fill: float = _NOTHING) -> Floats:
        out = np.full(len(clear), fill)
        out[lanes] = values
        return out

    excess = np.where(stops.ended, end - clear[lanes], np.maximum(end - clear[lanes], _ON))
    ledger.add(
        "stopping_path",
        spread(excess),
        "a stop from {0:.2f} m/s ends {1:.2f} m on, {2:.2f} m are clear",
        motion.speed,
        longest,
        clear - ground.station,
    )
    for kind, barred, words in _bars(ground, brakes, model):
        ahead = _next_barred(barred, ground.station)
        ledger.add(
            kind,
            spread(end - ahead[lanes]),
            f"a stop from {{0:.2f}} m/s ends {{1:.2f}} m on, beyond {words} {{2:.2f}} m ahead",
            motion.speed,
            longest,
            ahead - ground.station,
        )
    _loads_on(ledger, model, stops, lanes, len(clear))
    _hold_at(ledger, field, stops, spread)
    distance, rear = np.zeros(len(rows)), np.ones(len(rows))
    own = moving[rows]
    first = rows[own]
    told = stops_as_told(
        field, ground.station[first], motion.speed[first], brakes.dead_time[first], give_up
    )
    distance[own], rear[own] = told.end + brakes.offset - ground.station[first], told.rear
    return JudgedStops(distance, rear, len(lanes))


def judge_places(
    ledger: Ledger, model: Model, ground: LineGround, brakes: Brakes, motion: Motion
) -> None:
    """Note where the plan drives on ground that bars it."""
    for kind, barred, words in _bars(ground, brakes, model):
        length = _run_length(motion.moving & barred, ground.station)
        ledger.add(kind, length, f"drives {{0:.2f}} m on {words}", length)


def _bars(ground: LineGround, brakes: Brakes, model: Model) -> list[tuple[str, Bools, str]]:
    bars = [
        ("unknown_terrain", ~ground.known, "unknown ground"),
        ("unknown_terrain", ~ground.body_known, "unknown ground below the body"),
        ("model_validity", brakes.leaning > _TRAINED, "side slopes that it was not trained on"),
    ]
    if not model.braking.extrapolate:
        words = "grades that it was not trained on"
        bars.append(("model_validity", brakes.steeper > _TRAINED, words))
    else:
        del bars[2]
    return bars


def _next_barred(barred: Bools, station: Floats) -> Floats:
    """(M,) station of the first barred sample after each sample, inf if there is none."""
    ahead = np.where(barred, station, np.inf)
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


def _loads_on(ledger: Ledger, model: Model, stops: StopEnds, lanes: Ints, count: int) -> None:
    least = model.limits.min_load
    counts = np.zeros(count, np.bool_)
    counts[lanes] = True
    loads = (
        ("tip_over", "rear axle", stops.rear, stops.rear_even),
        ("rollover", "lighter side", stops.side, stops.side_even),
        ("rollover", "lightest wheel", stops.wheel, stops.wheel_even),
    )
    for kind, what, share, even in loads:
        both = np.ones((2, count))
        both[:, lanes] = share, even
        words = f"on a stop the {what} keeps"
        add_load(ledger, kind, words, (both[0], both[1]), least, counts)


def _hold_at(ledger: Ledger, field: StopField, stops: StopEnds, spread: object) -> None:
    """Brakes and friction have to hold the vehicle where its stops end."""
    assert callable(spread)
    here = field.at(stops.end)
    zero = np.zeros(len(stops.end))
    held = np.minimum(
        field.force(here, zero), braking_cap(field.model.vehicle, here.pose, here.friction, zero)
    )
    slope = np.abs(here.pose.sine)
    words = "a stop ends where {0:.3f} of the weight has to be held, {1} {2:.3f}"
    lack = np.where(stops.ended, slope - held, _NOTHING)
    ledger.add(
        "holding",
        spread(lack),
        words.replace("{1}", "brakes hold"),
        spread(slope, 0.0),
        spread(slope, 0.0),
        spread(held, 0.0),
    )
    pull = np.hypot(here.pose.sine, here.pose.tilt)
    grip = here.friction * here.pose.upright
    lack = np.where(stops.ended, pull - grip, _NOTHING)
    ledger.add(
        "holding",
        spread(lack),
        words.replace("{1}", "friction holds"),
        spread(pull, 0.0),
        spread(pull, 0.0),
        spread(grip, 0.0),
    )
