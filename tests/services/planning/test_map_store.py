"""Mappers that restart, send wrong numbers, or are late."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError
from slopewise.planner.ground import averaged_map
from slopewise.services.planning.map_store import MapStore
from slopewise.services.wire.plan_messages import MapUpdate

PATCH = {"patch": True, "elevation": np.ones((2, 2))}


def update(sequence: int, height: float = 0.0, **more: object) -> MapUpdate:
    fields: dict[str, object] = {
        "source": "mapper",
        "sequence": sequence,
        "resolution": 0.5,
        "origin": (0.0, 0.0),
        "elevation": np.full((20, 20), height),
    }
    return MapUpdate(**(fields | more))  # type: ignore[arg-type]


def height(store: MapStore) -> float:
    return float(store.snapshot.elevation_map.elevation[0, 0])


def flags(store: MapStore) -> list[str]:
    return store.snapshot.warnings.active()


def test_patches_change_their_cells_only() -> None:
    store = MapStore()
    with pytest.raises(InputError, match="whole map first"):
        store.apply(update(1, patch=True), "map")
    assert store.apply(update(1), "map")
    cells = {"patch": True, "elevation": np.full((2, 3), 7.0), "origin": (1.0, 0.5)}
    assert store.apply(update(2, **cells), "map")
    assert store.snapshot is not None
    expected = np.zeros((20, 20))
    expected[1:3, 2:5] = 7.0
    np.testing.assert_array_equal(store.snapshot.elevation_map.elevation, expected)
    assert not store.snapshot.incomplete


@pytest.mark.parametrize("patch", [False, True])
def test_a_mapper_may_know_nothing_any_more(*, patch: bool) -> None:
    store = MapStore()
    store.apply(update(1), "map")
    assert store.apply(update(2, patch=patch, elevation=np.full((20, 20), np.nan)), "map")
    assert np.isnan(store.snapshot.elevation_map.elevation).all()
    assert store.apply(update(3, **PATCH), "map")
    assert height(store) == 1.0


@pytest.mark.parametrize("others_wait", [False, True])
def test_maps_are_averaged_before_they_come_into_use(
    monkeypatch: pytest.MonkeyPatch, *, others_wait: bool
) -> None:
    store, noisy = (
        MapStore(wheel_radius=0.6),
        np.random.default_rng(others_wait).normal(0.0, 0.03, (20, 20)),
    )
    store.apply(update(1, elevation=noisy, height_std=0.03), "map", others_wait=others_wait)
    assert store.snapshot is not None
    counted: list[int] = []
    monkeypatch.setattr(averaged_map, "_average_heights", lambda *_: counted.append(1) or noisy)
    averaged_map.averaged_map(store.snapshot.elevation_map, 0.6)
    assert len(counted) == others_wait


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"resolution": 5e-324}, "resolution"),
        ({"origin": (1e308, 0.0)}, "origin"),
        ({"height_std": 1e308}, "height_std"),
        ({"height_std": float("nan")}, "height_std"),
        ({"height_std": 11.0, **PATCH}, "height_std"),
        ({"elevation": np.zeros((1, 3))}, "elevation"),
        ({"terrain_class": np.full((20, 20), 3.0), "class_names": ["", "a"]}, "terrain_class"),
        ({"terrain_class": np.full((20, 20), np.nan)}, "terrain_class"),
        ({**PATCH, "terrain_class": np.zeros((2, 2)), "class_names": ["a"]}, "class_names"),
        ({**PATCH, "origin": (0.6, 0.0)}, "origin"),
        ({**PATCH, "resolution": 0.25}, "resolution"),
        ({**PATCH, "origin": (9.5, 0.0)}, "patch"),
    ],
)
def test_an_unusable_update_names_the_field_and_changes_nothing(
    changes: dict[str, object], field: str
) -> None:
    store = MapStore()
    store.apply(update(1), "map")
    before = store.snapshot
    with pytest.raises(InputError) as caught:
        store.apply(update(2, **changes), "map")
    assert (caught.value.source, caught.value.field) == ("map", field)
    assert store.snapshot is before


def test_a_patch_makes_a_map_no_more_exact() -> None:
    store = MapStore()
    patch = {"patch": True, "elevation": np.zeros((2, 2))}
    for n, (changes, expected) in enumerate(
        (
            ({}, 0.02 + 0.05 * 0.5),
            ({"height_std": 0.05}, 0.05),
            (patch, 0.05),
            ({"height_std": 0.01, **patch}, 0.05),
            ({"height_std": 0.08, **patch}, 0.08),
            ({"height_std": 0.0}, 0.0),
        )
    ):
        assert store.apply(update(n + 1, **changes), "map")
        assert store.snapshot.elevation_map.height_std == pytest.approx(expected)
        assert store.snapshot.elevation_map.height_std_is_assumed == (n == 0)


def test_errors_of_a_map_are_shared_as_far_as_those_of_its_patches() -> None:
    store = MapStore()
    patch = {"patch": True, "elevation": np.zeros((2, 2))}
    steps = ((None, {}, 0.0), (0.3, {}, 0.3), (0.1, patch, 0.3), (0.5, patch, 0.5))
    for n, (length, part, expected) in enumerate(steps):
        assert store.apply(update(n + 1, correlation_length=length, **part), "map")
        assert store.snapshot.elevation_map.correlation_length == expected


def test_a_lost_patch_is_flagged_until_the_next_whole_map() -> None:
    store, incomplete = MapStore(), []
    patch = {"patch": True, "elevation": np.zeros((2, 2))}
    for n, changes in ((1, {}), (3, patch), (2, patch), (4, patch), (5, {})):
        store.apply(update(n, **changes), "map")
        incomplete.append(store.snapshot.incomplete)
    assert incomplete == [False, True, True, True, False]


def test_a_restarted_count_is_accepted_with_the_third_map_and_flagged() -> None:
    store = MapStore()
    store.apply(update(50), "map")
    assert not store.apply(update(1, 1.0), "map")
    assert flags(store) == ["maps of mapper count backwards: ignored"]
    assert not store.apply(update(2, 2.0), "map")
    assert store.apply(update(3, 3.0), "map")
    assert height(store) == 3.0
    assert flags(store) == ["maps of mapper: the source restarted its count"]
    assert store.restarts == 1
    assert store.apply(update(4, 4.0), "map")


def test_a_map_is_identified_by_sender_and_digest() -> None:
    """The digest depends on cells only, not on the sender; each patch changes it."""
    first, second = MapStore(), MapStore()

    def identity(store: MapStore, *change: object, **more: object) -> tuple[str, str]:
        assert store.apply(update(*change, **more), "map")  # type: ignore[arg-type]
        return store.snapshot.id, store.snapshot.digest

    original = identity(first, 7, 1.0, instance="a")
    assert original[0] == "mapper/a#7"
    same = identity(second, 1, 1.0)
    assert same == ("mapper#1", original[1])
    patch = {"patch": True, "elevation": np.full((2, 2), 1.0)}
    patched = identity(first, 8, instance="a", **patch)
    assert patched[1] != original[1]
    assert identity(first, 9, instance="a", **patch)[1] != patched[1]
    assert identity(second, 2, **patch)[1] == patched[1]
    assert identity(second, 3, 1.0)[1] == original[1]
    ground = ElevationMap(
        elevation=np.full((20, 20), 1.0),
        resolution=0.5,
        origin=(0.0, 0.0),
        height_std=second.snapshot.elevation_map.height_std,  # type: ignore[union-attr]
    )
    begun = MapStore(ground, "hill.tif").snapshot
    assert (begun.id, begun.digest) == ("hill.tif", original[1])


def test_one_huge_sequence_does_not_freeze_the_map() -> None:
    store = MapStore()
    store.apply(update(7), "map")
    store.apply(update(2**53, 1.0), "map")
    assert store.apply(update(8, 2.0), "map")
    assert height(store) == 2.0
    assert "uses two counts" in flags(store)[0]


def test_an_instance_of_its_own_counts_for_itself() -> None:
    store = MapStore()
    store.apply(update(50, instance="a"), "map")
    assert store.apply(update(1, 1.0, instance="b"), "map")
    assert height(store) == 1.0
    assert "was restarted" in flags(store)[0]
    assert not store.apply(update(1, 5.0, instance="b"), "map")


def test_patches_after_a_restart_are_incomplete_until_the_next_whole_map() -> None:
    for start in ({"instance": "b", "sequence": 1}, {"sequence": 3}):
        store = MapStore()
        store.apply(update(50), "map")
        for n in (1, 2) if start["sequence"] == 3 else ():
            store.apply(update(n, 9.0, patch=True, elevation=np.full((2, 2), float(n))), "map")
        patch = {"patch": True, "elevation": np.ones((2, 2)), **start}
        assert store.apply(update(**patch), "map")  # type: ignore[arg-type]
        assert store.snapshot.incomplete


def test_the_age_of_a_map_counts_from_when_it_was_seen() -> None:
    store, ages = MapStore(), []
    for n, (seen, arrived) in enumerate([(5000.0, 0.0), (5001.0, 1.0), (5002.0, 12.0)]):
        store.apply(update(n, float(n), time=seen), "map", arrived)
        ages.append(store.snapshot.delay)
    assert ages == pytest.approx([0.0, 0.0, 10.0])
    store.apply(update(9, 9.0, time=5013.0 - 300.0), "map", 13.0)
    assert store.snapshot.delay == pytest.approx(300.0)


def test_one_time_stamp_of_the_far_future_makes_no_honest_map_old() -> None:
    store = MapStore()
    store.apply(update(1, time=100.0), "map", 0.0)
    store.apply(update(2, 1.0, time=1e18), "map", 1.0)
    assert "the clock of mapper was set" in flags(store)
    store.apply(update(3, 2.0, time=102.0), "map", 2.0)
    assert store.snapshot.delay == 0.0
