"""Effects that a log cannot tell from other values of the model's own coefficients.

An effect whose share of the force is the same in all stops, up to what the coefficients can do, is
absorbed by them; so is a pitch sensor that is mounted askew, to first order: with the grade read
δ too high, b_b comes out (1 + b_m) δ too low and m_b by m_m δ. Where the model as configured with
one such cause explains the log as well as four new coefficients, the log cannot tell which it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.search.candidates import candidates
from slopewise.models.discrepancy.search.patches import left_of
from slopewise.models.discrepancy.search.refine import Fit, fit, residual
from slopewise.models.discrepancy.search.screening import reduced, scores
from slopewise.models.discrepancy.thresholds import ABSORBED_SHARE, P_ABSORBED, USUAL_GRADE_BIAS
from slopewise.models.effects.registry import LAWS

GRADE_BIAS = "grade_bias"
"""A pitch sensor or a map that is off by the same angle everywhere."""


@dataclass(frozen=True, slots=True)
class Absorbed:
    """A cause that new coefficients would hide.

    Attributes:
        name: of the effect, or :data:`GRADE_BIAS`. strength: that explains the log.
        test: what would tell it from new coefficients, in words.
    """

    name: str
    strength: float
    test: str


_TELLS_BIAS = (
    "stand still on ground of known slope, or drive the same slope both ways, and read the pitch; "
    "or coast: without brakes a wrong grade shows and brakes do not"
)


def absorbed_explanations(
    table: StopTable, base: Fit, taken_up: Mapping[str, float]
) -> tuple[Absorbed, ...]:
    """Single causes that explain what otherwise four new coefficients and a dead time do.

    Args:
        table: stops. base: refitted model. taken_up: share of each effect's column that the
            coefficients take up, by name.
    """
    configured = Hypothesis.configured(base.hypothesis.model)
    configured = replace(configured, oscillation=base.hypothesis.oscillation)
    # Only the cause is free: the coefficients stay as configured.
    as_it_is = fit(table, configured, base.white, passes=0)
    limit = base.deviance + float(chi2.isf(P_ABSORBED, 4)) * len(table) / max(len(table) - 5, 1)
    found = []
    bias = _bias(table, configured, base)
    if bias is not None and abs(bias[0]) <= USUAL_GRADE_BIAS and bias[1] < limit:
        found.append(Absorbed(GRADE_BIAS, bias[0], _TELLS_BIAS))
    names = {name for name, share in taken_up.items() if share >= ABSORBED_SHARE}
    if names:
        found += _effects(table, as_it_is, names, limit)
    return tuple(found)


def _bias(table: StopTable, configured: Hypothesis, base: Fit) -> tuple[float, float] | None:
    """Angle by which all grades would have to be off, and −2 log likelihood with it."""
    step = 1e-3
    here = fit(table, configured, base.white, passes=0)
    moved = replace(table, grade=table.grade + step)
    slope = (residual(moved, configured) - residual(table, configured)) / step
    gain, chi_square = _one_number(base, residual(table, configured), slope)
    if chi_square <= 0.0:
        return None
    return gain, here.deviance - chi_square


def _one_number(base: Fit, left: Floats, slope: Floats) -> tuple[float, float]:
    """Best multiple of a change of the residual, and the chi square that it takes away."""
    white = base.white
    weight = 1.0 / (1.0 + white.noise.scatter**2 * white.power)
    both = white.bins @ np.stack((left, slope), axis=2)
    between, within = white.split(both)
    products = np.einsum("ska,skb->ab", within, within)
    products += np.einsum("s,sa,sb->ab", weight, between, between)
    if products[1, 1] <= 0.0:
        return 0.0, 0.0
    gain = -products[0, 1] / products[1, 1]
    return float(gain), float(products[0, 1] ** 2 / products[1, 1])


def _effects(table: StopTable, as_it_is: Fit, names: set[str], limit: float) -> list[Absorbed]:
    library, columns = candidates(table, as_it_is.hypothesis)
    own = [i for i, c in enumerate(library) if c.name in names]
    white = as_it_is.white
    nothing = np.zeros((*table.time.shape, 1))
    sums = reduced(white, nothing, columns[:, :, own], np.ones(1))
    one_sided = np.array([library[i].search.one_sided for i in own])
    scored = scores(sums, left_of(table, as_it_is), white.noise.scatter, one_sided)
    found: dict[str, Absorbed] = {}
    for i in np.argsort(-np.abs(scored.z)):
        candidate = library[own[i]]
        wrong_sign = candidate.search.one_sided and scored.z[i] <= 0.0
        if wrong_sign or as_it_is.deviance - float(scored.z[i]) ** 2 > limit:
            continue
        text = LAWS[candidate.name].experiment
        found.setdefault(candidate.name, Absorbed(candidate.name, float(scored.strength[i]), text))
    return list(found.values())
