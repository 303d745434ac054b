"""Shared by the readers: joining runs and writing them as a drive log."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.services.io.table import write_csv

Columns = dict[str, NDArray[Any]]


def joined(runs: Sequence[Columns], pause: float = 60.0) -> Columns:
    """Runs one after the other on one clock, a pause [s] between them."""
    if not runs:
        raise ValueError("no run to join")
    parts: dict[str, list[NDArray[Any]]] = {name: [] for name in runs[0]}
    clock = 0.0
    for run in runs:
        t = run["t"] - run["t"][0] + clock
        for name in parts:
            parts[name].append(t if name == "t" else run[name])
        clock = float(t[-1]) + pause
    return {name: np.concatenate(values) for name, values in parts.items()}


def main(read: Callable[[Path], Columns], description: str) -> None:
    """`python -m examples.recordings.NAME FOLDER OUT.csv`."""
    if len(sys.argv) != 3:
        print(f"usage: FOLDER OUT.csv\n{description}", file=sys.stderr)
        sys.exit(2)
    columns = read(Path(sys.argv[1]))
    texts = {name: list(v) if v.dtype.kind in "UO" else v for name, v in columns.items()}
    write_csv(texts, Path(sys.argv[2]))
    print(f"wrote {len(columns['t'])} samples to {sys.argv[2]}")
