"""`slopewise query`: ask a running service for plans along candidate paths."""

from __future__ import annotations

import logging
import os
import time
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from rich.console import Console
from rich.table import Table

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.errors import InputError, ParameterError
from slopewise.services.cli.arguments.robot import QueryOptions
from slopewise.services.client import ClientAnswer, PlanClient
from slopewise.services.io.map_file import read_map
from slopewise.services.io.no_data import NoData, nodata_of
from slopewise.services.io.path_file import read_paths
from slopewise.services.wire import plan_messages
from slopewise.services.wire.connect import client_session
from slopewise.services.wire.plan_messages import MapUpdate

_log = logging.getLogger("slopewise")
_PAUSE = 0.01


def run(job: QueryOptions) -> ClientAnswer:
    """Send the map, if there is one, and ask.

    Raises:
        InputError: a file or option cannot be used, or nobody is there.
    """
    paths = [_message(path) for path in read_paths(job.path_file)]
    nodata = nodata_of(job.nodata)
    update = None if job.map_file is None else _update(job.map_file, nodata)
    with client_session(job.connect, job.zenoh_file) as session:
        try:
            client = PlanClient(session, namespace=job.namespace, timeout=job.timeout)
        except ParameterError as error:
            raise InputError(f"--{error.field}", "", f"expected {error.expected}") from None
        with client:
            if update is not None:
                _bring(client, update, job.timeout)
            return client.plan(job.speed, paths, clear=job.clear)


def _message(path: CandidatePath) -> plan_messages.Path:
    """A candidate as the service wants it: a straight line of two points gets a third."""
    points, limit = path.points, path.speed_limit
    if len(points) == 2:
        points = np.stack([points[0], points.mean(axis=0), points[1]])
        # The first limit holds up to the second point, so the lower one is never left out.
        limit = None if limit is None else np.array([limit[0], limit.min(), limit[1]])
    return plan_messages.Path(name=path.name, points=points, speed_limit=limit)


def _bring(client: PlanClient, update: MapUpdate, timeout: float) -> None:
    """Send a map, and wait until plans are made from it.

    Raises:
        InputError: that did not happen in time; plans would be of other ground.
    """
    before = _map_version(client)
    client.put_map(update)
    until = time.monotonic() + timeout
    while _map_version(client) == before:
        if time.monotonic() > until:
            raise InputError("--map", "", "expected a service that takes it up, got none in time")
        time.sleep(_PAUSE)


def _map_version(client: PlanClient) -> int:
    reply = client.plan(0.0, []).reply
    return 0 if reply is None else reply.map_version


def _update(file: Path, nodata: NoData) -> MapUpdate:
    ground = read_map(file, nodata=nodata)
    for assumption in ground.assumed:
        _log.warning("%s: %s", file, assumption)
    return MapUpdate(
        source=f"query-{os.getpid()}-{time.time_ns()}",
        sequence=1,
        elevation=ground.elevation,
        resolution=ground.resolution,
        origin=ground.origin,
        terrain_class=ground.terrain_class,
        class_names=list(ground.class_names),
        height_std=ground.height_std,
    )


def admissible(outcome: ClientAnswer) -> bool:
    """Is there a plan that may be driven?"""
    return outcome.reply is not None and any(
        plan.status != "infeasible" and plan.progress > 0.0 for plan in outcome.reply.plans
    )


def as_json(outcome: ClientAnswer) -> dict[str, Any]:
    """The reply as it came, or the client's own stop."""
    if outcome.reply is not None:
        hook = lambda value: value.tolist()  # noqa: E731
        return dict(msgspec.to_builtins(outcome.reply, enc_hook=hook))
    stop = outcome.stop
    assert stop is not None
    columns = {"time": stop.time.tolist(), "speed": stop.speed.tolist()}
    return {"status": "safe_stop", "reason": stop.reason, "distance": stop.distance, **columns}


def show(outcome: ClientAnswer, console: Console) -> None:
    """A row a plan."""
    if outcome.reply is None:
        assert outcome.stop is not None
        console.print(
            f"[red]own stop[/] within {outcome.stop.distance:.2f} m: {outcome.stop.reason}"
        )
        return
    reply = outcome.reply
    table = Table(title=f"{reply.service}: {reply.status}, in {1e3 * outcome.seconds:.1f} ms")
    for title in ("candidate", "status", "time [s]", "reaches [m]", "margin [m]", "reason"):
        table.add_column(title)
    for plan in reply.plans:
        margin = "–" if plan.least_margin is None else f"{plan.least_margin:.2f}"
        numbers = (f"{plan.travel_time:.2f}", f"{plan.progress:.1f}", margin)
        table.add_row(plan.candidate, plan.status, *numbers, plan.reason)
    console.print(table)
    for note in (*reply.flags, *(c.reason for c in reply.ranking if not c.usable)):
        console.print(note)
