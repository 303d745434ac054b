"""The command line as a user meets it: words in, exit status and lines out."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys

import pytest

from slopewise.services.cli import app
from tests.services.warm_process import WarmProcess

Done = subprocess.CompletedProcess[str]


def slopewise(*words: object, timeout: float = 120.0, fresh: bool = False) -> Done:
    """In a process of its own; `fresh` as from a shell, with everything still to import."""
    if not fresh:
        return WarmProcess([str(word) for word in words], os.environ).finished(timeout)
    command = [sys.executable, "-m", "slopewise.services.cli", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)


def here(*words: object) -> Done:
    """In this process, which has everything imported already."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        pytest.raises(SystemExit) as left,
    ):
        app.main([str(word) for word in words])
    status = left.value.code or 0
    assert isinstance(status, int), status
    return subprocess.CompletedProcess(words, status, out.getvalue(), err.getvalue())


def one_line_of(result: Done, *words: str) -> None:
    """The line of a mistake, with these words in it."""
    assert result.returncode == 2, result.stderr
    assert len(result.stderr.strip().splitlines()) == 1, result.stderr
    assert "Traceback" not in result.stderr
    for word in words:
        assert word in result.stderr, result.stderr
