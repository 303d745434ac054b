"""Round trip of a plan request over zenoh, between two processes on the loopback.

``python -m benchmarks.service.round_trip [--requests 500] [--candidates 20]``, each candidate of
100 points. The cost of the wire is the round trip minus the planner's own time, which the reply
contains. The service is not imported: both sides are commands and payloads as of any client.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import zenoh

from ..common.timing import free_port

_POINTS, _LENGTH = 100, 25.0  # of a candidate, [m]
_FORMAT = "application/msgpack;slopewise.{}.v1"
_WARM_UP = 20  # requests that are not timed


def measure(requests: int, candidates: int) -> dict[str, Any]:
    """Start a service, send requests, stop it; times in ms."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with tempfile.TemporaryDirectory() as folder:
        settings = Path(folder) / "service.toml"
        settings.write_text(
            f'model = "atv"\nnamespace = "bench"\n[zenoh]\nlisten = ["{endpoint}"]\n'
            "[planning]\ndeadline = 5.0\n"
        )
        start = time.perf_counter()
        command = [sys.executable, "-m", "slopewise.services.cli", "serve"]
        command += ["--config", str(settings)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            process.stdout.readline()
            started = time.perf_counter() - start
            return {"start": started, **_run(endpoint, _fan(candidates), requests)}
        finally:
            process.terminate()
            process.wait(10.0)


def _fan(candidates: int) -> list[np.ndarray]:
    along = np.linspace(0.0, _LENGTH, _POINTS)
    curvatures = np.linspace(-0.004, 0.004, candidates)
    return [np.stack([along, c * along**2], axis=1) for c in curvatures]


def _run(endpoint: str, fan: list[np.ndarray], requests: int) -> dict[str, Any]:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as session:
        ground = {"source": "bench", "sequence": 1, "elevation": _block(np.zeros((121, 241)))}
        ground |= {"resolution": 0.25, "origin": [-5.0, -15.0]}
        payload = msgspec.msgpack.encode(ground)
        session.put("bench/v1/map", payload, encoding=_FORMAT.format("map_update"))
        time.sleep(0.5)
        querier = session.declare_querier("bench/v1/plan", timeout=5.0, express=True)
        for _ in range(_WARM_UP):
            _once(querier, fan)
        result: dict[str, Any] = {}
        for client in ("", "robot"):
            times = np.array([_once(querier, fan, client) for _ in range(requests)])
            result["named" if client else "alone"] = _figures(times)
        return result


def _block(array: np.ndarray) -> dict[str, Any]:
    return {"shape": array.shape, "data": np.ascontiguousarray(array, "<f8").tobytes()}


def _once(querier: Any, fan: list[np.ndarray], client: str = "") -> tuple[float, float]:
    """Round trip, encoding and decoding included, and the planner's own time [s]."""
    start = time.perf_counter()
    paths = [{"name": f"c{j}", "points": _block(points)} for j, points in enumerate(fan)]
    request = {"speed": 1.0, "paths": paths, "client": client, "pose": [0.0, 0.0, 0.0]}
    payload = msgspec.msgpack.encode(request)
    (reply,) = querier.get(payload=payload, encoding=_FORMAT.format("plan_request"))
    plans = msgspec.msgpack.decode(reply.ok.payload.to_bytes())
    seconds = time.perf_counter() - start
    if plans["status"] not in ("ok", "degraded") or not plans["plans"]:
        raise RuntimeError(f"no plan: {plans['status']}: {plans['reason']}")
    return seconds, plans["seconds"]["planner"]


def _figures(times: np.ndarray) -> dict[str, float]:
    trip, planner = 1e3 * times.T
    wire = trip - planner
    columns = {"round_trip": trip, "planner": planner, "wire": wire}
    medians = {f"{name}_median": float(np.median(part)) for name, part in columns.items()}
    tail = {"wire_p99": float(np.percentile(wire, 99)), "wire_max": float(wire.max())}
    return medians | tail | {"questions": len(wire)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--requests", type=int, default=500)
    parser.add_argument("--candidates", type=int, default=20)
    given = parser.parse_args()
    print(json.dumps(measure(given.requests, given.candidates), indent=1))


if __name__ == "__main__":
    main()
