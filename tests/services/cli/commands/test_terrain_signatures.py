"""`slopewise terrain --learn` and signatures: learned, read again, told; what cannot be is said."""

from __future__ import annotations

import json

import numpy as np
import pytest

from slopewise.services.io.table import write_csv
from slopewise.services.io.terrain_file import read_terrains
from tests.models.terrain import plant
from tests.models.terrain.test_borealtc import example
from tests.services.cli.commands.test_terrain import model, status_of, written

GROUNDS = {"road": plant.ASPHALT, "track": plant.DIRT, "beach": plant.SAND}


def run_on(name: str, seed: int) -> dict:
    log = plant.drive(plant.square(sides=2), GROUNDS[name], seed=seed)
    return log | {"terrain": np.full(len(log["t"]), name)}


def log_of(path, names: str, first: int, runs: int):
    runs = [(f"{name}{i}", run_on(name, first + i)) for i in range(runs) for name in names.split()]
    return written(path, *runs)


@pytest.fixture(scope="module")
def learned(tmp_path_factory):
    pytest.importorskip("sklearn", reason="the learn extra is not installed")
    folder = tmp_path_factory.mktemp("signatures")
    log, husky = log_of(folder / "log.csv", "road track beach", 0, 5), model(folder)
    file = folder / "mine.toml"
    assert status_of("terrain", log, "-m", husky, "--learn", file) == 0
    return folder, husky, file


def test_signatures_are_learned_beside_the_classes_and_tell_other_runs(learned, capsys) -> None:
    folder, husky, file = learned
    assert read_terrains(file).signatures == "mine.signatures.json"
    other = log_of(folder / "other.csv", "road track beach", 20, 2)
    capsys.readouterr()
    assert status_of("terrain", other, "-m", husky, "--terrains", file, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["agreement"] > 0.8
    assert told["reliability"]
    for run in told["runs"]:
        assert sum(run["probabilities"].values()) == pytest.approx(1.0)
        assert run["not_compared_seconds"] >= 0
        for stretch in run["stretches"]:
            assert 0.0 <= stretch["probability"] <= 1.0


def test_a_signature_file_that_is_gone_is_one_line(learned, tmp_path, capsys) -> None:
    folder, husky, file = learned
    lonely = tmp_path / "lonely.toml"
    lonely.write_text(file.read_text())
    assert status_of("terrain", folder / "log.csv", "-m", husky, "--terrains", lonely) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "mine.signatures.json" in error


def test_too_few_runs_of_a_class_are_said_and_classes_are_written_all_the_same(
    tmp_path, capsys
) -> None:
    log = written(tmp_path / "log.csv", ("1", run_on("road", 0)), ("2", run_on("beach", 1)))
    file = tmp_path / "few.toml"
    assert status_of("terrain", log, "-m", model(tmp_path), "--learn", file, "--json") == 0
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert any("no signatures learned" in note for note in notes)
    assert read_terrains(file).signatures == ""
    assert len(read_terrains(file).terrain) == 2


def test_the_example_says_what_it_skips_and_why(tmp_path, capsys) -> None:
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
    said = capsys.readouterr().out
    assert "skipped GRAVEL: expected one of ASPHALT" in said
    assert "skipped ICE/pro_01.csv: there is no imu_01.csv" in said
    assert "skipped ice_02: " in said
    assert "skipped SNOW: no such folder here" in said
