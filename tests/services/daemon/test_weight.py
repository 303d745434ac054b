"""Imports and memory of the service: no unused module, and bounded memory.

`docs/deploy.md` has the figures.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from slopewise.services.client import PlanClient
from slopewise.services.jobs.cold_start import compile_first
from tests.services.service_process import fan, flat, running

UNUSED = ["matplotlib", "rasterio", "casadi", "PIL", "contourpy", "pyarrow", "sklearn", "plotly"]
UNUSED += ["rosbags", "waitress", "scipy.stats", "scipy.ndimage", "scipy.cluster"]
MAX_RESIDENT = 300.0
"""[MB] resident after 100 requests; 272 were measured."""
MAX_GROWTH = 25.0
"""[MB] that 100 requests may add to what it has after its start."""


def test_nothing_is_imported_that_serving_does_not_use() -> None:
    code = (
        "import sys, slopewise.services.cli.app, slopewise.services.daemon.daemon; "
        f"print([m for m in {UNUSED!r} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def resident(process: int) -> float:
    """[MB]."""
    status = Path(f"/proc/{process}/status").read_text()
    line = re.search(r"^VmRSS:\s+(\d+) kB", status, re.MULTILINE)
    assert line is not None
    return int(line[1]) / 1024


@pytest.mark.nightly
def test_memory_where_nothing_was_compiled_before(tmp_path: Path) -> None:
    """The compiler's own memory is that of another process."""
    cache = tmp_path / "compiled"
    cache.mkdir()
    with running(tmp_path, environment={"NUMBA_CACHE_DIR": str(cache)}) as started:
        assert resident(started.process.pid) < MAX_RESIDENT
    assert list(cache.glob("**/*.nbi"))


def test_memory_after_a_hundred_questions(tmp_path: Path) -> None:
    compile_first("for a test")
    with running(tmp_path, fresh=True) as started, started.session() as session:
        begin = resident(started.process.pid)
        uneven = 0.05 * np.random.default_rng(0).standard_normal((240, 480))
        with PlanClient(session, namespace=started.namespace, name="weight", timeout=5.0) as client:
            client.put_map(flat(elevation=uneven, origin=(-5.0, -30.0)))
            # Memory retained for a request is retained for a small one, too; large ones need most.
            for candidates in (64, 8, 8, 8) * 25:
                outcome = client.plan(1.0, fan(candidates), pose=(0.0, 0.0, 0.0))
                assert outcome.reply is not None
        end = resident(started.process.pid)
    assert end < MAX_RESIDENT
    assert end - begin < MAX_GROWTH
