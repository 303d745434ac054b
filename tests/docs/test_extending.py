"""The page docs/extending.md: each diff applies to the tree, and its check then passes."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hatch_build import compiler
from tests.world.compilers import compiler_with

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "extending.md").read_text()
PARTS = ("slopewise", "models", "planner", "services", "configs")
MAX_FILES = 3
BOX = re.compile(r"^```(?P<kind>\w+)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)


def sections() -> dict[str, list[tuple[str, str]]]:
    """Title -> boxes (kind, text) of every section that has a diff."""
    parts = re.split(r"^## (.+)$", PAGE, flags=re.MULTILINE)[1:]
    boxes_by_title = {
        title: [(box["kind"], box["text"]) for box in BOX.finditer(text)]
        for title, text in zip(parts[::2], parts[1::2], strict=True)
    }
    return {title: boxes for title, boxes in boxes_by_title.items() if "diff" in dict(boxes)}


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    ignore = shutil.ignore_patterns("__pycache__")
    (tmp_path / "tree").mkdir()
    shutil.copy(ROOT / "hatch_build.py", tmp_path / "tree")
    for part in PARTS:
        shutil.copytree(ROOT / part, tmp_path / "tree" / part, ignore=ignore, symlinks=True)
    return tmp_path / "tree"


def run(tree: Path, *command: str, text: str = "") -> subprocess.CompletedProcess[str]:
    environment = {"PYTHONPATH": str(tree), "PATH": "/usr/bin:/bin", "HOME": str(tree)}
    # The checks ask what a change does, not how fast.
    environment |= compiler_with("-O0", tree)
    return subprocess.run(
        command, cwd=tree, env=environment, input=text, capture_output=True, text=True, timeout=400
    )


def of_kind(title: str, kind: str) -> list[str]:
    return [text for box, text in sections()[title] if box == kind]


def changed_by(title: str) -> list[str]:
    diffs = "".join(of_kind(title, "diff"))
    return sorted(set(re.findall(r"^\+\+\+ b/(.+)$", diffs, re.MULTILINE)))


def apply_diffs(title: str, tree: Path) -> None:
    assert 1 <= len(changed_by(title)) <= MAX_FILES
    for diff in of_kind(title, "diff"):
        done = run(tree, "git", "apply", "--whitespace=error", "-", text=diff)
        assert done.returncode == 0, done.stderr


def test_no_plan_ignores_an_effect_that_the_core_lacks(tree: Path) -> None:
    apply_diffs("An effect", tree)
    planned = run(tree, sys.executable, "-P", "-c", "import slopewise.planner.compiled_core")
    assert "CoreError" in planned.stderr
    assert "generate_laws.py" in planned.stderr
    done = run(tree, sys.executable, "-P", "planner/core/generate_laws.py")
    assert done.returncode == 0, done.stderr
    header = (tree / "planner" / "core" / "generated" / "laws.hpp").read_text()
    assert "gust_from_behind(speed, curvature, yaw, values[6], values[7])" in header


OF_THE_CORE = [
    title
    for title in sections()
    if any(file.startswith("planner/core/") for file in changed_by(title))
]


@pytest.mark.parametrize(
    "title",
    [
        pytest.param(title, marks=[pytest.mark.nightly] if title in OF_THE_CORE else [])
        for title in sections()
    ],
)
def test_a_diff_applies_and_its_check_passes(title: str, tree: Path) -> None:
    checks = of_kind(title, "python")
    assert checks, f"{title}: no check follows the diff"
    before = run(tree, sys.executable, "-P", "-c", checks[0])
    assert before.returncode != 0, f"{title}: the check passes without the diff"
    apply_diffs(title, tree)
    if title in OF_THE_CORE:
        done = run(tree, sys.executable, "hatch_build.py")
        assert done.returncode == 0, done.stderr
    for check in checks:
        done = run(tree, sys.executable, "-P", "-c", check)
        assert done.returncode == 0, done.stderr


@pytest.mark.skipif(compiler() is None, reason="there is no C++ compiler on this machine")
@pytest.mark.parametrize("title", OF_THE_CORE)
def test_by_day_headers_that_a_diff_changes_compile(title: str, tree: Path) -> None:
    apply_diffs(title, tree)
    headers = [file for file in changed_by(title) if file.endswith(".hpp")]
    options = ["-std=c++20", "-fsyntax-only", "-Wall", "-Werror", "-Iplanner/core", "-xc++"]
    text = "".join(f'#include "{header}"\n' for header in headers)
    done = run(tree, str(compiler()), *options, "-I.", "-", text=text)
    assert done.returncode == 0, done.stderr


def test_there_is_something_to_extend() -> None:
    assert sections()
