"""Terrain files: the classes one vehicle knows, and settings of the terrain estimator, as TOML."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from slopewise.models.terrain.adaptation import AdaptationSettings
from slopewise.models.terrain.change import ChangeSettings
from slopewise.models.terrain.classes import TerrainClass, TerrainClasses
from slopewise.models.terrain.classifier import ClassifierSettings
from slopewise.models.terrain.settings import (
    EstimatorSettings,
    FilterSettings,
    MotionSettings,
    ResistanceSettings,
)
from slopewise.models.terrain.signature_memory import MemorySettings
from slopewise.models.terrain.signature_model import SignatureModel
from slopewise.services.io.decode import decode_table, encode_table
from slopewise.services.io.files import find_shipped, read_toml, shipped_files, write_atomic
from slopewise.services.io.signature_file import read_signatures


@dataclass(frozen=True, slots=True, kw_only=True)
class TerrainFile:
    """Content of a terrain file; every key except `name` is optional."""

    name: str
    signatures: str = ""  # file of signatures in the same folder, empty: none
    terrain: tuple[TerrainClass, ...] = ()
    filter: FilterSettings = field(default_factory=FilterSettings)
    motion: MotionSettings = field(default_factory=MotionSettings)
    resistance: ResistanceSettings = field(default_factory=ResistanceSettings)
    classifier: ClassifierSettings = field(default_factory=ClassifierSettings)
    change: ChangeSettings = field(default_factory=ChangeSettings)
    adaptation: AdaptationSettings = field(default_factory=AdaptationSettings)
    memory: MemorySettings = field(default_factory=MemorySettings)

    def __post_init__(self) -> None:
        TerrainClasses(name=self.name, terrain=self.terrain)

    @property
    def classes(self) -> TerrainClasses:
        """The classes alone."""
        return TerrainClasses(name=self.name, terrain=self.terrain)

    @property
    def estimator(self) -> EstimatorSettings:
        """Settings of the estimator."""
        return EstimatorSettings(filter=self.filter, motion=self.motion, resistance=self.resistance)


def read_terrains(path: Path) -> TerrainFile:
    """The terrain file at a path."""
    return decode_table(TerrainFile, read_toml(path), str(path))


def read_signatures_of(terrains: TerrainFile, path: Path) -> SignatureModel | None:
    """The signatures that the terrain file at a path names, None if it names none."""
    return read_signatures(path.parent / terrains.signatures) if terrains.signatures else None


def write_terrains(terrains: TerrainFile, path: Path) -> None:
    """Write, all or nothing; :func:`read_terrains` gives the same again."""
    import tomli_w

    tables = encode_table(terrains)
    tables["terrain"] = tables.pop("terrain", [])  # a list of tables comes last in TOML
    write_atomic(path, tomli_w.dumps(tables).encode())


def shipped_terrains() -> dict[str, Path]:
    """Terrain files that come with the package: name -> file."""
    return shipped_files("terrains")


def find_terrains(name_or_path: str | Path) -> Path:
    """The terrain file a user means: an existing file, else one that comes with the package."""
    return find_shipped(name_or_path, "terrains", "terrain")
