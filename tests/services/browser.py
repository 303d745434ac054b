"""Pages in a browser without a screen."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")


def _run(*arguments: str) -> subprocess.CompletedProcess[str]:
    if BROWSER is None:
        pytest.skip("needs chromium to show the page")
    command = [
        BROWSER,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--hide-scrollbars",
        "--enable-logging=stderr",
        "--virtual-time-budget=3000",
        *arguments,
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    errors = re.findall(r"CONSOLE[^\n]*", done.stderr)
    assert not errors, errors
    return done


def text_of(url: str, width: int = 1400, tries: int = 5) -> str:
    """Document as HTML once its script has shown all; the script reported no error."""
    for _ in range(tries):
        shown = _run(f"--window-size={width},1200", "--dump-dom", url).stdout
        # The browser's clock may run out before a busy machine has answered.
        if 'data-ready="true"' in shown:
            return shown
    raise AssertionError(f"the page was not ready in {tries} tries: {shown[-2000:]}")


def screenshot(url: str, file: Path, width: int, height: int = 1500) -> None:
    _run(f"--window-size={width},{height}", f"--screenshot={file}", url)
