"""An explanation as the model file knows it, where a finer form of its effects fits better."""

from __future__ import annotations

from dataclasses import replace

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.verdict import Decision
from slopewise.models.discrepancy.model.hypothesis import Hypothesis, is_placed
from slopewise.models.discrepancy.search.candidates import is_cap
from slopewise.models.discrepancy.search.refine import fit_with_scatter

_SLIPPERY = "that place is slippery: friction caps the force there, on any slope"
_DRIFTS = "wheels that slide drift sideways on cross slopes, and slow less"


def as_in_the_model(table: StopTable, decision: Decision) -> Decision:
    """The decision with its effects refitted in the model's forms, and what these lack in words.

    What is compared, written and kept as a margin then belongs to what is planned with.
    """
    found = decision.explanation.fit
    words = _left_out(found.hypothesis)
    if not words:
        return decision
    plain = replace(found.hypothesis, slips=False, drifts=False)
    made = fit_with_scatter(table, plain, found.noise, rounds=1)
    explanation = replace(decision.explanation, fit=made)
    return replace(decision, explanation=explanation, notes=(*decision.notes, *words))


def _left_out(hypothesis: Hypothesis) -> tuple[str, ...]:
    """What such effects do that their forms in a model do not."""
    slips = hypothesis.slips and any(map(is_placed, hypothesis.added))
    drifts = hypothesis.drifts and (slips or any(map(is_cap, hypothesis.names)))
    told = ((_SLIPPERY, slips), (_DRIFTS, drifts))
    return tuple(f"{words}, which the model leaves out" for words, is_so in told if is_so)
