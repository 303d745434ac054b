"""Drive logs out of ROS 2 recordings (sqlite3 and MCAP), without ROS."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.services.io.access import fault
from slopewise.services.io.bags.recording import Bag, folder_of, opened
from slopewise.services.io.bags.topics import Channel, read_topics
from slopewise.services.io.logs.bag_guess import guessed
from slopewise.services.io.logs.drive_log import DriveLog, log_of_tables
from slopewise.services.io.table import Table

_FEWEST = 2


def read_bags(paths: Sequence[Path], topics: Path | None = None) -> DriveLog:
    """One log out of one or several recordings, a run each.

    Args:
        paths: folders of recordings, or files in them.
        topics: mapping; if left out, topics are guessed by their types, see
            :mod:`slopewise.services.io.logs.bag_guess`.

    Raises:
        InputError: names the recording and the topic or field.
    """
    channels, mapping = read_topics(topics)
    return log_of_tables([_table(path, channels, mapping, topics is None) for path in paths])


def _table(path: Path, channels: dict[str, Channel], mapping: str, guess: bool) -> Table:
    with opened(path) as bag:
        if guess:
            channels = guessed(channels, bag.types)
        series = _series(bag, channels, mapping)
    clock = series["v"][0]
    begin = max(float(times[0]) for times, _ in series.values())
    end = min(float(times[-1]) for name, (times, _) in series.items() if not channels[name].hold)
    time = clock[(clock >= begin) & (clock <= end)]
    # Two messages may be received within the same tick of the clock.
    time = time[np.concatenate(([True], np.diff(time) > 0.0))] if len(time) else time
    if len(time) < _FEWEST:
        words = "expected a time at which every mapped topic is recorded, got none"
        raise fault(path, "messages", words)
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
    found: dict[str, tuple[list[float], list[float]]] = {name: ([], []) for name in channels}
    wanted = {channel.topic for channel in channels.values()}
    here = [c for c in bag.reader.connections if c.topic in wanted]
    _check_topics(bag.path, channels, set(bag.types), mapping)
    for connection, received, raw in bag.reader.messages(here):
        message = bag.reader.deserialize(raw, connection.msgtype)
        for name, channel in channels.items():
            if channel.topic == connection.topic:
                value = _value(message, name, channel, bag.path, mapping)
                found[name][0].append(1e-9 * received)
                found[name][1].append(channel.scale * value + channel.offset)
    for name, (times, _) in found.items():
        if not times:
            raise fault(bag.path, f"topic {channels[name].topic}", "expected messages, got none")
    return {name: _ordered(name, *series) for name, series in found.items()}


def _check_topics(path: Path, channels: dict[str, Channel], there: set[str], mapping: str) -> None:
    for name, channel in channels.items():
        if channel.topic not in there:
            words = (
                f"{name} of {mapping} is not recorded, expected one of {', '.join(sorted(there))}"
            )
            raise fault(path, f"topic {channel.topic}", words)


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
            words = f"expected one of {', '.join(names)}, got {channel.joint}"
            raise fault(path, f"{where}.joint", words)
        value = value[names.index(channel.joint)]
    try:
        return float(value)
    except (TypeError, ValueError):
        found = type(value).__name__
        raise fault(path, f"{where}.field", f"expected a number, got {found}") from None


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
    """By time; of messages received at the same time the last one counts. Yaw is unwrapped."""
    t, v = np.array(times), np.array(values)
    order = np.argsort(t, kind="stable")
    t, v = t[order], v[order]
    last = np.concatenate((np.diff(t) > 0.0, [True]))
    return t[last], np.unwrap(v[last]) if name == "yaw" else v[last]
