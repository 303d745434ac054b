"""Investigations of stored stops: failures are reported, nothing waits, nothing is left behind."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import msgspec
import numpy as np
import pytest

from slopewise.models.errors import ParameterError
from slopewise.services.discovery import investigation_process, investigator
from slopewise.services.discovery.investigation_process import InvestigationOutcome, as_log
from slopewise.services.discovery.investigator import Investigator
from slopewise.services.discovery.stop_store import StoredStop
from slopewise.services.io.model_file import find_model, model_to_dict, read_model
from slopewise.services.settings.learning_settings import Investigation
from tests.services.robot_plant import ASPHALT, Vehicle

FILE = read_model(find_model("atv"))


def filled(folder: Path, stops: int = 13, **settings: float) -> Investigator:
    chosen = Investigation(samples=str(folder), **settings)  # type: ignore[arg-type]
    known = Investigator(chosen, "vehicle", Counter())
    vehicle = Vehicle(seed=3)
    for _ in range(stops + 1):
        _, samples = vehicle.stop(ASPHALT, 2.0)
        known.add_samples("robot", samples, "", "model")
    assert known.counters["stops_lost"] == 0
    return known


def outcome_of(known: Investigator, seconds: float = 30.0) -> InvestigationOutcome:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        begun = time.monotonic()
        outcome = known.poll()
        if outcome is not None:
            return outcome
        assert time.monotonic() - begun < 0.5, "asking waits for the other process"
        time.sleep(0.02)
    raise AssertionError("it did not end")


@pytest.fixture(autouse=True)
def _nothing_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):  # type: ignore[no-untyped-def]
    place = tmp_path / "tmp"
    place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    yield
    assert list(place.iterdir()) == []


def test_no_samples_and_too_few_stops_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="samples in the settings"):
        Investigator(Investigation(), "vehicle", Counter()).begin(FILE, FILE, FILE, "ann")
    with pytest.raises(ParameterError, match="at least 12 stored stops, got 5"):
        filled(tmp_path / "stops", 5).begin(FILE, FILE, FILE, "ann")


def test_a_process_beyond_its_time_limit_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = filled(tmp_path / "stops", limit=1.0)
    monkeypatch.setattr(investigator, "_GRACE", 0.0)
    begun = time.monotonic()
    # A process that never ends, in place of the investigation.
    monkeypatch.setattr(sys, "executable", _script(tmp_path, "while true; do sleep 0.1; done"))
    known.begin(FILE, FILE, FILE, "ann")
    with pytest.raises(ParameterError, match="got one"):
        known.begin(FILE, FILE, FILE, "bob")
    outcome = outcome_of(known)
    assert outcome.offer is None
    assert "within 1 s" in outcome.reason
    assert time.monotonic() - begun < 5.0
    assert not known.running
    assert known.counters["looks_failed"] == 1


def test_a_failed_process_is_reported_and_the_next_may_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = filled(tmp_path / "stops")
    monkeypatch.setattr(sys, "executable", _script(tmp_path, "exit 3"))
    for _ in range(2):
        known.begin(FILE, FILE, FILE, "ann")
        assert "status 3" in outcome_of(known).reason
    monkeypatch.setattr(sys, "executable", str(tmp_path / "nowhere"))
    with pytest.raises(ParameterError, match="a process for the investigation"):
        known.begin(FILE, FILE, FILE, "ann")
    assert not known.running


def test_damaged_stops_are_left_out_quarantine_and_counted(tmp_path: Path) -> None:
    known = filled(tmp_path / "stops", 12)
    victim = sorted((tmp_path / "stops").iterdir())[4]
    victim.write_bytes(victim.read_bytes()[:-8])
    known.begin(FILE, FILE, FILE, "ann")
    outcome = outcome_of(known, 60.0)
    assert outcome.damaged == [victim.name]
    assert "at least 12 usable stops, got 11" in outcome.reason
    assert known.counters["stops_damaged"] == 1
    assert not victim.exists()
    with pytest.raises(ParameterError, match="at least 12 stored stops, got 11"):
        known.begin(FILE, FILE, FILE, "ann")


def test_stops_that_cannot_be_written_are_counted_and_flagged(tmp_path: Path) -> None:
    known = filled(tmp_path / "stops", 2)
    for path in (tmp_path / "stops").iterdir():
        path.unlink()
    (tmp_path / "stops").rmdir()
    vehicle = Vehicle(seed=4)
    for _ in range(3):
        _, samples = vehicle.stop(ASPHALT, 2.0)
        known.add_samples("other", samples, "", "model")
    assert known.counters["stops_lost"] == 2
    assert any("stops are not kept" in flag for flag in known.flags())


def test_closing_ends_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = filled(tmp_path / "stops")
    monkeypatch.setattr(sys, "executable", _script(tmp_path, "while true; do sleep 0.1; done"))
    known.begin(FILE, FILE, FILE, "ann")
    known.close()
    assert not known.running


def test_an_investigation_is_due_after_its_interval_with_new_stops(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unscheduled = filled(tmp_path / "a", fresh=5)
    known = filled(tmp_path / "b", fresh=5, every=60.0)
    few = filled(tmp_path / "c", fresh=500, every=60.0)
    assert not known.is_due()
    later = time.monotonic() + 61.0
    monkeypatch.setattr(time, "monotonic", lambda: later)
    assert [each.is_due() for each in (unscheduled, known, few)] == [False, True, False]


def test_the_process_has_the_lowest_priority_and_ends_with_the_service(tmp_path: Path) -> None:
    folder = tmp_path / "job"
    folder.mkdir()
    models = dict.fromkeys(("file", "basis", "active"), model_to_dict(FILE))
    job = investigation_process.InvestigationJob(
        store=str(tmp_path), names=[], vehicle="v", cause="test", limit=20.0, **models
    )
    (folder / investigation_process.JOB).write_bytes(msgspec.json.encode(job))
    waits = (
        "import sys, time; from pathlib import Path\n"
        "from slopewise.services.discovery import investigation_process as i\n"
        "i._investigate = lambda *_: (print('here', flush=True), time.sleep(20))\n"
        f"i.main(Path({str(folder)!r}))"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", waits], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdin is not None
    assert process.stdout.readline() == "here\n"
    assert os.getpriority(os.PRIO_PROCESS, process.pid) == 19
    process.stdin.close()
    assert process.wait(5.0) == 1
    process.stdout.close()


def test_stops_become_a_log_on_one_clock() -> None:
    def stop(source: str, begin: float, at: float, **more: float) -> StoredStop:
        t = begin + np.linspace(0.0, 2.0, 21)
        columns = {"t": t, "v": 0.0 * t, "v_cmd": 0.0 * t, "pitch": 0.0 * t}
        columns |= {name: 0.0 * t + value for name, value in more.items()}
        return StoredStop(
            source=source,
            surface="ice",
            at=at,
            vehicle="v",
            model="m",
            columns=list(columns),
            values=np.stack(list(columns.values())),
        )

    stops = [
        stop("a", 500.0, 1000.0, grade=0.1),
        stop("a", 510.0, 1001.0),
        stop("b", 3.0, 1031.0),
        stop("b", 1.0, 900.0),
    ]
    columns, runs, ground = as_log(stops)
    starts = [float(columns["t"][run.start]) for run in runs]
    # The sender's clock, the wall clock, and a minute where that was set back.
    assert starts == pytest.approx([0.0, 10.0, 12.0 + 28.0, 42.0 + 60.0])
    assert np.all(np.diff(columns["t"]) > 0.0)
    assert list(dict.fromkeys(columns["run"])) == ["0", "1", "2", "3"]
    assert set(columns["terrain"]) == {"ice"}
    assert ground is not None
    assert "grade" not in columns
    assert np.isfinite(ground).sum() == 21


def _script(folder: Path, commands: str) -> str:
    path = folder / "python"
    path.write_text(f"#!/bin/sh\n{commands}\n")
    path.chmod(0o755)
    return str(path)
