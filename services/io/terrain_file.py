"""Terrain files: the classes and thresholds of one vehicle, and settings of the estimator."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from slopewise.models.terrain.classes import TerrainClass, TerrainClasses
from slopewise.models.terrain.description import ThresholdSettings
from slopewise.models.terrain.settings import (
    EstimatorSettings,
    FilterSettings,
    MotionSettings,
    ResistanceSettings,
)
from slopewise.services.io.decode import decode_table, encode_table
from slopewise.services.io.files import find_shipped, read_toml, write_atomic

_IGNORED = ("signatures", "classifier", "change", "adaptation", "memory")
"""Keys of files written by earlier versions, which had a classifier; they change nothing now."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TerrainFile:
    """Content of a terrain file; every key except `name`, that of the vehicle, is optional."""

    name: str
    terrain: tuple[TerrainClass, ...] = ()
    thresholds: ThresholdSettings = field(default_factory=ThresholdSettings)
    filter: FilterSettings = field(default_factory=FilterSettings)
    motion: MotionSettings = field(default_factory=MotionSettings)
    resistance: ResistanceSettings = field(default_factory=ResistanceSettings)

    def __post_init__(self) -> None:
        TerrainClasses(name=self.name, terrain=self.terrain)

    @property
    def classes(self) -> TerrainClasses:
        return TerrainClasses(name=self.name, terrain=self.terrain)

    @property
    def estimator(self) -> EstimatorSettings:
        return EstimatorSettings(filter=self.filter, motion=self.motion, resistance=self.resistance)


def read_terrains(path: Path) -> TerrainFile:
    """The terrain file at a path; keys of earlier versions' classifier are ignored."""
    tables = {key: value for key, value in read_toml(path).items() if key not in _IGNORED}
    return decode_table(TerrainFile, tables, str(path))


def write_terrains(terrains: TerrainFile, path: Path) -> None:
    """Write, all or nothing; :func:`read_terrains` returns the same again."""
    import tomli_w

    tables = encode_table(terrains)
    tables["terrain"] = tables.pop("terrain", [])  # a list of tables comes last in TOML
    write_atomic(path, tomli_w.dumps(tables).encode())


def find_terrains(name_or_path: str | Path) -> Path:
    """An existing terrain file, else one that comes with the package."""
    return find_shipped(name_or_path, "terrains", "terrain")
