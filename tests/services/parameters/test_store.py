from __future__ import annotations

import contextlib
import resource
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from slopewise.services.parameters.store import BootTime, Store, StoredChange, StoreError

ANY_TIME = BootTime(1e9, "boot", 50.0)


def change(version: int, group: str = "braking", **more: object) -> StoredChange:
    fields: dict[str, object] = {
        "version": version,
        "group": group,
        "fingerprint": "f",
        "cause": f"stop {version}",
        "who": "robot",
        "moment": ANY_TIME,
        "state": f"state {version}".encode(),
    }
    return StoredChange(**(fields | more))  # type: ignore[arg-type]


@contextlib.contextmanager
def edited(path: Path) -> Iterator[sqlite3.Connection]:
    """A store of two changes of one source, to be written to by another program."""
    store = Store(path)
    store.write([change(1)])
    store.write([change(2)], {"stop:robot": 7})
    store.close()
    with sqlite3.connect(path) as raw:
        yield raw
    raw.close()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "folder" / "parameters.sqlite"


def test_changes_are_read_after_a_restart(path: Path) -> None:
    store = Store(path)
    store.write([change(1), change(1, "terrain")], {"stop:robot": 7})
    store.write([change(2, cause="operator", learned=False)])
    store.close()
    again = Store(path)
    assert again.lost == ""
    assert again.last_version() == 2
    assert again.seen() == {"stop:robot": 7}
    assert next(iter(again.newest("f", "braking"))) == change(2, cause="operator", learned=False)
    assert [c.version for c in again.newest("f", "braking", up_to=1)] == [1]
    assert [c.version for c in again.history("braking")] == [2, 1]
    assert again.groups("another vehicle") == []
    assert again.groups("f") == ["braking", "terrain"]
    assert again.has("f", 1)
    assert not again.has("f", 3)
    again.close()


def test_a_change_is_written_whole_or_not_at_all(path: Path) -> None:
    store = Store(path)
    store.write([change(1)])
    with pytest.raises(StoreError, match="UNIQUE"):
        store.write([change(2), change(1)], {"stop:robot": 9})
    assert store.last_version() == 1
    assert store.seen() == {}
    store.write([change(2)])
    assert store.last_version() == 2


def test_the_lock_excludes_a_second_process_and_ends_with_a_killed_one(path: Path) -> None:
    Store(path).close()
    code = (
        "import sys, time; from pathlib import Path;"
        "from slopewise.services.parameters.store import Store;"
        f"s = Store(Path({str(path)!r})); print('open', flush=True); time.sleep(60)"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == "open\n"
        with pytest.raises(StoreError, match="locked"):
            Store(path)
    finally:
        process.kill()
        process.wait()
    Store(path).close()


@pytest.mark.parametrize("where", ["header", "middle", "short"])
def test_a_file_that_is_none_is_quarantine(path: Path, where: str) -> None:
    store = Store(path)
    for version in range(1, 200):
        store.write([change(version, state=bytes(500))])
    store.close()
    content = bytearray(path.read_bytes())
    if where == "header":
        content[:100] = b"x" * 100
    elif where == "middle":
        content[4096 : len(content)] = b"x" * (len(content) - 4096)
    else:
        del content[len(content) // 2 :]
    path.write_bytes(bytes(content))
    again = Store(path)
    assert again.last_version() == 0
    assert "corrupt-1" in again.lost
    assert path.with_name("parameters.sqlite.corrupt-1").read_bytes() == bytes(content)
    again.write([change(1)])
    again.close()


def test_corrupt_files_do_not_pile_up(path: Path) -> None:
    path.parent.mkdir()
    for n in range(5):
        path.write_bytes(f"nonsense {n}".encode() * 100)
        Store(path).close()
    assert len(list(path.parent.glob("*corrupt*"))) == 3


def test_attempts_on_a_full_disk_replace_no_corrupt_file_with_data(path: Path) -> None:
    path.parent.mkdir()
    path.write_bytes(b"nonsense" * 100)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))  # no file may grow, as on a full disk
    try:
        for _ in range(6):
            with pytest.raises(StoreError):
                Store(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.with_name("parameters.sqlite.corrupt-1").read_bytes() == b"nonsense" * 100
    again = Store(path)
    assert again.lost
    again.close()


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("state", b"statf 2"),
        ("state", "state 2"),
        ("cause", b"stop 2"),
        ("who", b"robot"),
        ("at", "yesterday"),
        ("boot", b"boot"),
        ("uptime", "long"),
        ("crc", "none"),
    ],
)
def test_a_row_that_changed_on_disk_is_skipped(path: Path, column: str, value: object) -> None:
    with edited(path) as raw:
        raw.execute(f"UPDATE change SET {column} = ? WHERE version = 2", (value,))
    again = Store(path)
    assert [c.version for c in again.newest("f", "braking")] == [1]
    assert again.damaged == {"braking"}
    again.close()


@pytest.mark.parametrize(
    ("table", "column"), [("change", "version"), ("change", "grp"), ("source", "sequence")]
)
def test_a_file_whose_keys_have_another_type_is_quarantined(
    path: Path, table: str, column: str
) -> None:
    with edited(path) as raw:
        raw.execute(f"UPDATE {table} SET {column} = ? WHERE version = 2", (b"x",))
    again = Store(path)
    assert again.last_version() == 0
    assert "has another type" in again.lost
    again.close()


def test_old_changes_are_deleted_and_the_newest_of_each_vehicle_stays(path: Path) -> None:
    store = Store(path, max_changes=40)
    store.write([change(1, fingerprint="other")])
    store.write([change(2, learned=False)])
    for version in range(3, 120):
        store.write([change(version)])
    changes = store.history("braking", 1000)
    assert len(changes) <= 40
    assert {1, 2, 119} <= {c.version for c in changes}


def test_the_file_stays_within_its_size(path: Path) -> None:
    store = Store(path, max_bytes=1_000_000)
    for version in range(1, 650):
        store.write([change(version, state=bytes(2000))])
    store.close()
    assert path.stat().st_size <= 1_000_000
    assert Store(path).last_version() == 649


def test_a_full_store_raises_and_loses_nothing(path: Path) -> None:
    store = Store(path, max_bytes=300_000)
    store.write([change(1)])
    with pytest.raises(StoreError, match="full"):
        store.write([change(2, state=bytes(10_000_000))])
    store.write([change(3)])
    store.close()
    assert [c.version for c in Store(path).newest("f", "braking")] == [3, 1]


def test_a_folder_that_cannot_be_written_raises(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(StoreError, match="cannot be opened"):
        Store(tmp_path / "file" / "parameters.sqlite")


def test_ages_survive_clocks_that_jump() -> None:
    now = BootTime.now()
    earlier = replace(now, at=now.at - 60.0, uptime=now.uptime - 60.0)
    for jump in (0.0, 3600.0, -3600.0):
        assert earlier.age(replace(now, at=now.at + jump), 1e9) == pytest.approx(60.0)
    assert replace(now, uptime=now.uptime + 5.0).age(now, 1e9) == 0.0
    # Over a boot only the wall clock shows the age, unless it was set back.
    later = BootTime(now.at + 100.0, "next boot", 20.0)
    assert now.age(later, 1e9) == pytest.approx(100.0)
    assert now.age(replace(later, at=now.at + 5.0), 1e9) == 20.0
    assert now.age(replace(later, at=now.at - 5.0), 777.0) == 777.0
    assert now.age(later, 30.0) == 30.0
    assert time.time() - now.at < 10.0
