"""The durable store of parameters: every change with its cause and the state after it.

SQLite in WAL mode with full synchronisation: a change is on disk before it is published, and a
process or machine that dies while it writes leaves the change before. One process at a time: the
file stays locked, so that a second service cannot write between. Each row carries a checksum.
"""

from __future__ import annotations

import sqlite3
import time
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

_SCHEMA_VERSION = 1  # of the tables
_PAGE = 4096  # size of a page of SQLite [B]
_HEADER = 100  # size of the header of an SQLite file [B]
_FULL_SHARE = 0.8
"""Share of the size limit beyond which the oldest changes are deleted [1]: the rest is free for
indices and for the change that is written meanwhile."""
_MAX_CORRUPT_FILES = 3  # unreadable files that are quarantined [1]
MAX_SOURCES = 1000  # sources whose numbers are remembered and stored [1]; bounds memory
_LOCK_TIMEOUT = 0.5  # wait for another process's lock [s]: longer than one write takes
_NO_LIMIT = 2**62  # above all versions [1]

_SCHEMA = """
CREATE TABLE IF NOT EXISTS change (
    version INTEGER NOT NULL, grp TEXT NOT NULL, fingerprint TEXT NOT NULL, cause TEXT NOT NULL,
    who TEXT NOT NULL, at REAL NOT NULL, boot TEXT NOT NULL, uptime REAL NOT NULL,
    learned INTEGER NOT NULL, state BLOB NOT NULL, crc INTEGER NOT NULL,
    PRIMARY KEY (version, grp)
);
CREATE INDEX IF NOT EXISTS change_of_group ON change (grp, version);
CREATE TABLE IF NOT EXISTS source (
    name TEXT PRIMARY KEY, sequence INTEGER NOT NULL, version INTEGER NOT NULL
);
"""

_ROW = int, str, str, str, str, float, str, float, bytes, int, int
"""Types of a change's columns, state before learned: SQLite stores any type in any of them."""

_UNTYPED = """
SELECT 1 FROM change
WHERE (typeof(version), typeof(grp), typeof(fingerprint)) <> ('integer', 'text', 'text')
UNION SELECT 1 FROM source
WHERE (typeof(name), typeof(sequence), typeof(version)) <> ('text', 'integer', 'integer')
"""


class StoreError(Exception):
    """The store cannot be used now; the message is the short reason."""


@dataclass(frozen=True, slots=True)
class BootTime:
    """A time whose age survives a restart and a clock that is set."""

    at: float  # wall clock [s since 1970]
    boot: str  # id of the boot of the machine
    uptime: float  # time since that boot [s], which no clock setting changes

    @classmethod
    def now(cls) -> BootTime:
        try:
            boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        except OSError:
            boot = ""
        return cls(time.time(), boot, time.clock_gettime(time.CLOCK_BOOTTIME))

    def earlier(self, seconds: float) -> BootTime:
        """The time ``seconds`` before this one."""
        return BootTime(self.at - seconds, self.boot, self.uptime - seconds)

    def age(self, now: BootTime, oldest: float) -> float:
        """Time since then [s]; ``oldest`` where clocks cannot show it."""
        if self.boot and self.boot == now.boot:
            return min(max(now.uptime - self.uptime, 0.0), oldest)
        passed = now.at - self.at
        # A clock that was set back shows no age; the time since the boot has passed at least.
        return min(max(passed, now.uptime), oldest) if passed >= 0.0 else oldest


@dataclass(frozen=True, slots=True)
class StoredChange:
    """State of one group of parameters from a version on."""

    version: int  # version of all parameters; grows with every change
    group: str
    fingerprint: str  # digest of the vehicle
    cause: str  # reason as text
    who: str  # source or operator
    moment: BootTime  # time of the change
    state: bytes  # the group's state as JSON
    learned: bool = True  # no operator made the change; those of operators are evicted last


class Store:
    """An open store; every method raises :class:`StoreError` if it cannot do its work."""

    def __init__(self, path: Path, *, max_bytes: int = 64_000_000, max_changes: int = 20_000):
        """Open, check, and create what is missing; at most ``max_changes`` of each group."""
        self.path = path
        self.lost = ""  # why it is empty although changes were stored before
        self.damaged: set[str] = set()  # groups of which a change cannot be read any more
        self._max_changes = max_changes
        self._max_pages = max(max_bytes // _PAGE, 64)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                # SQLite takes a file without header for a new store, and deletes its log.
                if path.exists() and path.stat().st_size < _HEADER:
                    raise sqlite3.DatabaseError("the file is empty, or cut off")
                self._open()
            except sqlite3.DatabaseError as error:
                if isinstance(error, sqlite3.OperationalError) or not path.exists():
                    raise
                self._quarantine(str(error))
                self._open()
        except (OSError, sqlite3.Error) as error:
            raise StoreError(f"{path.name} cannot be opened: {error}") from None

    def _open(self) -> None:
        connection = sqlite3.connect(
            self.path, timeout=_LOCK_TIMEOUT, isolation_level=None, check_same_thread=False
        )
        try:
            for pragma in (
                f"page_size = {_PAGE}",
                "locking_mode = EXCLUSIVE",
                "journal_mode = WAL",
                "synchronous = FULL",
                f"max_page_count = {self._max_pages}",
                f"journal_size_limit = {1024 * _PAGE}",
            ):
                connection.execute(f"PRAGMA {pragma}").fetchall()
            (answer,) = connection.execute("PRAGMA quick_check(1)").fetchone()
            if answer != "ok":
                raise sqlite3.DatabaseError(answer)
            (version,) = connection.execute("PRAGMA user_version").fetchone()
            if version not in (0, _SCHEMA_VERSION):
                raise sqlite3.DatabaseError(f"written by another version, {version}")
            # Takes the lock, too, so that a second process is refused here and not later.
            connection.executescript(
                f"BEGIN IMMEDIATE;{_SCHEMA}PRAGMA user_version = {_SCHEMA_VERSION};COMMIT;"
            )
            if connection.execute(_UNTYPED).fetchone():
                raise sqlite3.DatabaseError("a number or a name has another type")
        except BaseException:
            connection.close()
            raise
        self._connection = connection

    def _quarantine(self, reason: str) -> None:
        """Rename an unreadable file, the last few of which stay next to the store."""
        stem = self.path.name + ".corrupt-"
        names = [self.path.with_name(f"{stem}{n}") for n in range(1, _MAX_CORRUPT_FILES + 1)]
        # On a full disk every attempt leaves an empty file: it must not replace one with data.
        target = min(names, key=_content_order)
        self.path.replace(target)
        log, quarantined = (file.with_name(file.name + "-wal") for file in (self.path, target))
        quarantined.unlink(missing_ok=True)
        if log.exists():
            log.replace(quarantined)
        self.path.with_name(self.path.name + "-shm").unlink(missing_ok=True)
        self.lost = f"the stored parameters could not be read and are in {target.name}: {reason}"

    def close(self) -> None:
        """Close the file and release its lock."""
        try:
            self._connection.close()
        except sqlite3.Error as error:
            raise StoreError(str(error)) from None

    # ------------------------------------------------------------------ writing

    def write(self, changes: Sequence[StoredChange], seen: Mapping[str, int] | None = None) -> None:
        """Write changes and sequence numbers of sources: all of it or nothing."""
        connection, version = self._connection, max((c.version for c in changes), default=0)
        rows = []
        for c in changes:
            head = c.version, c.group, c.fingerprint, c.cause, c.who, *astuple(c.moment)
            rows.append((*head, int(c.learned), c.state, zlib.crc32(c.state)))
        sources = [(name, sequence, version) for name, sequence in (seen or {}).items()]
        try:
            connection.execute("BEGIN IMMEDIATE")
            try:
                connection.executemany(
                    "INSERT INTO change VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", rows
                )
                connection.executemany("INSERT OR REPLACE INTO source VALUES (?, ?, ?)", sources)
                connection.execute("COMMIT")
            except BaseException:
                if connection.in_transaction:
                    connection.execute("ROLLBACK")
                raise
        except sqlite3.Error as error:
            raise StoreError(f"{self.path.name} cannot be written: {error}") from None
        self._evict({c.group for c in changes})

    def _evict(self, groups: set[str]) -> None:
        """Delete the oldest learned changes; the latest of every group and vehicle stays."""
        try:
            pages = self._number("PRAGMA page_count") - self._number("PRAGMA freelist_count")
            full = pages > _FULL_SHARE * self._max_pages
            if full:
                groups = self._names("SELECT DISTINCT grp FROM change")
            for group in groups:
                count = self._number("SELECT count(*) FROM change WHERE grp = ?", group)
                if full or count > self._max_changes:
                    self._connection.execute(
                        "DELETE FROM change WHERE rowid IN (SELECT rowid FROM change WHERE grp = ?1"
                        " AND version NOT IN"
                        " (SELECT max(version) FROM change WHERE grp = ?1 GROUP BY fingerprint)"
                        " ORDER BY learned DESC, version LIMIT ?2)",
                        (group, max(count // 4, 1)),
                    )
            self._connection.execute(
                "DELETE FROM source WHERE name NOT IN"
                " (SELECT name FROM source ORDER BY version DESC LIMIT ?)",
                (MAX_SOURCES,),
            )
        except sqlite3.Error as error:
            raise StoreError(f"{self.path.name} has no free space: {error}") from None

    # ------------------------------------------------------------------ reading

    def last_version(self) -> int:
        """Highest version of all, 0 for an empty store."""
        return self._number("SELECT coalesce(max(version), 0) FROM change")

    def seen(self) -> dict[str, int]:
        """Last sequence number of each source."""
        return {str(n): int(last) for n, last in self._rows("SELECT name, sequence FROM source")}

    def groups(self, fingerprint: str) -> list[str]:
        """Groups of a vehicle with changes."""
        query = "SELECT DISTINCT grp FROM change WHERE fingerprint = ?"
        return sorted(self._names(query, fingerprint))

    def fingerprints(self) -> set[str]:
        """Vehicles with changes."""
        return self._names("SELECT DISTINCT fingerprint FROM change")

    def has(self, fingerprint: str, version: int) -> bool:
        """Return True if a vehicle's parameters changed with that version."""
        query = "SELECT count(*) FROM change WHERE fingerprint = ? AND version = ?"
        return self._number(query, fingerprint, version) > 0

    def newest(
        self, fingerprint: str, group: str, up_to: int | None = None
    ) -> Iterator[StoredChange]:
        """Changes of a group of a vehicle, from the newest or a version back."""
        where = "WHERE fingerprint = ? AND grp = ? AND version <= ? ORDER BY version DESC"
        return self._changes(where, fingerprint, group, _NO_LIMIT if up_to is None else up_to)

    def history(self, group: str = "", count: int = 100) -> list[StoredChange]:
        """Last changes of a group, newest first; of all groups and vehicles without a name."""
        where, given = ("WHERE grp = ? ", (group, count)) if group else ("", (count,))
        return list(self._changes(f"{where}ORDER BY version DESC LIMIT ?", *given))

    def latest(self) -> list[StoredChange]:
        """The newest change of every group and vehicle."""
        newest = "SELECT max(version), grp, fingerprint FROM change GROUP BY grp, fingerprint"
        return list(self._changes(f"WHERE (version, grp, fingerprint) IN ({newest})"))

    def _changes(self, where: str, *given: object) -> Iterator[StoredChange]:
        """Changes whose checksum fits."""
        query = (
            "SELECT version, grp, fingerprint, cause, who, at, boot, uptime, state, learned, crc"
            f" FROM change {where}"
        )
        for row in self._rows(query, *given):
            version, grp, vehicle, cause, who, at, boot, uptime, state, learned, crc = row
            if tuple(map(type, row)) != _ROW or zlib.crc32(state) != crc:
                self.damaged.add(grp)
                continue
            moment = BootTime(at, boot, uptime)
            yield StoredChange(version, grp, vehicle, cause, who, moment, state, bool(learned))

    def _names(self, query: str, *given: object) -> set[str]:
        return {str(name) for (name,) in self._rows(query, *given)}

    def _number(self, query: str, *given: object) -> int:
        return int(next(self._rows(query, *given))[0])

    def _rows(self, query: str, *given: object) -> Iterator[tuple[Any, ...]]:
        try:
            with closing(self._connection.execute(query, given)) as rows:
                yield from rows
        except sqlite3.Error as error:
            raise StoreError(f"{self.path.name} cannot be read: {error}") from None


def _content_order(file: Path) -> tuple[bool, bool, float]:
    """Order in which quarantined files are replaced: missing, empty, then the oldest."""
    if not file.exists():
        return False, False, 0.0
    log = file.with_name(file.name + "-wal")
    return True, file.stat().st_size > 0 or log.exists(), file.stat().st_mtime
