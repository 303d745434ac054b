"""The build of the core, and a wheel that brings one package and works away from the repository."""

from __future__ import annotations

import importlib.util
import os
import runpy
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from pathlib import Path
from types import ModuleType

import pytest

from slopewise.planner import core_sources
from tests.world.compilers import compiler_with

pytest.importorskip("hatchling", reason="the dev extra is not installed")

ROOT = Path(__file__).parents[2]
PARTS = ("slopewise", "models", "planner", "services", "configs", "benchmarks")
FILES = ("hatch_build.py", "pyproject.toml", "README.md", "LICENSE")


NOT_AGAIN = """

def compile_core(folder: Path) -> Path:
    return next(PLANNER.glob("_core.*so"))
"""
"""End of the build script in a copy of the sources: the core is the one that was compiled here."""


def wheel_of(folder: Path, *, compiles: bool) -> Path:
    """A wheel, built in a copy of the sources."""
    source = folder / "source"
    source.mkdir()
    for part in PARTS:
        ignore = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / part, source / part, ignore=ignore, symlinks=True)
    for file in FILES:
        shutil.copy(ROOT / file, source)
    if not compiles:
        with (source / "hatch_build.py").open("a") as script:
            script.write(NOT_AGAIN)
    # What is inside and whether it starts does not depend on how fast it is.
    quick = compiler_with("-O0", folder)
    pip("wheel", source, "--no-build-isolation", "--wheel-dir", folder, environment=quick)
    return next(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return wheel_of(tmp_path_factory.mktemp("wheel"), compiles=False)


@pytest.fixture(scope="module")
def installed(wheel: Path) -> Path:
    return install(wheel)


def install(wheel: Path) -> Path:
    target = wheel.parent / "installed"
    pip("install", wheel, "--no-compile", "--target", target)
    return target


def pip(
    command: str, what: Path, *options: object, environment: dict[str, str] | None = None
) -> None:
    arguments = [command, str(what), "--no-deps", "--no-index", "--quiet", *map(str, options)]
    done = subprocess.run(
        [sys.executable, "-m", "pip", "--disable-pip-version-check", *arguments],
        env=os.environ | (environment or {}),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr


def python(installed: Path, folder: Path, *arguments: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    done = subprocess.run(
        [sys.executable, "-P", *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_it_holds_one_package_with_all_its_files(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    top = {name.split("/")[0] for name in names if ".dist-info/" not in name}
    assert top == {"slopewise"}
    for part in PARTS:
        for file in (ROOT / part).rglob("*"):
            if file.is_file() and "__pycache__" not in file.parts:
                place = part if part == "slopewise" else f"slopewise/{part}"
                assert f"{place}/{file.relative_to(ROOT / part).as_posix()}" in names


def test_a_source_archive_has_the_linked_folders(wheel: Path, tmp_path: Path) -> None:
    arguments = [sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(tmp_path)]
    subprocess.run(
        arguments, cwd=wheel.parent / "source", check=True, capture_output=True, timeout=120
    )
    with tarfile.open(next(tmp_path.glob("*.tar.gz"))) as archive:
        names = {name.split("/", 1)[1] for name in archive.getnames()}
    inside = {
        "hatch_build.py",
        "slopewise/models/laws/braking.py",
        "slopewise/configs/vehicles/atv.toml",
        "slopewise/planner/core/CMakeLists.txt",
        "slopewise/planner/core/profile/smoothing.hpp",
    }
    assert inside <= names
    assert not any(name.startswith(("models/", "planner/", "services/")) for name in names)


def test_it_holds_a_core_for_this_platform_alone(wheel: Path) -> None:
    assert not wheel.name.endswith("-none-any.whl")
    cores = [name for name in zipfile.ZipFile(wheel).namelist() if name.endswith(".so")]
    assert len(cores) == 1
    assert cores[0].startswith("slopewise/planner/_core.")


def test_shipped_vehicles_and_benchmarks_are_inside(installed: Path, tmp_path: Path) -> None:
    script = (
        "import slopewise; from slopewise.services.io import model_file, terrain_file;"
        "from slopewise.services.io.topics import read_topics;"
        "from slopewise.services.cli.bench import benchmarks;"
        "print(model_file.find_model('atv')); print(terrain_file.find_terrains('husky'));"
        "print(slopewise.read_model('ugv').name, read_topics(None)[1]);"
        "print(benchmarks().benchmark('planner').__file__)"
    )
    lines = python(installed, tmp_path, "-c", script).splitlines()
    assert lines[0] == str(installed / "slopewise/configs/vehicles/atv.toml")
    assert lines[1] == str(installed / "slopewise/configs/terrains/husky.toml")
    assert lines[2].split()[0] == "ugv"
    assert lines[3] == str(installed / "slopewise/benchmarks/planner/planner_speed.py")


def test_the_command_works(installed: Path, tmp_path: Path) -> None:
    assert "closed-loop" in python(installed, tmp_path, "-m", "slopewise", "bench", "--help")
    assert "slopewise 0" in python(installed, tmp_path, "-m", "slopewise", "--version")


@pytest.mark.nightly
def test_compiled_from_its_own_sources_it_plans_and_measures(tmp_path: Path) -> None:
    """By day tests/docs/test_extending.py compiles the core."""
    installed = install(wheel_of(tmp_path, compiles=True))
    python(installed, tmp_path, "-m", "slopewise", "demo", "--out", "demo")
    assert (tmp_path / "demo" / "report.html").stat().st_size > 100_000
    figures = tmp_path / "bench.json"
    python(installed, tmp_path, "-m", "slopewise", "bench", "--quick", "--json", str(figures))
    assert figures.stat().st_size > 1000


pytest.importorskip("hatchling", reason="the dev extra is not installed")

IMPORT = ROOT / "planner" / "compiled_core.py"


@pytest.fixture
def build() -> ModuleType:
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_what_is_missing_is_asked_for(
    build: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CXX", raising=False)
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(tmp_path))
    names = [tool.split(">")[0] for tool in build.missing_tools()]
    assert names == ["ziglang", "cmake", "ninja"]
    old = tmp_path / "cmake"
    old.write_text("#!/bin/sh\necho cmake version 3.16.3\n")
    for name in ("g++", "ninja"):
        (tmp_path / name).write_text("#!/bin/sh\n")
    for file in tmp_path.iterdir():
        file.chmod(0o755)
    assert build.missing_tools() == ["cmake>=3.24"]
    old.write_text("#!/bin/sh\necho cmake version 4.0.1\n")
    assert build.missing_tools() == []


def test_a_cmake_of_the_machine_is_taken_wherever_the_environment_is_in_the_path(
    build: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    environment, machine = tmp_path / "venv", tmp_path / "usr"
    for folder in (environment, machine):
        folder.mkdir()
        (folder / "cmake").write_text("#!/bin/sh\necho cmake version 4.0.1\n")
        (folder / "cmake").chmod(0o755)
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(environment))
    for path in (f"{environment}:{machine}", f"{machine}:{environment}"):
        monkeypatch.setenv("PATH", path)
        assert build.tool("cmake") == str(machine / "cmake")
    (machine / "cmake").write_text("#!/bin/sh\necho cmake version 3.16.3\n")
    assert build.tool("cmake") == str(environment / "cmake")


def test_a_compiler_that_fails_is_named(
    build: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CXX", "/bin/false")
    with pytest.raises(build.CoreError, match=r"not compiled \(compiler /bin/false\)") as caught:
        build.compile_core(tmp_path / "core")
    assert "\n" not in str(caught.value)


def test_missing_headers_of_python_are_named(
    build: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(tmp_path))
    with pytest.raises(build.CoreError, match=r"Python\.h is missing: install"):
        build.compile_core(tmp_path / "core")


def test_a_core_of_other_sources_is_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(core_sources, "digest_of_core", lambda _: "other")
    with pytest.raises(ImportError, match="older than its sources: run `make core`"):
        runpy.run_path(str(IMPORT))


def test_a_missing_core_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "slopewise.planner._core", None)
    with pytest.raises(ImportError, match="core of slopewise is missing: run `make core`"):
        runpy.run_path(str(IMPORT))
