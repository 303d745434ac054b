"""An explanation as the model file knows it, where a finer form of its effects fits better."""

from __future__ import annotations

from dataclasses import replace

from models.discrepancy.data.stop_table import StopTable
from models.discrepancy.decide.verdict import Decision
from models.discrepancy.search.refine import fit_with_scatter

_FORMS = {
    "slips": "that place is slippery: friction caps the force there, where the model changes it by "
    "the same on any slope",
    "drifts": "wheels that slide drift sideways on cross slopes and slow less, which the model "
    "leaves out",
}
"""What the form that fits best is, by the attribute of the hypothesis."""


def as_in_the_model(table: StopTable, decision: Decision) -> Decision:
    """The decision with its effects refitted in the model's forms, and what these lack in words.

    What is compared, written and kept as a margin then belongs to what is planned with.
    """
    found = decision.explanation.fit
    forms = [form for form in _FORMS if getattr(found.hypothesis, form)]
    if not forms:
        return decision
    plain = replace(found.hypothesis, slips=False, drifts=False)
    made = fit_with_scatter(table, plain, found.noise, rounds=1)
    words = (_FORMS[form] for form in forms)
    explanation = replace(decision.explanation, fit=made)
    return replace(decision, explanation=explanation, notes=(*decision.notes, *words))
