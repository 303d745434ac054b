"""Whoever waits is told how far an investigation is."""

from __future__ import annotations

import pytest

from slopewise.models.discrepancy.progress import Progress, Stage
from slopewise.models.discrepancy.workflow import investigate
from tests.models.discrepancy.logs import log
from tests.models.models_for_tests import BASE


def test_hundredths_are_told_once_and_all_of_them() -> None:
    told: list[int] = []
    investigate(*log("clean"), BASE, advance=told.append)
    assert min(told) > 0
    assert sum(told) == Stage.FINDINGS == 100


@pytest.mark.parametrize("parents", [1, 3])
def test_each_level_of_the_search_takes_half_of_what_is_left(parents: int) -> None:
    told: list[int] = []
    progress = Progress(told.append)
    reached = []
    for level in range(6):
        for index in range(parents):
            progress.search(level, (index + 1) / parents)
            reached.append(sum(told))
    assert reached == sorted(reached)
    assert reached[parents - 1] == (Stage.BASE + Stage.SEARCH) // 2
    assert reached[2 * parents - 1] == int(Stage.SEARCH - (Stage.SEARCH - Stage.BASE) / 4)
    assert reached[-1] <= Stage.SEARCH
    progress.reach(Stage.BASE)
    assert sum(told) == reached[-1]
