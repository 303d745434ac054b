"""Checks of a drive log before anything is learned from it: units, channels, speeds.

In a unit f times as fine, speeds and decelerations are f times too large: F_b/W + sin θ comes out f
times as large, so that b_m, the change of F_b/W with the grade, comes near f b_m + f − 1. Source:
none; Braking (7), (8).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.effects import registry
from slopewise.models.errors import InputError
from slopewise.models.parameters import Braking, Effect, Model
from slopewise.models.stop_logs import unit_suspects
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.files import fault

_NEEDED = ("t", "v", "v_cmd", "pitch")
_FEW = 0.25  # share of the runs that may look like another unit and are only excluded [1]
_TOO_FAST = 1.5
"""Ratio to the highest wheel speed [1]: above slip downhill, below 1.9, the factor of knots."""
_LIKELY = 0.1
"""Share of the highest wheel speed that the fastest driving of a log is at least [1]."""

_MAX_SHIFT, _MAX_RATIO = 0.2, 0.12
"""Largest deviations of b_m and of the force's factor from those of a unit [1]: knots and miles per
hour differ by 15 %."""

_MIN_GRADE_STD = 0.02  # grades that vary by less do not determine b_m [rad]


def refuse_wrong_units(log: DriveLog) -> None:
    """Raise InputError where a required channel looks like another unit in many of the runs.

    Where only a few look so, as that of a standing vehicle whose positions wander, the data issues
    of the log exclude those and the others are used.
    """
    suspects: dict[str, list[tuple[str, str]]] = {}
    for run, source in zip(log.runs, log.sources, strict=True):
        part = {n: v[run] for n, v in log.columns.items() if v.dtype.kind == "f"}
        for channel, reason in unit_suspects.find(part):
            if channel in _NEEDED:
                suspects.setdefault(channel, []).append((source, reason))
    for channel, reasons in suspects.items():
        if len(reasons) > _FEW * len(log.runs):
            source, reason = reasons[0]
            raise fault(source, f"column {channel}", reason)


def refuse_too_fast(log: DriveLog, model: Model) -> None:
    """Raise InputError where a log drives far faster than the vehicle's wheels can turn."""
    max_speed = model.vehicle.max_wheel_speed
    for run, source in zip(log.runs, log.sources, strict=True):
        speeds = np.abs(log.columns["v"][run])
        speeds = speeds[np.isfinite(speeds)]
        fast = float(np.quantile(speeds, 0.95)) if len(speeds) else 0.0
        if fast > _TOO_FAST * max_speed:
            fitting = [
                name
                for name, factor in unit_suspects.SPEED_FACTORS.items()
                if _LIKELY * max_speed <= fast / factor <= max_speed
            ]
            units = " or ".join(fitting) or "another unit"
            expected = f"expected m/s of wheels that turn at up to {max_speed:g} m/s"
            raise fault(source, "column v", f"{expected}, got {fast:.3g}, which looks like {units}")


def refuse_unit(learned: Braking, known: Braking, grades: np.ndarray, source: str) -> None:
    """Raise InputError where the learned coefficients look like those of another unit.

    ``grades`` (n,) are those of the stops [rad].
    """
    if len(grades) < 2 or float(np.std(grades)) < _MIN_GRADE_STD:
        return
    level = learned.b_b / max(known.b_b, 1e-9)
    fitting = [
        unit
        for unit, factor in unit_suspects.SPEED_FACTORS.items()
        if abs(learned.b_m - (factor * known.b_m + factor - 1.0)) < _MAX_SHIFT
        and abs(level / factor - 1.0) < _MAX_RATIO
    ]
    if fitting:
        got = f"brakes {level:.2g} times as strong as known and b_m {learned.b_m:+.2f}"
        reason = f"expected m/s, got {got}, which looks like {' or '.join(fitting)}"
        raise InputError(source, "column v", reason)


def refuse_ramps(learned: Braking, source: str) -> None:
    """Raise InputError where the force vanishes with the speed at which braking begins."""
    low, high = learned.speed_range
    weakest, _ = Braking.__dataclass_fields__["b_b"].metadata["plausible"]
    if learned.b_b >= weakest or learned.level_force(high) < weakest:
        return
    raise InputError(
        source,
        "braking.b_b",
        f"expected a force over weight of at least {weakest:g} [1] at rest, got {learned.b_b:.2g}: "
        f"{learned.level_force(high):.2g} from {high:.2g} m/s, {learned.level_force(low):.2g} from "
        f"{low:.2g} m/s, so that stops from any speed take about as long; a controller that "
        "lowers the speed along a ramp does that, or a filter of the speed, as in a GPS: log the "
        "speed of the wheels, or stops by the brakes alone",
    )


def unseen_channels(
    effects: Iterable[Effect], columns: Mapping[str, NDArray[Any]]
) -> tuple[str, ...]:
    """A sentence for each effect whose columns are missing or have gaps: they count as 0 there."""
    sentences = []
    for effect in effects:
        needed = sorted(registry.law_of(effect).channels)
        missing = [name for name in needed if name not in columns]
        gaps = [
            name
            for name in needed
            if name in columns and not np.isfinite(np.asarray(columns[name], np.float64)).all()
        ]
        if missing:
            names = ", ".join(missing)
            sentences.append(f"{effect.name} needs {names}, which the log does not have: 0")
        if gaps:
            names = ", ".join(gaps)
            sentences.append(f"{effect.name} needs {names}, which has gaps: 0 there at least")
    return tuple(sentences)
