"""Stops streamed to the learning of the service, from brakes that lose force after 100 of them.

A generated vehicle is calibrated, then drives another session. Before each stop the distance that
plans allow is compared with its own, and with what the calibration alone allowed. Streams without
the loss show how often learning gives a false warning.
"""

from __future__ import annotations

from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console

from slopewise.models.arrays import Floats
from slopewise.models.calibration.learn import learn
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from slopewise.models.stop_logs.stop_stream import StopStream
from slopewise.services.parameters.braking_forces import BrakingForces
from slopewise.services.settings.learning_settings import Learning

from ..common.campaign import BenchmarkRequest, Progress, run_jobs
from ..common.text_tables import grouped, table_of
from .brake_kinds import BrakeVehicle, StopLog, drive_log, stream_log
from .margins import QUANTILES, ROUGH, allowed_distance, is_inside

STOPS, CHANGE, LOSS = 200, 100, 0.20  # of a stream; stops before the change; force lost [1]
_LOG = 40, 8  # stops and sessions of the log
_FIRST = 10_000  # number of the first vehicle
_STREAMS, _QUICK = 500, 24  # generated vehicles; the same in a short run
_LEARNED_AFTER = 2  # stops after the change that are not counted: they are the first to show it


class StreamResult(NamedTuple):
    """Excess over the stops of a stream, (n, Q) each, NaN outside what was trained [m]."""

    kind: str
    loss: float
    excess: Floats
    # by the calibration alone
    offline: Floats
    warned: bool  # before the change


def run(request: BenchmarkRequest, progress: Progress) -> dict[str, Any]:
    """Stream all, with and without the loss."""
    streams = _QUICK if request.quick else _STREAMS
    cases = [(_FIRST + i, loss) for loss in (LOSS, 0.0) for i in range(streams)]
    results = [r for r in run_jobs(stream_stops, cases, progress, "streaming stops") if r]
    worse = [r for r in results if r.loss]
    by_kind = grouped(worse, lambda row: row.kind)
    after, before = slice(CHANGE + _LEARNED_AFTER, None), slice(0, CHANGE)
    clean = [r for r in results if not r.loss]
    return {
        "quantiles": list(QUANTILES),
        "streams": len(worse),
        "refused": len(cases) - len(results),
        "before the loss": _compared(results, before),
        "two stops after it": _compared(worse, slice(CHANGE, CHANGE + _LEARNED_AFTER)),
        "from the third on": _compared(worse, after),
        "by_kind": {kind: _compared(rows, after) for kind, rows in by_kind.items()},
        "clean streams": len(clean),
        "clean streams with a warning": sum(r.warned for r in clean),
    }


def show(result: dict[str, Any], console: Console) -> None:
    """Print a row for each part of the streams and each kind of brakes."""
    columns = [f"beyond ÷ promised, {q:g}" for q in result["quantiles"]]
    columns += ["calibration alone, 0.99", "excess, 0.99 [m]", "calibration alone [m]"]
    table = table_of(f"{result['streams']} streams of {STOPS} stops", *columns)
    parts = {k: v for k, v in result.items() if isinstance(v, dict) and k != "by_kind"}
    for name, part in (parts | result["by_kind"]).items():
        cells = [f"{share:.2f}" for share in part["beyond_over_promised"]]
        cells.append(f"{part['offline_beyond_over_promised'][1]:.2f}")
        cells += [f"{part[key][1]:.2f}" for key in ("excess", "offline_excess")]
        table.add_row(name, *cells)
    console.print(table)
    warned, clean = result["clean streams with a warning"], result["clean streams"]
    console.print(f"{warned} of {clean} streams without a loss gave a warning")


def stream_stops(case: tuple[int, float]) -> StreamResult | None:
    """One stream, by its vehicle and the share of force lost; None where its log was refused."""
    (number, loss), vehicle = case, BrakeVehicle.generate(case[0])
    rng = np.random.default_rng([number, round(100.0 * loss)])
    log = drive_log(vehicle, *_LOG, rng)
    try:
        braking = learn(log.columns, log.runs, ROUGH, ground=log.ground).braking
    except ParameterError:
        return None
    stops = stream_log(vehicle, STOPS, CHANGE, loss, rng)
    forces = BrakingForces(braking, Learning())
    stream = StopStream(braking.dead_time)
    excess, offline, warned = [], [], False
    for i, samples in enumerate(stops.runs):
        excess.append(_excess(forces.planning_braking({}), stops, i))
        offline.append(_excess(braking, stops, i))
        stream.dead_time = forces.dead_time()
        rows = zip(*(stops.columns[n][samples] for n in ("t", "v", "v_cmd", "pitch")), strict=True)
        for t, v, command, pitch in rows:
            stop = stream.feed(t, v, command, pitch, -pitch)
            if stop is not None:
                forces.learn(stop, "", "robot", None)
        warned = warned or (i < CHANGE and bool(forces.flags()))
    inside = is_inside(braking, stops.speed, stops.grade)[:, None]
    ours, alone = (np.where(inside, np.array(rows), np.nan) for rows in (excess, offline))
    return StreamResult(vehicle.kind, loss, ours, alone, warned)


def _excess(braking: Braking, stops: StopLog, i: int) -> list[float]:
    """(Q,) allowed minus actual distance of a stop [m]."""
    stop = stops.speed[i : i + 1], stops.grade[i : i + 1]
    weaker = {q: NormalDist().inv_cdf(q) * braking.force_std for q in QUANTILES}
    allowed = [float(allowed_distance(braking, *stop, q, weaker[q])[0]) for q in QUANTILES]
    return [distance - float(stops.distance[i]) for distance in allowed]


def _compared(rows: list[StreamResult], part: slice) -> dict[str, Any]:
    promised = 1.0 - np.array(QUANTILES)
    ours, alone = (
        np.concatenate([getattr(r, name)[part] for r in rows]) for name in ("excess", "offline")
    )
    known = ~np.isnan(ours[:, 0])
    ours, alone = ours[known], alone[known]
    return {
        "stops": int(known.sum()),
        "beyond_over_promised": (np.mean(ours < 0.0, axis=0) / promised).tolist(),
        "offline_beyond_over_promised": (np.mean(alone < 0.0, axis=0) / promised).tolist(),
        "excess": np.mean(ours, axis=0).tolist(),
        "offline_excess": np.mean(alone, axis=0).tolist(),
    }
