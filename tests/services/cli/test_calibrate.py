"""`slopewise calibrate`, `coverage` and `simulate` on logs of a plant that shares no code."""

from __future__ import annotations

import csv
import hashlib
import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Effect
from slopewise.services.io.log_checks import unseen_channels
from slopewise.services.io.map_file import write_map_npz
from slopewise.services.io.model_file import find_model, read_model, write_model
from slopewise.services.jobs import calibrate as job
from slopewise.services.jobs.coverage import coverage
from slopewise.services.jobs.log_input import LogInput
from slopewise.services.jobs.provenance import calibration_digests
from slopewise.services.jobs.simulate import simulate
from slopewise.services.report.brake_sheet import write_calibration_sheet
from tests.models.calibration.plant import FREE_ROLLING, Plant, drive
from tests.services.cli.conftest import write_log
from tests.services.command_line import here, one_line_of
from tests.services.faults import fault_in
from tests.world.logs import log as discrepancy_log
from tests.world.vehicles import BASE

Log = dict[str, np.ndarray]
SETTINGS = job.calibration_settings(0.999)


@pytest.fixture(scope="module")
def log() -> Log:
    return drive(Plant(), 24, 0)[0]


@pytest.fixture(scope="module")
def short() -> Log:
    """As many stops as show what a log lacks."""
    return drive(Plant(), 8, 0)[0]


def calibrate(path: Path, **options: Any) -> job.CalibrateResult:
    return job.calibrate(LogInput([path], **options), "atv", settings=SETTINGS)


@pytest.fixture(scope="module")
def clean(files: Path) -> job.CalibrateResult:
    return calibrate(files / "stops.csv")


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def test_the_command_writes_model_stops_and_page(world: Path, clean: job.CalibrateResult) -> None:
    arguments = ("--out", "m.toml", "--stops", "s.csv", "--report", "page.html")
    result = here("calibrate", "stops.csv", "--model", "atv", *arguments)
    assert result.returncode == 0, result.stderr
    for line in (
        "dead time 0.30",
        "speed error unchanged",
        "counted, new sessions",
        "mount offset",
    ):
        assert line in result.stdout
    model = read_model(world / "m.toml")
    assert model == clean.model
    b = model.braking
    assert (b.b_b, b.dead_time) == (pytest.approx(0.40, abs=0.02), pytest.approx(0.3, abs=0.01))
    assert b.covariance is not None
    assert max(b.force_std, b.force_scatter) > 0.0
    assert b.distance_offset < 0.1
    assert (b.dead_band, b.saturation, model.vehicle.mass) == (0.0, 1.0, 500.0)
    rows = rows_of(world / "s.csv")
    assert [row["verdict"] for row in rows] == ["usable"] * 24
    for row in rows:
        assert float(row["predicted_with_offset"]) > float(row["distance"])
        late = float(row["predicted_time_with_offset"]) - float(row["predicted_time"])
        assert late == pytest.approx(b.time_offset)
        assert float(row["predicted_time_with_offset"]) > float(row["time"])
        assert abs(float(row["grade"])) < 0.3
    html = (world / "page.html").read_text()
    assert html.count("data:image/svg+xml") == 4
    assert "24 of 24 stops" in html


def test_the_brake_sheet_is_one_page_with_digests(world: Path, clean: job.CalibrateResult) -> None:
    logs, out, sheet = [world / "stops.csv"] * 8, world / "m.toml", world / "sheet.html"
    write_model(clean.model, out)
    sheet_json = write_calibration_sheet(sheet, clean, LogInput(logs), "atv", out, quantile=0.999)
    html = sheet.read_text()
    assert html.count("data:image/svg+xml") == 1
    assert "both are unsafe there" in html
    allowed, mean = (np.array(sheet_json[f"{n}_distance"]) for n in ("allowed", "mean"))
    assert allowed.shape == (len(sheet_json["speeds"]), len(sheet_json["grades"]))
    assert (allowed > mean).all()
    assert (np.diff(allowed, axis=1) < 0.0).all()
    at_rest = sheet_json["brake_ratio"]["at_rest"]
    assert at_rest["least"] < at_rest["mean"]
    lines = "\n".join(calibration_digests(LogInput(logs), "atv", read_model(out), out))
    for path in (logs[0], out, find_model("atv")):
        assert f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}" in lines
    assert "of all, 2 more" in lines


def test_stop_settings_are_read_from_a_file(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_text("longest = 3.0\nfewest = 8\nleast_speed = 0.5\n")
    stops = job.calibration_settings(0.999, file).stops
    assert (stops.longest, stops.fewest, stops.least_speed) == (3.0, 8, 0.5)
    assert stops.partial


def test_the_speed_error_is_estimated_where_the_log_has_driving(log: Log, tmp_path: Path) -> None:
    """One more run, of a vehicle that is a little too fast at each of six commands."""
    t = np.arange(0.0, 60.0, 0.01)
    command = 1.0 + 0.5 * (t // 10.0)
    v, pitch = command + 0.05 + 0.02 * np.sin(2.0 * np.pi * t / 3.0), float(np.mean(log["pitch"]))
    more = {"run": np.full(len(t), "drive"), "t": float(log["t"][-1]) + 100.0 + t}
    more |= {"v": v, "v_cmd": command, "pitch": np.full(len(t), pitch)}
    joined = {name: np.concatenate((log[name], more[name])) for name in more}
    result = calibrate(write_log(joined, tmp_path / "joined.csv"))
    assert result.model.braking.speed_error == pytest.approx(0.065, abs=0.01)
    assert result.calibration.speed_error.stretches == 6


def test_tracking_is_learned_from_sessions_with_poses_and_a_path(log: Log, tmp_path: Path) -> None:
    """Four straight sessions of 120 m; their errors are waves of 5 cm about means of up to 2 cm."""
    parts, t = [{**log, "session": np.full(len(log["t"]), "stops")}], float(log["t"][-1])
    for session, mean in enumerate((-0.02, 0.0, 0.01, 0.02)):
        x = np.arange(0.0, 130.0, 0.1)
        across = mean + 0.05 * np.sin(x / 1.3 + session)
        empty = {
            "run": np.full(len(x), f"path {session}"),
            "session": np.full(len(x), f"{session}"),
        }
        flat = {"v": np.full(len(x), 1.0), "v_cmd": np.full(len(x), 1.0), "pitch": 0.0 * x}
        pose = {"x": x, "y": across, "yaw": 0.0 * x, "path_x": x, "path_y": 0.0 * x}
        parts.append({**empty, **flat, **pose, "t": t + 10.0 * (session + 1) + 200.0 * session + x})
    names = list(parts[1])
    missing = np.full(len(log["t"]), np.nan)
    parts[0] = {name: parts[0].get(name, missing) for name in names}
    joined = {name: np.concatenate([part[name] for part in parts]) for name in names}
    result = calibrate(write_log(joined, tmp_path / "joined.csv"))
    learned = result.model.tracking
    assert 0.035 < learned.cross_track_std < 0.12
    assert learned.heading_std < 0.01
    assert any("in 4 sessions: " in w for w in result.calibration.warnings)


def test_with_a_map_the_grade_is_that_of_the_ground(tmp_path: Path) -> None:
    # An even slope, driven down and up; the body dives and its sensor is inclined.
    plant = Plant(undulation=0.0, dive=np.deg2rad(0.3), mount=np.deg2rad(1.0))
    log = drive(plant, 40, 2, grades=(-0.12, -0.12), out_and_back=True)[0]
    log["x"] = log["x"] - 1000.0 * np.round(log["x"] / 1000.0)
    height = np.tan(-0.12) * np.arange(-40.0, 41.0)
    ground = ElevationMap(elevation=np.tile(height, (13, 1)), resolution=1.0, origin=(-40.0, -6.0))
    write_map_npz(ground, tmp_path / "map.npz")
    path = write_log(log, tmp_path / "log.csv")
    c = calibrate(path, map_file=tmp_path / "map.npz").calibration
    assert c.mount.source == "map"
    assert np.rad2deg(c.mount.offset) == pytest.approx(1.0, abs=0.1)
    grades = np.array([r.grade for r in c.surfaces[0].records])
    np.testing.assert_allclose(np.abs(grades), 0.12, atol=0.01)
    assert {round(float(np.sign(g))) for g in grades} == {-1, 1}
    bare = {n: v for n, v in log.items() if n not in ("x", "y", "yaw")}
    lost = write_log(bare, tmp_path / "bare.csv")
    with fault_in(lost, "column x", "expected x and y"):
        calibrate(lost, map_file=tmp_path / "map.npz")


def changed(log: Log, channel: str, value: object, part: slice = slice(None)) -> Log:
    copy = {name: values.copy() for name, values in log.items()}
    copy[channel][part] = value
    return copy


def in_knots(log: Log) -> Log:
    return log | {"v": log["v"] / 0.514444}


UNUSABLE: dict[str, tuple[Any, tuple[str, ...]]] = {
    "nan": (lambda log: changed(log, "v", np.nan, slice(7, 8)), ("row 9, column v", "finite")),
    "no stop": (lambda log: changed(log, "v_cmd", 2.0), ("at least 6 usable stops", "0 found")),
    "coasting": (
        lambda log: log | {"brake": np.zeros(len(log["t"]))},
        ("0 of 8 found", "8 coasted"),
    ),
    "deg": (lambda log: log | {"pitch": np.clip(15.0 * log["pitch"], -90, 90)}, ("degrees",)),
    "%": (lambda log: log | {"pitch": 100 * log["pitch"]}, ("column pitch", "degrees or per cent")),
    "ms": (lambda log: log | {"t": 1e3 * log["t"]}, ("column t", "expected seconds", "like ms")),
    "us": (lambda log: log | {"t": 1e6 * log["t"]}, ("column t", "expected seconds", "like us")),
    "rare rows": (
        lambda log: log | {"t": 300.0 * log["t"]},
        ("0 of 8 found", "sparse", "no sample in"),
    ),
    "no brakes": (lambda _: drive(FREE_ROLLING, 8, 0)[0], ("braking.b_b", "0.02 … 1.5")),
    "knots": (
        lambda _: in_knots(drive(Plant(), 8, 0, out_and_back=True)[0]),
        ("column v", "knots"),
    ),
}
"""What spoils a log, and texts of its refusal; further ones are in io/bad_inputs/drive_log.toml."""


@pytest.mark.parametrize("name", UNUSABLE)
def test_unusable_logs_are_rejected_in_one_line(short: Log, tmp_path: Path, name: str) -> None:
    spoil, lines = UNUSABLE[name]
    path = write_log(spoil(short), tmp_path / "bad.csv")
    one_line_of(here("calibrate", path, "-m", "atv"), str(path), *lines)


def test_accelerations_in_g_are_flagged_and_do_not_stop_it(log: Log, tmp_path: Path) -> None:
    path = write_log(log | {"accel_z": np.full(len(log["t"]), 1.0)}, tmp_path / "log.csv")
    calibration = calibrate(path).calibration
    assert any("looks like g" in s.reason for s in calibration.suspects)
    assert calibration.verdicts == {"usable": 24}


SUSPECT = {
    5: ("v", 2.2, 150, "stays at exactly"),
    9: ("v", -1000.0, 5, "stands for no value"),
    13: ("v", 9.0, 1, "jumps to"),
    17: ("pitch", 0.05, 150, "stays at exactly"),
}
"""Channel, value, samples and reason of a stretch, by the number of its stop."""


def test_a_suspect_stretch_excludes_its_stop_only(
    log: Log, clean: job.CalibrateResult, tmp_path: Path
) -> None:
    commands = np.flatnonzero(np.diff((log["v_cmd"] <= 0.0).astype(int)) == 1) + 1
    spoilt = log
    for stop, (channel, value, length, _) in SUSPECT.items():
        start = commands[stop] + 5
        spoilt = changed(spoilt, channel, value, slice(start, start + length))
    result = calibrate(write_log(spoilt, tmp_path / "log.csv"))
    excluded = {w.command for w in result.calibration.windows if not w.usable}
    assert excluded <= {commands[stop] for stop in SUSPECT}
    for channel, _, _, reason in SUSPECT.values():
        assert any(reason in s.reason and channel == s.channel for s in result.calibration.suspects)
    assert result.calibration.verdicts["usable"] >= 24 - len(SUSPECT)
    assert result.model.braking.b_b == pytest.approx(clean.model.braking.b_b, abs=0.01)


def test_a_rejected_log_has_its_stops_and_reasons_written(world: Path) -> None:
    arguments = ("calibrate", "few.csv", "-m", "atv", "--stops", "s.csv", "--report", "p.html")
    reason = "at least 6 usable stops, got 5 of 5 found"
    one_line_of(here(*arguments), reason)
    assert [row["verdict"] for row in rows_of(world / "s.csv")] == ["usable"] * 5
    assert reason in (world / "p.html").read_text()
    (world / "s.toml").write_text("least_speed = 9.0\n")
    one_line_of(here(*arguments, "--stop-settings", "s.toml"), "got 0 of 5 found; 5 slow")
    rows = rows_of(world / "s.csv")
    assert [row["verdict"] for row in rows] == ["slow"] * 5
    for text in ((world / "p.html").read_text(), rows[0]["reason"]):
        assert "below the least speed of 9 m/s" in text  # words: ok, a reason of the models


def test_one_run_in_another_unit_is_excluded_and_half_are_an_error(tmp_path: Path) -> None:
    """Speeds noisier than the distance between positions look like another unit, in that run."""
    log = drive(Plant(), 12, 4, out_and_back=True)[0]
    t = np.arange(0.0, 60.0, 0.1)
    zero = np.zeros(len(t))
    still = {"run": np.full(len(t), "still"), "t": float(log["t"][-1]) + 10.0 + t}
    still |= {"v": zero + 0.36, "v_cmd": zero, "pitch": zero, "x": 0.1 * t, "y": zero, "yaw": zero}
    path, stops = tmp_path / "log.csv", tmp_path / "stops.csv"
    write_log({name: np.concatenate((log[name], still[name])) for name in log}, path)
    calibration = calibrate(path).calibration
    assert calibration.verdicts["usable"] == 12
    assert any("looks like km/h" in s.reason for s in calibration.suspects)
    first = {name: values[log["run"] == "0"] for name, values in log.items()}
    write_log({name: np.concatenate((first[name], still[name])) for name in log}, path)
    one_line_of(here("calibrate", path, "-m", "atv", "--stops", stops), "looks like km/h")
    assert stops.is_file()


def test_columns_of_other_names_and_units_give_the_same(
    log: Log, world: Path, clean: job.CalibrateResult
) -> None:
    renamed = {"segment": log["run"], "stamp": 1e3 * log["t"], "slope": -np.rad2deg(log["pitch"])}
    renamed |= {"speed": 3.6 * log["v"], "command": 3.6 * log["v_cmd"]}
    write_log(renamed, world / "renamed.csv")
    names = "run=segment,time=stamp:ms,speed=speed:km/h,command=command:km/h,grade=slope:deg"
    columns = ("renamed.csv", "--columns", names)
    assert here("calibrate", *columns, "-m", "atv", "--out", "m.toml").returncode == 0
    braking, expected = read_model(world / "m.toml").braking, clean.model.braking
    assert braking.b_b == pytest.approx(expected.b_b, rel=1e-9)
    assert braking.dead_time == pytest.approx(expected.dead_time, rel=1e-9)
    for command, key in (("coverage", "mean_excess_m"), ("simulate", "rms")):
        done = [here(command, *log, "-m", "m.toml", "--json") for log in (("stops.csv",), columns)]
        assert done[0].returncode == done[1].returncode == 0, done[1].stderr
        first, second = (json.loads(result.stdout) for result in done)
        pairs = zip(first.get("runs", [first]), second.get("runs", [second]), strict=True)
        for expected_run, run in pairs:
            assert run[key] == pytest.approx(expected_run[key], rel=0.02)
    for command in ("coverage", "simulate", "discrepancy --out ."):
        arguments = (*command.split(), "renamed.csv", "-m", "m.toml")
        one_line_of(here(*arguments), "column t, column v,", "missing")


def test_a_rejected_model_says_so_in_its_file(tmp_path: Path) -> None:
    log = drive(Plant(), 20, 1)[0]
    log["pitch"] = -log["pitch"]
    write_log(log, tmp_path / "log.csv")
    logs, model = LogInput([tmp_path / "log.csv"]), tmp_path / "m.toml"
    result = here("calibrate", *logs.files, "-m", "atv", "--out", model)
    assert result.returncode == 3
    warning = "do not plan with this model: real stops may be far longer than planned"
    assert warning in result.stdout
    text = model.read_text()
    assert text.startswith("# rejected, do not plan with it: the grade of the log has the wrong")
    assert read_model(model).name == "atv"
    digest = hashlib.sha256(model.read_bytes()).hexdigest()
    assert any(
        digest in line for line in calibration_digests(logs, "atv", read_model(model), model)
    )
    for seed, name in enumerate(("a", "b")):
        write_log(drive(Plant(), 20, seed)[0], tmp_path / f"{name}.csv")
    (tmp_path / "cut.csv").write_text(logs.files[0].read_text()[:5000].rpartition(",")[0])
    files = [tmp_path / f"{name}.csv" for name in ("a", "b", "log", "cut")]
    result = here("fleet", "calibrate", *files, "-m", "atv", "--out", tmp_path, "--workers", 0)
    assert result.returncode == 3
    shown = " ".join(result.stdout.split())
    assert f"log: {warning}" in shown
    assert "cut rejected: no model file" in shown
    assert shown.count(warning) == 1  # of those that have a file


def test_coverage_is_status_0_if_covered_and_3_if_not(
    clean: job.CalibrateResult, tmp_path: Path
) -> None:
    model = tmp_path / "m.toml"
    write_model(clean.model, model)
    same = write_log(drive(Plant(), 20, 1)[0], tmp_path / "same.csv")
    result = here("coverage", same, "--model", model, "--json")
    assert result.returncode == 0, result.stderr
    summary = json.loads(result.stdout)
    assert summary["stops"] == summary["found"] == 20
    assert (summary["beyond"], summary["share_beyond"]) == (0, 0.0)
    assert summary["mean_excess_m"] > 0.0
    for parts in ("by_speed", "by_grade", "by_session"):
        assert sum(part["stops"] for part in summary[parts]) == 20
    weak = write_log(drive(replace(Plant(), b_b=0.30), 20, 1)[0], tmp_path / "weak.csv")
    result = here("coverage", weak, "--model", model)
    assert result.returncode == 3
    assert "does not cover" in result.stdout


def test_simulation_is_measured_minus_simulated_at_every_sample(tmp_path: Path) -> None:
    t = np.arange(0.0, 5.0, 0.02)
    v = np.clip(3.0 - 4.0 * np.maximum(t - 2.3, 0.0), 0.0, None)
    command = np.where(t < 2.0, 3.0, 0.0)
    log = {"run": np.full(len(t), "1"), "t": t, "v": v, "v_cmd": command, "pitch": 0.0 * t}
    out = tmp_path / "sim.csv"
    result = here("simulate", write_log(log, tmp_path / "log.csv"), "-m", "atv", "--out", out)
    assert result.returncode == 0, result.stderr
    rows = rows_of(out)
    assert list(rows[0]) == ["run", "t", "v_measured", "v_simulated", "residual"]
    assert len(rows) == len(t)
    for row in rows:
        difference = float(row["v_measured"]) - float(row["v_simulated"])
        assert float(row["residual"]) == pytest.approx(difference, abs=1e-12)
    # The model brakes at 9.81 · 0.445 = 4.36 m/s², the log at 4: the simulation is ahead.
    assert max(float(row["residual"]) for row in rows) == pytest.approx(0.25, abs=0.05)


def with_effect(folder: Path, *drop: str, stops: int = 48, **effect: Any) -> tuple[Path, str]:
    """A log of the discrepancy plant, and a model with an effect."""
    columns, _ = discrepancy_log("clean", stops)
    write_model(replace(BASE, effect=(Effect(**effect),)), folder / "model.toml")
    log = {n: v for n, v in columns.items() if n not in drop}
    log["run"] = np.array([f"{run}" for run in columns["run"]])
    return write_log(log, folder / "log.csv"), str(folder / "model.toml")


def test_a_lasting_change_acts_from_its_run_on(tmp_path: Path) -> None:
    """Replayed on the log that it was found in, it acts in the runs behind it only."""
    parameters = {"scale": 0.5, "run": 24.0}
    log, model = with_effect(tmp_path, name="step_change", parameters=parameters)
    rms = np.array([run.rms for run in simulate(LogInput([log]), model).summary.runs])
    assert np.all(rms[:24] < 0.1)
    assert np.median(rms[24:]) > 0.3


def test_a_missing_column_of_an_effect_is_a_note(tmp_path: Path) -> None:
    wind = {"c": 0.001, "wind": 1.0, "direction": 0.0}
    log, model = with_effect(tmp_path, "yaw", stops=12, name="headwind", parameters=wind)
    (note,) = simulate(LogInput([log]), model).summary.notes
    assert "headwind needs yaw" in note
    assert coverage(LogInput([log]), model, quantile=0.999).notes == [note]
    columns, _ = discrepancy_log("clean", 12)
    effects, count = read_model(Path(model)).effect, len(columns["t"])
    gap = {**columns, "yaw": np.where(np.arange(count) == 7, np.nan, 0.0)}
    (note,) = unseen_channels(effects, gap)
    assert "gaps" in note
    assert not unseen_channels(effects, {**columns, "yaw": np.zeros(count)})
    assert not unseen_channels(BASE.effect, columns)


@pytest.fixture(scope="module")
def step(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Findings in a log with weaker brakes from run 25 on."""
    folder = tmp_path_factory.mktemp("discrepancy")
    log = write_log(discrepancy_log("step", 36)[0], folder / "drive.csv")
    done = here("discrepancy", log, "-m", "atv", "--out", folder / "out", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == json.loads((folder / "out/discrepancy.json").read_text())
    return folder / "out"


def test_discrepancy_names_the_effect_and_adds_it_to_the_model(step: Path) -> None:
    findings = json.loads((step / "discrepancy.json").read_text())
    assert findings["verdict"] == "missing_effect"
    assert [effect["name"] for effect in findings["effects"]] == ["step_change"]
    scale, run = (findings["effects"][0]["parameters"][name] for name in ("scale", "run"))
    assert abs(scale["value"] - 0.85) < 4.0 * scale["std"]
    assert abs(run["value"] - 25.0) <= 2.0
    assert findings["next_experiment"]["text"]
    assert [e.name for e in read_model(step / "model.toml").effect] == ["step_change"]
    (effect,) = tomllib.loads((step / "model.toml").read_text())["effect"]
    assert "drive.csv" in effect["source"]
    assert "parent atv.toml" in effect["source"]
    assert np.array(effect["covariance"]).shape == (2, 2)
    page = (step / "report.html").read_text()
    assert "one lasting change during the log" in page
    assert "from the log&#39;s run" in page
    assert page.count("data:image/svg+xml") >= 5
    assert "<script src" not in page


def test_plans_with_the_effect_reserve_longer_stops(step: Path, world: Path) -> None:
    (world / "line.csv").write_text("x,y\n0,0\n40,0\n")
    longest = []
    for model in ("atv", str(step / "model.toml")):
        done = here("plan", "level.npz", "line.csv", "-m", model, "--json")
        columns = json.loads(done.stdout)["plans"][0]["columns"]
        speed, distance = np.array(columns["speed"]), np.array(columns["stop_distance"])
        fast = speed > 0.95 * speed.max()
        longest.append(float(np.max(distance[fast] / speed[fast])))
    assert longest[1] > 1.05 * longest[0]
