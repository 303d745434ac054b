"""The notebook runs from its first cell to its last, and gives the output that it stores."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

pytest.importorskip("nbclient", reason="nbclient is not installed")

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs" / "site"))

import nbformat  # noqa: E402
import notebook  # noqa: E402

LARGEST = 100_000


def texts_of(cells: nbformat.NotebookNode) -> list[list[str]]:
    """Words of every cell's results, without numbers and what a table's width depends on."""
    outputs = [[out["data"]["text/plain"] for out in cell.get("outputs", [])] for cell in cells]
    return [re.findall(r"[A-Za-z_]{3,}", "".join(texts)) for texts in outputs]


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::RuntimeWarning")
def test_it_runs_and_shows_what_is_stored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    stored = nbformat.read(notebook.FILE, as_version=4)
    now = notebook.executed(tmp_path)
    assert texts_of(now.cells) == texts_of(stored.cells), "docs/site/notebook.py stores the outputs"
    assert sum(bool(texts) for texts in texts_of(now.cells)) >= 6


def test_it_is_small_and_says_nothing_of_a_machine() -> None:
    text = notebook.FILE.read_text()
    assert len(text) < LARGEST
    assert not re.search("/(home|work|tmp)", text)
