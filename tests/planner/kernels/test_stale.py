"""Compiled kernels of other sources are never loaded."""

from __future__ import annotations

from pathlib import Path

import pytest

from slopewise.planner.kernels.stale import forget_stale_kernels


@pytest.fixture
def packages(tmp_path: Path) -> tuple[Path, Path]:
    planner, models = tmp_path / "planner", tmp_path / "models"
    for folder in (planner / "bounds" / "__pycache__", models / "laws", models / "effects"):
        folder.mkdir(parents=True)
    (planner / "bounds" / "pointwise.py").write_text("limit = 1\n")
    (models / "laws" / "crest.py").write_text("law = 1\n")
    (models / "quantity.py").write_text("GRAVITY = 9.80665\n")
    return planner, models


def compiled(planner: Path) -> Path:
    kernel = planner / "bounds" / "__pycache__" / "pointwise.bars-1.py311.nbi"
    kernel.write_bytes(b"machine code")
    return kernel


@pytest.mark.parametrize("changed", ["planner/bounds/pointwise.py", "models/laws/crest.py"])
def test_a_change_of_what_is_compiled_in_forgets_the_kernels(
    packages: tuple[Path, Path], changed: str
) -> None:
    planner, models = packages
    forget_stale_kernels(planner, models)
    kernel = compiled(planner)
    (planner.parent / changed).write_text("something = 2\n")
    assert forget_stale_kernels(planner, models)
    assert not kernel.exists()


def test_unchanged_sources_keep_their_kernels(packages: tuple[Path, Path]) -> None:
    planner, models = packages
    forget_stale_kernels(planner, models)
    kernel = compiled(planner)
    assert not forget_stale_kernels(planner, models)
    assert kernel.exists()


def test_kernels_of_unknown_origin_go(packages: tuple[Path, Path]) -> None:
    kernel = compiled(packages[0])
    assert forget_stale_kernels(*packages)
    assert not kernel.exists()
