"""Files that come with the package: vehicles, terrains, topic mappings."""

from __future__ import annotations

from pathlib import Path


def shipped_folder() -> Path:
    """Where they are: in ``slopewise/configs`` when installed, in ``configs`` of the repository."""
    top = Path(__file__).parents[2]
    installed = top / "slopewise" / "configs"
    return installed if installed.is_dir() else top / "configs"


def shipped_files(kind: str) -> dict[str, Path]:
    """TOML files of one kind (a folder there): name -> file."""
    return {file.stem: file for file in sorted((shipped_folder() / kind).glob("*.toml"))}
