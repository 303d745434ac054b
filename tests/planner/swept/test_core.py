"""Random scenes through the sweep and the roughness of the core, under sanitizers."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.world.compilers import run_under_sanitizers


@pytest.mark.nightly  # by day with the whole planner, tests/planner/test_from_cpp.py
def test_random_scenes_pass_the_sanitizers(tmp_path: Path) -> None:
    run_under_sanitizers(Path(__file__).parent / "swept_driver.cpp", tmp_path)
