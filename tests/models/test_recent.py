"""Results of the last few arguments are computed once; objects are compared by identity."""

from __future__ import annotations

import numpy as np

from slopewise.models.recent import Recent


def test_same_objects_and_equal_numbers_have_one_result() -> None:
    calls: list[float] = []
    recent: Recent[int] = Recent()
    ground, duplicate = np.zeros(3), np.zeros(3)

    def length() -> int:
        calls.append(1.0)
        return len(calls)

    assert recent.get(length, ground, 0.1 + 0.2) == 1
    assert recent.get(length, ground, 0.1 + 0.2) == 1
    assert recent.get(length, duplicate, 0.1 + 0.2) == 2
    assert recent.get(length, ground, 0.4) == 3


def test_only_the_last_few_are_cached() -> None:
    recent: Recent[int] = Recent(2)
    arguments = [object() for _ in range(3)]
    for n, argument in enumerate(arguments):
        assert recent.get(lambda n=n: n, argument) == n  # type: ignore[misc]
    assert recent.get(lambda: 10, arguments[2]) == 2
    assert recent.get(lambda: 10, arguments[0]) == 10
