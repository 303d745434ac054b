"""Files that the tests of commands share; each test gets a folder with all of them."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from slopewise.services.io.map_file import write_map_npz
from slopewise.services.io.model_file import find_model, write_model
from slopewise.services.io.path_file import write_paths_csv
from slopewise.services.io.table import write_csv
from slopewise.services.jobs.demo import fan, hillside
from tests.models.calibration.plant import Plant, drive
from tests.models.terrain import plant
from tests.services.check.drives import ground, model_with, trapezoid
from tests.services.quick_figures import quick_figures

__all__ = ["quick_figures"]


def write_log(log: dict, path: Path) -> Path:
    """A drive log as CSV."""
    write_csv({n: list(v) if v.dtype.kind in "UO" else v for n, v in log.items()}, path)
    return path


def write_runs(path: Path, *runs: tuple[str, dict], drop: tuple[str, ...] = ()) -> Path:
    """A drive log of several runs, one after the other on one clock."""
    columns: dict = {}
    begin = 0.0
    for name, log in runs:
        run = {"run": np.full(len(log["t"]), name), **log, "t": log["t"] + begin}
        for key, values in run.items():
            columns.setdefault(key, []).append(values)
        begin += log["t"][-1] + 1.0
    return write_log({k: np.concatenate(v) for k, v in columns.items() if k not in drop}, path)


def labelled_run(name: str, surface: plant.Ground, seed: int, sides: int = 3) -> tuple[str, dict]:
    log = plant.drive(plant.square(sides=sides), surface, seed=seed)
    return name, log | {"terrain": np.full(len(log["t"]), name)}


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the shared files: do not write to it."""
    folder = tmp_path_factory.mktemp("commands")
    write_map_npz(hillside(), folder / "map.npz")
    write_paths_csv(fan()[:4], folder / "paths.csv")
    write_map_npz(ground(), folder / "level.npz")
    write_model(model_with(), folder / "quad.toml")
    s, v = trapezoid(3.0, spacing=0.25)
    for name, factor in (("good", 1.0), ("fast", 1.5)):
        candidate = [name] * len(s)
        table = {"x": s, "y": np.zeros_like(s), "speed": factor * v, "candidate": candidate}
        write_csv(table, folder / f"{name}.csv")
    write_log(drive(Plant(), 24, 0)[0], folder / "stops.csv")
    write_log(drive(Plant(), 12, 0)[0], folder / "dozen.csv")
    write_log(drive(Plant(), 5, 3)[0], folder / "few.csv")
    surfaces = {"road": plant.ASPHALT, "track": plant.DIRT, "beach": plant.SAND}
    runs = [labelled_run(name, surface, i) for i, (name, surface) in enumerate(surfaces.items())]
    write_runs(folder / "terrain.csv", *runs)
    (folder / "atv.toml").write_text(find_model("atv").read_text())
    idle = "idle_current = 0.5\n# idle_current: not"
    husky = find_model("husky").read_text().replace("# idle_current: not", idle)
    (folder / "husky.toml").write_text(husky)
    (folder / "topics.toml").write_text("")
    (folder / "loop.csv").symlink_to("loop.csv")
    return folder


@pytest.fixture
def world(files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with links to the shared files, in which commands run."""
    for file in files.iterdir():
        os.symlink(file, tmp_path / file.name)
    monkeypatch.chdir(tmp_path)
    return tmp_path
