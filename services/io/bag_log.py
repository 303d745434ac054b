"""Tables of a drive log's columns from ROS 2 recordings (sqlite3 and MCAP), without ROS."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.services.io.bags import Bag, folder_of, opened
from slopewise.services.io.files import fault
from slopewise.services.io.table import Table
from slopewise.services.io.topics import Channel, infer_channels

_MIN_SAMPLES = 2  # Fewest samples with an interval between them


def bag_table(path: Path, channels: dict[str, Channel], mapping: str, *, infer: bool) -> Table:
    """The columns of one recording, which is one run, at the times of its speeds.

    Args:
        path: folder of a recording, or a file in it.
        infer: replace their topics by those inferred from the recorded types.
    """
    with opened(path) as bag:
        if infer:
            channels = infer_channels(channels, bag.types)
        series = _series(bag, channels, mapping)
    clock = series["v"][0]
    begin = max(float(times[0]) for times, _ in series.values())
    end = min(float(times[-1]) for name, (times, _) in series.items() if not channels[name].hold)
    time = clock[(clock >= begin) & (clock <= end)]
    # Two messages may be received within the same tick of the clock.
    time = time[np.concatenate(([True], np.diff(time) > 0.0))] if len(time) else time
    if len(time) < _MIN_SAMPLES:
        expected = "expected a time at which every mapped topic is recorded, got none"
        raise fault(path, "messages", expected)
    columns: dict[str, list[str] | Floats] = {"run": [_name(path)] * len(time), "t": time}
    for name, (times, values) in series.items():
        columns[name] = _at(time, times, values, channels[name].hold)
    return Table(str(path), columns, range(1, len(time) + 1))


def _name(path: Path) -> str:
    return path.name if path.is_dir() or not folder_of(path) else path.parent.name


def _at(time: Floats, times: Floats, values: Floats, hold: bool) -> Floats:
    if hold:
        held: Floats = values[np.searchsorted(times, time, side="right") - 1]
        return held
    return np.interp(time, times, values)


def _series(
    bag: Bag, channels: dict[str, Channel], mapping: str
) -> dict[str, tuple[Floats, Floats]]:
    """(times [s], values) of each column, in the order of the times."""
    series: dict[str, tuple[list[float], list[float]]] = {name: ([], []) for name in channels}
    mapped = {channel.topic for channel in channels.values()}
    here = [c for c in bag.reader.connections if c.topic in mapped]
    for name, channel in channels.items():
        if channel.topic not in bag.types:
            there = ", ".join(sorted(bag.types))
            expected = f"{name} of {mapping} is not recorded, expected one of {there}"
            raise fault(bag.path, f"topic {channel.topic}", expected)
    for connection, received, raw in bag.raw(here):
        message = bag.decoded(connection, raw)
        for name, channel in channels.items():
            if channel.topic == connection.topic:
                value = _value(message, name, channel, bag.path, mapping)
                series[name][0].append(1e-9 * received)
                series[name][1].append(channel.scale * value + channel.offset)
    for name, (times, _) in series.items():
        if not times:
            raise fault(bag.path, f"topic {channels[name].topic}", "expected messages, got none")
    return {name: _ordered(name, *samples) for name, samples in series.items()}


def _value(message: Any, name: str, channel: Channel, path: Path, mapping: str) -> float:
    where = f"{mapping}, {name}"
    if channel.quaternion is not None:
        q = _inside(message, channel.quaternion, path, where)
        return _angle(name, *(float(_inside(q, axis, path, where)) for axis in "wxyz"))
    assert channel.field is not None
    value = _inside(message, channel.field, path, where)
    if channel.joint is not None:
        names = list(_inside(message, "name", path, where))
        if channel.joint not in names:
            expected = f"expected one of {', '.join(names)}, got {channel.joint}"
            raise fault(path, f"{where}.joint", expected)
        value = value[names.index(channel.joint)]
    try:
        return float(value)
    except (TypeError, ValueError):
        got = type(value).__name__
        raise fault(path, f"{where}.field", f"expected a number, got {got}") from None


def _inside(message: Any, dotted: str, path: Path, where: str) -> Any:
    value = message
    for part in dotted.split("."):
        if not hasattr(value, part):
            kind = type(value).__name__
            raise fault(path, where, f"expected {dotted} in the message, {kind} has no {part}")
        value = getattr(value, part)
    return value


def _angle(name: str, w: float, x: float, y: float, z: float) -> float:
    """Roll, pitch or yaw of a unit quaternion, z-y-x order as in REP-103 [rad]."""
    if name == "roll":
        return float(np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)))
    if name == "pitch":
        return float(np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)))
    return float(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def _ordered(name: str, times: list[float], values: list[float]) -> tuple[Floats, Floats]:
    """By time; of messages received at the same time the last one is used. Yaw is unwrapped."""
    t, v = np.array(times), np.array(values)
    order = np.argsort(t, kind="stable")
    t, v = t[order], v[order]
    last = np.concatenate((np.diff(t) > 0.0, [True]))
    return t[last], np.unwrap(v[last]) if name == "yaw" else v[last]
