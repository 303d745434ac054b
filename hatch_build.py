"""Compiles the core of the planner where slopewise is built or installed, by CMake and nanobind.

`python hatch_build.py` compiles it in place again, in an environment with the extra `dev`.
The environment: `CXX` is the compiler, `SLOPEWISE_MARCH` the processor, see planner/core.
"""

from __future__ import annotations

import os
import re
import runpy
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ROOT = Path(__file__).parent
PLANNER = ROOT / "slopewise" / "planner"
IN_PLACE = ROOT / "build" / "core"
COMPILERS = ("c++", "g++", "clang++")
CMAKE = (3, 20)
"""The oldest CMake that is sufficient: major, minor [1]."""


class CoreError(Exception):
    """The core cannot be compiled; one sentence."""


class CoreBuildHook(BuildHookInterface[Any]):
    """Build hook of hatchling."""

    def dependencies(self) -> list[str]:
        """Tools that are not on this machine, for pip to bring."""
        return missing_tools()

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the core, in place for an editable installation, else into the wheel."""
        try:
            if version == "editable":
                install_in_place(compile_core(IN_PLACE))
                return
            module = compile_core(Path(self.directory) / "core")
        except CoreError as error:
            self.app.abort(str(error))
        build_data["force_include"][str(module)] = f"slopewise/planner/{module.name}"
        build_data["pure_python"] = False
        build_data["tag"] = tag()


def missing_tools() -> list[str]:
    """Requirements of the tools for compiling that this machine lacks."""
    tools = []
    if compiler() is None:
        tools.append("ziglang>=0.13")
    if tool("cmake") is None:
        tools.append("cmake>=3.24")
    if tool("ninja") is None:
        tools.append("ninja>=1.11")
    return tools


def compiler() -> str | None:
    """The C++ compiler of this machine."""
    named = os.environ.get("CXX")
    return named or next(filter(None, map(shutil.which, COMPILERS)), None)


def tool(name: str) -> str | None:
    """A program of this machine, else of the environment of this Python.

    Installers put the environment first in the path: with another CMake all is compiled again.
    """
    scripts = sysconfig.get_path("scripts")
    folders = [f for f in os.get_exec_path() if f != scripts]
    programs = (shutil.which(name, path=f) for f in (os.pathsep.join(folders), scripts))
    return next((p for p in programs if p and (name != "cmake" or _is_new_enough(p))), None)


def _is_new_enough(cmake: str) -> bool:
    text = subprocess.run([cmake, "--version"], capture_output=True, text=True).stdout
    match = re.search(r"version (\d+)\.(\d+)", text)
    return match is not None and (int(match[1]), int(match[2])) >= CMAKE


def tag() -> str:
    """Of the wheel: from Python 3.12 on one serves all later versions."""
    platform = re.sub(r"\W", "_", sysconfig.get_platform())
    version = f"cp{sys.version_info.major}{sys.version_info.minor}"
    if sys.version_info >= (3, 12) and not sysconfig.get_config_var("Py_GIL_DISABLED"):
        return f"cp312-abi3-{platform}"
    return f"{version}-{version}{sys.abiflags}-{platform}"


def compile_core(folder: Path) -> Path:
    """Compile the core in a folder that keeps what need not be compiled again.

    Raises:
        CoreError: that is not possible here.
    """
    if not (Path(sysconfig.get_path("include")) / "Python.h").is_file():
        raise CoreError(f"Python.h is missing: install the headers of {sys.executable}")
    import nanobind

    sources = PLANNER.resolve() / "core"
    digest = runpy.run_path(str(PLANNER / "core_sources.py"))["digest_of_core"](sources)
    options = {
        "CMAKE_BUILD_TYPE": "Release",
        "Python_EXECUTABLE": sys.executable,
        "SLOPEWISE_DIGEST": digest,
        "SLOPEWISE_MARCH": os.environ.get("SLOPEWISE_MARCH", "native"),
        "nanobind_DIR": nanobind.cmake_dir(),
    }
    made_for = "\n".join([str(sources), sys.executable, nanobind.cmake_dir(), compiler() or "zig"])
    note = folder / "made_for"
    if folder.exists() and not (note.is_file() and note.read_text() == made_for):
        shutil.rmtree(folder)
    folder.mkdir(parents=True, exist_ok=True)
    note.write_text(made_for)
    options |= {"CMAKE_CXX_COMPILER": native} if (native := compiler()) else zig_tools(folder)
    defined = [f"-D{name}={value}" for name, value in options.items()]
    cmake, ninja = tool("cmake") or "cmake", tool("ninja") or "ninja"
    defined.append(f"-DCMAKE_MAKE_PROGRAM={ninja}")
    run(cmake, "-G", "Ninja", "-S", str(sources), "-B", str(folder), *defined)
    for old in folder.glob("_core.*so"):
        old.unlink()
    run(cmake, "--build", str(folder))
    return next(folder.glob("_core.*so"))


def zig_tools(folder: Path) -> dict[str, str]:
    """Options of CMake for the compiler that comes as a package: CMake asks for files."""
    options = {}
    for option, tool in {"CXX_COMPILER": "c++", "AR": "ar", "RANLIB": "ranlib"}.items():
        script = folder / f"zig-{tool}"
        script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m ziglang {tool} "$@"\n')
        script.chmod(0o755)
        options[f"CMAKE_{option}"] = str(script)
    return options


def run(*command: str) -> None:
    """Run a step of the build.

    Raises:
        CoreError: it failed.
    """
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    except OSError as error:
        raise CoreError(f"the core of slopewise was not compiled: {error}") from None
    if done.returncode == 0:
        return
    lines = done.stdout.splitlines()
    print(*lines[-40:], sep="\n", file=sys.stderr)
    errors = [line.strip() for line in lines if re.search(r"\berror\b", line, re.IGNORECASE)]
    first = errors[0] if errors else f"{command[0]} ended with {done.returncode}"
    raise CoreError(
        f"the core of slopewise was not compiled (compiler {compiler() or 'ziglang'}): {first}"
    )


def install_in_place(module: Path) -> None:
    """Put the module next to the Python code; a running process keeps the file that it has open."""
    for old in PLANNER.glob("_core.*so"):
        old.unlink()
    fresh = PLANNER / f".{module.name}"
    shutil.copy(module, fresh)
    fresh.replace(PLANNER / module.name)


if __name__ == "__main__":
    try:
        install_in_place(compile_core(IN_PLACE))
    except CoreError as error:
        sys.exit(str(error))
