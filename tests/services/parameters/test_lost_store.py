"""A store that is gone, empty or broken: a flag, and plans no faster than file and last known."""

from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slopewise.planner.ground.uncertainty import HOUR, Uncertainty
from slopewise.services.parameters.parameter_history import copy_path
from slopewise.services.parameters.parameter_service import ParameterService
from tests.services.parameters.parameter_fixtures import level_force, started, stopped

HURT: dict[str, Callable[[Path], object]] = {
    "empty": lambda file: file.write_bytes(b""),
    "one byte": lambda file: file.write_bytes(file.read_bytes()[:1]),
    "cut off": lambda file: file.write_bytes(file.read_bytes()[: file.stat().st_size // 2]),
    "noise": lambda file: file.write_bytes(os.urandom(20_000)),
    "deleted": lambda file: file.unlink(),
}


@pytest.fixture
def store(tmp_path: Path) -> Path:
    return tmp_path / "p.sqlite"


def weak(store: Path) -> float:
    """A store in which the base has learned weak brakes; their force at 2 m/s."""
    first = started(store)
    for n in range(1, 5):
        assert stopped(first, n, 0.12).durable
    force = level_force(first)
    first.close()
    return force


def strong(store: Path) -> float:
    """A store in which the base has learned brakes that are stronger than the file's."""
    first = started(store, rise=0.1, stops_at_once=1000)
    rng, n = np.random.default_rng(1), 0
    while not first.learner.state.group("braking").describe("braking").valid:
        n += 1
        force = 0.50 + 0.002 * float(rng.standard_normal())
        stopped(first, n, force, deceleration_std=0.01)
        assert n < 200
    stopped(first, n + 1, 0.50)
    assert level_force(first) > 0.44
    first.close()
    return level_force(first)


def margin(service: ParameterService) -> float:
    """Force that plans give up at 2 m/s on level ground for what is not known [1]."""
    survives = service.active.uncertainty or Uncertainty()
    phi = np.array([0.0, 0.0, 2.0, 1.0])
    return float(np.sqrt(phi @ survives.force_matrix(service.active.model.braking) @ phi))


def file_force(path: Path) -> tuple[float, float]:
    """Force by the model file alone, and what plans give up of it."""
    plain = started("")
    return level_force(plain), margin(plain)


def flagged(service: ParameterService, part: str) -> bool:
    return any(part in flag for flag in service.flags())


def test_a_first_start_is_not_a_loss(store: Path) -> None:
    for _ in range(2):
        service = started(store)
        assert service.flags() == []
        assert (level_force(service), margin(service)) == file_force(store)
        service.close()


@pytest.mark.parametrize("hurt", HURT)
def test_the_second_copy_is_planned_with_where_the_store_is_lost(store: Path, hurt: str) -> None:
    force = weak(store)
    HURT[hurt](store)
    content = store.read_bytes() if store.exists() else None
    again = started(store)
    assert level_force(again) == pytest.approx(force, abs=1e-3)
    assert flagged(again, "from p.sqlite-last")
    if content is not None:
        assert store.with_name("p.sqlite.corrupt-1").read_bytes() == content
    assert stopped(again, 4, 0.12).status == "ignored", "sequences are known as well"
    assert stopped(again, 5, 0.12).durable
    again.close()
    third = started(store)
    assert level_force(third) == pytest.approx(force, abs=0.01)
    assert third.flags() == []


@pytest.mark.parametrize("hurt", ["empty", "noise", "deleted"])
def test_a_copy_is_used_below_the_model_file_only(store: Path, hurt: str) -> None:
    strong(store)
    by_file, _ = file_force(store)
    HURT[hurt](store)
    for _ in range(2):
        again = started(store)
        assert level_force(again) <= by_file + 1e-9
        assert flagged(again, "braking: the newest state may be missing: no faster than by the")
        again.close()


@pytest.mark.parametrize(
    ("hurt", "copy"),
    [
        ("empty", "one byte"),
        ("empty", "deleted"),
        ("cut off", "noise"),
        ("noise", "cut off"),
        ("deleted", "noise"),
    ],
)
def test_without_either_the_file_counts_as_if_it_had_aged(
    store: Path, hurt: str, copy: str
) -> None:
    force = weak(store)
    HURT[hurt](store)
    HURT[copy](copy_path(store))
    by_file, little = file_force(store)
    assert force < by_file
    reserve = Uncertainty().width * Uncertainty().drift * np.sqrt(14_400.0 / HOUR)
    lost = "braking: what was learned is lost: the share of the model file that is used on unknown"
    for start in range(3):
        again = started(store)
        assert flagged(again, lost)
        assert flagged(again, "what was learned and set before is gone") == (start == 0)
        assert level_force(again) == pytest.approx(Uncertainty().untrained_share * by_file)
        assert margin(again) >= np.hypot(little, 0.99 * reserve)
        again.close()
    again = started(store)
    stopped(again, 10, 0.42)
    assert not flagged(again, lost)
    assert margin(again) < np.hypot(little, 0.99 * reserve)
    again.close()


def test_a_copy_in_which_a_digit_changed_is_not_planned_with(store: Path) -> None:
    weak(store)
    HURT["empty"](store)
    content = copy_path(store).read_bytes()
    changed = content.replace(b'"dead_time": 0.3', b'"dead_time": 0.2')
    assert changed != content
    copy_path(store).write_bytes(changed)
    again = started(store)
    assert flagged(again, "braking: what was learned is lost")
    again.close()


def test_changes_that_a_store_lost_are_read_from_the_copy(store: Path) -> None:
    first = started(store)
    stopped(first, 1, 0.42)
    first.close()
    old = store.read_bytes()
    force = weak(store)
    store.write_bytes(old)
    again = started(store)
    assert level_force(again) == pytest.approx(force, abs=1e-3)
    assert flagged(again, "changes are missing in the stored parameters")
    assert again.active.version >= 5


def test_a_state_that_changed_on_disk_is_flagged_and_an_older_one_held_below_the_file(
    store: Path,
) -> None:
    strong(store)
    with sqlite3.connect(store) as tables:
        last = tables.execute("SELECT max(version) FROM change").fetchone()[0]
        tables.execute("UPDATE change SET state = ? WHERE version = ?", (b"{}", last))
    tables.close()
    by_file, _ = file_force(store)
    again = started(store)
    assert flagged(again, "stored parameters could not be used, older ones are: braking")
    assert level_force(again) <= by_file + 1e-9


def test_a_store_that_cannot_be_opened_is_replaced_by_its_copy_until_it_can(store: Path) -> None:
    force = weak(store)
    content = store.read_bytes()
    store.unlink()
    store.mkdir()
    again = started(store)
    assert flagged(again, "parameters are not kept: p.sqlite cannot be opened")
    assert level_force(again) == pytest.approx(force, abs=1e-3)
    copy_path(store).unlink()
    none = started(store)
    assert flagged(none, "braking: what was learned is lost")
    store.rmdir()
    store.write_bytes(content)
    again.close()
    time.sleep(0.1)
    none.tick()
    assert none.flags() == []
    assert level_force(none) == pytest.approx(force, abs=1e-3)
    none.close()


def test_a_copy_that_cannot_be_written_is_flagged_and_nothing_else_stops(store: Path) -> None:
    service = started(store)
    copy_path(store).with_name("p.sqlite-last.new").mkdir()
    assert stopped(service, 1, 0.42).durable
    assert flagged(service, "parameters are kept once only: p.sqlite-last cannot be written")
    copy_path(store).with_name("p.sqlite-last.new").rmdir()
    service.close()
    assert copy_path(store).exists()
