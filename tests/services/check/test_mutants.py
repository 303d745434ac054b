"""Plans of a planner that is wrong in one place are found, those of the honest one are not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import islice, zip_longest
from pathlib import Path

import pytest

from slopewise.services.check.plan_checker import check_plan_on_map
from tests.planner.test_real_terrain import CASES
from tests.services.check.mutants import MUTATIONS, Question, matters, questions, stripped

REQUIRED = 50
"""Unsafe mutants of each kind at night, 200 in all."""


def mixed(data: Path, cases: list[tuple[str, str]]) -> Iterator[Question]:
    """Paths of all cases in turn."""
    each = [questions(place, vehicle, data, 50 + i) for i, (place, vehicle) in enumerate(cases)]
    for row in zip_longest(*each):
        yield from (question for question in row if question is not None)


def hunt(asked: Iterator[Question], count: int) -> tuple[Counter[str], list[str]]:
    """Unsafe mutants of each kind, up to count, and those that the checker lets pass."""
    unsafe: Counter[str] = Counter()
    missed = []
    for question in asked:
        honest = question.plan()
        for name, mutate in MUTATIONS.items():
            if unsafe[name] >= count:
                continue
            mutant = mutate(question)
            if not matters(mutant, honest, question):
                continue
            unsafe[name] += 1
            plan = stripped(mutant, question.path.name)
            if check_plan_on_map(plan, question.model, question.ground, clear=question.clear).valid:
                missed.append(f"{name}: {question.model.name} on {question.path.name}")
        if all(unsafe[name] >= count for name in MUTATIONS):
            break
    return unsafe, missed


def test_a_share_of_mutants_is_found(data: Path) -> None:
    unsafe, missed = hunt(islice(mixed(data, CASES[:4]), 12), count=4)
    assert not missed
    assert len(unsafe) >= 3
    assert unsafe.total() >= 10


@pytest.mark.nightly
@pytest.mark.timeout(3600)
def test_99_of_100_mutants_are_found(data: Path) -> None:
    unsafe, missed = hunt(mixed(data, CASES), REQUIRED)
    print(dict(unsafe), missed)
    assert unsafe == dict.fromkeys(MUTATIONS, REQUIRED)
    assert len(missed) <= 0.01 * unsafe.total(), missed
