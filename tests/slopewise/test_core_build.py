"""The build of the compiled core: it asks for missing tools, and fails with one sentence."""

from __future__ import annotations

import importlib.util
import runpy
import sys
import sysconfig
from pathlib import Path
from types import ModuleType

import pytest

from slopewise.planner import core_sources

pytest.importorskip("hatchling", reason="the dev extra is not installed")

ROOT = Path(__file__).parents[2]
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
