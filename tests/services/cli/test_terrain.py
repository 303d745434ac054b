"""`slopewise terrain`: events, classes, models, page; bad samples are excluded."""

from __future__ import annotations

import json
import re
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slopewise.models.errors import InputError
from slopewise.models.terrain.monitor import TerrainMonitor
from slopewise.services.io.model_file import find_model, read_model, write_model
from slopewise.services.io.table import read_csv, write_csv
from slopewise.services.io.terrain_file import find_terrains, read_terrains, write_terrains
from slopewise.services.jobs import terrain_outputs as outputs
from slopewise.services.jobs.log_input import LogInput
from slopewise.services.jobs.terrain import NEEDED, terrain
from slopewise.services.jobs.terrain_outputs import COLUMNS
from tests.models.terrain import plant
from tests.models.terrain.test_borealtc import example
from tests.models.terrain.vehicles import samples_of
from tests.services.cli.conftest import labelled_run, write_runs
from tests.services.command_line import here, one_line_of
from tests.services.faults import fault_in

SURFACES = {"road": plant.ASPHALT, "track": plant.DIRT, "beach": plant.SAND}
CLASSES = {"road": "asphalt", "track": "dirt_road", "beach": "beach_sand"}
TERRAIN = ("terrain", "terrain.csv", "-m", "husky.toml")


def terrain_json(*arguments: object) -> dict[str, Any]:
    done = here(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)  # type: ignore[no-any-return]


def test_one_row_per_stretch_and_json(world: Path) -> None:
    data = terrain_json(*TERRAIN, "--out", "out.csv", "--update", "m.toml")
    table = read_csv(world / "out.csv")
    assert tuple(table.columns) == COLUMNS
    rows = dict(zip(table.text("run"), range(10_000), strict=False))
    assert set(rows) == set(CLASSES)
    assert [run["words"]["hardness"] for run in data["runs"]] == ["hard", "undecided", "soft"]
    for run in data["runs"]:
        name = CLASSES[run["run"]]
        assert name in run["agrees_with"]
        assert run["class"] is None
        assert run["probabilities"] == {}
        assert run["words"]["grip"] == "undecided"  # the shipped file has no threshold of it
        spots = [s for s in run["stretches"] if s["phase"] == "turn_on_the_spot"]
        assert name in spots[-1]["agrees_with"]
        assert spots[-1]["p_values"][name] > 0.05
        assert spots[-1]["terrain"] == ""
        assert spots[-1]["probability"] is None
        assert spots[-1]["rules"] in (name, "")
    track = data["runs"][1]["terrain"]
    assert track["motion_resistance"]["value"] == pytest.approx(0.13, abs=0.01)
    low, high = track["motion_resistance"]["interval"]
    assert low < 0.13 < high
    assert high - low == pytest.approx(3.92 * track["motion_resistance"]["std"])
    assert track["slip_track"]["value"] == pytest.approx(1.15, abs=0.15)
    assert data["terrain"]["motion_resistance"]["value"] == pytest.approx(0.30, abs=0.02)
    assert data["agreement"] == 0.0  # the log has other names
    assert set(data["classes"]) == set(SURFACES)
    model = read_model(world / "m.toml")
    assert model.terrain.motion_resistance == pytest.approx(0.40, abs=0.03)
    assert model.terrain.slip_track > 1.5
    assert set(model.braking.terrain) == set(SURFACES)  # as the log names them
    assert model.braking.on("road").b_b < 0.25 - 0.09
    assert model.braking.on("beach").b_b == 0.25


def test_labels_give_classes_and_thresholds_that_are_read_again(world: Path) -> None:
    data = terrain_json(*TERRAIN, "--learn", "mine.toml")
    assert any("road 1, track 1, beach 1" in note for note in data["notes"])
    learned = read_terrains(world / "mine.toml")
    assert [c.name for c in learned.terrain] == list(SURFACES)
    assert {c.days for c in learned.terrain} == {1.0}
    assert learned.thresholds.soft_above == pytest.approx(0.07, abs=0.01)  # road, then track
    data = terrain_json(*TERRAIN, "--terrains", "mine.toml")
    assert data["agreement"] > 0.9
    assert {run["class"] for run in data["runs"]} == {None}


def test_three_sites_give_names(world: Path) -> None:
    runs = []
    for site in range(3):
        for name, surface in SURFACES.items():
            label, log = labelled_run(name, surface, 10 * site + len(runs), sides=2)
            log["session"] = np.full(len(log["t"]), f"day {site}")
            runs.append((f"{label}{site}", log))
    write_runs(world / "log.csv", *runs)
    terrain_json("terrain", "log.csv", *TERRAIN[2:], "--learn", "mine.toml")
    assert {c.days for c in read_terrains(world / "mine.toml").terrain} == {3.0}
    data = terrain_json(*TERRAIN, "--terrains", "mine.toml", "--out", "out.csv")
    assert [run["class"] for run in data["runs"]] == list(SURFACES)
    assert data["runs"][0]["probabilities"] == {"road": 0.95}
    assert {"road", "track", "beach", ""} == set(read_csv(world / "out.csv").text("terrain"))


def test_without_names_of_the_ground_nothing_is_learned(world: Path) -> None:
    write_runs(world / "log.csv", ("1", drive_log()))
    one_line_of(here("terrain", "log.csv", *TERRAIN[2:], "--learn", "l.toml"), "column terrain")


def test_a_vehicle_file_that_cannot_be_right_is_reported(world: Path) -> None:
    husky = read_model(world / "husky.toml")
    light = replace(husky, vehicle=replace(husky.vehicle, mass=5.0, max_drive_force=90.0))
    write_model(light, world / "light.toml")
    data = terrain_json("terrain", "terrain.csv", "-m", "light.toml")
    (note,) = [n for n in data["notes"] if "cannot be right" in n]
    assert note.startswith("light.toml: ")
    assert not [n for n in terrain_json(*TERRAIN)["notes"] if "cannot be right" in n]
    data = terrain_json("terrain", "terrain.csv", "-m", "husky")  # states no idle current
    assert any("idle_current" in note and "f_r" in note for note in data["notes"])


def test_files_of_earlier_versions_are_read(tmp_path: Path) -> None:
    path = tmp_path / "t.toml"
    text = find_terrains("husky").read_text()
    tables = ("classifier", "change", "adaptation", "memory")
    old = "\n".join(f"[{name}]\nany = 1.0" for name in tables)
    path.write_text(text.replace("[thresholds]", f'signatures = "x.json"\n{old}\n[thresholds]'))
    assert read_terrains(path) == read_terrains(find_terrains("husky"))


def test_terrain_files_are_read_back_equal(tmp_path: Path) -> None:
    terrains = read_terrains(find_terrains("husky"))
    write_terrains(terrains, tmp_path / "again.toml")
    assert read_terrains(tmp_path / "again.toml") == terrains


def test_the_page_has_the_figures_of_the_paper_and_no_markup_of_names(world: Path) -> None:
    runs = [labelled_run(name, surface, 0) for name, surface in SURFACES.items()]
    log = plant.drive(plant.square(sides=1), plant.DIRT)
    runs.append(("<b>[red]run", log | {"terrain": np.full(len(log["t"]), "")}))
    write_runs(world / "log.csv", *runs)
    assert here("terrain", "log.csv", *TERRAIN[2:], "--report", "p.html").returncode == 0
    text = (world / "p.html").read_text()
    assert len(re.findall(r"data:image/svg\+xml;base64,[A-Za-z0-9+/=]{2000,}", text)) == 3
    for part in ("Three features", "How fast the filter settles", "road", "beach"):
        assert part in text
    assert "<script>" in text
    assert "http://" not in text.split("base64")[0]
    assert "<b>[red]" not in text
    assert "&lt;b&gt;[red]run" in text


def drive_log() -> dict[str, np.ndarray]:
    return plant.drive(plant.square(sides=2), plant.DIRT)


@pytest.mark.parametrize("name", NEEDED)
def test_a_missing_column_is_an_error(tmp_path: Path, name: str) -> None:
    path = write_runs(tmp_path / "log.csv", ("1", drive_log()), drop=(name,))
    with fault_in(path, f"column {name}", "missing column", "v_left, v_right, yaw_rate"):
        terrain(LogInput([path]), "husky")


STRAIGHT = slice(400, 800)  # of the first leg, driven from 2 s to 10 s


@pytest.mark.parametrize(
    ("channel", "value", "reason"),
    [
        ("current_left", np.nan, "not a number"),
        ("current_left", -1000.0, "thrust of"),
        ("v_left", -1000.0, "v_left of -1000"),
        ("v_left", None, "v_left stays at exactly"),
        ("yaw_rate", np.nan, "not a number"),
    ],
    ids=["nan", "sentinel current", "sentinel speed", "frozen encoder", "nan yaw rate"],
)
def test_bad_samples_are_flagged_and_excluded(
    files: Path, tmp_path: Path, channel: str, value: float | None, reason: str
) -> None:
    log = drive_log()
    log[channel] = log[channel].copy()
    log[channel][STRAIGHT] = log[channel][STRAIGHT.start] if value is None else value
    path = write_runs(tmp_path / "log.csv", ("1", log))
    result = terrain(LogInput([path]), str(files / "husky.toml"))
    (run,) = result.runs
    assert any(reason in stretch.reason for stretch in run.excluded), run.excluded
    assert not [e for e in run.stretches if 4.0 < e.observation.begin < 7.9]
    assert run.known.values == pytest.approx((0.13, 0.20, 1.15), abs=0.12)
    assert run.known.values[0] == pytest.approx(0.13, abs=0.02)
    outputs.write_events(result, tmp_path / "out.csv")
    assert "excluded" in read_csv(tmp_path / "out.csv").text("phase")


@pytest.mark.parametrize(
    ("names", "factor", "reason"),
    [(("v_left", "v_right"), 1 / 0.13, "rad/s"), (("yaw_rate",), 57.29578, "degrees per second")],
)
def test_wrong_units_exclude_the_run(
    files: Path, tmp_path: Path, names: tuple[str, ...], factor: float, reason: str
) -> None:
    log = drive_log()
    log |= {name: log[name] * factor for name in names}
    path = write_runs(tmp_path / "log.csv", ("1", log), ("2", drive_log()))
    first, second = terrain(LogInput([path]), str(files / "husky.toml")).runs
    assert not first.stretches
    assert not first.changes
    assert any(reason in stretch.reason for stretch in first.excluded)
    assert second.stretches


def test_a_class_too_slippery_to_stop_on_is_rejected(files: Path, tmp_path: Path) -> None:
    path = write_runs(tmp_path / "log.csv", labelled_run("asphalt", plant.ASPHALT, 0))
    husky = read_model(files / "husky.toml")
    weak = tmp_path / "weak.toml"
    write_model(replace(husky, braking=replace(husky.braking, b_b=0.08)), weak)
    with pytest.raises(InputError, match="asphalt"):
        outputs.updated_model(terrain(LogInput([path]), str(weak)))


def test_an_hour_at_100_hertz_is_quick() -> None:
    """Five seconds on an idle machine; a tenth of an hour here, with a margin for a busy one."""
    rows = samples_of(plant.drive(plant.square(sides=34), plant.DIRT))
    file = read_terrains(find_terrains("husky"))
    monitor = TerrainMonitor(read_model(find_model("husky")), file.classes, file.thresholds)
    begin = time.process_time()
    for row in rows:
        monitor.update(row)
    assert (time.process_time() - begin) / len(rows) * 360_000 < 15.0


def test_the_example_reports_what_it_skips(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    borealtc = example("borealtc")
    folder = tmp_path / "data"
    (folder / "GRAVEL").mkdir(parents=True)
    (folder / "ICE").mkdir()
    (folder / "ICE" / "pro_01.csv").write_text("time,curL,curR,velL,velR\n")
    t = np.arange(0.0, 3.0, 0.01)
    fast = {name: np.zeros(len(t)) for name in ("wx", "wy", "wz", "ax", "ay", "az")}
    write_csv({"time": t, **fast}, folder / "ICE" / "imu_02.csv")
    (folder / "ICE" / "pro_02.csv").write_text("time,curL\n0.0,1.0\n")
    with pytest.raises(SystemExit, match="nothing written"):
        borealtc.main(str(folder), str(tmp_path / "out"))
    printed = capsys.readouterr().out
    assert "skipped GRAVEL: expected one of ASPHALT" in printed
    assert "skipped ICE/pro_01.csv: there is no imu_01.csv" in printed
    assert "skipped ice_02: " in printed
    assert "skipped SNOW: no such folder here" in printed
