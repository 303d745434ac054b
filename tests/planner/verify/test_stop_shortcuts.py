"""Stops that are neither marched nor checked for their loads, against those that are."""

from __future__ import annotations

from pathlib import Path

from tests.world.compilers import needs_compiler, output_of


@needs_compiler
def test_shortcuts_pass_no_stop_that_unloads_anything(tmp_path: Path) -> None:
    source = Path(__file__).with_name("stop_shortcuts.cpp")
    output_of(source, tmp_path, "-O1", "-ffp-contract=off")
