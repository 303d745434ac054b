"""The tutorials run unchanged: their boxes, in order, in an empty folder."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest

from tests.docs.shown import ROOT, environment, extras_of, hidden, in_text
from tests.docs.warm_shell import warm_shell
from tests.services.warm_process import WarmProcess

TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
BOX = re.compile(r"^```(?P<kind>\w+)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
NEEDS = {"recordings": ("rosbags", "foxglove")}
BOXES_BY_DAY = {"hidden-effect": 1, "calibrate": 5, "recordings": 2}
"""What README runs by day as well, or takes a search, is left to the night."""
FINDINGS = {"hidden-effect": "out/hidden/found/discrepancy.json"}


def script_of(page: str, boxes: int | None) -> str:
    """One program of the boxes: files are written, commands run by a shell that stops on errors."""
    parts = ["import subprocess as _shell, pathlib as _files"]
    for box in list(BOX.finditer(page))[:boxes]:
        text = box["text"]
        if box["kind"] == "python":
            parts.append(text)
        elif box["kind"] == "bash":
            parts.append(f"_run({text!r})")
        elif box["kind"] == "toml":
            name = text.splitlines()[0].removeprefix("# ")
            parts.append(f"_files.Path({name!r}).write_text({text!r})")
    run = (
        "def _run(text):\n"
        "    done = _shell.run(['bash', '-euc', text], capture_output=True, text=True)\n"
        "    assert done.returncode in (0, 3), text + done.stdout + done.stderr\n"
    )
    return "\n".join([parts[0], run, *parts[1:]])


@pytest.mark.parametrize(
    ("tutorial", "boxes"),
    [
        *(pytest.param(t, BOXES_BY_DAY.get(t.stem), id=t.stem) for t in TUTORIALS),
        *(
            pytest.param(t, None, id=f"{t.stem}, all of it", marks=pytest.mark.nightly)
            for t in TUTORIALS
            if t.stem in BOXES_BY_DAY
        ),
    ],
)
def test_a_tutorial_does_what_it_says(tutorial: Path, boxes: int | None, tmp_path: Path) -> None:
    for module in NEEDS.get(tutorial.stem, ()):
        pytest.importorskip(module, reason=f"{module} is not installed")
    page = tutorial.read_text()
    assert len(BOX.findall(page)) >= 3
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    (tmp_path / "tutorial.py").write_text(script_of(page, boxes))
    extras = [extra for line in page.splitlines() for extra in extras_of(line)]
    missing = hidden(extras)
    with warm_shell(environment(tmp_path, extras), missing) as outside:
        program = [sys.executable, "tutorial.py"]
        done = WarmProcess(program, outside, folder=tmp_path, hidden=missing).finished(600.0)
    assert done.returncode == 0, done.stdout + done.stderr
    if boxes is None and tutorial.stem in FINDINGS:
        findings = json.loads((tmp_path / FINDINGS[tutorial.stem]).read_text())
        assert f"\n{findings['verdict']} – " in page
        assert findings["effects"]
        for effect in findings["effects"]:
            assert f"\n  {effect['name']} " in page
            assert all(number["std"] > 0.0 for number in effect["parameters"].values())


def test_there_are_tutorials_whose_commands_stand_in_boxes() -> None:
    for tutorial in TUTORIALS:
        assert not [line for line in in_text(tutorial.read_text()) if "…" not in line], tutorial
    assert {path.stem for path in TUTORIALS} >= {"plan", "calibrate", "recordings", "service"}
