"""Warnings about a calibration, as sentences.

Notes say what it rests on; objections, that no brakes have such numbers: then a log was misread.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from slopewise.models.calibration.force_fit import MIRRORED_SLOPE, NAMES
from slopewise.models.calibration.surface_fit import SurfaceFit
from slopewise.models.calibration.uphill import Asymmetry
from slopewise.models.parameters import Braking
from slopewise.models.stop_logs.drive_quality import SuspectKind
from slopewise.models.stop_logs.measured_log import MeasuredLog
from slopewise.models.stop_logs.mount_offset import Mount
from slopewise.models.stop_logs.stop_record import StopRecord

_MAX_FORCE = 1.2  # [1] of the weight; tyres on dry tarmac reach one
_LATEST = 1.5  # [s] no brakes of vehicles that plan take longer
_SIGNIFICANCE = 3.0  # [1] standard deviations by which a slope coefficient shows a wrong sign
_TOO_LONG = 3.0
"""Median factor of allowed over actual distance from which a promise is of little use [1]."""


def notes(base: SurfaceFit, mount: Mount, known: Braking, uneven: Asymmetry | None) -> list[str]:
    """Sentences on the base.

    Args:
        base: its fit. mount: pitch sensor's. known: braking so far. uneven: the change of the
            slope coefficient uphill, if it was fitted.
    """
    texts = []
    if not mount.known and base.records[0].samples.grade is None:
        shift = float(np.deg2rad(1.0) * (1.0 + base.fit.coefficients[1]))
        texts.append(
            "mount offset of the pitch sensor cannot be identified from this log (it takes a map, "
            f"heights, or ground driven both ways): each degree would shift b_b by {shift:.4f}; "
            "the covariance allows for half a degree as a standard deviation"
        )
    if known.uphill is not None and uneven is None:
        texts.append(
            "separate coefficients for uphill were dropped: one slope is fitted for both ways"
        )
    if uneven is not None:
        texts.append(
            f"uphill the slope coefficient differs by {uneven.value:+.2f} ± {uneven.std:.2f}: it "
            "has separate coefficients, with which nothing is learned while driving"
        )
    weak = [n for n, share in zip(NAMES, base.fit.learned, strict=True) if share < 0.5]
    if weak:
        texts.append(f"the stops say little about {', '.join(weak)}: kept near the model so far")
    texts += _corners(base)
    out = [r for r in base.records if not r.kept]
    if out:
        worst = max(r.samples.distance - r.predicted_distance for r in out)
        texts.append(
            f"{len(out)} of {len(base.records)} stops fit no other: the coefficients do not rest "
            f"on them, the promised distances do; the longest was {worst:+.2f} m beyond its "
            "prediction"
        )
    if not any(r.samples.session for r in base.records):
        texts.append(
            "the log has no column session: each run counts as one; name days, or other "
            "conditions, in it"
        )
    return texts


def _corners(base: SurfaceFit) -> list[str]:
    """Corners of the trained rectangle that the stops do not reach, as a sentence."""
    listed = ", ".join(
        f"{c.speed:.1f} m/s at {np.rad2deg(c.grade):+.0f}° (force {c.force:.2f} ± {c.std:.2f})"
        for c in base.corners
    )
    held = "" if base.speed_by_grade is None else ", and plans are no faster than what was driven"
    return [f"no stop was near {listed}: there the model extrapolates{held}"] if listed else []


class SurfaceStops(NamedTuple):
    """Stops of one vehicle of a fleet on one surface, named as those of a :class:`.SurfaceFit`."""

    name: str
    records: Sequence[StopRecord]
    slope_at_middle: tuple[float, float]


def objections(surfaces: Iterable[SurfaceFit | SurfaceStops], dead_time: float) -> tuple[str, ...]:
    """Faults of a vehicle's calibration, as sentences; empty without any. dead_time: [s]."""
    texts = []
    if dead_time > _LATEST:
        texts.append(
            f"a dead time of {dead_time:.2f} s, where {_LATEST:g} s is the longest that "
            "brakes have: is v_cmd the command that the vehicle followed?"
        )
    for surface in surfaces:
        on = f" on {surface.name}" if surface.name else ""
        force = float(np.median([r.force_ratio for r in surface.records]))
        if force > _MAX_FORCE:
            texts.append(
                f"braking forces of {force:.2f} of the weight{on}, where {_MAX_FORCE:g} is a lot"
            )
        slope, std = surface.slope_at_middle
        if slope + _SIGNIFICANCE * std < MIRRORED_SLOPE:
            texts.append(
                f"the grade of the log has the wrong sign{on}: by it the vehicle decelerates less "
                f"the steeper it drives uphill (slope coefficient {slope:.2f} ± {std:.2f}, where "
                f"the weight alone gives more than {MIRRORED_SLOPE:g}): pitch counts nose down as "
                "positive, and a grade from a map uphill"
            )
        actual = np.array([r.samples.distance for r in surface.records])
        bound = np.array([r.bound_distance for r in surface.records])
        longer = float(np.median(bound / np.maximum(actual, 1e-6)))
        if longer > _TOO_LONG:
            texts.append(f"plans allow {longer:.1f} times the length of the stops{on}")
    return tuple(texts)


def lost_samples(log: MeasuredLog) -> tuple[str, ...]:
    """Objection to a log that loses samples in most stops: then the others lose some unseen."""
    steps = [s for s in log.suspects if s.kind is SuspectKind.STEP]
    if 2 * len(steps) <= len(log.windows):
        return ()
    return (
        f"{len(steps)} falls of v that no vehicle makes in {len(log.windows)} stops, such as "
        f"{steps[0].reason}: samples are lost where time shows no gap",
    )
