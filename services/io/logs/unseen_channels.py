"""Which effects of a model a log cannot follow, because it lacks what they depend on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.effects import registry
from slopewise.models.parameters import Effect


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
            sentences.append(
                f"{effect.name} needs {', '.join(missing)}, which the log does not have: 0"
            )
        if gaps:
            sentences.append(
                f"{effect.name} needs {', '.join(gaps)}, which has gaps: 0 there at least"
            )
    return tuple(sentences)
