"""A robot's side of learning, by keys and payloads alone: nothing here is the service's code."""

from __future__ import annotations

import contextlib
import itertools
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import zenoh

from tests.services.service_process import Running, running, until

FORMAT = "application/msgpack;slopewise.{}.v1"
SCHEMAS = {"stop": "stop_observation", "drive": "drive_samples", "terrain": "terrain_label"}


def block(array: Any) -> dict[str, Any]:
    array = np.ascontiguousarray(array, "<f8")
    return {"shape": array.shape, "data": array.tobytes()}


class Robot:
    """Sends observations, counts them, and asks for parameters."""

    def __init__(self, service: Running, session: zenoh.Session, source: str = "robot") -> None:
        self.service, self.session, self.source = service, session, source
        self.sequence = itertools.count(1)

    def query(
        self, name: str, fields: dict[str, Any] | None, schema: str, timeout: float = 5.0
    ) -> dict[str, Any] | None:
        """The answer as plain values, None without a reply."""
        payload = None if fields is None else msgspec.msgpack.encode(fields)
        encoding = None if fields is None else FORMAT.format(schema)
        replies = self.session.get(
            self.service.key(name), payload=payload, encoding=encoding, timeout=timeout
        )
        for reply in replies:
            if reply.ok is not None:
                data = reply.ok.payload.to_bytes()
                machine = str(reply.ok.encoding).startswith("application/msgpack")
                decode = msgspec.msgpack.decode if machine else msgspec.json.decode
                return dict(decode(data))
        return None

    def fields(self, **given: Any) -> dict[str, Any]:
        return {
            "source": self.source,
            "sequence": next(self.sequence),
            "time": time.monotonic(),
            **given,
        }

    def stop_fields(self, deceleration: float, **given: Any) -> dict[str, Any]:
        stop = {
            "speed": 2.0,
            "grade": 0.0,
            "deceleration": deceleration,
            "deceleration_std": 0.02,
            "dead_time": 0.3,
        }
        return self.fields(**{**stop, **given})

    def stop(self, deceleration: float, **given: Any) -> dict[str, Any]:
        """One stop, acknowledged."""
        return self.send("stop", self.stop_fields(deceleration, **given))

    def send(self, kind: str, fields: dict[str, Any]) -> dict[str, Any]:
        """An observation as a query."""
        receipt = self.query(f"obs/{kind}", fields, SCHEMAS[kind])
        assert receipt is not None, "no reply"
        return receipt

    def put(self, kind: str, fields: dict[str, Any]) -> None:
        """An observation without an answer."""
        self.session.put(
            self.service.key(f"obs/{kind}"),
            msgspec.msgpack.encode(fields),
            encoding=FORMAT.format(SCHEMAS[kind]),
        )

    def parameters(self, group: str = "", history: int = 0) -> dict[str, Any]:
        question = {"group": group, "history": history}
        reply = self.query("params", question, "parameter_question")
        assert reply is not None
        return reply

    def group(self, name: str = "braking") -> dict[str, Any]:
        (group,) = self.parameters(name)["groups"]
        return dict(group)

    def level_force(self, name: str = "braking", speed: float = 2.0) -> float:
        values = self.group(name)["values"]
        return float(values["m_b"] * speed + values["b_b"])

    def set(self, group: str, **values: float) -> dict[str, Any]:
        fields = {"group": group, "values": values, "who": "test"}
        reply = self.query("params/set", fields, "set_parameters")
        assert reply is not None
        return reply

    def roll_back(self, version: int, group: str = "") -> dict[str, Any]:
        fields = {"version": version, "group": group, "who": "test"}
        reply = self.query("params/rollback", fields, "roll_back")
        assert reply is not None
        return reply

    def plan(self, speed: float = 1.0, length: float = 25.0, **given: Any) -> dict[str, Any]:
        """The reply to a request for one straight plan."""
        along = np.linspace(0.0, length, 60)
        path = {"name": "a", "points": block(np.stack([along, 0.0 * along], axis=1))}
        question = {"speed": speed, "paths": [path], **given}
        reply = self.query("plan", question, "plan_request")
        assert reply is not None, "no reply"
        return reply

    def top_speed(self, clear: float = 8.0, **given: Any) -> float:
        """Highest speed of a plan from rest on a straight path of that length."""
        reply = self.plan(0.0, clear=clear, **given)
        assert reply["plans"], reply
        return float(speeds_of(reply["plans"][0]).max())

    def status(self, seconds: float = 5.0) -> dict[str, Any]:
        """The next status."""
        received: list[bytes] = []
        with self.session.declare_subscriber(
            self.service.key("status"), lambda s: received.append(s.payload.to_bytes())
        ):
            until(lambda: len(received) > 1, seconds)
        return dict(msgspec.json.decode(received[-1]))


def column(plan: dict[str, Any], name: str) -> np.ndarray:
    values = plan["values"]
    rows = np.frombuffer(values["data"], "<f8").reshape(values["shape"])
    return np.asarray(rows[plan["columns"].index(name)])


def speeds_of(plan: dict[str, Any]) -> np.ndarray:
    return column(plan, "speed")


def ground(names: list[str] | None = None, classes: Any = None, length: int = 200) -> dict:
    """A flat map, whole; 0.5 m cells from (-5, -10) on."""
    rows, columns = 41, 2 * length
    update: dict[str, Any] = {
        "source": f"map-{time.monotonic_ns()}",
        "sequence": 1,
        "resolution": 0.5,
        "elevation": block(np.zeros((rows, columns))),
        "origin": (-5.0, -10.0),
    }
    if names is not None:
        update |= {"class_names": names, "terrain_class": block(classes)}
    return update


def send_ground(robot: Robot, update: dict[str, Any] | None = None) -> None:
    """Put a map in, and wait until plans are made from it."""
    before = robot.plan()["map_version"]
    payload, end = msgspec.msgpack.encode(update or ground()), time.monotonic() + 10.0
    while robot.plan()["map_version"] == before:
        assert time.monotonic() < end, "the map did not arrive"
        # What is put before the service's subscription is known here goes nowhere.
        robot.session.put(robot.service.key("map"), payload, encoding=FORMAT.format("map_update"))
        time.sleep(0.2)


@contextlib.contextmanager
def robot_on_ground(folder: Path, **options: Any) -> Iterator[Robot]:
    """A robot on level ground before a service in a separate process."""
    with running(folder, **options) as service, service.session() as session:
        robot = Robot(service, session)
        send_ground(robot)
        yield robot
