"""Versions of parameters: each change gets the next one and goes to the store before it is told.

Without a store, or while it cannot be written, everything goes on and is said not to be durable;
what could not be written is written once that is possible again. The newest state is kept a second
time, for the day on which the store is lost.
"""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

from slopewise.services.parameters.change import Moment, StoredChange
from slopewise.services.parameters.group import State
from slopewise.services.parameters.store import Store, StoreError
from slopewise.services.parameters.store_copy import StoreCopy, copy_path, read_copy, write_copy
from slopewise.services.settings.learning_settings import StoreSettings

_log = logging.getLogger("slopewise")

_COPY_EVERY = 1.0
"""Shortest time between two writes of the second copy, which may lack what came since [s]."""


class Memory(Enum):
    """Source of what is known from before this start."""

    STORE = "the store, whole"
    COPY = "its second copy, with the newest state"
    LOST = "nothing, although a store was there"


@dataclass(frozen=True, slots=True)
class Last:
    """The last change of a group, as people are told of it."""

    version: int
    cause: str
    who: str


class ParameterLog:
    """Versions and history of one vehicle's parameters; one thread.

    Attributes:
        version: of all parameters; 1 is the model file.
        last: last change of each group.
        memory: what is known of what was learned before.
    """

    def __init__(self, settings: StoreSettings, fingerprint: str) -> None:
        """Open the store, if there is to be one."""
        self._settings, self._fingerprint = settings, fingerprint
        self.version = 1
        self.last: dict[str, Last] = {}
        self.notes: list[str] = []
        self.memory = Memory.STORE
        self._store: Store | None = None
        self._path = Path(settings.path)
        self._instead: StoreCopy | None = None
        self._newest_of: dict[tuple[str, str], StoredChange] = {}
        self._copied = -_COPY_EVERY
        self._copy_due = False
        self._fault = self._copy_fault = ""
        self._unsaved: dict[str, StoredChange] = {}
        self._unheard: dict[str, int] = {}
        self._tried = time.monotonic()
        if settings.path:
            self._open()

    def _open(self) -> None:
        s, path = self._settings, self._path
        was_there, copy = path.exists(), read_copy(path)
        store: Store | None = None
        try:
            store = Store(path, most_bytes=int(1e6 * s.megabytes), most_changes=int(s.changes))
            self._take_over(store, copy)
        except StoreError as error:
            if store is not None:
                store.close()
            # Until it can be opened, its copy is used.
            self._instead = copy
            if copy is not None:
                self.memory = Memory.COPY
                self.version = max([self.version, *(c.version for c in copy.changes)])
            elif was_there:
                self.memory = Memory.LOST
            self._fail(error)
            return
        self._store, self._instead, self._fault, self._copy_due = store, None, "", True
        self._newest_of = {(c.fingerprint, c.group): c for c in store.latest()}
        self.version = max(self.version, store.last_version())
        strangers = store.fingerprints() - {self._fingerprint}
        if strangers and not store.groups(self._fingerprint):
            self.notes.append("the stored parameters are of another vehicle: not used")

    def _take_over(self, store: Store, copy: StoreCopy | None) -> None:
        """Bring what only the copy holds into a store that was lost, or lost its last changes."""
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
        elif store.lost and copy is None:
            self.memory = Memory.LOST
            self.notes.append("what was learned and set before is gone")

    def _fail(self, error: Exception) -> None:
        if not self._fault:
            _log.warning("%s", error)
        self._fault = str(error)

    @property
    def durable(self) -> bool:
        """Everything up to now is on disk."""
        return self._store is not None and not self._unsaved and not self._unheard

    @property
    def is_open(self) -> bool:
        """There is a store to write to."""
        return self._store is not None

    def flags(self) -> list[str]:
        """What is not as it should be."""
        flags = list(self.notes)
        if self._fault or self._unsaved or self._unheard:
            flags.append(f"parameters are not kept: {self._fault or 'there is no store'}")
        if self._copy_fault:
            flags.append(f"parameters are kept once only: {self._copy_fault}")
        return flags

    def seen(self) -> dict[str, int]:
        """Up to which sequence sources were heard, as far as that can be read."""
        try:
            if self._store is None:
                return {} if self._instead is None else dict(self._instead.seen)
            return self._store.seen()
        except StoreError as error:
            self._fail(error)
            return {}

    @property
    def unsaved(self) -> set[str]:
        """Groups whose last change is not on disk."""
        return set(self._unsaved)

    # ------------------------------------------------------------------ writing

    def commit(
        self,
        states: Mapping[str, State | None],
        cause: str,
        who: str,
        *,
        seen: Mapping[str, int] | None = None,
        learned: bool = True,
        moments: Mapping[str, Moment] | None = None,
    ) -> None:
        """Groups have changed together: the next version.

        Args:
            states: of the groups that changed. cause, who: in words.
            seen: up to which sequence sources were heard with it.
            learned: came by itself.
            moments: when what the states hold was learned, if not now.
        """
        self.version += 1
        now = Moment.now()
        for group, state in states.items():
            data = json.dumps(state, allow_nan=False).encode()
            moment = (moments or {}).get(group, now)
            self._unsaved[group] = StoredChange(
                self.version, group, self._fingerprint, cause, who, moment, data, learned
            )
            self.last[group] = Last(self.version, cause, who)
        self._unheard.update(seen or {})
        self.save()

    def save(self) -> None:
        """Write what is not on disk yet."""
        if not self._settings.path:
            self._unsaved.clear()
            self._unheard.clear()
            return
        self._tried = time.monotonic()
        if self._store is None:
            return
        try:
            self._store.write(list(self._unsaved.values()), self._unheard)
        except StoreError as error:
            self._fail(error)
            return
        self._fault = ""
        self._newest_of.update({(c.fingerprint, c.group): c for c in self._unsaved.values()})
        self._unsaved.clear()
        self._unheard.clear()
        self._copy_due = True
        self._copy()

    def _copy(self, *, at_once: bool = False) -> None:
        """Write the second copy, if it is time to."""
        late = at_once or time.monotonic() - self._copied >= _COPY_EVERY
        if self._store is None or not self._copy_due or not late:
            return
        self._copied = time.monotonic()
        try:
            newest = [*self._newest_of.values()]
            write_copy(self._path, StoreCopy(newest, self._store.seen()))
        except (OSError, StoreError) as error:
            self._copy_fault = f"{copy_path(self._path).name} cannot be written: {error}"
            return
        self._copy_due, self._copy_fault = False, ""

    def retry(self) -> bool:
        """Try again what failed, if it is time to; True if a store is there that was not before."""
        self._copy()
        if time.monotonic() - self._tried < self._settings.retry or not self._settings.path:
            return False
        opened = False
        if self._store is None:
            self._tried = time.monotonic()
            self._open()
            if self._store is None:
                return False
            opened = True
            # What another process wrote meanwhile keeps its numbers.
            self.version += 1
            self._unsaved = {
                group: replace(change, version=self.version)
                for group, change in self._unsaved.items()
            }
        if self._unsaved or self._unheard or self._fault:
            self.save()
        return opened

    def close(self) -> None:
        """Let the store go."""
        if self._store is not None:
            self._copy(at_once=True)
            try:
                self._store.close()
            except StoreError as error:
                self._fail(error)

    # ------------------------------------------------------------------ reading

    def groups(self) -> list[str]:
        """Groups of this vehicle that changed at some time.

        Raises:
            StoreError: there is no store, or it cannot be read.
        """
        if self._instead is not None:
            changes = self._instead.changes
            return sorted({c.group for c in changes if c.fingerprint == self._fingerprint})
        return self._there().groups(self._fingerprint)

    @property
    def damaged(self) -> set[str]:
        """Groups of which a change cannot be read any more."""
        return set() if self._store is None else self._store.damaged

    def newest(
        self, group: str, up_to: int | None = None
    ) -> Iterator[tuple[StoredChange, State | None]]:
        """Changes of a group from the newest back with their states, those that can be read."""
        for change in self._newest(group, up_to):
            try:
                state = json.loads(change.state)
            except ValueError:
                continue
            if state is None or isinstance(state, dict):
                yield change, state

    def _newest(self, group: str, up_to: int | None) -> Iterator[StoredChange]:
        if self._instead is None:
            return self._there().newest(self._fingerprint, group, up_to)
        known = (group, self._fingerprint)
        return iter([c for c in self._instead.changes if (c.group, c.fingerprint) == known])

    def knows(self, version: int) -> bool:
        """Whether there is a change of this vehicle with that version, or it is the model file."""
        return self._there().has(self._fingerprint, version) or version == 1

    def _there(self) -> Store:
        if self._store is None:
            raise StoreError(self._fault or "there is no store")
        return self._store

    def history(self, group: str, most: int) -> list[StoredChange]:
        """Changes of a group, or of all, newest first."""
        return self._there().history(group, most)
