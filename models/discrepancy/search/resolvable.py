"""What a log could have shown: the least change of a stop by each effect, and what hides it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.search import screening
from slopewise.models.discrepancy.search.candidates import candidates
from slopewise.models.discrepancy.search.refine import Fit, prior_precision

_NAMED_FROM = 12.0
"""Chi square from which a name outweighs none: odds of 0.08, and the width of its prior [1]."""


@dataclass(frozen=True, slots=True)
class Resolvable:
    """Of each effect, by name.

    Attributes:
        visible: change of a stop, beyond new coefficients, from which five logs of six like this
            one name it [m]. absorbed: share of its column that new coefficients take up [1].
    """

    visible: Mapping[str, float]
    absorbed: Mapping[str, float]


def resolvable(table: StopTable, fit: Fit) -> Resolvable:
    """What the log could have shown.

    Args:
        table: stops. fit: refitted model.
    """
    found, columns = candidates(table, fit.hypothesis)
    sums = screening.reduced(fit.white, fit.jacobian, columns, prior_precision(fit.hypothesis))
    shares = sums.at(fit.noise.scatter).absorbed
    sizes = screening.visible(sums, table, fit, columns, _NAMED_FROM)
    visible: dict[str, float] = {}
    absorbed: dict[str, float] = {}
    for name in dict.fromkeys(c.name for c in found):
        own = [i for i, c in enumerate(found) if c.name == name]
        # Nobody chooses where a surface lies or which way the wind blows: the middle of the grid.
        visible[name] = float(np.median(sizes[own]))
        absorbed[name] = float(np.min(shares[own]))
    return Resolvable(visible, absorbed)
