from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slopewise.models.errors import InputError
from slopewise.services.planning.plan_questions import check, resampled, usable_of
from slopewise.services.settings.service_settings import SizeLimits
from slopewise.services.wire.messages import Path, PlanRequest

SIZES = SizeLimits(candidates=3, points=50, stations=200)


def line(name: str, length: float, **more: Any) -> Path:
    along = np.linspace(0.0, length, 20)
    return Path(name=name, points=np.stack([along, 0.0 * along], axis=1), **more)


def asked(**fields: Any) -> PlanRequest:
    return PlanRequest(**{"speed": 1.0, "paths": [line("a", 10.0)], **fields})


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"paths": [line(name, 1.0) for name in "abcd"]}, "paths"),
        ({"client": "robot"}, "pose"),
        ({"client": "robot", "pose": (0.0, 1e10, 0.0)}, "pose"),
        ({"client": "robot", "pose": (0.0, 0.0, float("nan"))}, "pose"),
        ({"speed": 1e4}, "speed"),
        ({"speed": float("nan")}, "speed"),
        ({"speed": -0.1}, "speed"),
    ],
)
def test_what_cannot_be_answered_names_its_field(fields: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError) as caught:
        check(asked(**fields), SIZES, "plan")
    assert (caught.value.source, caught.value.field) == ("plan", field)


def test_a_named_client_may_roll_backwards() -> None:
    check(asked(client="robot", pose=(0.0, 0.0, 0.0), speed=-0.1), SIZES, "plan")


def test_all_candidates_together_have_a_largest_size() -> None:
    three = [line(name, 20.0) for name in "abc"]
    usable, refused = usable_of(asked(paths=three), SIZES, 1.0, "plan")
    assert [u.path.name for u in usable] == ["a", "b", "c"]
    assert refused == []
    with pytest.raises(InputError, match="at most 200 stations in all, got 249"):
        usable_of(asked(paths=three), SIZES, 0.25, "plan")


def test_lengths_of_many_are_each_its_own() -> None:
    """They are measured in one go: a fault of one is not its neighbour's."""
    paths = [line("a", 20.0), line("far", 1e10), line("b", 30.0)]
    paths[0].points[7] = paths[0].points[6]
    usable, refused = usable_of(asked(paths=paths), SIZES, 1.0, "plan")
    assert [u.path.name for u in usable] == ["b"]
    assert [(c.name, c.reason) for c in refused] == [
        ("a", "points[7]: expected a place of its own: stations have to grow"),
        ("far", "points: expected finite coordinates [m]"),
    ]


def test_the_way_known_free_is_a_candidates_own_or_the_questions() -> None:
    paths = [line("own", 10.0, clear=3.0), line("shared", 10.0)]
    usable, _ = usable_of(asked(paths=paths, clear=7.0), SIZES, 1.0, "plan")
    assert [u.clear for u in usable] == [3.0, 7.0]
    usable, _ = usable_of(asked(paths=paths), SIZES, 1.0, "plan")
    assert [u.clear for u in usable] == [3.0, np.inf]


def test_a_path_that_turns_back_on_itself_is_refused_and_the_others_stay() -> None:
    cusp = Path(name="cusp", points=np.array([[0.0, 0.0], [5.0, 0.0], [0.5, 0.01]]))
    offered, refused = usable_of(asked(paths=[cusp, line("a", 10.0)]), SIZES, 0.5, "plan")
    assert refused == []
    usable, refused = resampled(offered, 0.5, 0.3)
    assert [u.path.name for u in usable] == ["a"]
    assert [c.name for c in refused] == ["cusp"]
    assert "cusp" in refused[0].reason
