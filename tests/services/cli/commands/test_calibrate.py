"""`slopewise calibrate` from outside, with logs of a plant that shares no code; bad logs named."""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError
from slopewise.services.cli.arguments.files import CalibrateOptions
from slopewise.services.cli.commands import calibrate, calibrate_sheet
from slopewise.services.io.map_file import write_map_npz
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.table import write_csv
from tests.models.calibration.plant import Plant, drive
from tests.services.command_line import here, one_line_of, slopewise
from tests.services.faults import fault_in

Log = dict[str, np.ndarray]


def written(log: Log, path: Path) -> Path:
    write_csv({n: list(v) if v.dtype.kind == "U" else v for n, v in log.items()}, path)
    return path


@pytest.fixture(scope="module")
def log() -> Log:
    return drive(Plant(), 24, 0)[0]


@pytest.fixture(scope="module")
def file(log: Log, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(log, tmp_path_factory.mktemp("drive") / "log.csv")


def job(path: Path, **further: object) -> CalibrateOptions:
    return CalibrateOptions([path], "atv", **further)  # type: ignore[arg-type]


def test_the_command_writes_model_stops_and_page(file: Path, tmp_path: Path) -> None:
    model, stops, page = (tmp_path / n for n in ("m.toml", "stops.csv", "page.html"))
    result = slopewise(
        "calibrate", file, "--model", "atv", "--out", model, "--stops", stops, "--report", page
    )
    assert result.returncode == 0, result.stderr
    for words in (
        "dead time 0.30",
        "speed error kept",
        "stops found: 24",
        "distance offset",
        "mount offset",
    ):
        assert words in result.stdout
    learned = read_model(model).braking
    assert learned.b_b == pytest.approx(0.40, abs=0.02)
    assert learned.dead_time == pytest.approx(0.3, abs=0.01)
    assert learned.covariance is not None
    assert read_model(model).vehicle.mass == 500.0
    with stops.open() as handle:
        rows = list(csv.DictReader(handle))
    assert len(rows) == 24
    for row in rows:
        assert row["verdict"] == "usable"
        assert float(row["predicted_with_offset"]) > float(row["distance"])
        late = float(row["predicted_time_with_offset"]) - float(row["predicted_time"])
        assert late == pytest.approx(read_model(model).braking.time_offset)
        assert float(row["predicted_time_with_offset"]) > float(row["time"])
        assert float(row["grade"]) == pytest.approx(float(row["grade"]), abs=0.3)
    html = page.read_text()
    assert html.count("data:image/svg+xml") == 4
    assert "24 of 24 stops" in html
    assert "http" not in html.split("<body>")[1].replace("http-equiv", "")


def test_the_brake_sheet_is_one_page_and_names_what_it_was_made_from(
    file: Path, tmp_path: Path
) -> None:
    out, pdf, html = (tmp_path / n for n in ("m.toml", "sheet.pdf", "sheet.html"))
    for sheet in (pdf, html):
        words = "calibrate", file, "--model", "atv", "--out", out, "--sheet", sheet, "--json"
        result = slopewise(*words)
        assert result.returncode == 0, result.stderr
    assert pdf.read_bytes().startswith(b"%PDF")
    assert pdf.read_bytes().count(b"/Type /Page ") == 1
    assert html.read_text().count("data:image/svg+xml") == 1
    assert "both are unsafe there" in html.read_text()
    told = json.loads(result.stdout)["sheet"]
    assert told["quantile"] == 0.999
    allowed, mean = np.array(told["allowed_distance"]), np.array(told["mean_distance"])
    assert allowed.shape == (len(told["speeds"]), len(told["grades"]))
    assert (allowed > mean).all()
    assert (np.diff(allowed, axis=1) < 0.0).all()
    assert told["brake_ratio"]["at_rest"]["least"] < told["brake_ratio"]["at_rest"]["mean"]
    assert told["rule_short_below_grade"] == pytest.approx(0.0, abs=2e-3)


def test_the_trace_of_a_sheet_is_what_sha256sum_says(file: Path, tmp_path: Path) -> None:
    out = tmp_path / "m.toml"
    command = job(file, out=out)
    result = calibrate.run(command, quiet=True)
    calibrate.write_learned_model(result, out)
    lines = "\n".join(calibrate_sheet.trace_of(result, command))
    for path in (file, out, find_model("atv")):
        assert f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}" in lines
    many = dataclasses.replace(command, logs=[file] * 8)
    assert "of all, 2 more" in "\n".join(calibrate_sheet.trace_of(result, many))


def test_a_sheet_of_another_ending_is_refused_at_once(file: Path, tmp_path: Path) -> None:
    words = "calibrate", file, "--model", "atv", "--sheet", tmp_path / "sheet.docx"
    one_line_of(here(*words), "sheet.docx", ".html or .pdf")


def test_json_holds_everything_for_machines(file: Path) -> None:
    data = json.loads(json.dumps(calibrate.as_json(calibrate.run(job(file), quiet=True))))
    assert data["stops"] == {"found": 24, "usable": 24}
    (base,) = data["surfaces"]
    assert base["coefficients"]["b_b"]["std"] > 0.0
    assert np.array(base["covariance"]).shape == (4, 4)
    assert base["coverage"] == 1.0
    assert 0.0 < base["mean_excess"] < 0.2
    assert data["dead_time"]["value"] == pytest.approx(0.3, abs=0.01)


def test_how_well_speeds_are_driven_is_learned_where_the_log_tells(
    log: Log, tmp_path: Path
) -> None:
    """One more run, of a vehicle that is a little too fast at each of six commands."""
    job_of = job(written(log, tmp_path / "stops.csv"))
    before = calibrate.run(job_of, quiet=True)
    assert before.model.braking.speed_error == 0.0
    assert calibrate.as_json(before)["speed_error"] is None
    t = np.arange(0.0, 60.0, 0.01)
    told = 1.0 + 0.5 * (t // 10.0)
    more = {
        "run": np.full(len(t), "drive"),
        "t": float(log["t"][-1]) + 100.0 + t,
        "v": told + 0.05 + 0.02 * np.sin(2.0 * np.pi * t / 3.0),
        "v_cmd": told,
        "pitch": np.full(len(t), float(np.mean(log["pitch"]))),
    }
    both = {name: np.concatenate((log[name], more[name])) for name in more}
    result = calibrate.run(job(written(both, tmp_path / "both.csv")), quiet=True)
    assert result.model.braking.speed_error == pytest.approx(0.065, abs=0.01)
    data = calibrate.as_json(result)["speed_error"]
    assert data["stretches"] == 6
    calibrate.write_learned_model(result, tmp_path / "m.toml")
    assert read_model(tmp_path / "m.toml").braking.speed_error == data["value"]


def test_the_learned_model_is_read_back_as_it_was(file: Path, tmp_path: Path) -> None:
    result = calibrate.run(job(file), quiet=True)
    calibrate.write_learned_model(result, tmp_path / "m.toml")
    assert read_model(tmp_path / "m.toml") == result.model


def test_a_map_gives_the_grade_of_the_ground(tmp_path: Path) -> None:
    # An even slope, driven down and up; the body dives and its sensor is askew.
    plant = Plant(undulation=0.0, dive=np.deg2rad(0.3), mount=np.deg2rad(1.0))
    log = drive(plant, 40, 2, grades=(-0.12, -0.12), out_and_back=True)[0]
    log["x"] = log["x"] - 1000.0 * np.round(log["x"] / 1000.0)
    height = np.tan(-0.12) * np.arange(-40.0, 41.0)
    ground = ElevationMap(elevation=np.tile(height, (13, 1)), resolution=1.0, origin=(-40.0, -6.0))
    write_map_npz(ground, tmp_path / "map.npz")
    path = written(log, tmp_path / "log.csv")
    result = calibrate.run(job(path, map_file=tmp_path / "map.npz"), quiet=True)
    c = result.calibration
    assert c.mount.source == "map"
    assert np.rad2deg(c.mount.offset) == pytest.approx(1.0, abs=0.1)
    grades = np.array([r.grade for r in c.surfaces[0].records])
    np.testing.assert_allclose(np.abs(grades), 0.12, atol=0.01)
    assert {round(float(np.sign(g))) for g in grades} == {-1, 1}
    bare = {n: v for n, v in log.items() if n not in ("x", "y", "yaw")}
    lost = written(bare, tmp_path / "bare.csv")
    with fault_in(lost, "column x", "expected x and y"):
        calibrate.run(job(lost, map_file=tmp_path / "map.npz"), quiet=True)


# ------------------------------------------------------------------------------------ bad logs


def changed(log: Log, channel: str, value: object, part: slice = slice(None)) -> Log:
    copy = {name: values.copy() for name, values in log.items()}
    copy[channel][part] = value
    return copy


@pytest.mark.parametrize(
    ("channel", "factor", "words"),
    [("pitch", 1.5, "looks like degrees"), ("pitch", 57.3, "looks like degrees")],
)
def test_wrong_units_are_an_error(
    log: Log, tmp_path: Path, channel: str, factor: float, words: str
) -> None:
    steep = 10.0 * factor * log[channel] if factor < 10 else factor * log[channel]
    path = written(changed(log, channel, np.clip(steep, -90, 90)), tmp_path / "log.csv")
    with pytest.raises(InputError, match=words):
        calibrate.run(job(path), quiet=True)


def test_speed_in_knots_is_an_error(tmp_path: Path) -> None:
    log = drive(Plant(), 24, 0, out_and_back=True)[0]
    path = written(log | {"v": log["v"] / 0.514444}, tmp_path / "log.csv")
    with fault_in(path, "column v", "knots"):
        calibrate.run(job(path), quiet=True)


def test_accelerations_in_g_are_flagged_and_do_not_stop_it(log: Log, tmp_path: Path) -> None:
    path = written(log | {"accel_z": np.full(len(log["t"]), 1.0)}, tmp_path / "log.csv")
    result = calibrate.run(job(path), quiet=True)
    assert any("looks like g" in s.reason for s in result.calibration.suspects)
    assert result.calibration.verdicts == {"usable": 24}


def stop_of(log: Log, number: int) -> int:
    """Sample of a stop command."""
    told = (log["v_cmd"] <= 0.0).astype(int)
    return int(np.flatnonzero(np.diff(told) == 1)[number]) + 1


@pytest.mark.parametrize(
    ("channel", "value", "length", "words"),
    [
        ("v", 2.2, 150, "stays at exactly"),
        ("v", -1000.0, 5, "stands for no value"),
        ("v", 9.0, 1, "jumps to"),
        ("pitch", 0.05, 150, "stays at exactly"),
    ],
)
def test_a_bad_stretch_costs_its_stop_and_no_other(
    log: Log, tmp_path: Path, channel: str, value: float, length: int, words: str
) -> None:
    at = stop_of(log, 5) + 5
    bad = changed(log, channel, value, slice(at, at + length))
    result = calibrate.run(job(written(bad, tmp_path / "log.csv")), quiet=True)
    spoilt = [w for w in result.calibration.windows if not w.usable]
    assert len(spoilt) <= 1
    assert any(words in s.reason for s in result.calibration.suspects)
    assert result.calibration.verdicts["usable"] >= 23
    assert all(w.command == at - 5 for w in spoilt)
    b_b = result.model.braking.b_b
    clean = calibrate.run(job(written(log, tmp_path / "clean.csv")), quiet=True)
    assert b_b == pytest.approx(clean.model.braking.b_b, abs=0.01)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda log: {n: v for n, v in log.items() if n != "v_cmd"}, ("v_cmd", "missing column")),
        (lambda log: changed(log, "v", np.nan, slice(7, 8)), ("row 9, column v", "finite")),
        (lambda log: changed(log, "t", 0.0, slice(7, 8)), ("row 9, column t", "after")),
        (lambda log: changed(log, "t", log["t"][6], slice(7, 8)), ("row 9, column t", "after")),
        (
            lambda log: changed(log, "v_cmd", 2.0),
            ("at least 8 usable stops", "0 found", "a stop begins where v_cmd goes to 0 while"),
        ),
        (
            lambda log: log | {"brake": np.zeros(len(log["t"]))},
            ("0 of 24 found", "a stop begins where v_cmd goes to 0", "24 coasted"),
        ),
    ],
    ids=["missing column", "nan", "unsorted", "duplicate", "no stop", "coast-downs"],
)
def test_logs_that_cannot_be_used_are_one_line(
    log: Log, tmp_path: Path, spoil: object, words: tuple[str, ...]
) -> None:
    path = written(spoil(log), tmp_path / "bad.csv")  # type: ignore[operator]
    with pytest.raises(InputError) as error:
        calibrate.run(job(path), quiet=True)
    for word in (str(path), *words):
        assert word in str(error.value)
    assert "\n" not in str(error.value)


def test_columns_of_other_names_and_units_teach_the_same(
    log: Log, file: Path, tmp_path: Path
) -> None:
    """Every command that reads drive logs takes the same words for the same columns."""
    other = {
        "segment": log["run"],
        "stamp": 1e3 * log["t"],
        "speed": 3.6 * log["v"],
        "told": 3.6 * log["v_cmd"],
        "slope": -np.rad2deg(log["pitch"]),
    }
    path = written(other, tmp_path / "other.csv")
    names = "run=segment,time=stamp:ms,speed=speed:km/h,command=told:km/h,grade=slope:deg"
    told, expected = tmp_path / "told.toml", tmp_path / "expected.toml"
    result = here("calibrate", path, "--model", "atv", "--columns", names, "--out", told)
    assert result.returncode == 0, result.stderr
    calibrate.write_learned_model(calibrate.run(job(file), quiet=True), expected)
    learned, known = read_model(told).braking, read_model(expected).braking
    assert learned.b_b == pytest.approx(known.b_b, rel=1e-9)
    assert learned.dead_time == pytest.approx(known.dead_time, rel=1e-9)
    for command, words in {
        "coverage": (),
        "simulate": (),
        "discrepancy": ("--out", tmp_path),
    }.items():
        said = [
            here(command, log_file, "--model", told, "--json", *words, *columns)
            for log_file, columns in ((file, ()), (path, ("--columns", names)))
        ]
        assert said[0].returncode == said[1].returncode == 0, said[1].stderr
        one, two = (json.loads(s.stdout) for s in said)
        assert one.get("stops") == two.get("stops")
        assert one.get("verdict") == two.get("verdict")
        one_line_of(here(command, path, "--model", told, *words), "column t, column v,", "missing")


def test_faults_leave_by_status_two(log: Log, tmp_path: Path) -> None:
    path = written(changed(log, "v_cmd", 2.0), tmp_path / "bad.csv")
    one_line_of(here("calibrate", path, "--model", "atv"), "bad.csv", "stops", "at least 8")
    with fault_in("--coverage", "", "1.5"):
        calibrate.run(job(path, coverage=1.5), quiet=True)
