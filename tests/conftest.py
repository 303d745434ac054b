"""Fixtures of all tests: the search of hypothesis, the nightly selection, and a model to plan with.

Tests marked `nightly` run only when the marker is asked for: `pytest -m nightly`; hypothesis then
searches forty times as long, and with other seeds every time.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture.providers import Constants, HypothesisProvider

from slopewise.models.parameters import Model
from tests.world import shared
from tests.world.real_terrain import data_folder
from tests.world.vehicles import ATV, Tables, model_of, tables_with

_CALM = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("default", max_examples=50, derandomize=True, database=None, **_CALM)
settings.register_profile("nightly", max_examples=2000, print_blob=True, **_CALM)


TESTS = Path(__file__).parent
COMPILING = {"test_from_cpp", "test_sanitizers"}
"""Their single tests take so long that the last worker would work on them alone."""


def pytest_configure(config: pytest.Config) -> None:
    """Search with the same seeds by day, with others by night."""
    settings.load_profile("nightly" if config.getoption("markexpr") == "nightly" else "default")
    # Otherwise draws depend on the constants of all modules that a process has imported so far, and
    # with them on the tests that it happened to run before.
    assert "_local_constants" in vars(HypothesisProvider)
    HypothesisProvider._local_constants = Constants()
    gc.disable()  # a quarter of the time of collecting


def pytest_sessionstart(session: pytest.Session) -> None:
    """Each worker of a run of all tests begins to import at another file.

    pytest takes seconds to rewrite their assertions: what one worker has rewritten, others find.
    """
    worker = getattr(session.config, "workerinput", None)
    if worker is None or session.config.args != session.config.getini("testpaths"):
        return
    files = sorted(TESTS.rglob("test_*.py"))
    first = len(files) * int(worker["workerid"].removeprefix("gw")) // worker["workercount"]
    for file in files[first:] + files[:first]:
        # What cannot be imported is reported when it is collected.
        with contextlib.suppress(Exception, pytest.skip.Exception):
            importlib.import_module(".".join(file.relative_to(TESTS.parent).with_suffix("").parts))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave the nightly tests out unless they are asked for; what compiles begins first."""
    items.sort(key=lambda item: item.path.stem not in COMPILING)
    if "nightly" in config.getoption("markexpr"):
        return
    nightly = [item for item in items if item.get_closest_marker("nightly")]
    if nightly:
        config.hook.pytest_deselected(items=nightly)
        items[:] = [item for item in items if not item.get_closest_marker("nightly")]


def pytest_collection_finish() -> None:
    """Imported and collected objects stay: garbage is searched for among later ones alone."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def folder_of_all_workers(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Where results are kept that all workers of this run need."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared.FOLDERS[:] = [tmp_path_factory.getbasetemp().parent]


@pytest.fixture
def tables() -> Tables:
    """The quad as the tables of a model file; a copy to change."""
    return tables_with()


@pytest.fixture
def model() -> Model:
    """The quad."""
    return model_of(ATV)


@pytest.fixture
def data() -> Path:
    """Folder of the public recordings; skips where it is absent."""
    folder = data_folder()
    if not folder.is_dir():
        pytest.skip(f"no recordings at {folder}: set SLOPEWISE_DATA to their folder")
    return folder
