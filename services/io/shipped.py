"""Files that come with the package: vehicles, terrains, topic mappings."""

from __future__ import annotations

from pathlib import Path


def shipped_folder() -> Path:
    """Where they are: ``slopewise/configs``, in the repository a link to ``configs``."""
    return Path(__file__).parents[2] / "configs"


def shipped_files(kind: str) -> dict[str, Path]:
    """TOML files of one kind (a folder there): name -> file."""
    return {file.stem: file for file in sorted((shipped_folder() / kind).glob("*.toml"))}
