"""Findings as text: missing effects, confidence, change in metres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.verdict import Decision
from slopewise.models.discrepancy.findings import Estimate, Gap, LocatedAxis, NamedEffect, Verdict
from slopewise.models.discrepancy.likelihood.prior import RULED_OUT
from slopewise.models.discrepancy.likelihood.residual_axes import ResidualAxis
from slopewise.models.discrepancy.report.text import UNSEEN
from slopewise.models.effects.registry import LAWS
from slopewise.models.parameters import Effect


def named_effects(decision: Decision, located: Sequence[ResidualAxis]) -> tuple[NamedEffect, ...]:
    """Effects of an explanation with numbers, confidence and alternatives."""
    if decision.verdict not in (Verdict.MISSING_EFFECT, Verdict.AMBIGUOUS):
        return ()
    fit = decision.explanation
    named = []
    named_already = set(decision.names)
    covariances = fit.of_effects
    for i in decision.named:
        effect = fit.hypothesis.added[i]
        law, std = LAWS[effect.name].parameters, np.sqrt(np.diag(covariances[i]))
        values = {
            name: Estimate(float(value), float(error), law[name].unit)
            for (name, value), error in zip(effect.parameters.items(), std, strict=True)
        }
        alternatives = []
        for alternative in decision.alternatives:
            if effect.name not in alternative.names:
                alternatives += [
                    n for n in alternative.names if n not in named_already and n not in alternatives
                ]
        along = next((f for f in located if f.axis.name == LAWS[effect.name].axis), None)
        named.append(
            NamedEffect(
                *(effect.name, values, decision.confidence[i], tuple(alternatives)),
                _where(effect, along),
            )
        )
    # By confidence; of equals, in the order of the search.
    return tuple(sorted(named, key=lambda e: -round(e.confidence, 2)))


def located_axes(
    decision: Decision, located: Sequence[ResidualAxis], above_floor: float, structure: float
) -> tuple[LocatedAxis, ...]:
    """Axes that the refitted base disagrees along, those that the named effects act along first.

    Args:
        decision: names, if there are any. located: what the refitted base follows.
        above_floor: mean square of its residual speeds above that of a perfect model [m²/s²].
        structure: p-value below which an axis contradicts that nothing is missing.
    """
    calm = decision.verdict in (Verdict.NONE, Verdict.TOO_NOISY)
    certain = [f for f in located if f.p_value < (structure if calm else RULED_OUT)]
    acting = [LAWS[n].axis for n in decision.names]
    if decision.axis is not None and not acting:
        acting = [decision.axis.axis.name]
    certain.sort(key=lambda f: (f.axis.name not in acting, -f.strength))
    axes = []
    for f in certain:
        low, high = f.part
        share = float(np.clip(f.removed / max(above_floor, 1e-12), 0.0, 1.0))
        axes.append(LocatedAxis(f.axis.name, low, high, f.axis.unit, share, f.p_value))
    return tuple(axes)


def _where(effect: Effect, along: ResidualAxis | None) -> str:
    where = LAWS[effect.name].where
    if where is not None:
        return where(effect.parameters)
    axis = LAWS[effect.name].axis
    if along is None:
        return f"along {axis}"
    if along.axis.name == "heading" and "direction" in effect.parameters:
        return f"along {axis}, most at {np.rad2deg(effect.parameters['direction']) % 360.0:.0f}°"
    low, high = along.part
    if along.axis.unit == "rad":
        return f"along {axis}, most at {np.rad2deg(low):.0f}° … {np.rad2deg(high):.0f}°"
    return f"along {axis}, most at {low:.3g} … {high:.3g} {along.axis.unit}".rstrip()


def summary(
    table: StopTable,
    decision: Decision,
    visible: Mapping[str, float],
    distance: Gap,
    ends: tuple[float, float],
) -> str:
    """One or two sentences.

    Args:
        table: stops. decision: verdict and names. visible: change of a stop from which an effect
            would have been seen, by name [m]. distance: gap in stopping distance.
        ends: how much longer than configured stops are, the least and the most [m].
    """
    names = " and ".join(LAWS[n].missing for n in dict.fromkeys(decision.names))
    match decision.verdict:
        case Verdict.NONE:
            text = "The model stops as the log does. " + _not_seen(table, visible)
        case Verdict.TOO_NOISY:
            text = "This log is too noisy to say whether anything is missing. "
            text += _not_seen(table, visible)
        case Verdict.PARAMETER_DRIFT:
            text = "The model is right in kind, its coefficients or dead time are not: refitted."
        case Verdict.MISSING_EFFECT:
            text = f"The model lacks: {names}."
        case Verdict.AMBIGUOUS:
            alternatives = "; ".join(
                " and ".join(r.names) or "new coefficients alone" for r in decision.alternatives[:3]
            )
            text = f"The model most likely lacks: {names}; "
            text += f"{alternatives} would fit nearly as well."
        case Verdict.UNIDENTIFIABLE:
            causes = " or ".join(decision.absorbed)
            text = f"New coefficients fit, but so does {causes}: this log cannot distinguish them."
        case Verdict.UNKNOWN:
            axis = decision.axis.axis.name if decision.axis else "no single axis"
            text = f"Something is missing that no known effect explains; it follows {axis}."
    if decision.verdict in (Verdict.NONE, Verdict.TOO_NOISY):
        return text
    return (
        f"{text} Stops of this log are {_both_ways(*ends)} than the model predicts; "
        f"typically {distance.before:.2f} m off before, {distance.after:.2f} m after."
    )


def _both_ways(shortest: float, longest: float) -> str:
    """The largest change of each sign, the dangerous one first."""
    longer, shorter = f"up to {longest:.2f} m longer", f"up to {-shortest:.2f} m shorter"
    if shortest >= -UNSEEN:
        return longer
    return shorter if longest <= UNSEEN else f"{longer} and {shorter}"


def _not_seen(table: StopTable, visible: Mapping[str, float]) -> str:
    """Change of stops from which an effect would have shown in this log, as a sentence."""
    sizes = sorted((size, name) for name, size in visible.items() if np.isfinite(size))
    if not sizes:
        return "Its stops are too much alike to show any effect."
    (shortest, first), (longest, last) = sizes[0], sizes[-1]
    mean = float(np.mean(table.distance))
    plain = f"An effect would have shown from {_length(shortest, mean)} a stop on ({first})"
    return plain + (f" to {_length(longest, mean)} ({last})." if last != first else ".")


def _length(size: float, mean: float) -> str:
    return f"{size:.2f} m or {size / mean:.0%}" if size >= 0.01 else f"{1000.0 * size:.0f} mm"
