"""KeptPickles results: an interrupted run goes on, and nothing old is taken for new."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mujoco", reason="the extra sim is not installed")

from benchmarks.closed_loop.kept import kept
from benchmarks.common.jobs import do_all
from benchmarks.common.kept import KeptPickles


class _Counted:
    """Squares, each of which leaves a file; fails at one number until told otherwise."""

    def __init__(self, folder: Path, fails_at: int | None = None) -> None:
        self._folder, self._fails_at = folder, fails_at

    def __call__(self, number: int) -> int:
        if number == self._fails_at:
            raise RuntimeError("interrupted")
        (self._folder / f"{number}").touch()
        return number * number

    @property
    def done(self) -> set[int]:
        return {int(file.name) for file in self._folder.iterdir()}


def _silent(what: str, total: int) -> Callable[[int], Any]:
    return lambda done: None


def test_an_interrupted_run_goes_on(tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    keep = kept(tmp_path / "runs", "squares")
    with pytest.raises(RuntimeError, match="interrupted"):
        do_all(_Counted(first, fails_at=5), range(6), _silent, "squares", keep)
    before = _Counted(first).done
    assert before
    again = _Counted(second)
    assert do_all(again, range(6), _silent, "squares", keep) == [0, 1, 4, 9, 16, 25]
    assert again.done == set(range(6)) - before


def test_without_a_folder_everything_is_done_again(tmp_path: Path) -> None:
    work = _Counted(tmp_path)
    assert do_all(work, [3, 1], _silent, "squares", None) == [9, 1]
    assert work.done == {1, 3}


def test_other_origins_share_nothing(tmp_path: Path) -> None:
    one, other = (kept(tmp_path, "driving: a b", model) for model in ("model 1", "model 2"))
    one.put(4, "result")
    assert one.find(4) == "result"
    assert other.find(4) is None
    assert kept(tmp_path, "driving: a b", "model 1").find(4) == "result"


def test_changed_sources_share_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept(tmp_path, "drives").put(0, "old")
    monkeypatch.setattr("benchmarks.closed_loop.kept._origin", lambda: "other sources")
    assert kept(tmp_path, "drives").find(0) is None


def test_what_was_half_written_does_not_count(tmp_path: Path) -> None:
    keep = KeptPickles(tmp_path)
    (tmp_path / "7.123").write_bytes(b"half")
    assert keep.find(7) is None
