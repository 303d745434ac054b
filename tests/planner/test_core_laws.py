"""Laws written in C++ by the generator: they are there as generated, and give what Python gives."""

from __future__ import annotations

import inspect
import os
import runpy
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.effects.registry import LAWS, MOTION_LAWS, motion, motion_deceleration
from slopewise.models.parameters import Effect

CORE = Path(__file__).parents[2] / "planner" / "core"


def test_generated_laws_are_those_of_python(tmp_path: Path) -> None:
    generator = runpy.run_path(str(CORE / "generate_laws.py"))
    assert (CORE / "generated" / "laws.hpp").read_text() == generator["header"](), (
        "run `python planner/core/generate_laws.py`"
    )
    compiler = os.environ.get("CXX") or shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        pytest.skip("needs a compiler on the PATH")
    rng = np.random.default_rng(3)
    calls, expected = [], []
    laws = {law.__name__: law for law in generator["_LAWS"]}
    laws |= {name: LAWS[name].law for name in MOTION_LAWS}
    for name, law in laws.items():
        # Falling, so that the centre of gravity lies between the axles.
        arguments = np.sort(rng.uniform(0.1, 0.9, len(inspect.signature(law).parameters)))[::-1]
        calls.append(f"laws::{name}({', '.join(map(repr, map(float, arguments)))})")
        expected.append(float(law(*arguments)))
    effects = [
        Effect(name=name, parameters=dict.fromkeys(LAWS[name].parameters, 0.01 * (k + 2)))
        for k, name in enumerate(MOTION_LAWS)
    ]
    terms = motion(effects)
    values = ", ".join(map(repr, terms.values))
    calls.append(f"laws::motion_deceleration(3.0, -0.2, 0.7, std::array{{{values}}}.data())")
    expected.append(float(motion_deceleration(3.0, -0.2, 0.7, terms)))
    program = (
        "#include <array>\n#include <cstdio>\n#include <initializer_list>\n"
        '#include "generated/laws.hpp"\nusing namespace slopewise;\n'
        f"int main() {{ for (const double value : {{{', '.join(calls)}}}) "
        'std::printf("%.17g\\n", value); }'
    )
    (tmp_path / "laws.cpp").write_text(program)
    command = [compiler, "-std=c++20", f"-I{CORE}", str(tmp_path / "laws.cpp"), "-o"]
    subprocess.run([*command, str(tmp_path / "laws")], check=True)
    done = subprocess.run([str(tmp_path / "laws")], check=True, capture_output=True, text=True)
    np.testing.assert_allclose([float(line) for line in done.stdout.split()], expected, rtol=1e-14)
