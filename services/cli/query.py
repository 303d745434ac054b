"""`slopewise query`: plans of a running service along candidate paths."""

from __future__ import annotations

import logging
import math
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from slopewise.models.errors import InputError, ParameterError
from slopewise.services.cli import options
from slopewise.services.cli.command import ExitStatus, print_result
from slopewise.services.cli.options import option
from slopewise.services.cli.tables import line, number, table

if TYPE_CHECKING:
    from slopewise.models.candidate_path import CandidatePath
    from slopewise.services.client import ClientAnswer, PlanClient
    from slopewise.services.io.no_data import NoData
    from slopewise.services.wire.plan_messages import MapUpdate
    from slopewise.services.wire.plan_messages import Path as PathMessage

_log = logging.getLogger("slopewise")
_PERIOD = 0.01
"""Pause between requests for the version of the map [s]; a request takes about as long."""


def query(
    path_file: options.PathFile,
    connect: options.Connect = "tcp/127.0.0.1:7447",
    namespace: options.Namespace = "slopewise/robot",
    speed: options.StartSpeed = 0.0,
    clear: options.ClearDistance = math.inf,
    map_file: Annotated[
        Path | None, option("Elevation map to send before.", "MAP", "--map")
    ] = None,
    nodata: options.NoDataValue = None,
    timeout: options.Timeout = 2.0,
    zenoh_file: options.ZenohFile = "",
    as_json: options.AsJson = False,
) -> ExitStatus | None:
    """Request plans along candidate paths from a running service.

    Without a reply in time the result is the client's own stop. Status 3: no plan may be driven.

    [bold]Example[/]  slopewise query paths.csv --map hill.tif --speed 2
    """
    from slopewise.services.client import PlanClient
    from slopewise.services.io.path_file import read_paths
    from slopewise.services.wire.connect import client_session

    if not 0.0 <= speed < math.inf:
        raise InputError("--speed", "", f"expected a finite start speed >= 0 [m/s], got {speed}")
    paths = [_message(path) for path in read_paths(path_file)]
    update = None if map_file is None else _map_update(map_file, nodata)
    with client_session(connect, zenoh_file) as session:
        try:
            client = PlanClient(session, namespace=namespace, timeout=timeout)
        except ParameterError as error:
            raise InputError(f"--{error.field}", "", f"expected {error.expected}") from None
        with client:
            if update is not None:
                _send_map(client, update, timeout)
            outcome = client.plan(speed, paths, clear=None if math.isinf(clear) else clear)
    print_result(as_json, _summary(outcome), _tables(outcome))
    plans = [] if outcome.reply is None else outcome.reply.plans
    is_admissible = any(p.status != "infeasible" and p.progress > 0.0 for p in plans)
    return None if is_admissible else ExitStatus.NOT_ADMISSIBLE


def _message(path: CandidatePath) -> PathMessage:
    """A candidate as the service requires it: a straight line of two points gets a third."""
    import numpy as np

    from slopewise.services.wire.plan_messages import Path as PathMessage

    points, limit = path.points, path.speed_limit
    if len(points) == 2:
        points = np.stack([points[0], points.mean(axis=0), points[1]])
        # The first limit holds up to the second point, so the lower limit is used from there.
        limit = None if limit is None else np.array([limit[0], limit.min(), limit[1]])
    return PathMessage(name=path.name, points=points, speed_limit=limit)


def _map_update(map_file: Path, nodata: NoData) -> MapUpdate:
    from slopewise.services.io.map_file import read_map
    from slopewise.services.wire.map_message import update_of

    ground = read_map(map_file, nodata=nodata)
    for assumption in ground.assumed:
        _log.warning("%s: %s", map_file, assumption)
    return update_of(ground, f"query-{os.getpid()}-{time.time_ns()}", 1)


def _send_map(client: PlanClient, update: MapUpdate, timeout: float) -> None:
    """Send a map, and wait until the service plans with it and no other ground."""

    def version() -> int:
        reply = client.plan(0.0, []).reply
        return 0 if reply is None else reply.map_version

    before = version()
    client.put_map(update)
    until = time.monotonic() + timeout
    while version() == before:
        if time.monotonic() > until:
            raise InputError("--map", "", "expected a service that accepts it, got none in time")
        time.sleep(_PERIOD)


def _summary(outcome: ClientAnswer) -> object:
    """The reply unchanged, or the client's own stop."""
    if outcome.reply is not None:
        return outcome.reply
    stop = outcome.stop
    assert stop is not None
    profile = {"time": stop.time.tolist(), "speed": stop.speed.tolist()}
    return {"status": "safe_stop", "reason": stop.reason, "distance": stop.distance, **profile}


def _tables(outcome: ClientAnswer) -> Iterator[Any]:
    """One row per plan, then flags and reasons."""
    if outcome.reply is None:
        assert outcome.stop is not None
        message = f"own stop within {outcome.stop.distance:.2f} m: {outcome.stop.reason}"
        yield line(message, "red")
        return
    reply = outcome.reply
    yield from table(
        ("candidate", "status", "time [s]", "reaches [m]", "margin [m]", "reason"),
        (
            (
                plan.candidate,
                plan.status,
                f"{plan.travel_time:.2f}",
                f"{plan.progress:.1f}",
                number(plan.least_margin, ".2f"),
                plan.reason,
            )
            for plan in reply.plans
        ),
        title=f"{reply.service}: {reply.status}, in {1e3 * outcome.seconds:.1f} ms",
        left=("status", "reason"),
    )
    for note in (*reply.flags, *(c.reason for c in reply.ranking if not c.usable)):
        yield line(note)
