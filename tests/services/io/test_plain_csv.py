"""The quick reader of CSV gives what the careful one gives, or leaves the file to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from slopewise.services.io import table
from slopewise.services.io.plain_csv import plain_columns

pytest.importorskip("polars", reason="polars is not installed")

TEXT = ("run",)
HEADER = "run,t,note\n"

cells = st.one_of(
    st.floats().map(repr),
    st.integers(-5, 5).map(str),
    st.sampled_from(["", " ", "1_0", " 1", "1e400", "+3", "x", '"1"', "-.5", "1\r", "é", "007"]),
)
lines = st.lists(cells, min_size=2, max_size=4).map(",".join)


@given(body=st.lists(lines, max_size=6), end=st.sampled_from(["", "\n", "\r\n", "\n\n"]))
@example(body=["1,2,", "2,3,x"], end="\n")
@example(body=["007,0.1,", "1,1e-3,4"], end="")
@example(body=["1,,", ",,", "1,2,3"], end="\n")
@example(body=["1,2", "1,2,3,4"], end="\n")
def test_it_is_the_careful_reader_or_none(body: list[str], end: str) -> None:
    content = HEADER + "\n".join(body) + end
    quick = plain_columns(content, TEXT)
    if quick is None:
        return
    careful = table._read_carefully(Path("log.csv"), content)
    assert list(quick) == list(careful.columns)
    one = table.Table("log.csv", quick, careful.rows)
    assert one.text("run") == careful.text("run")
    for name in careful.columns:
        (ours, bad), (theirs, wrong) = one.parsed(name), careful.parsed(name)
        np.testing.assert_array_equal(ours, theirs)
        assert bad == wrong


def test_plain_files_are_read_by_it() -> None:
    quick = plain_columns("run, t\n007,0.1\r\n1,0.30000000000000004\n", TEXT)
    assert quick is not None
    assert quick["run"] == ["007", "1"]
    np.testing.assert_array_equal(quick["t"], [0.1, 0.30000000000000004])


@pytest.mark.parametrize(
    "content",
    [
        HEADER,
        HEADER + "1,2\n",
        HEADER + "1,2,3,4\n",
        HEADER + "1,2\n1,2,3,4\n",
        HEADER + '1,"2",3\n',
        HEADER + "1,2,3\r4,5,6\n",
        HEADER + ",,\n",
        HEADER + "1,2,3\n\n",
        "run,t,t\n1,2,3\n",
        "run,,t\n1,2,3\n",
        "",
    ],
)
def test_what_is_not_plain_is_left_alone(content: str) -> None:
    assert plain_columns(content, TEXT) is None


def test_long_files_come_the_same_either_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "log.csv"
    path.write_text(HEADER + "".join(f"01,{0.1 * k!r},\n" for k in range(100)))
    careful = table.read_csv(path, TEXT)
    monkeypatch.setattr(table, "_LONG", 0)
    quick = table.read_csv(path, TEXT)
    assert isinstance(careful.columns["t"], list)
    assert isinstance(quick.columns["t"], np.ndarray)
    assert list(quick.rows) == list(careful.rows)
    assert quick.text("run") == careful.text("run")
    np.testing.assert_array_equal(quick.numbers("t", "s"), careful.numbers("t", "s"))
