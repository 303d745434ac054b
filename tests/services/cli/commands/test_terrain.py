from __future__ import annotations

import csv
import json
import re
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.errors import InputError
from slopewise.services.cli.app import main
from slopewise.services.cli.commands import terrain as command
from slopewise.services.cli.commands import terrain_result as results
from slopewise.services.cli.commands import terrain_view as view
from slopewise.services.io.model_file import find_model, read_model, write_model
from slopewise.services.io.table import write_csv
from slopewise.services.io.terrain_file import find_terrains, read_terrains, write_terrains
from slopewise.services.io.terrain_table import COLUMNS
from tests.models.terrain import plant
from tests.services.faults import fault_in

QUIET = 'name = "test"\n[filter]\nyaw_rate_std = 0.03\n'


def written(path: Path, *runs: tuple[str, dict], drop: tuple[str, ...] = ()) -> Path:
    """A drive log of some runs, one after the other on one clock."""
    columns: dict = {"run": []}
    begin = 0.0
    for name, log in runs:
        columns["run"] += [name] * len(log["t"])
        for key, values in {**log, "t": log["t"] + begin}.items():
            columns.setdefault(key, []).append(values)
        begin += log["t"][-1] + 1.0
    joined = {
        key: values if key == "run" else np.concatenate(values)
        for key, values in columns.items()
        if key not in drop
    }
    if "terrain" in joined:
        joined["terrain"] = joined["terrain"].tolist()
    write_csv(joined, path)
    return path


def model(folder: Path, *, idle_current: float = 0.5) -> Path:
    """The shipped Husky with the idle current of the plant."""
    text = find_model("husky").read_text()
    path = folder / "husky.toml"
    path.write_text(
        text.replace("# idle_current: not", f"idle_current = {idle_current}\n# idle_current: not")
    )
    return path


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("driven")
    runs = [
        (name, plant.drive(plant.square(sides=3), ground, seed=i) | {"terrain": label})
        for i, (name, ground) in enumerate(
            (("road", plant.ASPHALT), ("track", plant.DIRT), ("beach", plant.SAND))
        )
        for label in [np.full(len(plant.drive(plant.square(sides=3), ground)["t"]), name)]
    ]
    return written(folder / "drive.csv", *runs), model(folder)


def status_of(*words: object) -> int:
    with pytest.raises(SystemExit) as caught:
        main([str(word) for word in words])
    return int(caught.value.code or 0)


def test_a_row_a_stretch_and_json(driven, tmp_path, capsys) -> None:
    log, husky = driven
    out = tmp_path / "terrain.csv"
    assert status_of("terrain", log, "-m", husky, "--out", out) == 0
    with out.open() as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    assert {row["run"] for row in rows} == {"road", "track", "beach"}
    told = {"road": "asphalt", "track": "dirt_road", "beach": "beach_sand"}
    last = {row["run"]: row for row in rows if row["phase"] == "turn_on_the_spot"}
    for run, name in told.items():
        assert last[run]["terrain"] == name
        assert last[run]["rules"] in (name, "")
    assert float(last["track"]["motion_resistance"]) == pytest.approx(0.13, abs=0.01)
    assert float(last["track"]["slip_track"]) == pytest.approx(1.15, abs=0.15)
    capsys.readouterr()
    assert status_of("terrain", log, "-m", husky, "--json") == 0
    data = json.loads(capsys.readouterr().out)
    assert [run["class"] for run in data["runs"]] == list(told.values())
    assert data["terrain"]["motion_resistance"]["value"] == pytest.approx(0.30, abs=0.02)
    assert data["agreement"] == 0.0  # the log calls them otherwise


def test_the_updated_model_plans(driven, tmp_path) -> None:
    log, husky = driven
    better = tmp_path / "better.toml"
    assert status_of("terrain", log, "-m", husky, "--update", better) == 0
    model = read_model(better)
    assert model.terrain.motion_resistance == pytest.approx(0.33, abs=0.03)
    assert model.terrain.slip_track > 1.5
    assert set(model.braking.terrain) == {"asphalt", "dirt_road", "beach_sand"}
    assert model.braking.on("asphalt").b_b < 0.25 - 0.09
    assert model.braking.on("beach_sand").b_b == 0.25


def test_labels_make_classes_that_are_read_again(driven, tmp_path, capsys) -> None:
    log, husky = driven
    learned = tmp_path / "mine.toml"
    assert status_of("terrain", log, "-m", husky, "--learn", learned) == 0
    found = read_terrains(learned)
    assert [one.name for one in found.terrain] == ["road", "track", "beach"]
    capsys.readouterr()
    assert status_of("terrain", log, "-m", husky, "--terrains", learned, "--json") == 0
    assert json.loads(capsys.readouterr().out)["agreement"] > 0.9


def test_without_labels_classes_arise_from_what_lies_together(tmp_path) -> None:
    pytest.importorskip("sklearn", reason="the learn extra is not installed")
    legs = plant.square(sides=16, straight=4.0)
    runs = [("1", plant.drive(legs, plant.ASPHALT)), ("2", plant.drive(legs, plant.SAND, seed=1))]
    log, unknown = written(tmp_path / "log.csv", *runs), tmp_path / "unknown.toml"
    unknown.write_text(QUIET)
    learned = tmp_path / "learned.toml"
    words = ("terrain", log, "-m", model(tmp_path), "--terrains", unknown, "--learn", learned)
    assert status_of(*words) == 0
    first, second = read_terrains(learned).terrain
    assert (first.name, second.name) == ("new_1", "new_2")
    assert first.lateral_resistance.mean == pytest.approx(0.26, abs=0.02)
    assert second.lateral_resistance.mean == pytest.approx(0.11, abs=0.02)
    assert second.slip_track.mean == pytest.approx(1.62, abs=0.15)


def test_labels_need_no_clustering(driven, tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "sklearn.cluster", None)
    log, husky = driven
    assert status_of("terrain", log, "-m", husky, "--learn", tmp_path / "mine.toml") == 0


def test_clustering_without_scikit_learn_is_one_line(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setitem(sys.modules, "sklearn.cluster", None)
    log = written(tmp_path / "log.csv", ("1", plant.drive(plant.square(sides=9), plant.DIRT)))
    unknown = tmp_path / "unknown.toml"
    unknown.write_text(QUIET)
    words = ("terrain", log, "-m", model(tmp_path), "--terrains", unknown, "--adapt")
    assert status_of(*words) == 2
    assert "pip install '.[learn]'" in capsys.readouterr().err


def test_terrain_files_come_back_the_same(tmp_path) -> None:
    given = read_terrains(find_terrains("husky"))
    write_terrains(given, tmp_path / "again.toml")
    assert read_terrains(tmp_path / "again.toml") == given


@pytest.mark.parametrize(
    ("text", "field", "words"),
    [
        ("name = ", "end of document", "expected TOML"),
        ('name = "x"\nnam = 1', "nam", "did you mean name?"),
        ('name = "x"\n[filter]\nyaw_rate_std = -1', "filter.yaw_rate_std", "> 0"),
        ('name = "x"\n[motion]\nturn_begin = 0.01', "motion.turn_end", "at most turn_begin"),
        (
            'name = "x"\n[[terrain]]\nname = "a"\nslip_track = {mean = 1, std = 0, samples = 6}',
            "terrain[0].slip_track.std",
            "> 0",
        ),
        ('name = "x"\n[[terrain]]\nname = "a"\n[[terrain]]\nname = "a"', "terrain", "a twice"),
    ],
)
def test_terrain_files_that_cannot_be_used(tmp_path, text, field, words) -> None:
    path = tmp_path / "t.toml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_terrains(path)
    assert caught.value.source == str(path)
    assert field in caught.value.field
    assert words in str(caught.value)


def test_the_page_holds_the_figures_of_the_paper(driven, tmp_path) -> None:
    log, husky = driven
    page = tmp_path / "page.html"
    assert status_of("terrain", log, "-m", husky, "--report", page) == 0
    text = page.read_text()
    assert len(re.findall(r"data:image/svg\+xml;base64,[A-Za-z0-9+/=]{2000,}", text)) == 3
    for words in ("Three features", "How fast the filter settles", "road", "beach_sand"):
        assert words in text
    assert "<script>" in text
    assert "http://" not in text.split("base64")[0]


def test_names_of_a_log_do_not_become_markup(tmp_path) -> None:
    log = plant.drive(plant.square(sides=1), plant.DIRT)
    path = written(tmp_path / "log.csv", ("<b>[red]run", log))
    job = command.TerrainJob([path], str(model(tmp_path)))
    result = command.run(job, quiet=True)
    view.write_page(result, job, tmp_path / "page.html")
    assert "<b>[red]" not in (tmp_path / "page.html").read_text()
    assert "&lt;b&gt;[red]run" in (tmp_path / "page.html").read_text()


# bad logs


def good() -> dict:
    return plant.drive(plant.square(sides=2), plant.DIRT)


@pytest.mark.parametrize("name", command.NEEDED)
def test_a_missing_column_is_an_error(tmp_path, name) -> None:
    path = written(tmp_path / "log.csv", ("1", good()), drop=(name,))
    with fault_in(path, f"column {name}", "missing column", "v_left, v_right, yaw_rate"):
        command.run(command.TerrainJob([path], "husky"), quiet=True)


@pytest.mark.parametrize(
    ("shuffle", "words"),
    [(lambda t: np.r_[t[:50], t[49:-1]], "after"), (lambda t: t[::-1], "after")],
    ids=["duplicate", "unsorted"],
)
def test_time_that_does_not_increase_is_an_error(tmp_path, shuffle, words) -> None:
    log = good()
    path = written(tmp_path / "log.csv", ("1", {**log, "t": shuffle(log["t"])}))
    with pytest.raises(InputError, match=words) as caught:
        command.run(command.TerrainJob([path], "husky"), quiet=True)
    assert "column t" in caught.value.field


def test_pitch_in_degrees_is_an_error(tmp_path) -> None:
    log = good()
    path = written(tmp_path / "log.csv", ("1", {**log, "pitch": log["pitch"] + 12.0}))
    with fault_in(path, "row 2, column pitch", "looks like degrees"):
        command.run(command.TerrainJob([path], "husky"), quiet=True)


def spoilt(name: str, part: slice, value: float | None) -> dict:
    log = good()
    column = log[name].copy()
    column[part] = column[part.start] if value is None else value
    return {**log, name: column}


STRAIGHT = slice(400, 800)  # of the first leg, driven from 2 s to 10 s


@pytest.mark.parametrize(
    ("log", "words"),
    [
        (lambda: spoilt("current_left", STRAIGHT, np.nan), "not a number"),
        (lambda: spoilt("current_left", STRAIGHT, -1000.0), "thrust of"),
        (lambda: spoilt("v_left", STRAIGHT, -1000.0), "v_left of -1000"),
        (lambda: spoilt("v_left", STRAIGHT, None), "v_left stays at exactly"),
        (lambda: spoilt("yaw_rate", STRAIGHT, np.nan), "not a number"),
    ],
    ids=["nan", "sentinel current", "sentinel speed", "frozen encoder", "nan yaw rate"],
)
def test_bad_samples_are_flagged_and_left_out(tmp_path, log, words) -> None:
    path = written(tmp_path / "log.csv", ("1", log()))
    husky = str(model(tmp_path))
    result = command.run(command.TerrainJob([path], husky), quiet=True)
    (one,) = result.runs
    assert any(words in stretch.reason for stretch in one.excluded), one.excluded
    inside = [e for e in one.classified if 4.0 < e.observation.begin < 7.9]
    assert not inside
    assert one.known.values == pytest.approx((0.13, 0.20, 1.15), abs=0.12)
    assert one.known.values[0] == pytest.approx(0.13, abs=0.02)
    view.write(result, tmp_path / "out.csv")
    assert "excluded" in (tmp_path / "out.csv").read_text()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"v_left": 1 / 0.13, "v_right": 1 / 0.13}, "rad/s"),
        ({"yaw_rate": 57.29578}, "degrees per second"),
    ],
    ids=["wheels in rad/s", "yaw rate in deg/s"],
)
def test_wrong_units_leave_the_run_out(tmp_path, changes, words) -> None:
    log = good()
    log |= {name: log[name] * factor for name, factor in changes.items()}
    path = written(tmp_path / "log.csv", ("1", log), ("2", good()))
    result = command.run(command.TerrainJob([path], str(model(tmp_path))), quiet=True)
    assert not result.runs[0].events
    assert any(words in stretch.reason for stretch in result.runs[0].excluded)
    assert result.runs[1].events


def test_a_car_and_a_vehicle_without_motor_constants(tmp_path) -> None:
    path = written(tmp_path / "log.csv", ("1", good()))
    text = find_model("husky").read_text()
    car = tmp_path / "car.toml"
    car.write_text(text.replace('"skid_steer"', '"ackermann"'))
    with fault_in(car, "vehicle.drive", "expected skid_steer"):
        command.run(command.TerrainJob([path], str(car)), quiet=True)
    car.write_text(text.replace("gear_ratio = 78.71", "# "))
    with fault_in(car, "vehicle.gear_ratio", "expected a number > 0"):
        command.run(command.TerrainJob([path], str(car)), quiet=True)
    with fault_in("none", "", "expected a terrain file or one of husky"):
        command.run(command.TerrainJob([path], "husky", "none"), quiet=True)


def test_a_class_too_slippery_to_stop_on_is_refused(tmp_path) -> None:
    path = written(tmp_path / "log.csv", ("1", plant.drive(plant.square(), plant.ASPHALT)))
    husky = read_model(model(tmp_path))
    import dataclasses

    weak = dataclasses.replace(husky, braking=dataclasses.replace(husky.braking, b_b=0.08))
    write_model(weak, tmp_path / "weak.toml")
    job = command.TerrainJob([path], str(tmp_path / "weak.toml"))
    result = command.run(job, quiet=True)
    with pytest.raises(InputError, match="asphalt"):
        results.updated_model(result)


def test_an_hour_at_100_hertz_is_quick() -> None:
    """Five seconds on an idle machine; a tenth of an hour here, with room for a busy one."""
    log = plant.drive(plant.square(sides=34), plant.DIRT)
    husky = read_model(find_model("husky"))
    monitor = command.monitor_of(husky, read_terrains(find_terrains("husky")), 0)
    from tests.models.terrain.vehicles import samples_of

    rows = samples_of(log)
    begin = time.process_time()
    for row in rows:
        monitor.update(row)
    assert (time.process_time() - begin) / len(rows) * 360_000 < 15.0
