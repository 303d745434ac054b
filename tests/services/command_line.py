"""The command line as a user meets it: arguments in, exit status and lines out."""

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


def slopewise(*arguments: object, timeout: float = 120.0, fresh: bool = False) -> Done:
    """Run in a separate process; `fresh` as from a shell, with everything still to import."""
    if not fresh:
        return WarmProcess([str(text) for text in arguments], os.environ).finished(timeout)
    command = [sys.executable, "-m", "slopewise.services.cli", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)


def here(*arguments: object) -> Done:
    """In this process, which has everything imported already."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        pytest.raises(SystemExit) as left,
    ):
        app.main([str(text) for text in arguments])
    status = left.value.code or 0
    assert isinstance(status, int), status
    return subprocess.CompletedProcess(arguments, status, out.getvalue(), err.getvalue())


def one_line_of(result: Done, *arguments: str) -> None:
    """Assert status 2 and one line on standard error, with these texts in it."""
    assert result.returncode == 2, result.stderr
    assert len(result.stderr.strip().splitlines()) == 1, result.stderr
    assert "Traceback" not in result.stderr
    for text in arguments:
        assert text in result.stderr, result.stderr
