"""How much each effect is that no plan knows of, for the shipped vehicles at their limits.

python -m examples.not_modelled [MODEL…] [--into docs/not-modelled.md]

Prints the tables of docs/not-modelled.md as Markdown, or puts them there. Every number is a formula
with a size that is assumed, not a measurement: it says what to worry about first.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from examples.neglected_effects import LOADS, METRES, OTHERS, Row, Stop
from slopewise.models.laws import slip_track, tip_over
from slopewise.services.io.model_file import find_model, read_model

NAMES = ("atv", "husky", "ugv")
_PLACE = re.compile(r"(?<=<!-- tables -->\n).*?(?=<!-- end of tables -->\n)", re.DOTALL)

Stops = list[tuple[Stop, Stop]]
"""Of each vehicle: on the level, and on the steepest trained downhill."""


def _table(rows: Iterable[Row], stops: Stops, cell: Callable[..., str]) -> str:
    heads = "".join(f" {level.model.name} |" for level, _ in stops)
    lines = [
        f"| not modelled | size | formula |{heads} does | covered by |",
        f"|---|---|---|{'--:|' * len(stops)}---|---|",
    ]
    for row in rows:
        cells = "".join(f" {cell(*(row.value(s) for s in pair))} |" for pair in stops)
        arguments = (
            f"| {row.name} | {row.size} | {row.formula} |{cells} {row.does} | {row.covered} |"
        )
        lines.append(arguments)
    return "\n".join(lines) + "\n"


def _metres(level: float, down: float) -> str:
    return " / ".join("rolls on" if math.isinf(d) else f"{abs(d):.2f}" for d in (level, down))


def _share(level: float, down: float) -> str:
    return f"{abs(down):.1%}".replace("%", " %")


def _vehicles(stops: Stops) -> str:
    """The stops that all else is compared with."""
    lines = [
        "| vehicle | speed | level: F_b/W, stop | steepest downhill: F_b/W, stop | rear load there "
        "| top rim speed in the sharpest turn |",
        "|---|--:|--:|--:|--:|--:|",
    ]
    for level, down in stops:
        vehicle, terrain = down.model.vehicle, down.model.terrain
        rear = tip_over.rear_share_under_braking(
            down.grade, 0.0, down.force, vehicle.wheelbase, vehicle.cg_x, vehicle.cg_z
        )
        rim = level.speed * slip_track.outer_wheel_speed_ratio(level.turn, terrain.slip_track)
        lines.append(
            f"| {level.model.name} | {level.speed:.1f} m/s | {level.force:.2f}, "
            f"{level.distance():.2f} m | {down.force:.2f} at "
            f"{np.rad2deg(down.grade):.0f}°, {down.distance():.2f} m | {rear:.0%} | "
            f"{rim:.1f} m/s |"
        )
    return "\n".join(lines).replace("%", " %") + "\n"


def tables(names: Iterable[str] = NAMES) -> str:
    """All tables of the page, as Markdown, with a column for each model file."""
    models = [read_model(find_model(name)) for name in names]
    stops = [(Stop(m, 0.0), Stop(m, m.braking.grade_range[0])) for m in models]
    return "\n".join(
        (
            "\n**The stops: full braking from the highest speed, without offsets**\n",
            _vehicles(stops),
            "**Metres of a stop: on the level / on the steepest trained downhill**\n",
            _table(METRES, stops, _metres),
            "**Share of the level static load on an axle, side or wheel, steepest downhill**\n",
            _table(LOADS, stops, _share),
            "**Other shares**\n",
            _table(OTHERS, stops, _share),
        )
    )


def run() -> None:
    """Print the tables, or put them into a page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="*", default=NAMES)
    parser.add_argument("--into", type=Path)
    arguments = parser.parse_args()
    text = tables(arguments.models)
    if arguments.into is None:
        print(text)
        return
    arguments.into.write_text(_PLACE.sub(lambda _: text, arguments.into.read_text()))


if __name__ == "__main__":
    run()
