from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.errors import InputError
from slopewise.services.io.drive_log import read_drive_log
from slopewise.services.jobs.log_input import LogInput
from tests.services.faults import fault_in

HEADER = "run,t,v,v_cmd,pitch"
LOG = f"""{HEADER},roll,terrain,temperature,note,empty
1,0.0,2.0,2.0,0.1,0.0,sand,20.5,start,
1,0.1,1.9,0.0,0.1,,sand,,,
2,5.0,2.0,2.0,-0.1,0.1,,21.5,,
2,5.5,1.0,0.0,-0.1,nan,gravel,inf,,
"""


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_columns_and_runs(tmp_path: Path) -> None:
    log = read_drive_log([written(tmp_path / "log.csv", LOG)])
    assert log.runs == (slice(0, 2), slice(2, 4))
    assert log.sources == (str(tmp_path / "log.csv"),) * 2
    assert log.one_clock
    assert log.columns["run"].tolist() == ["1", "1", "2", "2"]
    assert log.columns["t"].tolist() == [0.0, 0.1, 5.0, 5.5]
    assert log.columns["v"][log.runs[1]].tolist() == [2.0, 1.0]
    assert log.columns["terrain"].tolist() == ["sand", "sand", "", "gravel"]
    np.testing.assert_array_equal(log.columns["roll"], [0.0, np.nan, 0.1, np.nan])
    assert log.further == ("temperature",)
    np.testing.assert_array_equal(log.columns["temperature"], [20.5, np.nan, 21.5, np.nan])
    for column in log.columns.values():
        with pytest.raises(ValueError, match="read-only"):
            column[0] = column[1]


def test_several_files_are_one_log(tmp_path: Path) -> None:
    a = written(tmp_path / "a.csv", LOG)
    b = written(tmp_path / "b.csv", f"{HEADER},brake\n1,9,1,1,0,0.5\n1,10,1,0,0,1\n")
    log = read_drive_log([a, b])
    assert log.runs == (slice(0, 2), slice(2, 4), slice(4, 6))
    assert log.sources == (str(a), str(a), str(b))
    assert log.one_clock
    np.testing.assert_array_equal(log.columns["brake"], [*[np.nan] * 4, 0.5, 1.0])
    assert log.columns["terrain"].tolist()[-2:] == ["", ""]
    assert np.isnan(log.columns["temperature"][-2:]).all()
    assert not read_drive_log([b, a]).one_clock


def test_a_file_is_a_session_unless_it_says_otherwise(tmp_path: Path) -> None:
    rows = "{run},{t},1,1,0{s}\n{run},{u},1,0,0{s}\n"
    plain = [
        written(tmp_path / f"{t}.csv", f"{HEADER}\n{rows.format(run=1, t=t, u=t + 1, s='')}")
        for t in (0, 9)
    ]
    days = rows.format(run=1, t=3, u=4, s=",wet") + rows.format(run=2, t=5, u=6, s=",")
    stated = written(tmp_path / "c.csv", f"{HEADER},session\n{days}")
    (note,) = (log := read_drive_log([*plain, stated])).notes
    assert "counts as one session" in note
    sessions = [str(log.columns["session"][run.start]) for run in log.runs]
    assert sessions == ["0", "9", "wet", "c"]
    # Of one file each run counts as a session; and names of files may be alike.
    assert "session" not in read_drive_log(plain[:1]).columns
    (tmp_path / "more").mkdir()
    namesake = written(tmp_path / "more" / "0.csv", f"{HEADER}\n2,50,1,1,0\n")
    assert len(set(read_drive_log([plain[0], namesake]).columns["session"].tolist())) == 2


def test_a_drive_is_not_counted_twice(tmp_path: Path) -> None:
    rows = "\n{r},0,1,1,0\n{r},1,0.5,0,0"
    a = written(tmp_path / "a.csv", HEADER + rows.format(r="x"))
    copy = written(tmp_path / "copy.csv", HEADER + rows.format(r="y"))
    with pytest.raises(InputError, match=r"copy.csv: run y: expected each .* run x of .*a.csv"):
        read_drive_log([a, copy])
    with pytest.raises(InputError, match=r"a.csv: run x: expected each .* run x of .*a.csv again"):
        read_drive_log([a, a])
    still = written(tmp_path / "still.csv", f"{HEADER}\n1,0,0,0,0\n2,0,0,0,0")
    assert len(read_drive_log([a, still]).runs) == 3
    simulated = written(
        tmp_path / "simulated.csv", HEADER + rows.format(r="x") + rows.format(r="y")
    )
    assert len(read_drive_log([simulated]).runs) == 2


def test_runs_that_start_their_own_clock_are_noticed(tmp_path: Path) -> None:
    log = read_drive_log(
        [written(tmp_path / "l.csv", f"{HEADER}\na,0,1,1,0\na,1,1,0,0\nb,0,1,1,0\n")]
    )
    assert log.runs == (slice(0, 2), slice(2, 3))
    assert not log.one_clock


def test_no_files_and_a_missing_one_of_parquet(tmp_path: Path) -> None:
    with fault_in("drive log", "", "at least one file"):
        read_drive_log([])
    with fault_in(tmp_path / "none.parquet", "", "expected an existing file"):
        read_drive_log([tmp_path / "none.parquet"])


def test_csv_needs_no_pyarrow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert len(read_drive_log([written(tmp_path / "log.csv", LOG)]).runs) == 2
    path = written(tmp_path / "log.parquet", "")
    with fault_in(path, "", "expected pyarrow to read Parquet", "pip install '.[parquet]'"):
        read_drive_log([path])


def test_parquet_is_read_as_csv_is(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="the parquet extra is not installed")
    from pyarrow.csv import read_csv

    csv = written(tmp_path / "log.csv", LOG)
    parquet.write_table(read_csv(csv), tmp_path / "log.parquet")
    expected, log = read_drive_log([csv]), read_drive_log([tmp_path / "log.parquet"])
    assert log.runs == expected.runs
    assert log.further == expected.further
    assert log.columns.keys() == expected.columns.keys()
    for name, column in expected.columns.items():
        np.testing.assert_array_equal(log.columns[name], column, name)


def test_parquet_that_cannot_be_used(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="the parquet extra is not installed")
    from pyarrow import table

    path = tmp_path / "log.parquet"
    path.write_bytes(b"PAR1" + b"garbage" * 50 + b"PAR1")
    with fault_in(path, "", "expected an intact Parquet file"):
        read_drive_log([path])
    parquet.write_table(table({}), path)
    with fault_in(path, "column t, column v, column v_cmd, column pitch", "missing columns"):
        read_drive_log([path])
    columns = {"run": [1.0, 1.0], "t": [0.0, 1.0], "v": [1, None], "v_cmd": [1, 0], "pitch": [0, 0]}
    parquet.write_table(table(columns), path)
    with fault_in(path, "row 2, column v", "expected a finite number [m/s], got nan"):
        read_drive_log([path])
    parquet.write_table(table(columns | {"v": ["1", "fast"]}), path)
    with fault_in(path, "row 2, column v", "got 'fast'"):
        read_drive_log([path])
    parquet.write_table(table(columns | {"v": [1.0, 0.5], "run": [1.0, None]}), path)
    with fault_in(path, "row 2, column run", "got nothing"):
        read_drive_log([path])
    parquet.write_table(table(columns | {"v": [1.0, 0.5], "run": [1.0, float("inf")]}), path)
    assert read_drive_log([path]).columns["run"].tolist() == ["1", "inf"]


@pytest.mark.parametrize(
    ("count", "expected"),
    [(1, "0.csv"), (3, "0.csv, 1.csv, 2.csv"), (40, "0.csv, 1.csv, 2.csv … (40 logs)")],
)
def test_names_of_many_logs_lists_a_few(count: int, expected: str) -> None:
    assert LogInput([Path(f"{i}.csv") for i in range(count)]).names == expected
