"""Keeps stops, begins looks at them in a process of their own, and gathers what they come to.

Whoever learns calls it and goes on: nothing here waits for the other process.
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
from slopewise.services.discovery.finding import InvestigationOutcome
from slopewise.services.discovery.investigate import (
    BASE,
    FILE,
    IN_USE,
    JOB,
    OUTCOME,
    InvestigationJob,
)
from slopewise.services.discovery.stop_cutter import StopCutter
from slopewise.services.discovery.stop_store import StopStore, StoredStop
from slopewise.services.io.files import reason
from slopewise.services.io.model_file import write_model
from slopewise.services.settings.investigation_settings import Investigation

_log = logging.getLogger("slopewise")

_GRACE = 5.0  # [s] that a process gets beyond its limit to end itself
_FEWEST = 12  # stops from whose scatter something can be told
_SAID, _MOST_SAID = "said.txt", 2000
BY_ITSELF = "by schedule"


class Investigator:
    """Stops and looks at them; one thread.

    Attributes:
        counters: stops kept, lost and damaged; looks begun, done and failed.
        last: what became of the last look, in words.
    """

    def __init__(self, settings: Investigation, vehicle: str) -> None:
        """Open the store of the stops, if there is to be one.

        Args:
            settings: what to keep, when to look. vehicle: its fingerprint.
        """
        self._settings, self._vehicle = settings, vehicle
        self._store: StopStore | None = None
        self._fault = ""
        self.counters: Counter[str] = Counter()
        self.last = ""
        self._cutter = StopCutter()
        self._process: subprocess.Popen[bytes] | None = None
        self._folder: Path | None = None
        self._cause = ""
        self._begun = time.monotonic()
        self._fresh = 0
        if settings.samples:
            try:
                self._store = StopStore(Path(settings.samples), int(1e6 * settings.megabytes))
            except InputError as error:
                self._fault = str(error)
                _log.warning("%s", error)

    # ------------------------------------------------------------------ stops

    def hear(self, source: str, columns: Mapping[str, Floats], surface: str, model: str) -> None:
        """Samples of a drive; what is a stop in them is kept.

        Args:
            source: who drove. columns: (n,) by name. surface: of the ground, "" unknown.
            model: fingerprint of what is planned with.
        """
        if self._store is None:
            return
        for cut in self._cutter.take(source, columns, surface):
            stop = StoredStop(
                source=cut.source,
                surface=cut.surface,
                at=time.time(),
                vehicle=self._vehicle,
                model=model,
                columns=list(cut.columns),
                values=np.stack(list(cut.columns.values())),
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
            self._fresh += 1

    # ------------------------------------------------------------------ looks

    @property
    def running(self) -> bool:
        """A look is going on."""
        return self._process is not None

    def due(self) -> bool:
        """Whether it is time to look by itself."""
        s = self._settings
        late = time.monotonic() - self._begun >= s.every > 0.0
        return late and self._store is not None and self._fresh >= s.fresh and not self.running

    def begin(self, file: Model, base: Model, in_use: Model, cause: str) -> None:
        """Begin to look.

        Args:
            file: the model file's. base: to hold the stops against. in_use: planned with now.
            cause: who asked, in words.

        Raises:
            ParameterError: it cannot be begun.
        """
        if self.running:
            raise ParameterError("start", "no look going on, one is")
        if self._store is None:
            words = self._fault or "[discrepancy] samples in the settings, got none"
            raise ParameterError("start", words)
        if len(self._store) < _FEWEST:
            words = f"at least {_FEWEST} stored stops, got {len(self._store)}"
            raise ParameterError("start", words)
        self._begun = time.monotonic()
        folder = Path(tempfile.mkdtemp(prefix="slopewise-look-"))
        job = InvestigationJob(
            store=str(Path(self._settings.samples).resolve()),
            vehicle=self._vehicle,
            cause=cause,
            names=self._store.latest(int(self._settings.stops)),
            limit=self._settings.limit,
        )
        try:
            # Surfaces that were only learned are in none of the others.
            on = in_use.braking
            known = {name: on.terrain[name] for name in file.braking.terrain if name in on.terrain}
            in_use = dataclasses.replace(in_use, braking=dataclasses.replace(on, terrain=known))
            for name, model in ((FILE, file), (BASE, base), (IN_USE, in_use)):
                write_model(model, folder / name)
            (folder / JOB).write_bytes(msgspec.json.encode(job))
            with (folder / _SAID).open("wb") as said:
                self._process = subprocess.Popen(
                    [sys.executable, "-m", "slopewise.services.discovery.investigate", str(folder)],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=said,
                    start_new_session=True,
                    env=os.environ | {"OMP_NUM_THREADS": "1"},
                )
        except (OSError, InputError) as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise ParameterError("start", f"a process to look with: {reason(error)}") from None
        self._folder, self._cause, self._fresh = folder, cause, 0
        self.counters["looks"] += 1
        self.last = f"looking at {len(job.names)} stops, {cause}"

    def poll(self) -> InvestigationOutcome | None:
        """What a look came to that has ended since; a failed one has no offer."""
        process, folder = self._process, self._folder
        if process is None or folder is None:
            return None
        over = time.monotonic() - self._begun > self._settings.limit + _GRACE
        if process.poll() is None and not over:
            return None
        outcome = self._ended(process, folder)
        if self._store is not None:
            self._store.put_aside(outcome.damaged)
        if outcome.offer is None:
            self.counters["looks_failed"] += 1
            self.last = f"nothing found, {self._cause}: {outcome.reason}"
            _log.warning("%s", self.last)
        else:
            self.last = f"done, {self._cause}: {outcome.offer.text()}"
        return outcome

    def _ended(self, process: subprocess.Popen[bytes], folder: Path) -> InvestigationOutcome:
        if process.poll() is None:
            process.kill()
        # Closes what it listens to, and waits for the little that is left.
        process.communicate()
        self._process = self._folder = None
        try:
            if process.returncode == 0:
                return msgspec.json.decode(
                    (folder / OUTCOME).read_bytes(), type=InvestigationOutcome
                )
            if time.monotonic() - self._begun >= self._settings.limit:
                words = f"expected an end within {self._settings.limit:g} s"
            else:
                said = (folder / _SAID).read_text(errors="replace")
                _log.error("%s", said[-_MOST_SAID:])
                words = f"the process ended with status {process.returncode}"
        except (OSError, msgspec.DecodeError) as error:
            words = f"its outcome cannot be read: {error}"
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        return InvestigationOutcome(reason=words, damaged=[])

    # ------------------------------------------------------------------ telling

    def flags(self) -> list[str]:
        """What is not as it should be."""
        return [self._fault] if self._fault else []

    def told(self) -> Counter[str]:
        """Counters for the status."""
        store = Counter[str]() if self._store is None else self._store.counters
        return self.counters + store

    def close(self) -> None:
        """End what is going on."""
        if self._process is not None and self._folder is not None:
            self._process.kill()
            self._ended(self._process, self._folder)
