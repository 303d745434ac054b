"""Paths of a fleet: memory, speed-up of a second worker, a killed worker, a resumed run, bytes.

A tiled map is generated on disk, larger than a worker's memory, and files of paths all over it.
Dask scheduler, workers and the command are separate processes. Memory is the resident set of the
workers, read from outside five times a second.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console

from ..common.campaign import BenchmarkRequest, Progress, Result
from ..common.text_tables import table_of
from .local_cluster import cluster, workers_of

_RESOLUTION = 0.5  # [m]
_TILE = 512  # cells
_STEP = 1.0  # [m] between the points of a path
_POINTS = 25  # of a path
_FAN = 25  # paths from one place
_SAMPLE = 0.2  # [s] between readings of the memory
_SEED = 20  # of map and paths


class FleetSize(NamedTuple):
    """Edge of the map in tiles, files, fans per file, files of the smaller runs."""

    tiles: int
    files: int
    fans: int
    small: int


FULL = FleetSize(tiles=64, files=40, fans=100, small=6)  # 4.3 GB of heights, 100,000 paths
QUICK = FleetSize(tiles=8, files=4, fans=20, small=4)  # 67 MB, 2,000 paths


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Run everything in a temporary folder, of 6 GB for the large map."""
    advance = progress("fleet", 6)
    if request.out is not None:
        request.out.mkdir(parents=True, exist_ok=True)
    size = QUICK if request.quick else FULL
    with TemporaryDirectory(prefix="slopewise-fleet-", dir=request.out) as folder:
        return {"quick": request.quick} | _run_all(size, Path(folder), advance)


def _run_all(size: FleetSize, folder: Path, advance: Callable[[int], Any]) -> Result:
    map_file = _write_map(folder / "map.tif", size)
    paths = _write_paths(folder, size)
    some = paths[: size.small]
    advance(1)
    _run(map_file, some, folder / "local", "--workers", "0")
    advance(1)
    # A first run loads the workers' libraries, so that timed ones begin in the same state.
    with cluster(1) as (address, _):
        _run(map_file, paths[:1], folder / "warm1", "--scheduler", address)
        single = _run(map_file, some, folder / "one", "--scheduler", address)
    advance(1)
    with cluster(2) as (address, workers):
        _run(map_file, paths[:1], folder / "warm2", "--scheduler", address)
        two = _run(map_file, some, folder / "two", "--scheduler", address)
        advance(1)
        with _watched(workers) as memory:
            large = _run(map_file, paths, folder / "large", "--scheduler", address)
    advance(1)
    killed = _killed(map_file, some, folder)
    advance(1)
    again = _run(map_file, paths, folder / "large", "--workers", "0")
    digests = {name: _digest(folder / name) for name in ("local", "one", "two", "killed")}
    return {
        "size": {**size._asdict(), "map_bytes": map_file.stat().st_size},
        "candidates": large["candidates"],
        "seconds": large["seconds"],
        "speed_up": single["seconds"] / two["seconds"],
        "memory": _memory(memory),
        "killed": killed | {"equal": digests["killed"] == digests["local"]},
        "resumed": again["resumed"],
        "resume_seconds": again["seconds"],
        "equal": digests["two"] == digests["local"] == digests["one"],
    }


def _write_map(path: Path, size: FleetSize) -> Path:
    """Hills made of waves, by rows of tiles; with unknown hollows."""
    import rasterio
    from rasterio.transform import from_origin
    from rasterio.windows import Window

    cells = size.tiles * _TILE
    half = 0.5 * _RESOLUTION
    rng = np.random.default_rng(_SEED)
    place = from_origin(-half, cells * _RESOLUTION - half, _RESOLUTION, _RESOLUTION)
    form = {"driver": "GTiff", "width": cells, "height": cells, "count": 1, "dtype": "float32"}
    tiles = {"tiled": True, "blockxsize": _TILE, "blockysize": _TILE, "BIGTIFF": "YES"}
    where = {"crs": "EPSG:32633", "nodata": -9999.0, "transform": place}
    with rasterio.open(path, "w", **form, **tiles, **where) as dataset:
        x = (np.arange(cells) * _RESOLUTION).astype(np.float32)
        along = 1.1 * np.sin(x / 11.0) + 0.3 * np.sin(x / 3.1)
        for first in range(0, cells, _TILE):
            y = ((cells - 1 - np.arange(first, first + _TILE)) * _RESOLUTION).astype(np.float32)
            height = along[None, :] * np.cos(y / 23.0)[:, None] + 0.8 * np.cos(y / 9.0)[:, None]
            for column in rng.integers(0, cells - 20, size.tiles // 2):
                row = int(rng.integers(0, _TILE - 20))
                height[row : row + 12, column : column + 12] = -9999.0
            dataset.write(height.astype(np.float32), 1, window=Window(0, first, cells, _TILE))
    return path


def _write_paths(folder: Path, size: FleetSize) -> list[Path]:
    """Fans of arcs from places all over the map."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    rng = np.random.default_rng(_SEED + 1)
    reach = _STEP * _POINTS + 5.0
    far = size.tiles * _TILE * _RESOLUTION - reach
    files = []
    for number in range(size.files):
        start = np.repeat(rng.uniform(reach, far, (size.fans, 2)), _FAN, axis=0)
        middle = np.repeat(rng.uniform(-np.pi, np.pi, size.fans), _FAN)
        first = middle + np.tile(np.linspace(-0.8, 0.8, _FAN), size.fans)
        curvature = rng.uniform(-0.04, 0.04, len(first))
        heading = first[:, None] + curvature[:, None] * np.arange(_POINTS)
        x = start[:, :1] + _STEP * np.cumsum(np.cos(heading), axis=1)
        y = start[:, 1:] + _STEP * np.cumsum(np.sin(heading), axis=1)
        names = [f"{number}.{i}" for i in range(len(first)) for _ in range(_POINTS)]
        file = folder / f"paths-{number:03d}.parquet"
        pq.write_table(pa.table({"x": x.ravel(), "y": y.ravel(), "candidate": names}), file)
        files.append(file)
    return files


def _run(map_file: Path, paths: list[Path], out: Path, *options: str) -> Result:
    return _result_of(_started(map_file, paths, out, *options))


def _started(map_file: Path, paths: list[Path], out: Path, *options: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "slopewise.services.cli", "fleet", "plan", str(map_file)]
    command += [*map(str, paths), "--model", "atv", "--out", str(out), "--json", *options]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True)


def _result_of(process: subprocess.Popen[str]) -> Result:
    text, error = process.communicate()
    if process.returncode != 0:
        raise RuntimeError(f"fleet plan ended with {process.returncode}: {error.strip()}")
    result: Result = json.loads(text)
    return result


@contextmanager
def _watched(nannies: list[int]) -> Iterator[list[tuple[float, int]]]:
    """Collect (time, largest resident set of a worker) while the block runs."""
    import psutil

    seen: list[tuple[float, int]] = []
    stop = threading.Event()

    def sample() -> None:
        start = time.monotonic()
        while not stop.wait(_SAMPLE):
            sizes = []
            for worker in workers_of(nannies):
                try:
                    sizes.append(worker.memory_info().rss)
                except psutil.NoSuchProcess:
                    continue
            if sizes:
                seen.append((time.monotonic() - start, max(sizes)))

    thread = threading.Thread(target=sample, daemon=True)
    thread.start()
    try:
        yield seen
    finally:
        stop.set()
        thread.join()


def _memory(seen: list[tuple[float, int]]) -> Result:
    """Maximum of a worker, and its medians in the second and last quarter of the run [bytes]."""
    sizes = np.array([size for _, size in seen], np.float64)
    if len(sizes) < 4:
        return {"most": None, "second_quarter": None, "last_quarter": None}
    _, second, _, last = (float(np.median(quarter)) for quarter in np.array_split(sizes, 4))
    return {"most": float(sizes.max()), "second_quarter": second, "last_quarter": last}


def _killed(map_file: Path, paths: list[Path], folder: Path) -> Result:
    """Run two workers, one of which is killed half-way."""
    out = folder / "killed"
    parts = len(list((folder / "local" / "candidates").glob("*.parquet")))
    with cluster(2) as (address, nannies):
        process, dead = _started(map_file, paths, out, "--scheduler", address), 0
        while process.poll() is None:
            written = len(list((out / "candidates").glob("*.parquet")))
            if not dead and 2 * written >= parts:
                os.kill(workers_of(nannies)[0].pid, signal.SIGKILL)
                dead = written
            time.sleep(0.02)
        result = _result_of(process)
    counts = {key: result[key] for key in ("planned", "candidates")}
    return {"after_parts": dead, "parts": parts, **counts}


def _digest(folder: Path) -> str:
    """Digest of the names and bytes of all parts."""
    digest = hashlib.sha256()
    for file in sorted(folder.glob("*/*.parquet")):
        digest.update(f"{file.parent.name}/{file.name}".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


def show(result: Result, console: Console) -> None:
    table = table_of("Fleet", "measured", first="what")
    memory, killed = result["memory"], result["killed"]
    largest, second, last = (
        "too short to see" if size is None else f"{size / 1e6:.0f} MB" for size in memory.values()
    )
    rows = {
        "map": f"{result['size']['map_bytes'] / 1e9:.2f} GB",
        "candidates": f"{result['candidates']:,}",
        "all, two workers": f"{result['seconds']:.0f} s",
        "second worker": f"{result['speed_up']:.2f} x",
        "most memory of a worker": largest,
        "in the second, the last quarter": f"{second} {last}",
        "worker killed after": f"{killed['after_parts']} of {killed['parts']} parts",
        "planned nevertheless": f"{killed['planned']:,} of {killed['candidates']:,}",
        "its bytes are the local run's": "yes" if killed["equal"] else "NO",
        "bytes of one and two workers": "equal" if result["equal"] else "DIFFERENT",
        "second run": f"{result['resumed']:,} resumed in {result['resume_seconds']:.1f} s",
    }
    for name, cell in rows.items():
        table.add_row(name, cell)
    console.print(table)
