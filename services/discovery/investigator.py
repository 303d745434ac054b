"""Stores stops, starts investigations in a separate process, and collects their results.

Called by the learning thread; never blocks on the investigation process.
"""

from __future__ import annotations

import dataclasses
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import msgspec
import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import InputError, ParameterError
from slopewise.models.parameters import Model
from slopewise.services.discovery.investigation_process import (
    JOB,
    OUTCOME,
    InvestigationJob,
    InvestigationOutcome,
)
from slopewise.services.discovery.stop_extractor import StopExtractor
from slopewise.services.discovery.stop_store import StopStore, StoredStop
from slopewise.services.io.files import reason
from slopewise.services.io.model_file import model_to_dict
from slopewise.services.settings.learning_settings import Investigation

_log = logging.getLogger("slopewise")

_GRACE = 5.0  # time beyond its limit in which a process may end normally [s]

_MIN_STOP_COUNT = 12
"""Stops from which their scatter can be estimated [1], as the workflow requires."""

_ERRORS, _MAX_LOGGED = "errors.txt", 2000
SCHEDULED = "by schedule"


class Investigator:
    """Stored stops and their investigations; one thread."""

    def __init__(self, settings: Investigation, vehicle: str, counters: Counter[str]) -> None:
        """Open the store of the stops, if the settings name one; ``vehicle``: fingerprint."""
        self._settings, self._vehicle = settings, vehicle
        self._store: StopStore | None = None
        self._fault = ""
        self.counters = counters  # stops lost; investigations started and failed
        self.last = ""  # result of the last investigation as text
        self._extractor = StopExtractor()
        self._process: subprocess.Popen[bytes] | None = None
        self._folder: Path | None = None
        self._cause = ""
        self._started = time.monotonic()
        self._new_stops = 0
        if settings.samples:
            try:
                max_bytes = int(1e6 * settings.megabytes)
                self._store = StopStore(Path(settings.samples), max_bytes, counters)
            except InputError as error:
                self._fault = str(error)
                _log.warning("%s", error)

    # ------------------------------------------------------------------ stops

    def add_samples(
        self, source: str, columns: Mapping[str, Floats], surface: str, model: str
    ) -> None:
        """Store the stops that end in these samples; ``model``: fingerprint of that in use."""
        if self._store is None:
            return
        for extracted in self._extractor.add_samples(source, columns):
            stop = StoredStop(
                source=source,
                surface=surface,
                at=time.time(),
                vehicle=self._vehicle,
                model=model,
                columns=list(extracted),
                values=np.stack(list(extracted.values())),
            )
            try:
                self._store.put(stop)
            except InputError as error:
                self.counters["stops_lost"] += 1
                if not self._fault:
                    _log.warning("%s", error)
                self._fault = f"stops are not kept: {error.expected}"
                continue
            self._fault = ""
            self._new_stops += 1

    # ------------------------------------------------------------------ investigations

    @property
    def running(self) -> bool:
        """True while an investigation is running."""
        return self._process is not None

    def is_due(self) -> bool:
        """Return True if a scheduled investigation should start."""
        s = self._settings
        late = time.monotonic() - self._started >= s.every > 0.0
        enough = self._store is not None and self._new_stops >= s.fresh
        return late and enough and not self.running

    def begin(self, file: Model, basis: Model, active: Model, cause: str) -> None:
        """Compare stored stops with ``basis``; ``active``: model planned with now."""
        if self.running:
            raise ParameterError("start", "no running investigation, got one")
        if self._store is None:
            expected = self._fault or "[discrepancy] samples in the settings, got none"
            raise ParameterError("start", expected)
        if len(self._store) < _MIN_STOP_COUNT:
            expected = f"at least {_MIN_STOP_COUNT} stored stops, got {len(self._store)}"
            raise ParameterError("start", expected)
        self._started = time.monotonic()
        folder = Path(tempfile.mkdtemp(prefix="slopewise-look-"))
        job = InvestigationJob(
            store=str(Path(self._settings.samples).resolve()),
            vehicle=self._vehicle,
            cause=cause,
            names=self._store.latest(int(self._settings.stops)),
            limit=self._settings.limit,
            file=model_to_dict(file),
            basis=model_to_dict(basis),
            active=model_to_dict(_without_learned_surfaces(active, file)),
        )
        try:
            (folder / JOB).write_bytes(msgspec.json.encode(job))
            self._process = _start_process(folder)
        except OSError as error:
            shutil.rmtree(folder, ignore_errors=True)
            expected = f"a process for the investigation: {reason(error)}"
            raise ParameterError("start", expected) from None
        self._folder, self._cause, self._new_stops = folder, cause, 0
        self.counters["looks"] += 1
        self.last = f"investigating {len(job.names)} stops, {cause}"

    def poll(self) -> InvestigationOutcome | None:
        """Result of an investigation that ended since the last call; a failed one has no offer."""
        process, folder = self._process, self._folder
        if process is None or folder is None:
            return None
        over = time.monotonic() - self._started > self._settings.limit + _GRACE
        if process.poll() is None and not over:
            return None
        outcome = self._collect(process, folder)
        if self._store is not None:
            self._store.quarantine(outcome.damaged)
        if outcome.offer is None:
            self.counters["looks_failed"] += 1
            self.last = f"no result, {self._cause}: {outcome.reason}"
            _log.warning("%s", self.last)
        else:
            self.last = f"done, {self._cause}: {outcome.offer.text()}"
        return outcome

    def _collect(self, process: subprocess.Popen[bytes], folder: Path) -> InvestigationOutcome:
        if process.poll() is None:
            process.kill()
        # Closes its input, and waits until it has exited.
        process.communicate()
        self._process = self._folder = None
        try:
            if process.returncode == 0:
                content = (folder / OUTCOME).read_bytes()
                return msgspec.json.decode(content, type=InvestigationOutcome)
            if time.monotonic() - self._started >= self._settings.limit:
                failure = f"expected an end within {self._settings.limit:g} s"
            else:
                errors = (folder / _ERRORS).read_text(errors="replace")
                _log.error("%s", errors[-_MAX_LOGGED:])
                failure = f"the process ended with status {process.returncode}"
        except (OSError, msgspec.DecodeError) as error:
            failure = f"its outcome cannot be read: {error}"
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        return InvestigationOutcome(reason=failure, damaged=[])

    # ------------------------------------------------------------------ reports

    def flags(self) -> list[str]:
        """Warnings about the stored stops."""
        return [self._fault] if self._fault else []

    def close(self) -> None:
        """End a running investigation."""
        if self._process is not None and self._folder is not None:
            self._process.kill()
            self._collect(self._process, self._folder)


def _without_learned_surfaces(active: Model, file: Model) -> Model:
    """The active model with the surfaces of the file only: no other model has learned ones."""
    known = active.braking.terrain
    tables = {name: known[name] for name in file.braking.terrain if name in known}
    return dataclasses.replace(active, braking=dataclasses.replace(active.braking, terrain=tables))


def _start_process(folder: Path) -> subprocess.Popen[bytes]:
    module = "slopewise.services.discovery.investigation_process"
    with (folder / _ERRORS).open("wb") as errors:
        return subprocess.Popen(
            [sys.executable, "-m", module, str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            start_new_session=True,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
        )
