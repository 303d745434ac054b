"""One lasting change during a log, F_b/W → scale F_b/W + δ from a run on: payload, brakes repaired.

What is planned comes after the log: there it holds everywhere. Effects by place are not scaled.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slopewise.models.arrays import Elementwise, Floats
from slopewise.models.effects.effect_law import POSITIVE, EffectLaw, Enters, Parameter, Search
from slopewise.models.effects.stops_seen import MIN_STOP_COUNT, StopsSeen


def changed_force(
    force: Elementwise, scale: Elementwise, delta: Elementwise, run: Elementwise
) -> Elementwise:
    """F_b/W after the change [1]."""
    return force * scale + delta


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    for first in np.unique(stops.run)[1:]:
        later = stops.run >= first
        if min(int(later.sum()), int((~later).sum())) >= MIN_STOP_COUNT:
            yield {"run": float(first)}, stops.demanded * later[:, None]


EFFECT = EffectLaw(
    missing="one lasting change during the log",
    enters=Enters.LASTING,
    law=changed_force,
    parameters={
        "scale": Parameter(
            unit="1", plausible=(0.05, 5.0), bounds=POSITIVE, default=1.0, step=0.02
        ),
        "delta": Parameter(unit="1", plausible=(-1.5, 1.5), default=0.0, step=0.01),
        "run": Parameter(unit="1", bounds=POSITIVE, default=0.0, step=1.0, fitted=False),
    },
    axis="run",
    experiment="repeat these stops as the vehicle was before",
    search=Search(
        columns=_columns, strength="scale", one_sided=False, offset=1.0, pauses_distinguish=True
    ),
    where=lambda p: f"from the log's run {p['run']:.0f} on, the first being 0",
    max_force=lambda _: {"scale": 1.0, "delta": 1.0},
    may_add=lambda p: p.get("scale", 1.0) > 1.0 or p.get("delta", 0.0) > 0.0,
)
