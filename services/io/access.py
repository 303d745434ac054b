"""What all formats share: errors in one line, reading whole files, writing them all or nothing."""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path

from slopewise.models.errors import InputError

_LONGEST = 80


def fault(source: object, field: str, expected: str) -> InputError:
    """An InputError that is one line, whatever a file's keys and cells hold.

    Args:
        source: file as the user named it.
        field: row, column or dotted key; empty if the file as a whole is wrong.
        expected: "expected …, got …".
    """
    return InputError(*(_one_line(str(part)) for part in (source, field, expected)))


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shown(value: object) -> str:
    """A value of a file as an error shows it: short."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}"
    text = repr(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"


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


def reason(error: BaseException) -> str:
    """Why the system refused, in a few words."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return str(text)


def read_text(path: Path) -> str:
    """A whole UTF-8 file; line ends stay as they are."""
    check_file(path)
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise fault(path, f"byte {error.start}", "expected UTF-8 text, got other bytes") from None
    except (OSError, MemoryError) as error:
        raise fault(path, "", f"expected a readable file, got: {reason(error)}") from None


def write_atomic(path: Path, content: bytes) -> None:
    """Write a file all or nothing: a reader, or a crash, sees the old content or the new one.

    Raises:
        InputError: the place cannot be written to; what was there is intact.
    """
    temporary: Path | None = None
    try:
        if path.exists() and not path.is_file():  # a pipe or /dev/stdout; a directory fails here
            path.write_bytes(content)
            return
        target = path.resolve()
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
    """Make a rename last; file systems that cannot sync a directory need none."""
    with contextlib.suppress(OSError):
        handle = os.open(directory, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
