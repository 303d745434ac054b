"""The C++ core without Python, and the compiler of this machine, as hatch_build.py finds it."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from hatch_build import compiler

CORE = Path(__file__).parents[2] / "planner" / "core"
needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C++ compiler on this machine")


def compiler_with(option: str, folder: Path) -> dict[str, str]:
    """Environment in which the core is compiled with an option that prevails over its own."""
    if compiler() is None:
        return {}  # hatch_build.py installs one
    script = folder / "c++"
    script.write_text(f'#!/bin/sh\nexec "{compiler()}" "$@" {option}\n')
    script.chmod(0o755)
    return {"CXX": str(script)}


def output_of(source: Path, folder: Path, *options: str) -> str:
    """Output of a program over the core, compiled and run in a folder; it has to succeed."""
    program = folder / source.stem
    command = [
        str(compiler()),
        "-std=c++20",
        f"-I{CORE}",
        *options,
        str(source),
        "-o",
        str(program),
    ]
    for step in (command, [str(program)]):
        done = subprocess.run(step, capture_output=True, text=True, timeout=200)
        assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
