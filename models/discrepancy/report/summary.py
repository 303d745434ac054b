"""Findings in words: what is missing, how sure, what it changes in metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.discrepancy.decide.verdict import Decision
from models.discrepancy.findings import (
    Estimate,
    Gap,
    LocatedAxis,
    NamedEffect,
    Verdict,
)  # fmt: skip
from models.discrepancy.model.hypothesis import BASE, free_parameters
from models.discrepancy.search.locate import Followed, part_of_axis
from models.discrepancy.thresholds import LOCATED
from models.effects.registry import LAWS
from models.parameters import Effect


def named_effects(
    decision: Decision, located: Sequence[Followed], widths: dict[str, dict[str, float]]
) -> tuple[NamedEffect, ...]:
    """Effects of an explanation with numbers, confidence and alternatives.

    Args:
        decision: explanation and rivals. located: axes. widths: standard deviations of places and
            times of change, see :func:`models.discrepancy.search.extent.extents`.
    """
    if decision.verdict not in (Verdict.MISSING_EFFECT, Verdict.AMBIGUOUS):
        return ()
    fit = decision.explanation.fit
    std = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    named = []
    k = BASE
    own = set(decision.explanation.names)
    for effect, confidence in zip(fit.hypothesis.added, decision.confidence, strict=True):
        law = LAWS[effect.name].parameters
        free = free_parameters(effect)
        values = {}
        for name, value in effect.parameters.items():
            error = float(std[k + free.index(name)]) if name in free else 0.0
            error = widths.get(effect.name, {}).get(name, error)
            values[name] = Estimate(float(value), error, law[name].unit)
        k += len(free)
        others = []
        for rival in decision.rivals:
            if effect.name not in rival.names:
                others += [n for n in rival.names if n not in own and n not in others]
        along = next((f for f in located if f.axis.name == LAWS[effect.name].axis), None)
        named.append(
            NamedEffect(effect.name, values, confidence, tuple(others), _where(effect, along))
        )
    # The surest first; of equals, the one that was found first.
    return tuple(sorted(named, key=lambda e: -round(e.confidence, 2)))


def located_axes(
    decision: Decision, located: Sequence[Followed], above_floor: float
) -> tuple[LocatedAxis, ...]:
    """Axes that the refitted base disagrees along, those that the named effects act along first.

    Args:
        decision: names, if there are any. located: what the refitted base follows.
        above_floor: mean square of its residual speeds above that of a perfect model [m²/s²].
    """
    certain = [f for f in located if f.p_value < LOCATED]
    acting = [LAWS[n].axis for n in decision.explanation.fit.hypothesis.names]
    if decision.axis is not None and not acting:
        acting = [decision.axis.axis.name]
    certain.sort(key=lambda f: (f.axis.name not in acting, -f.strength))
    found = []
    for f in certain:
        low, high = part_of_axis(f)
        share = float(np.clip(f.removed / max(above_floor, 1e-12), 0.0, 1.0))
        found.append(LocatedAxis(f.axis.name, low, high, f.axis.unit, share, f.p_value))
    return tuple(found)


def _where(effect: Effect, along: Followed | None) -> str:
    where = LAWS[effect.name].where
    if where is not None:
        return where(effect.parameters)
    axis = LAWS[effect.name].axis
    if along is None:
        return f"along {axis}"
    low, high = part_of_axis(along)
    if along.axis.unit == "rad":
        return f"along {axis}, most at {np.rad2deg(low):.0f}° … {np.rad2deg(high):.0f}°"
    return f"along {axis}, most at {low:.3g} … {high:.3g} {along.axis.unit}".rstrip()


def summary(decision: Decision, distance: Gap, longer: float) -> str:
    """One or two sentences.

    Args:
        decision: verdict and names. distance: gap in stopping distance.
        longer: how much longer stops are than configured, 95 % quantile [m].
    """
    names = " and ".join(LAWS[n].missing for n in decision.explanation.fit.hypothesis.names)
    match decision.verdict:
        case Verdict.NONE:
            text = "The model stops as the log does: nothing is missing that this log could show."
        case Verdict.PARAMETER_DRIFT:
            text = "The model is right in kind, its coefficients or dead time are not: refitted."
        case Verdict.MISSING_EFFECT:
            text = f"The model leaves out: {names}."
        case Verdict.AMBIGUOUS:
            others = "; ".join(" and ".join(r.names) for r in decision.rivals[:3])
            text = f"The model most likely leaves out: {names}; {others} would fit nearly as well."
        case Verdict.UNIDENTIFIABLE:
            causes = " or ".join(a.name for a in decision.absorbed)
            text = f"New coefficients fit, but so does {causes}: this log cannot tell which it is."
        case Verdict.UNKNOWN:
            axis = decision.axis.axis.name if decision.axis else "no single axis"
            text = f"Something is missing that no known effect explains; it follows {axis}."
    if decision.verdict is Verdict.NONE:
        return text
    way = "longer" if longer >= 0.0 else "shorter"
    return (
        f"{text} Stops of this log are up to {abs(longer):.2f} m {way} than the model said; "
        f"typically {distance.before:.2f} m off before, {distance.after:.2f} m after."
    )
