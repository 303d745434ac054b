"""The notebook in `examples/`, run from its first cell to its last, with what it printed.

`python docs/site/notebook.py` runs it and stores the outputs with its cells.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient

EXAMPLES = Path(__file__).parents[2] / "examples"
FILE = EXAMPLES / "from_map_to_discrepancy.ipynb"


def executed(folder: Path) -> nbformat.NotebookNode:
    """The notebook with fresh outputs, run in a copy of the examples.

    Raises:
        CellExecutionError: the first cell that fails.
    """
    place = folder / "examples"
    place.mkdir(parents=True)
    shutil.copy(EXAMPLES / "made_up.py", place)
    notebook = nbformat.read(FILE, as_version=4)
    NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(place)}}
    ).execute()
    for number, cell in enumerate(notebook.cells):
        cell.id = f"cell-{number}"
        cell.metadata = {}
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    return notebook


def main() -> None:
    """Run it and store it."""
    with tempfile.TemporaryDirectory() as folder:
        nbformat.write(executed(Path(folder)), FILE)


if __name__ == "__main__":
    main()
