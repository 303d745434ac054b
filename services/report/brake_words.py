"""What a brake sheet says: rows, sentences, and the same for machines."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from slopewise.services.report.brake_numbers import BrakeNumbers, SteepestSlope
from slopewise.services.report.brake_rules import short_from
from slopewise.services.report.brake_table import DistanceTable, shown_distances

_SURFACES, _NAME = 2, 14
"""Other surfaces that are told, and letters of their names."""

_LEVEL = np.deg2rad(0.1)


def as_json(numbers: BrakeNumbers) -> dict[str, Any]:
    """The numbers of the sheet for machines, SI units; null where a stop does not end."""
    table = shown_distances(numbers)
    top = float(table.speeds[-1])
    slopes = {
        f"{what}_{way}": {"claimed": found.claimed, "law": found.law}
        for what, of in (("holds", numbers.holds), ("stops", numbers.stops))
        for way, found in (("uphill", of(1.0)), ("downhill", of(-1.0)))
    }
    return {
        "quantile": numbers.survive.quantile,
        "brake_ratio": {
            name: {"mean": numbers.mean_force(v, 0.0), "least": numbers.least_force(v, 0.0)}
            for name, v in (("at_rest", 0.0), ("at_top_speed", top))
        },
        "slopes": slopes,
        "least_rear_load": numbers.least_rear_load(),
        "speeds": table.speeds.tolist(),
        "grades": table.grades.tolist(),
        "mean_distance": _finite(table.mean),
        "allowed_distance": _finite(table.allowed),
        "plain_distance": table.plain.tolist(),
        "rule_distance": table.rule.tolist(),
        "rule_short_below_grade": short_from(numbers, top),
    }


def danger(numbers: BrakeNumbers, table: DistanceTable) -> str:
    """Where rules that know no slope promise too short a stop, in a sentence."""
    top, down = float(table.speeds[-1]), float(table.grades[0])
    needed = float(table.allowed[-1, 0]) - numbers.offset
    if down >= 0.0 or needed <= table.rule[-1]:
        return "On the trained grades no stop is longer than RSS says."
    short = "does not end" if math.isinf(needed) else f"takes {needed:.2f} m"
    return (
        f"On {degrees(down)} a stop from {top:.2f} m/s {short} before any safety offset; RSS says "
        f"{table.rule[-1]:.2f} m, v²/2a says {table.plain[-1]:.2f} m: both are unsafe there."
    )


def brake_rows(numbers: BrakeNumbers, table: DistanceTable) -> dict[str, str]:
    """What the brakes do on level ground."""
    model, top = numbers.model, float(table.speeds[-1])
    b = numbers.tables[0]

    def ratio(speed: float) -> str:
        mean, least = numbers.mean_force(speed, 0.0), numbers.least_force(speed, 0.0)
        return f"{mean:.3f} mean, {least:.3f} at the quantile"

    driven = f"± {b.speed_error:.3f} m/s" if b.speed_error > 0.0 else "not known"
    effects = ", ".join(e.name.replace("_", " ") for e in model.effect) or "none"
    return {
        "vehicle": f"{model.vehicle.mass:.0f} kg, wheelbase {model.vehicle.wheelbase:.2f} m",
        "F_b/W level, at rest": ratio(0.0),
        f"F_b/W level, {top:.2f} m/s": ratio(top),
        "level deceleration": f"{numbers.level_deceleration(top):.2f} m/s² at the quantile",
        "dead time": f"{b.dead_time:.3f} s mean, {numbers.dead_time:.3f} s at the quantile",
        "safety offset": f"{numbers.offset:.3f} m in each distance",
        "speeds are driven to": driven,
        "effects beside": effects,
        "surface": numbers.surface or "base",
        **_other_surfaces(numbers, top),
    }


def _other_surfaces(numbers: BrakeNumbers, speed: float) -> dict[str, str]:
    """The longest stop of the sheet on other surfaces of the model, the worst first."""
    b = numbers.model.braking
    down = b.grade_range[0]
    own = {n for n, table in b.terrain.items() if table.state_of is None} - {numbers.surface}
    longest = {
        n: replace(numbers, surface=n).allowed_distance(min(speed, b.on(n).speed_range[1]), down)
        for n in own
    }
    worst = sorted(longest, key=lambda n: -longest[n])[:_SURFACES]
    told = (
        f"{name[:_NAME]} {metres(longest[name])}" + (" m" if math.isfinite(longest[name]) else "")
        for name in worst
    )
    return {"longest stop on others": ", ".join(told)} if worst else {}


def slope_rows(numbers: BrakeNumbers) -> dict[str, str]:
    """What they do on slopes, and where that was learned."""
    b = numbers.tables[0]
    speeds, grades = b.speed_range, b.grade_range
    load = f"{numbers.least_rear_load():.0%} of level, {numbers.model.limits.min_load:.0%} wanted"
    return {
        "stops uphill, downhill": f"{_told(numbers.stops(1.0))}, {_told(numbers.stops(-1.0))}",
        "holds uphill, downhill": f"{_told(numbers.holds(1.0))}, {_told(numbers.holds(-1.0))}",
        "rear axle, steepest stop": load,
        "trained speeds": f"{speeds[0]:.2f} … {speeds[1]:.2f} m/s",
        "trained grades": f"{degrees(grades[0])} … {degrees(grades[1])}",
        "+": "training ends there, the law does not",
    }


def _told(slope: SteepestSlope) -> str:
    """Steepest slope that is claimed; a plus where only training ends it."""
    more = "+" if slope.law > slope.claimed else ""
    return f"{np.rad2deg(slope.claimed):.1f}°{more}"


def explained(numbers: BrakeNumbers, table: DistanceTable) -> str:
    """What was compared with what, in lines."""
    top, most = float(table.speeds[-1]), numbers.model.limits.accel
    from_rest, hurried = short_from(numbers, top), short_from(numbers, top, most)

    def below(grade: float | None) -> str:
        if grade is None:
            return "on no trained grade"
        return "on every descent" if grade > -_LEVEL else f"below {degrees(grade)}"

    return (
        "All with the level deceleration and the dead time at\n"
        "the quantile, none with the offset. RSS: v ρ + v²/2b.\n"
        f"It is too short {below(from_rest)};\n"
        f"with its acceleration of {most:g} m/s² through ρ,\n"
        f"{below(hurried)}. v²/2a leaves out ρ as well.\n"
        "On level ground RSS and the model are the same,\n"
        "but for effects that act on the motion."
    )


def degrees(grade: float) -> str:
    """A grade [rad] as people read it."""
    return f"{np.rad2deg(grade):.1f}°".replace("-", "−")


def metres(distance: float) -> str:
    """A distance, a dash where there is none."""
    return f"{distance:.2f}" if math.isfinite(distance) else "–"


def _finite(distances: Any) -> list[list[float | None]]:
    return [[float(d) if np.isfinite(d) else None for d in row] for row in distances]
