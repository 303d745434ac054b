"""The compiler of this machine with one more option, and the C++ core without Python."""

from __future__ import annotations

import shutil
from pathlib import Path

CORE = Path(__file__).parents[2] / "planner" / "core"


def compiler_with(option: str, folder: Path) -> dict[str, str]:
    """Environment in which the core is compiled with an option that prevails over its own."""
    compiler = shutil.which("c++")
    if compiler is None:
        return {}  # hatch_build.py finds another one
    script = folder / "c++"
    script.write_text(f'#!/bin/sh\nexec "{compiler}" "$@" {option}\n')
    script.chmod(0o755)
    return {"CXX": str(script)}
