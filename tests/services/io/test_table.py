"""Tables: the fast path gives what the careful one gives, and Parquet what CSV gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from slopewise.models.errors import InputError
from slopewise.services.io import table
from slopewise.services.io.table import Table, read_csv, read_parquet

TEXT = ("run",)
HEADER = "run,t,note\n"

cells = st.one_of(
    st.floats().map(repr),
    st.integers(-5, 5).map(str),
    st.sampled_from(["", " ", "1_0", " 1", "1e400", "+3", "x", '"1"', "-.5", "1\r", "é", "007"]),
    st.sampled_from(["#1", "0x10", "1d3", "１", "infinity", "'=1"]),
)
lines = st.lists(cells, min_size=2, max_size=4).map(",".join)


def read(path: Path, content: str, *, fast: bool) -> Table | str:
    path.write_bytes(content.encode())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(table, "_LONG", 0 if fast else 10**9)
        try:
            return read_csv(path, TEXT)
        except InputError as error:
            return str(error)


@settings(deadline=None)
@given(body=st.lists(lines, max_size=6), end=st.sampled_from(["", "\n", "\r\n", "\n\n"]))
@example(body=["1,2,", "2,3,x"], end="\n")
@example(body=["007,0.1,", "1,1e-3,4"], end="")
@example(body=["1,,", ",,", "1,2,3"], end="\n")
@example(body=["1,2", "1,2,3,4"], end="\n")
@example(body=["1,2,#", "1,2,3"], end="\n")
@example(body=["1,2,nan", "1,2,3"], end="\n")
@example(body=["1,2,3", "1,2,nan"], end="\n")
def test_long_files_are_read_as_short_ones(
    tmp_path_factory: pytest.TempPathFactory, body: list[str], end: str
) -> None:
    path = tmp_path_factory.mktemp("csv") / "log.csv"
    content = HEADER + "\n".join(body) + end
    fast, careful = (read(path, content, fast=fast) for fast in (True, False))
    if isinstance(careful, str) or isinstance(fast, str):
        assert fast == careful
        return
    assert list(fast.columns) == list(careful.columns)
    assert list(fast.rows) == list(careful.rows)
    assert fast.text("run") == careful.text("run")
    for name in careful.columns:
        (ours, texts), (theirs, expected) = fast.parsed(name), careful.parsed(name)
        np.testing.assert_array_equal(ours, theirs)
        assert texts == expected


def test_numbers_of_a_long_file_are_exact_and_text_stays_text(tmp_path: Path) -> None:
    content = "run, t\n007,0.1\r\n1,0.30000000000000004\n"
    fast = read(tmp_path / "log.csv", content, fast=True)
    assert isinstance(fast, Table)
    assert fast.columns["run"] == ["007", "1"]
    np.testing.assert_array_equal(fast.columns["t"], [0.1, 0.30000000000000004])
    assert isinstance(fast.columns["t"], np.ndarray)


def test_parquet_is_read_as_csv_is(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="the parquet extra is not installed")
    import pyarrow
    import pyarrow.parquet

    columns = {
        "text": ["a", None, "é"],
        "number": [1.5, None, 3.0],
        "whole": [1, 2, 3],
        "flag": [True, False, None],
        "nothing": [None, None, None],
        "decimal": pyarrow.array(["0.1", "0.2", "0.3"]).cast(pyarrow.decimal128(9, 1)),
        "when": pyarrow.array([1, 2, 3], pyarrow.timestamp("ns")),
    }
    path = tmp_path / "t.parquet"
    pyarrow.parquet.write_table(pyarrow.table(columns), path)
    read = read_parquet(path)
    assert read.text("text") == ["a", "", "é"]
    np.testing.assert_array_equal(read.parsed("number")[0], [1.5, np.nan, 3.0])
    assert read.text("whole") == ["1", "2", "3"]
    np.testing.assert_array_equal(read.parsed("flag")[0], [1.0, 0.0, np.nan])
    assert read.text("nothing") == ["", "", ""]
    np.testing.assert_array_equal(read.parsed("decimal")[0], [0.1, 0.2, 0.3])
    assert read.parsed("when")[1] == [0, 1, 2]
