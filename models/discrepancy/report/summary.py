"""Findings in words: what is missing, how sure, what it changes in metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.verdict import Decision
from slopewise.models.discrepancy.findings import (
    Estimate,
    Gap,
    LocatedAxis,
    NamedEffect,
    Verdict,
)
from slopewise.models.discrepancy.model.hypothesis import BASE, free_parameters
from slopewise.models.discrepancy.search.locate import Followed, part_of_axis
from slopewise.models.discrepancy.thresholds import LOCATED
from slopewise.models.effects.registry import LAWS
from slopewise.models.parameters import Effect

_UNSEEN = 0.005  # change of a stop that two decimals do not show [m]


def named_effects(
    decision: Decision, located: Sequence[Followed], widths: Sequence[dict[str, float]]
) -> tuple[NamedEffect, ...]:
    """Effects of an explanation with numbers, confidence and alternatives.

    Args:
        decision: explanation and rivals. located: axes. widths: standard deviations of places and
            times of change, see :func:`slopewise.models.discrepancy.search.extent.extents`.
    """
    if decision.verdict not in (Verdict.MISSING_EFFECT, Verdict.AMBIGUOUS):
        return ()
    fit = decision.explanation.fit
    std = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    named = []
    k = BASE
    own = set(decision.names)
    each = zip(fit.hypothesis.added, decision.confidence, widths, strict=True)
    for i, (effect, confidence, places) in enumerate(each):
        law = LAWS[effect.name].parameters
        free = free_parameters(effect)
        values = {}
        for name, value in effect.parameters.items():
            error = float(std[k + free.index(name)]) if name in free else 0.0
            error = places.get(name, error)
            values[name] = Estimate(float(value), error, law[name].unit)
        k += len(free)
        if i not in decision.named:
            continue
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
    decision: Decision, located: Sequence[Followed], above_floor: float, structure: float
) -> tuple[LocatedAxis, ...]:
    """Axes that the refitted base disagrees along, those that the named effects act along first.

    Args:
        decision: names, if there are any. located: what the refitted base follows.
        above_floor: mean square of its residual speeds above that of a perfect model [m²/s²].
        structure: p-value below which an axis contradicts that nothing is missing.
    """
    calm = decision.verdict in (Verdict.NONE, Verdict.TOO_NOISY)
    certain = [f for f in located if f.p_value < (structure if calm else LOCATED)]
    acting = [LAWS[n].axis for n in decision.names]
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
    if along.axis.periodic and "direction" in effect.parameters:
        return f"along {axis}, most at {np.rad2deg(effect.parameters['direction']) % 360.0:.0f}°"
    low, high = part_of_axis(along)
    if along.axis.unit == "rad":
        return f"along {axis}, most at {np.rad2deg(low):.0f}° … {np.rad2deg(high):.0f}°"
    return f"along {axis}, most at {low:.3g} … {high:.3g} {along.axis.unit}".rstrip()


def summary(table: StopTable, decision: Decision, distance: Gap, ends: tuple[float, float]) -> str:
    """One or two sentences.

    Args:
        table: stops. decision: verdict and names. distance: gap in stopping distance.
        ends: how much longer than configured stops are, the least and the most [m].
    """
    names = " and ".join(LAWS[n].missing for n in dict.fromkeys(decision.names))
    match decision.verdict:
        case Verdict.NONE:
            text = "The model stops as the log does. " + _not_seen(table, decision)
        case Verdict.TOO_NOISY:
            text = "This log is too noisy to say whether anything is missing. "
            text += _not_seen(table, decision)
        case Verdict.PARAMETER_DRIFT:
            text = "The model is right in kind, its coefficients or dead time are not: refitted."
        case Verdict.MISSING_EFFECT:
            text = f"The model leaves out: {names}."
        case Verdict.AMBIGUOUS:
            others = "; ".join(
                " and ".join(r.names) or "new coefficients alone" for r in decision.rivals[:3]
            )
            text = f"The model most likely leaves out: {names}; {others} would fit nearly as well."
        case Verdict.UNIDENTIFIABLE:
            causes = " or ".join(a.name for a in decision.absorbed)
            text = f"New coefficients fit, but so does {causes}: this log cannot tell which it is."
        case Verdict.UNKNOWN:
            axis = decision.axis.axis.name if decision.axis else "no single axis"
            text = f"Something is missing that no known effect explains; it follows {axis}."
    if decision.verdict in (Verdict.NONE, Verdict.TOO_NOISY):
        return text
    return (
        f"{text} Stops of this log are {_both_ways(*ends)} than the model said; "
        f"typically {distance.before:.2f} m off before, {distance.after:.2f} m after."
    )


def _both_ways(least: float, most: float) -> str:
    """The largest change of each sign, the dangerous one first."""
    longer, shorter = f"up to {most:.2f} m longer", f"up to {-least:.2f} m shorter"
    if least >= -_UNSEEN:
        return longer
    return shorter if most <= _UNSEEN else f"{longer} and {shorter}"


def _not_seen(table: StopTable, decision: Decision) -> str:
    """How much an effect has to change stops to show in this log, in a sentence."""
    sizes = sorted((size, name) for name, size in decision.visible.items() if np.isfinite(size))
    if not sizes:
        return "Its stops are too much alike to show any effect."
    (least, first), (most, last) = sizes[0], sizes[-1]
    mean = float(np.mean(table.distance))
    plain = f"An effect would have shown from {_length(least, mean)} a stop on ({first})"
    return plain + (f" to {_length(most, mean)} ({last})." if last != first else ".")


def _length(size: float, mean: float) -> str:
    return f"{size:.2f} m or {size / mean:.0%}" if size >= 0.01 else f"{1000.0 * size:.0f} mm"
