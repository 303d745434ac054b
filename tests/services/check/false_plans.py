"""Plans that are false or unsafe by construction, made of real ones, and plans that are neither.

A mutant contradicts itself, its ground or its vehicle by several times what rounding does, or it
drives what a closed form forbids. Where a change would leave a plan right it is not made (None).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from tests.services.check.sound_plans import SPACING, Base, Columns, Mutation

# --- one column that is false


def scaled(column: str, factor: float, more: float = 0.0) -> Mutation:
    """Another unit, or another zero, where that is not the same."""

    def mutate(c: Columns, _: np.random.Generator) -> Columns | None:
        changed = factor * c[column] + more
        plainly = {"grade": 0.02, "roll": 0.02, "curvature": 0.06}.get(column, 0.05)
        moves = c["speed"][2:-2] > 0.3
        is_false = np.abs(changed - c[column])[2:-2][moves].max(initial=0.0) > plainly
        return {**c, column: changed} if is_false else None

    return mutate


def one_row(column: str, by: float) -> Mutation:
    def mutate(c: Columns, rng: np.random.Generator) -> Columns:
        values = c[column].copy()
        values[rng.integers(4, np.flatnonzero(c["speed"] > 0.5)[-1])] += by
        return {**c, column: values}

    return mutate


def instead(column: str, of: Callable[[Columns], Any], plainly: float = 0.0) -> Mutation:
    """Other values, where they differ from the right ones by more than some amount."""

    def mutate(c: Columns, _: np.random.Generator) -> Columns | None:
        values = of(c)
        if plainly and np.abs(values - c[column]).max() < plainly:
            return None
        return {**c, column: values}

    return mutate


def text_as(column: str, text: Callable[[Columns], Any], status: str = "") -> Mutation:
    """Another text, in plans of one status or of any."""

    def mutate(c: Columns, _: np.random.Generator) -> Columns | None:
        if status and c["status"][0] != status:
            return None
        given = text(c)
        values = [given] * len(c["x"]) if isinstance(given, str) else given
        return {**c, column: values} if values != c[column] else None

    return mutate


def renamed(*pairs: tuple[str, str]) -> Mutation:
    """Rules that are confused where the plan names them."""
    names = dict(pairs)
    return text_as("limiting", lambda c: [names.get(name, name) for name in c["limiting"]])


ALL_RULES = [
    *("stopping_path", "tip_over", "rollover", "lateral", "wheel_speed", "accel", "decel", "jerk"),
    *("unknown_terrain", "friction", "crest", "model_validity"),
]

FALSE: dict[str, Mutation] = {
    "station 5 % longer": scaled("station", 1.05),
    "station in feet": scaled("station", 3.28),
    "station in km": scaled("station", 1e-3),
    "station before the start, clear distance not": scaled("station", 1.0, -5.0),
    "station jumps": one_row("station", 0.5),
    "station backward": instead("station", lambda c: c["station"][::-1]),
    "z higher": scaled("z", 1.0, 0.2),
    "z of one row": one_row("z", 0.1),
    "z in feet": scaled("z", 3.28),
    "z upside down": scaled("z", -1.0),
    "grade upside down": scaled("grade", -1.0),
    "grade in degrees": scaled("grade", 57.3),
    "grade in per cent": scaled("grade", 100.0),
    "grade off": scaled("grade", 1.0, 0.035),
    "grade of one row": one_row("grade", 0.04),
    "no grade": scaled("grade", 0.0),
    "roll upside down": scaled("roll", -1.0),
    "roll in degrees": scaled("roll", 57.3),
    "roll off": scaled("roll", 1.0, -0.035),
    "no roll": scaled("roll", 0.0),
    "grade for roll": instead("roll", lambda c: c["grade"], 0.06),
    "curvature to the other side": scaled("curvature", -1.0),
    "curvature doubled": scaled("curvature", 2.0),
    "no curvature": scaled("curvature", 0.0),
    "radius for curvature": instead("curvature", lambda c: 1.0 / (c["curvature"] + 1e-3), 1.0),
    "curvature off": scaled("curvature", 1.0, 0.1),
    "accel to the other side": scaled("accel", -1.0),
    "accel half as much again": scaled("accel", 1.5),
    "no accel": scaled("accel", 0.0),
    "accel in g": scaled("accel", 1.0 / 9.80665),
    "accel of the row before": instead("accel", lambda c: np.roll(c["accel"], 3), 0.2),
    "time backward": instead("time", lambda c: c["time"][::-1]),
    "time halved": scaled("time", 0.5),
    "time in ms": scaled("time", 1000.0),
    "no time": scaled("time", 0.0),
    "time jumps back": one_row("time", -1.0),
    "time of one row": one_row("time", 0.1),
    "bound below the speed": scaled("speed_bound", 0.5),
    "bound far off": instead("speed_bound", lambda c: np.full(len(c["x"]), 20.0)),
    "bound in km/h": scaled("speed_bound", 3.6),
    "bound a third higher": scaled("speed_bound", 1.33),
    "bound one m/s higher": scaled("speed_bound", 1.0, 1.0),
    "bound of the fastest row": instead(
        "speed_bound", lambda c: np.full(len(c["x"]), c["speed_bound"].max()), 0.5
    ),
    "stop distance halved": scaled("stop_distance", 0.5),
    "no stop distance": scaled("stop_distance", 0.0),
    "stop distance five times": scaled("stop_distance", 5.0),
    "stop distance in cm": scaled("stop_distance", 100.0),
    "stop distance without its offset": scaled("stop_distance", 1.0, -0.4),
    "stop distance of one row": one_row("stop_distance", -0.6),
    "clear distance 0.5 m too long": scaled("clear_distance", 1.0, 0.5),
    "clear distance 5 m too long": scaled("clear_distance", 1.0, 5.0),
    "clear distance doubled": scaled("clear_distance", 2.0),
    "clear distance endless": scaled("clear_distance", 0.0, 1e6),
    "clear distance of one row": one_row("clear_distance", 2.0),
    "clear distance in feet": scaled("clear_distance", 3.28),
    "rear load doubled": scaled("rear_load", 2.0),
    "rear load in per cent": scaled("rear_load", 100.0),
    "rear load of standing": scaled("rear_load", 0.0, 1.2),
    "rear load of one row": one_row("rear_load", 0.5),
    "rear load lost": scaled("rear_load", 0.0, -0.5),
    "side load doubled": scaled("side_load", 2.0),
    "side load in per cent": scaled("side_load", 100.0),
    "side load of standing": scaled("side_load", 0.0, 1.2),
    "side load of one row": one_row("side_load", 0.2),
    "side load lost": scaled("side_load", 0.0, -0.5),
    "infeasible": text_as("status", lambda _: "infeasible"),
    "blocked without a reason": text_as("status", lambda _: "blocked", "ok"),
    "degraded without a reason": text_as("status", lambda _: "degraded", "ok"),
    "ok although blocked": text_as("status", lambda _: "ok", "blocked"),
    "ok without its reason": lambda c, rng: (
        {**c, "status": ["ok"] * len(c["x"]), "reason": [""] * len(c["x"])}
        if c["status"][0] == "blocked" and c["limiting"][-1] != "stopping_path"
        else None
    ),
    "two statuses": text_as("status", lambda c: ["ok", *["blocked"] * (len(c["x"]) - 1)]),
    "no reason": text_as("reason", lambda _: "", "blocked"),
    "two reasons": text_as("reason", lambda c: ["", *["no way"] * (len(c["x"]) - 1)]),
    "ok for a reason": text_as("reason", lambda _: "stops at 3.0 m of 9.0 m: rollover", "ok"),
    "another place in the reason": text_as(
        "reason", lambda _: "stops at 1.2 m of 90.0 m: unknown ground", "blocked"
    ),
    "a shorter path in the reason": text_as(
        "reason", lambda c: re.sub(r" of [\d.]+ m", " of 1.0 m", c["reason"][0]), "blocked"
    ),
    "accel for decel": renamed(("accel", "decel"), ("decel", "accel")),
    "a rule that there is not": text_as("limiting", lambda _: "the driver"),
    **{f"{name} everywhere": text_as("limiting", lambda _, name=name: name) for name in ALL_RULES},
}
"""A column, or two, that say what is not."""


# --- rows that cannot be driven so


def stripped(c: Columns) -> Columns:
    return {name: c[name] for name in ("x", "y", "speed")}


def rows(c: Columns, chosen: np.ndarray) -> Columns:
    """Some rows, or rows in another order."""
    return {
        name: values[chosen] if isinstance(values, np.ndarray) else [values[i] for i in chosen]
        for name, values in c.items()
    }


def driving(change: Callable[[Columns, np.random.Generator], Columns | None]) -> Mutation:
    """Positions and speeds alone: no column contradicts them."""
    return lambda c, rng: change(stripped(c), rng)


def faster(factor: float, more: float = 0.0) -> Mutation:
    """Faster than the highest limit, or to rest beyond the end."""

    def mutate(c: Columns, _: np.random.Generator) -> Columns:
        return {**c, "speed": np.where(c["speed"] > 0.0, factor * c["speed"] + more, 0.0)}

    return driving(mutate)


def with_speed(speed: Callable[[np.ndarray], Any]) -> Mutation:
    return driving(lambda c, _: {**c, "speed": np.asarray(speed(c["speed"].copy()), float)})


def put(values: np.ndarray, where: Any, value: float) -> np.ndarray:
    values[where] = value
    return values


def without(first: float, last: float) -> Mutation:
    """Rows omitted of a part of the path, by shares of it."""

    def mutate(c: Columns, _: np.random.Generator) -> Columns | None:
        n = len(c["x"])
        retained = np.r_[: int(first * n), int(last * n) : n]
        return rows(c, retained) if (last - first) * n * SPACING > 2.5 else None

    return mutate


def sideways(by: float) -> Mutation:
    """One row next to the line."""

    def mutate(c: Columns, rng: np.random.Generator) -> Columns:
        k, y = int(rng.integers(8, len(c["x"]) // 2)), c["y"].copy()
        y[k] += by
        return {**c, "y": y}

    return driving(mutate)


UNSAFE: dict[str, Mutation] = {
    "30 % faster": faster(1.3),
    "speed in km/h": faster(3.6),
    "1 m/s faster": faster(1.0, 1.0),
    "full speed everywhere": with_speed(lambda v: np.full(len(v), v.max())),
    "full speed up to the last row": with_speed(lambda v: put(np.full(len(v), v.max()), -1, 0.0)),
    "one fast row": with_speed(lambda v: put(v, len(v) // 2, v.max() + 1.0)),
    "one slow row": with_speed(lambda v: put(v, int(np.argmax(v)), 0.3 * v.max())),
    "moves at its end": with_speed(lambda v: np.maximum(v, 0.5)),
    "starts abruptly": with_speed(
        lambda v: np.where(np.arange(len(v)) < 1, 0.0, np.maximum(v, v.max() * (v > 0)))
    ),
    "speeds of the path back": with_speed(lambda v: np.append(v[::-1][:-1], 1.0)),
    "speeds four rows late": with_speed(lambda v: np.append(v[:1].repeat(8), v[:-8])),
    "speed not a number": with_speed(lambda v: put(v, 3, np.nan)),
    "speed endless": with_speed(lambda v: put(v, 3, np.inf)),
    "speed negative": with_speed(lambda v: -v),
    "place not a number": driving(lambda c, _: {**c, "x": put(c["x"].copy(), 5, np.nan)}),
    "x for y": lambda c, _: {**c, "x": c["y"], "y": c["x"]},
    "mirrored": lambda c, _: {**c, "y": 2.0 * c["y"][0] - c["y"]},
    "2 m next to its ground": lambda c, _: {**c, "x": c["x"] + 2.0, "y": c["y"] + 2.0},
    "rows shuffled": lambda c, rng: rows(c, rng.permutation(len(c["x"]))),
    "the path back": lambda c, _: rows(c, np.arange(len(c["x"]))[::-1]),
    "rows swapped": lambda c, _: rows(c, np.r_[:10, 14:18, 10:14, 18 : len(c["x"])]),
    "a row next to the line": sideways(0.6),
    "a row far from the line": sideways(5.0),
    "every twelfth row": lambda c, _: rows(c, np.r_[0 : len(c["x"]) : 12]),
    "every twelfth place": driving(lambda c, _: rows(c, np.r_[0 : len(c["x"]) : 12])),
    "first and last row": driving(lambda c, _: rows(c, np.array([0, -1]))),
    "rows omitted": driving(without(0.3, 0.75)),
    "rows omitted with their columns": without(0.3, 0.75),
    "the last rows omitted": driving(lambda c, _: rows(c, np.r_[: len(c["x"]) // 2])),
    "the last rows omitted with their columns": lambda c, _: rows(c, np.r_[: len(c["x"]) // 2]),
    "a row twice, once faster": lambda c, _: {
        **(twice := rows(c, np.r_[:12, 11, 12 : len(c["x"])])),
        "speed": put(twice["speed"].copy(), 12, 2.0 + twice["speed"].max()),
    },
}
"""Real plans whose rows are driven otherwise."""


def of_another(base: Base, second: Base) -> dict[str, Base]:
    """Plans of a pair that were taken for one another, in part or whole."""
    n = min(len(base.columns["x"]), len(second.columns["x"]))
    mine, yours = rows(base.columns, np.arange(n)), rows(second.columns, np.arange(n))
    return {
        "of another map": replace(base, heights=second.heights),
        "of another vehicle": replace(base, model=second.model),
        "speeds of another": replace(base, columns={**mine, "speed": yours["speed"]}),
        "places of another": replace(base, columns={**mine, "x": yours["x"], "y": yours["y"]}),
        "continues as another": replace(base, columns=joined(mine, yours, n // 2)),
    }


def joined(first: Columns, second: Columns, k: int) -> Columns:
    """The first rows of one plan, and the last of ansecond."""
    return {
        name: np.append(first[name][:k], second[name][k:])
        for name, values in first.items()
        if isinstance(values, np.ndarray)
    }
