"""Shared by all formats: one-line errors, whole files read, atomic writes, digests, TOML."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import secrets
import tomllib
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from slopewise.models.errors import InputError, ParameterError

_MAX_SHOWN = 80
"""Characters of a value that an error shows: with file and key it stays one line of a terminal."""

_MAX_TOML_BYTES = 1_000_000
"""Fifty times the largest settings; tomllib takes a second for that much."""

_MAX_KEY_PARTS = 20  # Parts of a dotted key: settings have at most four

_PART = r"""(?:[A-Za-z0-9_-]+|"[^"\n]*"|'[^'\n]*')"""
_DEEP = re.compile(rf"{_PART}(?:[ \t]*\.[ \t]*{_PART}){{{_MAX_KEY_PARTS}}}")
"""tomllib stores every part of a dotted key with all parts before it: memory by the square."""

_TOML_PLACE = re.compile(r" \(at (line \d+, column \d+|end of document)\)$")


def fault(source: object, field: str, expected: str) -> InputError:
    """An InputError of one line, for any content of keys and cells; no field is the whole file."""
    return InputError(*(one_line(str(part)) for part in (source, field, expected)))


def check_ending(path: Path | None, *endings: str) -> None:
    """Raise InputError for a name, of a file to write, that has the ending of another format."""
    if path is not None and path.suffix and path.suffix.lower() not in endings:
        expected = f"expected a name that ends in {' or '.join(endings)}, got {path.suffix}"
        raise fault(path, "", expected)


@contextlib.contextmanager
def faults_of(source: object, prefix: str = "") -> Iterator[None]:
    """Turn a ParameterError of the block into an InputError of a file; prefix its field."""
    try:
        yield
    except ParameterError as error:
        raise fault(source, f"{prefix}{error.field}", f"expected {error.expected}") from None


def one_line(text: str) -> str:
    """The text with escapes in place of what does not print."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shown(value: object) -> str:
    """A value of a file as an error shows it: short."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}"
    text = repr(value)
    return text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]}…"


def reason(error: BaseException) -> str:
    """The operating system's reason for an error, short."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return str(text)


def real_path(path: Path) -> Path:
    """Absolute path without symbolic links; `Path.resolve` fails with those of a loop."""
    return Path(os.path.realpath(path))


def check_file(path: Path) -> None:
    """Raise InputError unless ``path`` is an existing file."""
    try:
        if path.is_dir():
            raise fault(path, "", "expected a file, got a directory")
        if not path.exists():
            raise fault(path, "", "expected an existing file, got none of that name")
        if not os.access(path, os.R_OK):
            raise fault(path, "", "expected a readable file, got one without permission to read")
    except (OSError, ValueError) as error:  # too long, or a NUL in the name
        raise fault(path, "", f"expected a file name, got {reason(error)}") from None


def read_text(path: Path) -> str:
    """A whole UTF-8 file; line ends stay unchanged."""
    check_file(path)
    content = b""
    try:
        content = path.read_bytes()
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        got = "UTF-16" if content[:2] in (BOM_UTF16_LE, BOM_UTF16_BE) else "other bytes"
        raise fault(path, f"byte {error.start}", f"expected UTF-8 text, got {got}") from None
    except (OSError, MemoryError) as error:
        raise fault(path, "", f"expected a readable file, got: {reason(error)}") from None


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a file."""
    check_file(path)
    if (size := path.stat().st_size) > _MAX_TOML_BYTES:
        raise fault(path, "", f"expected at most {_MAX_TOML_BYTES} bytes of TOML, got {size}")
    text = read_text(path)
    if (deep := _DEEP.search(text)) is not None:
        line = text.count("\n", 0, deep.start()) + 1
        raise fault(path, f"line {line}", f"expected keys of at most {_MAX_KEY_PARTS} parts")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        message = str(error)
        place = _TOML_PLACE.search(message)
        field, end = (place[1], place.start()) if place else ("", None)
        raise fault(path, field, f"expected TOML, got: {message[:end]}") from None
    except (ValueError, RecursionError) as error:
        raise fault(path, "", f"expected TOML, got: {reason(error)}") from None


def resolve_names(path: Path, data: dict[str, Any], *keys: str, exists: bool = True) -> None:
    """Take files that settings name relative to the settings; changes ``data``.

    With ``exists`` only names of existing files change: others may be names of another kind.
    """
    for key in keys:
        table, _, name = key.rpartition(".")
        inside = data.get(table) if table else data
        if not isinstance(inside, dict) or not isinstance(given := inside.get(name), str):
            continue
        if given and (not exists or (path.parent / given).is_file()):
            inside[name] = str(path.parent / given)


def write_atomic(path: Path, content: bytes) -> None:
    """Write a file all or nothing: a reader, or a crash, sees the old content or the new one."""
    temporary: Path | None = None
    try:
        if path.exists() and not path.is_file():  # a pipe or /dev/stdout; a directory fails here
            path.write_bytes(content)
            return
        target = real_path(path)
        temporary = target.with_name(f".{target.name[:80]}.{secrets.token_hex(6)}.tmp")
        with temporary.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        if target.exists():
            temporary.chmod(target.stat().st_mode & 0o777)
        os.replace(temporary, target)
        _sync_directory(target.parent)
    except (OSError, ValueError) as error:
        raise fault(path, "", f"expected a writable file, got: {reason(error)}") from None
    finally:
        if temporary is not None:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)


def _sync_directory(directory: Path) -> None:
    """Make a rename durable; file systems that cannot sync a directory need no sync."""
    with contextlib.suppress(OSError):
        handle = os.open(directory, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, as `sha256sum` prints it; of a folder that of its files and names."""
    digest = hashlib.sha256()
    try:
        if not path.is_dir():
            return _of_file(path)
        for file in sorted(p for p in path.rglob("*") if p.is_file()):
            digest.update(f"{_of_file(file)}  {file.relative_to(path).as_posix()}\n".encode())
    except OSError as error:
        raise fault(path, "", f"expected a readable file, got: {reason(error)}") from None
    return digest.hexdigest()


def _of_file(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def shipped_folder() -> Path:
    """Folder of the files that come with the package: ``slopewise/configs``."""
    return Path(__file__).parents[2] / "configs"


def shipped_files(kind: str) -> dict[str, Path]:
    """TOML files of one kind (a folder of the package's configs): name -> file."""
    return {file.stem: file for file in sorted((shipped_folder() / kind).glob("*.toml"))}


def find_shipped(name_or_path: str | Path, kind: str, noun: str) -> Path:
    """The file a user means: an existing file, else one that comes with the package."""
    path = Path(name_or_path)
    with contextlib.suppress(OSError, ValueError):  # too long a name, or a NUL in it
        if path.is_file():
            return path
    shipped = shipped_files(kind)
    if str(name_or_path) in shipped:
        return shipped[str(name_or_path)]
    expected = f"expected a {noun} file or one of {', '.join(shipped)}, got neither"
    raise fault(name_or_path, "", expected)
