"""What a user has to know before trusting a calibration, in sentences."""

from __future__ import annotations

import numpy as np

from slopewise.models.calibration.asymmetry import Asymmetry, asymmetry
from slopewise.models.calibration.force_fit import NAMES, WEAK_PRIOR
from slopewise.models.calibration.surface_fit import SurfaceFit
from slopewise.models.effects import registry
from slopewise.models.parameters import Braking, Model
from slopewise.models.stop_logs.mount_offset import Mount


def clear_asymmetry(base: SurfaceFit, beside: Model | None) -> Asymmetry | None:
    """The change of the slope coefficient uphill, where it is clear and nothing else has it."""
    laws = () if beside is None else [registry.LAWS[effect.name] for effect in beside.effect]
    if any(law.kinks_at_level and law.axis == "grade" for law in laws):
        return None
    found = _asymmetry(base)
    return found if found is not None and found.clear else None


def notes(base: SurfaceFit, mount: Mount, known: Braking, uneven: Asymmetry | None) -> list[str]:
    """Sentences on the base.

    Args:
        base: its fit. mount: of the pitch sensor. known: braking so far. uneven: the change of the
            slope coefficient uphill, if it was fitted.
    """
    said = []
    if not mount.known and base.records[0].samples.grade is None:
        shift = float(np.deg2rad(1.0) * (1.0 + base.fit.coefficients[1]))
        said.append(
            "mount offset of the pitch sensor cannot be told from this log (it takes a map, "
            f"heights, or ground driven both ways): each degree would shift b_b by {shift:.4f}; "
            "the covariance allows for half a degree as a standard deviation"
        )
    if known.uphill is not None and uneven is None:
        said.append(
            "coefficients of their own for uphill were dropped: one slope is fitted for both ways"
        )
    if uneven is not None:
        said.append(
            f"uphill the slope coefficient differs by {uneven.value:+.2f} ± {uneven.std:.2f}: it "
            "has coefficients of its own, with which nothing is learned while driving"
        )
    weak = [n for n, share in zip(NAMES, base.fit.learned, strict=True) if share < 0.5]
    if weak:
        said.append(f"the stops say little about {', '.join(weak)}: kept near the model so far")
    said += _corners(base)
    out = [r for r in base.records if not r.kept]
    if out:
        worst = max(r.samples.distance - r.predicted_distance for r in out)
        said.append(
            f"{len(out)} of {len(base.records)} stops fit no other: the coefficients do not rest "
            f"on them, the promised distances do; the longest was {worst:+.2f} m beyond its "
            "prediction"
        )
    if not any(r.samples.session for r in base.records):
        said.append(
            "the log has no column session: each run counts as one; name days, or other "
            "conditions, in it"
        )
    return said


def _corners(base: SurfaceFit) -> list[str]:
    """Corners of the trained rectangle that the stops do not reach, in a sentence."""
    corners = base.corners
    told = ", ".join(
        f"{c.speed:.1f} m/s at {np.rad2deg(c.grade):+.0f}° (force {c.force:.2f} ± {c.std:.2f})"
        for c in corners
    )
    if not corners:
        return []
    held = "" if base.speed_by_grade is None else ", and plans are no faster than what was driven"
    return [f"no stop was near {told}: there the model extrapolates{held}"]


def _asymmetry(base: SurfaceFit) -> Asymmetry | None:
    kept = [r for r in base.records if r.kept]
    return asymmetry(
        np.array([r.onset_speed for r in kept]),
        np.array([r.grade for r in kept]),
        np.array([r.force_ratio for r in kept]),
        np.array([r.force_std for r in kept]),
        WEAK_PRIOR,
    )
