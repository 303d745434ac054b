"""The core as C++ programs link it, and its laws as Python has them."""

from __future__ import annotations

import inspect
import runpy
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import slopewise
from hatch_build import compiler, tool
from slopewise.models.effects.registry import LAWS, MOTION_LAWS, motion, motion_deceleration
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Effect, Model, Tracking
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.path import EvenPath
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import Status
from slopewise.services.cli.app import main
from slopewise.services.export.cpp_model import write_cpp
from tests.world.compilers import CORE, needs_compiler, output_of

ROOT = Path(__file__).parents[2]
STATUSES = list(Status)
GENERATOR = runpy.run_path(str(CORE / "generate_laws.py"))


def example_in(folder: Path, model: Model) -> Path:
    """The program of the example with a model, built in a folder."""
    write_cpp(model, folder, resolution=0.2, height_std=0.0, quantile=0.999)
    cmake, ninja, build = tool("cmake"), tool("ninja"), folder / "build"
    assert cmake, "of the extra dev"
    given = {
        "slopewise_DIR": CORE,
        "CMAKE_CXX_COMPILER": compiler(),
        "CMAKE_MAKE_PROGRAM": ninja,
        "CMAKE_CXX_FLAGS": f"-I{folder}",
        "CMAKE_BUILD_TYPE": "None",  # compiled in a third of the time, to the same numbers
    }
    options = [f"-D{name}={value}" for name, value in given.items()]
    example = ROOT / "examples" / "cpp"
    for step in (
        [cmake, "-G", "Ninja", "-S", str(example), "-B", str(build), *options],
        [cmake, "--build", str(build)],
    ):
        done = subprocess.run(step, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return build / "plan_over_a_hill"


def hill() -> ElevationMap:
    """The ground of the example, in other words."""
    x, y = np.meshgrid(0.2 * np.arange(200.0), 0.2 * np.arange(200.0))
    away = (x - 22.0) ** 2 + (y - 20.0) ** 2
    z = 2.0 * np.exp(-away / 60.0) + 0.03 * np.sin(2.0 * x + y)
    z[60:80, 130] = np.nan
    return ElevationMap(elevation=z, resolution=0.2, origin=(0.0, 0.0), height_std=0.0)


def models() -> dict[str, Model]:
    """The vehicle; with errors of tracking, for which ground beside the path counts; and of place.

    The last keep 2.9 m free and rest farther from the end of a path than one that is ok may.
    """
    atv = slopewise.read_model("atv")
    wide = Tracking(cross_track_std=0.12, cross_track_per_curvature=0.1, heading_std=0.035)
    return {
        "exact": atv,
        "off its line": replace(atv, tracking=wide),
        "off along it": replace(atv, tracking=Tracking(along_track_std=0.95)),
    }


@needs_compiler
def test_the_example_plans_as_python_does(tmp_path: Path) -> None:
    statuses = {}
    for name, model in models().items():
        planner, program = CandidatePlanner(model, None, Uncertainty()), example_in(tmp_path, model)
        for start_speed in (0.0, 1.0):
            done = subprocess.run([program, str(start_speed)], capture_output=True, text=True)
            # Columns candidate, status, x, y, station, speed.
            rows = np.loadtxt(done.stdout.splitlines(), delimiter=",", skiprows=1)
            candidates = [rows[rows[:, 0] == candidate].T for candidate in np.unique(rows[:, 0])]
            paths = [EvenPath("", c[2:4].T.copy(), None) for c in candidates]
            plans = planner.plan(hill(), paths, start_speed=start_speed)
            for (_, status, _, _, station, speed), plan in zip(candidates, plans, strict=True):
                assert plan.status is STATUSES[int(status[0])], (name, plan.reason)
                np.testing.assert_allclose(station, plan.station, rtol=0.0, atol=1e-12)
                np.testing.assert_allclose(speed, plan.speed, rtol=0.0, atol=1e-9)
            statuses[name] = {plan.status for plan in plans}
    assert statuses == {
        "exact": {Status.OK, Status.BLOCKED},
        "off its line": {Status.OK, Status.BLOCKED},
        "off along it": {Status.BLOCKED},
    }


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--resolution", "0.1"], "--height-std"),
        (["--resolution", "-1", "--height-std", "0"], "resolution: expected a cell edge of"),
        (["--resolution", "0.1", "--height-std", "nan"], "height_std: expected a length of 0 m"),
    ],
)
def test_numbers_that_hold_for_no_map_are_refused(
    options: list[str], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main(["export", "atv", "--cpp", str(tmp_path), *options])
    assert left.value.code == 2
    assert expected in capsys.readouterr().err


def test_a_model_with_effects_is_refused(tmp_path: Path) -> None:
    lag = Effect(name="brake_lag", parameters={"tau": 0.2})
    model = replace(slopewise.read_model("atv"), effect=(lag,))
    with pytest.raises(ParameterError, match="without effects for C\\+\\+, got brake_lag"):
        write_cpp(model, tmp_path, resolution=0.1, height_std=0.0, quantile=0.999)


def test_generated_laws_are_those_of_their_generator() -> None:
    assert (CORE / "generated" / "laws.hpp").read_text() == GENERATOR["header"](), (
        "run `python planner/core/generate_laws.py`"
    )


@needs_compiler
def test_generated_laws_are_those_of_python(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    calls, expected = [], []
    laws = {law.__name__: law for law in GENERATOR["_LAWS"]}
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
    lines = output_of(tmp_path / "laws.cpp", tmp_path).split()
    np.testing.assert_allclose([float(line) for line in lines], expected, rtol=1e-14)
