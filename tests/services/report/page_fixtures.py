"""A generated plan, and readers of pages and of their pictures."""

from __future__ import annotations

import base64
import dataclasses
import io
import json
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np
from PIL import Image

from slopewise.planner.limiting import Limiting
from slopewise.planner.plan import SpeedPlan, Status


class PageReader(HTMLParser):
    """Elements with their attributes, and the text inside each kind of element."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self._open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self._open.append(tag)
        self.texts.setdefault(tag, []).append("")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if self._open:
            self.texts[self._open[-1]][-1] += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


def embedded(text: str) -> Any:
    """Data of the script of a page, unscaled; rejects constants that JSON does not know."""
    match = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)
    assert match is not None

    def reject(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    data = json.loads(match[1], parse_constant=reject)
    for plan in data.get("plans", ()):
        columns, bounds = plan["columns"], [(b, "speed", "speed_bound") for b in plan["bounds"]]
        for table, key, name in [*((columns, n, n) for n in data["decimals"]), *bounds]:
            scale = 10.0 ** data["decimals"][name]
            table[key] = [None if v is None else v / scale for v in table[key]]
    return data


def plan_of(
    name: str = "generated", status: Status = Status.OK, stations: int = 40, **changes: Any
) -> SpeedPlan:
    station = 0.25 * np.arange(stations)
    speed = np.sqrt(np.clip(np.minimum(2.0 * station, 2.0 * (station[-1] - station)), 0.0, 4.0))
    columns: dict[str, Any] = dict.fromkeys(("z", "grade", "roll", "curvature"), 0.0 * station)
    plan = SpeedPlan(
        candidate=name,
        status=status,
        reason="",
        **columns,
        station=station,
        x=station,
        y=0.1 * station,
        speed=speed,
        accel=np.gradient(speed),
        time=0.2 * np.arange(stations),
        speed_bound=speed,
        limiting=np.arange(stations) % len(Limiting),
        stop_distance=0.5 * speed,
        clear_distance=float(station[-1]) + 1.0,
        rear_load=np.full(stations, 0.7),
        side_load=np.full(stations, 0.9),
    )
    return dataclasses.replace(plan, **changes)


def pixels_of(uri: str) -> Any:
    """Pixels (rows, cols, 2) of a grey picture with transparency, 8 bits each."""
    png = base64.b64decode(uri.removeprefix("data:image/png;base64,"))
    picture = Image.open(io.BytesIO(png))
    assert picture.mode == "LA"
    return np.asarray(picture)
