"""Attackers of a running service, each a way to misuse keys that it may write to.

Nothing here is code of the service or of its client: sessions and payloads are made by hand, from
what the documentation says of keys and schemas. `python -m tests.services.attackers ENDPOINT
NAMESPACE KINDS SECONDS [PAGE]` runs some of them, each with a separate session.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import socket
import sys
import threading
import time
from collections.abc import Callable

import msgspec
import numpy as np
import zenoh

G = 9.80665
MACHINE, PEOPLE = "application/msgpack", "application/json"


def block(values: object) -> dict[str, object]:
    array = np.ascontiguousarray(values, "<f8")
    return {"shape": array.shape, "data": array.tobytes()}


def straight(length: float, points: int, curvature: float = 0.0) -> dict[str, object]:
    along = np.linspace(0.0, length, points)
    return block(np.stack([along, curvature * along**2], axis=1))


class Attacker:
    """An attacker with a separate session."""

    def __init__(self, endpoint: str, namespace: str, seed: int, page: int = 0) -> None:
        config = zenoh.Config.from_json5(
            json.dumps(
                {
                    "mode": "client",
                    "connect": {"endpoints": [endpoint]},
                    "scouting": {"multicast": {"enabled": False}},
                }
            )
        )
        self.session = zenoh.open(config)
        self.namespace, self.page, self.random = namespace, page, random.Random(seed)
        self.me, self.count = f"attacker {seed}", 0

    def key(self, name: str) -> str:
        return f"{self.namespace}/v1/{name}"

    def ask(self, fields: dict[str, object], selector: str = "") -> None:
        """Send a request without waiting for the reply."""
        self.session.get(
            self.key("plan") + selector,
            payload=msgspec.msgpack.encode(fields),
            timeout=5.0,
            encoding=f"{MACHINE};slopewise.plan_request.v1",
            handler=lambda _: None,
        )

    def put(self, name: str, schema: str, fields: dict[str, object]) -> None:
        self.session.put(
            self.key(name),
            msgspec.msgpack.encode(fields),
            encoding=f"{MACHINE};slopewise.{schema}.v1",
        )

    def observation(self, **more: object) -> dict[str, object]:
        self.count += 1
        return {"source": self.me, "sequence": self.count, "time": time.monotonic(), **more}

    # ------------------------------------------------------------------ kinds

    def heavy(self) -> float:
        """82 kB a second, a thousand candidates."""
        paths = [{"name": f"{i}", "points": straight(45.0, 3, 1e-6 * i)} for i in range(1000)]
        self.ask({"speed": 1.0, "paths": paths}, "?deadline=10")
        return 1.0

    def heavy_with_a_name(self) -> float:
        paths = [{"name": f"{i}", "points": straight(45.0, 3, 1e-6 * i)} for i in range(1000)]
        pose = (0.0, 0.0, 0.0)
        self.ask({"speed": 1.0, "paths": paths, "client": self.me, "pose": pose}, "?deadline=10")
        return 1.0

    def flood(self) -> float:
        """Small requests as fast as possible."""
        for _ in range(20):
            self.ask({"speed": 1.0, "paths": [{"name": "a", "points": straight(20.0, 30)}]})
        return 0.1

    def names(self) -> float:
        """A new name for each request."""
        for _ in range(5):
            self.count += 1
            path = {"name": "a", "points": straight(20.0, 30)}
            pose = (0.0, 0.0, 0.0)
            self.ask(
                {"speed": 1.0, "paths": [path], "client": f"{self.me}.{self.count}", "pose": pose}
            )
        return 0.1

    def stops(self) -> float:
        """Brakes that are better than any."""
        fields = self.observation(
            speed=self.random.uniform(1.0, 4.0),
            grade=self.random.uniform(-0.2, 0.2),
            deceleration=self.random.uniform(7.0, 10.0),
            deceleration_std=0.01,
        )
        self.put("obs/stop", "stop_observation", fields)
        return 0.05

    def contradictions(self) -> float:
        fields = self.observation(
            speed=2.0, grade=0.0, deceleration=9.0, distance=30.0, dead_time=0.3
        )
        self.put("obs/stop", "stop_observation", fields)
        return 0.1

    def surfaces(self) -> float:
        """Surfaces that do not exist."""
        self.put(
            "obs/stop",
            "stop_observation",
            self.observation(speed=2.0, grade=0.0, deceleration=0.42 * G, surface=f"x{self.count}"),
        )
        return 0.2

    def counts(self) -> float:
        """Numbers and clocks from far away."""
        far = {"sequence": self.random.choice([2**53, 0, 1, 2**40]), "time": 1e18}
        fields = self.observation(speed=2.0, grade=0.0, deceleration=9.0)
        self.put("obs/stop", "stop_observation", fields | far | {"source": "robot"})
        return 0.2

    def maps(self) -> float:
        """Malformed maps, and updates that do not fit."""
        far = self.random.choice([1e-300, 1e300, 1e-9, float("nan")])
        fields = {
            "source": self.me,
            "sequence": 2**53,
            "resolution": far,
            "origin": (1e300, 0.0),
            "elevation": block(np.zeros((40, 40))),
        }
        self.put("map", "map_update", fields)
        return 0.1

    def noise(self) -> float:
        """Bytes that are nothing, on every key."""
        for name in ("plan", "params/set", "obs/drive", "obs/terrain", "map", "discrepancy"):
            raw = self.random.randbytes(self.random.randrange(2000))
            self.session.put(self.key(name), raw, encoding=f"{MACHINE};slopewise.nonsense.v1")
            self.session.get(self.key(name), payload=raw, timeout=2.0, handler=lambda _: None)
        return 0.1

    def deadlines(self) -> float:
        for text in ("-1", "nan", "inf", "0", "1e-9", "tomorrow"):
            self.ask({"speed": 1.0, "paths": []}, f"?deadline={text}")
        return 0.1

    def half_open(self) -> float:
        """Connections to the page without a complete request."""
        held = []
        for _ in range(40 if self.page else 0):
            with contextlib.suppress(OSError):
                connection = socket.create_connection(("127.0.0.1", self.page), timeout=1.0)
                connection.sendall(b"GET / HT")
                held.append(connection)
        time.sleep(2.0)
        for connection in held:
            connection.close()
        return 0.1


KINDS = (
    "heavy",
    "heavy_with_a_name",
    "flood",
    "names",
    "stops",
    "contradictions",
    "surfaces",
    "counts",
    "maps",
    "noise",
    "deadlines",
    "half_open",
)


def _go_on(act: Callable[[], float], until: float) -> None:
    while time.monotonic() < until:
        wait = 1.0
        with contextlib.suppress(zenoh.ZError):
            wait = act()
        time.sleep(wait)


def main(endpoint: str, namespace: str, kinds: str, seconds: str, page: str = "0") -> None:
    """Attack for a duration [s]."""
    os.nice(10)
    until = time.monotonic() + float(seconds)
    threads = []
    for seed, kind in enumerate(kinds.split(",")):
        attacker = Attacker(endpoint, namespace, 1000 * os.getpid() + seed, int(page))
        act = getattr(attacker, kind)
        threads.append(threading.Thread(target=_go_on, args=(act, until), daemon=True))
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


if __name__ == "__main__":
    main(*sys.argv[1:])
