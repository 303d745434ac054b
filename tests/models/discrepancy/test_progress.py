"""Progress of an investigation."""

from __future__ import annotations

import pytest

from slopewise.models.discrepancy.progress import Progress, Stage
from slopewise.models.discrepancy.workflow import investigate
from tests.models.discrepancy.logs import log
from tests.models.models_for_tests import BASE


def test_each_hundredth_is_reported_once() -> None:
    reported: list[int] = []
    investigate(*log("clean"), BASE, advance=reported.append)
    assert min(reported) > 0
    assert sum(reported) == Stage.FINDINGS == 100


@pytest.mark.parametrize("parents", [1, 3])
def test_each_level_of_the_search_uses_half_of_the_remainder(parents: int) -> None:
    reported: list[int] = []
    progress = Progress(reported.append)
    reached = []
    for level in range(6):
        for index in range(parents):
            progress.search(level, (index + 1) / parents)
            reached.append(sum(reported))
    assert reached == sorted(reached)
    assert reached[parents - 1] == (Stage.BASE + Stage.SEARCH) // 2
    assert reached[2 * parents - 1] == int(Stage.SEARCH - (Stage.SEARCH - Stage.BASE) / 4)
    assert reached[-1] <= Stage.SEARCH
    progress.reach(Stage.BASE)
    assert sum(reported) == reached[-1]
