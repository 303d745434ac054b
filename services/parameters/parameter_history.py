"""Versions of parameters: each change gets the next one and is stored before it is published.

Without a store, or while it cannot be written, learning continues and is reported as not durable;
missing rows are written once that is possible again. The newest state of every group is stored a
second time, for the case that the store is lost: in a file that is written whole and renamed over
the one before, so that a process that dies meanwhile leaves that one.
"""

from __future__ import annotations

import json
import logging
import os
import time
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

import msgspec

from slopewise.services.parameters.parameter_group import State
from slopewise.services.parameters.store import BootTime, Store, StoredChange, StoreError
from slopewise.services.settings.learning_settings import StoreSettings

_log = logging.getLogger("slopewise")

_COPY_INTERVAL = 1.0
"""Shortest time between two writes of the second copy [s], so that bursts of stops do not double
the work of the disk; the copy may lack the changes of that time."""


class StoreCopy(msgspec.Struct, frozen=True):
    """Newest change of each group and vehicle; last sequence number of each source."""

    changes: list[StoredChange]
    seen: dict[str, int]

    def newest(self, fingerprint: str, group: str, _: int | None) -> Iterator[StoredChange]:
        return (c for c in self.changes if (c.group, c.fingerprint) == (group, fingerprint))

    def groups(self, fingerprint: str) -> list[str]:
        return sorted({c.group for c in self.changes if c.fingerprint == fingerprint})


def copy_path(store: Path) -> Path:
    return store.with_name(store.name + "-last")


def write_copy(store: Path, copy: StoreCopy) -> None:
    """Write the copy of a store to disk; if that fails, the copy before is still there."""
    body, path = msgspec.msgpack.encode(copy), copy_path(store)
    fresh = path.with_name(path.name + ".new")
    with fresh.open("wb") as file:
        file.write(zlib.crc32(body).to_bytes(4, "little") + body)
        file.flush()
        os.fsync(file.fileno())
    fresh.replace(path)


def read_copy(store: Path) -> StoreCopy | None:
    """The copy of a store; None if it is missing or damaged."""
    try:
        data = copy_path(store).read_bytes()
        if zlib.crc32(data[4:]).to_bytes(4, "little") != data[:4]:
            return None
        return msgspec.msgpack.decode(data[4:], type=StoreCopy)
    except (OSError, msgspec.MsgspecError):
        return None


class Memory(Enum):
    """Source of the parameters from before this start."""

    STORE = "the store, whole"
    COPY = "its second copy, with the newest state"
    LOST = "nothing, although there was a store"


@dataclass(frozen=True, slots=True)
class LastChange:
    """The last change of a group."""

    version: int
    cause: str
    who: str


class ParameterHistory:
    """Versions and stored changes of one vehicle's parameters; one thread."""

    def __init__(self, settings: StoreSettings, fingerprint: str) -> None:
        self._settings, self._fingerprint = settings, fingerprint
        self.version = 1  # of all parameters; 1 is the model file
        self.last: dict[str, LastChange] = {}  # of each group
        self.notes: list[str] = []  # warnings about the store
        self.memory = Memory.STORE
        self._path = Path(settings.path)
        self._store: Store | None = None
        self._substitute: StoreCopy | None = None
        self._newest_of: dict[tuple[str, str], StoredChange] = {}
        self._copied = -_COPY_INTERVAL
        self._copy_due = False
        self._fault = self._copy_fault = ""
        self.unsaved: dict[str, StoredChange] = {}  # groups whose last change is not on disk
        self._unsaved_sources: dict[str, int] = {}
        self._tried = time.monotonic()
        if settings.path:
            self._open()

    def _open(self) -> None:
        s, path = self._settings, self._path
        was_there, had_copy, copy = path.exists(), copy_path(path).exists(), read_copy(path)
        store: Store | None = None
        try:
            store = Store(path, max_bytes=int(1e6 * s.megabytes), max_changes=int(s.changes))
            self._recover(store, copy, is_lost=had_copy and not was_there)
        except StoreError as error:
            if store is not None:
                store.close()
            # Until it can be opened, its copy is used.
            self._substitute = copy
            if copy is not None:
                self.memory = Memory.COPY
                self.version = max([self.version, *(c.version for c in copy.changes)])
            elif was_there or had_copy:
                self.memory = Memory.LOST
            self._fail(error)
            return
        self._store, self._substitute, self._fault, self._copy_due = store, None, "", True
        self._newest_of = {(c.fingerprint, c.group): c for c in store.latest()}
        self.version = max(self.version, store.last_version())
        if store.fingerprints() - {self._fingerprint} and not store.groups(self._fingerprint):
            self.notes.append("the stored parameters are of another vehicle: not used")

    def _recover(self, store: Store, copy: StoreCopy | None, *, is_lost: bool) -> None:
        """Write the changes that only the copy holds to a store that lost them, or is new."""
        last = store.last_version()
        missing = [] if copy is None else [c for c in copy.changes if c.version > last]
        self.memory = Memory.STORE
        if store.lost:
            self.notes.append(store.lost)
        if missing and copy is not None:
            store.write(missing, copy.seen)
            self.memory = Memory.COPY
            note = "changes are missing in the stored parameters, the newest of each group are"
            self.notes.append(f"{note} from {copy_path(self._path).name}")
        elif copy is None and (store.lost or is_lost):
            self.memory = Memory.LOST
            self.notes.append("what was learned and set before is gone")

    def _fail(self, error: Exception) -> None:
        if not self._fault:
            _log.warning("%s", error)
        self._fault = str(error)

    @property
    def durable(self) -> bool:
        """True if all changes are on disk."""
        return self.is_open and not self.unsaved and not self._unsaved_sources

    @property
    def is_open(self) -> bool:
        """True if there is a store to write to."""
        return self._store is not None

    def flags(self) -> list[str]:
        """Warnings about the store."""
        flags = list(self.notes)
        if self._fault or self.unsaved or self._unsaved_sources:
            flags.append(f"parameters are not kept: {self._fault or 'there is no store'}")
        if self._copy_fault:
            flags.append(f"parameters are kept once only: {self._copy_fault}")
        return flags

    def seen(self) -> dict[str, int]:
        """Last stored sequence number of each source, empty if it cannot be read."""
        try:
            if self._store is None:
                return {} if self._substitute is None else dict(self._substitute.seen)
            return self._store.seen()
        except StoreError as error:
            self._fail(error)
            return {}

    # ------------------------------------------------------------------ writing

    def commit(
        self,
        states: Mapping[str, State | None],
        cause: str,
        who: str,
        *,
        seen: Mapping[str, int] | None = None,
        learned: bool = True,
        moments: Mapping[str, BootTime] | None = None,
    ) -> None:
        """Store groups that changed together as the next version.

        ``seen``: sequence numbers of sources; ``moments``: when the states were learned, if not
        now; ``learned``: no operator made the change.
        """
        self.version += 1
        now = BootTime.now()
        for group, state in states.items():
            data = json.dumps(state, allow_nan=False).encode()
            moment = (moments or {}).get(group, now)
            self.unsaved[group] = StoredChange(
                self.version, group, self._fingerprint, cause, who, moment, data, learned
            )
            self.last[group] = LastChange(self.version, cause, who)
        self._unsaved_sources.update(seen or {})
        self._save()

    def _save(self) -> None:
        """Write what is not on disk yet."""
        if self._settings.path:
            self._tried = time.monotonic()
            if self._store is None:
                return
            try:
                self._store.write(list(self.unsaved.values()), self._unsaved_sources)
            except StoreError as error:
                self._fail(error)
                return
            self._fault = ""
            self._newest_of.update({(c.fingerprint, c.group): c for c in self.unsaved.values()})
            self._copy_due = True
        self.unsaved.clear()
        self._unsaved_sources.clear()
        self._write_copy()

    def _write_copy(self, *, force: bool = False) -> None:
        """Write the second copy, if it is due."""
        late = force or time.monotonic() - self._copied >= _COPY_INTERVAL
        if self._store is None or not self._copy_due or not late:
            return
        self._copied = time.monotonic()
        try:
            write_copy(self._path, StoreCopy([*self._newest_of.values()], self._store.seen()))
        except (OSError, StoreError) as error:
            self._copy_fault = f"{copy_path(self._path).name} cannot be written: {error}"
            return
        self._copy_due, self._copy_fault = False, ""

    def retry(self) -> bool:
        """Repeat what failed, if it is due; True if the store could be opened only now."""
        self._write_copy()
        if time.monotonic() - self._tried < self._settings.retry or not self._settings.path:
            return False
        opened = self._store is None
        if opened:
            self._tried = time.monotonic()
            self._open()
            if self._store is None:
                return False
            # Versions that another process wrote meanwhile stay unique.
            self.version += 1
            self.unsaved = {
                group: replace(change, version=self.version)
                for group, change in self.unsaved.items()
            }
        if self.unsaved or self._unsaved_sources or self._fault:
            self._save()
        return opened

    def close(self) -> None:
        """Write the copy and close the store."""
        if self._store is not None:
            self._write_copy(force=True)
            try:
                self._store.close()
            except StoreError as error:
                self._fail(error)

    # ------------------------------------------------------------------ reading

    def groups(self) -> list[str]:
        """Groups of this vehicle that were ever changed."""
        return (self._substitute or self.opened()).groups(self._fingerprint)

    @property
    def damaged(self) -> set[str]:
        """Groups of which a change cannot be read any more."""
        return set() if self._store is None else self._store.damaged

    def newest(
        self, group: str, up_to: int | None = None
    ) -> Iterator[tuple[StoredChange, State | None]]:
        """Changes of a group with their states, newest first; unreadable ones are skipped."""
        source = self._substitute or self.opened()
        for change in source.newest(self._fingerprint, group, up_to):
            try:
                state = json.loads(change.state)
            except ValueError:
                continue
            if state is None or isinstance(state, dict):
                yield change, state

    def knows(self, version: int) -> bool:
        """Return True if the version is a stored change of this vehicle, or the model file."""
        return self.opened().has(self._fingerprint, version) or version == 1

    def opened(self) -> Store:
        """The store; a StoreError while it is not open."""
        if self._store is None:
            raise StoreError(self._fault or "there is no store")
        return self._store
