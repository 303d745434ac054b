"""The active parameters: learned from observations, set by operators, stored, restored, aged.

Independent of the wire. One thread calls it; any thread may read `active`.
"""

from __future__ import annotations

import dataclasses
import hashlib
import logging
import math
import time
from collections import Counter
from collections.abc import Callable, Collection, Mapping

from slopewise.models.errors import InputError, ParameterError
from slopewise.models.parameters import Model
from slopewise.services.discovery.investigator import SCHEDULED, Investigator
from slopewise.services.parameters.active_parameters import ActiveParameters, fingerprint, slowed
from slopewise.services.parameters.effects_group import EFFECTS
from slopewise.services.parameters.learner import NOT_LEARNED, Learner
from slopewise.services.parameters.observation_filter import ObservationFilter, columns_of
from slopewise.services.parameters.parameter_history import LastChange, ParameterHistory
from slopewise.services.parameters.restore import ParameterRestorer
from slopewise.services.parameters.store import BootTime, StoreError
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.observations import DriveSamples, ObservationAck, RobotObservation
from slopewise.services.wire.recent_warnings import RecentWarnings

_log = logging.getLogger("slopewise")

TAKEN, IGNORED, REFUSED = "taken", "ignored", "refused"


class ParameterService:
    """Learns, stores and publishes parameters."""

    def __init__(
        self,
        config: ServiceConfig,
        prior: Model,
        apply: Callable[[ActiveParameters], None] = lambda _: None,
        map_surfaces: Callable[[], Collection[str]] = tuple,
    ) -> None:
        """Begin with the model file, ``prior``, and what was stored.

        ``apply``: called with the active parameters each time they change; ``map_surfaces``:
        returns the names of the surfaces on the map in use.
        """
        settings = config.learning
        self._config, self._settings, self._file = config, settings, prior
        self.id, self._apply = config.id, apply
        # of observations, stops, investigations and changes
        self.counters: Counter[str] = Counter()
        self.learner = Learner(prior, settings, map_surfaces, self.counters)
        vehicle = fingerprint(prior.vehicle)
        self.history = ParameterHistory(config.store, vehicle)
        self._restorer = ParameterRestorer(self.learner, self.history, settings.oldest)
        self.investigator = Investigator(config.discrepancy, vehicle, self.counters)
        self._missing = set(settings.estimators)
        self._faults: list[str] = []
        self.notices = RecentWarnings()  # messages that failed
        self._refreshed = -math.inf
        self.changed: set[str] = set()  # groups that are not published yet
        self.rejected = ("", "")  # proposal last refused to be adopted: its id, and the reason
        self._filter = ObservationFilter(settings.early, self.history.seen())
        self.active = ActiveParameters(prior)  # to plan with
        self._restore(())
        self._publish()
        self.changed = set(self.learner.state.names())

    # ------------------------------------------------------------------ observations

    def observe(
        self, kind: str, observation: RobotObservation, key: str, arrived: float
    ) -> ObservationAck:
        """Learn from a `stop`, `drive` or `terrain` observation, and store the result.

        ``key``: where it arrived, for errors; ``arrived``: monotonic clock at its arrival [s].
        """
        reason = self._filter.check(kind, observation, arrived)
        if reason:
            self.counters[f"{kind}_{reason}"] += 1
            ignored = reason in ("duplicate", "out_of_order")
            return self.receipt(IGNORED if ignored else REFUSED, reason.replace("_", " "))
        try:
            if isinstance(observation, DriveSamples) and self._config.discrepancy.samples:
                self._store_samples(observation, key)
            changes, reason = self.learner.observe(observation, key, arrived)
        except (InputError, ParameterError) as error:
            self.counters[f"{kind}_refused"] += 1
            return self.receipt(REFUSED, str(error))
        seen = self._filter.accept(kind, observation)
        if reason.startswith(NOT_LEARNED) and not changes:
            # Rejected stops cost no time of the disk, however fast they arrive.
            self.counters[f"{kind}_refused"] += 1
            return self.receipt(REFUSED, reason)
        self.counters[f"{kind}_taken"] += 1
        if changes or kind == "stop":
            cause = f"{kind} {observation.sequence}: {reason}"
            self._commit(changes, cause, observation.source, seen=seen)
        if self.learner.is_outdated():
            self._publish()
        return self.receipt(TAKEN, reason)

    def _store_samples(self, samples: DriveSamples, key: str) -> None:
        surface = samples.surface or self.learner.ground.surface(time.monotonic())
        basis = self.learner.state.basis
        model = hashlib.sha256(repr((basis.braking, basis.effect)).encode()).hexdigest()[:12]
        columns = columns_of(samples, key)
        self.investigator.add_samples(samples.source, columns, surface, model)

    def receipt(self, status: str, reason: str) -> ObservationAck:
        """Reply to an observation."""
        version, durable = self.history.version, self.history.durable
        return ObservationAck(status=status, reason=reason, version=version, durable=durable)

    # ------------------------------------------------------------------ operators

    def set_values(self, group: str, values: Mapping[str, float], who: str) -> None:
        """Apply an operator's values; ParameterError says what was expected."""
        for name, value in values.items():
            if not math.isfinite(value):
                raise ParameterError(name, f"a finite number, got {value}")
        self.learner.state.group(group).set(group, values)
        cause = "set " + ", ".join(f"{name} = {value:g}" for name, value in values.items())
        self._commit({group}, cause, who, learned=False)

    def roll_back(self, version: int, group: str, who: str) -> None:
        """Restore one group, or all without a name, to a version of the history."""
        moments = self._restorer.roll_back(version, group)
        self.rejected = ("", "")
        cause = f"rolled back to version {version}"
        self._commit(set(moments), cause, who, learned=False, moments=moments)
        self.changed |= set(self.learner.state.names())

    def adopt(self, proposal: str, who: str, *, faster: bool = False) -> None:
        """Plan with the finding that is proposed; stops may become shorter only if ``faster``."""
        try:
            self.learner.state = state = self.learner.state.adopt(proposal, faster=faster)
        except ParameterError as error:
            self.rejected = (proposal, str(error))
            raise
        self.rejected = ("", "")
        summary = "" if state.effects.proposal is None else state.effects.proposal.text()
        self._commit({EFFECTS}, f"adopted {proposal}, {summary}", who, learned=False)
        # Braking is learned on top of another model from now on.
        self.changed |= set(self.learner.state.names())

    # ------------------------------------------------------------------ findings

    def investigate(self, who: str) -> None:
        """Start to compare the stored stops with the model; a ParameterError if that cannot be."""
        basis = self.learner.state.basis
        self.investigator.begin(self._file, basis, self.active.model, who)

    def _follow_investigation(self) -> None:
        """Start a scheduled investigation, and propose what one has found."""
        if self.investigator.is_due():
            try:
                self.investigate(SCHEDULED)
            except ParameterError as error:
                self.counters["looks_failed"] += 1
                _log.warning("%s", error)
        outcome = self.investigator.poll()
        if outcome is None or outcome.offer is None:
            return
        proposal = outcome.offer
        self.learner.state = self.learner.state.propose(proposal)
        self.rejected = ("", "")
        self._commit({EFFECTS}, f"offered {proposal.id}, {proposal.text()}", proposal.cause)
        allowed = self._config.discrepancy.adopt_slower
        if allowed and proposal.changes and proposal.valid and proposal.slower_than_now:
            try:
                self.adopt(proposal.id, "service, as the settings allow")
            except ParameterError as error:
                self.counters["changes_refused"] += 1
                _log.warning("%s", error)

    # ------------------------------------------------------------------ faults and time

    def alive(self, estimator: str, *, is_alive: bool) -> None:
        """Record that an estimator appeared or disappeared; the settings name required ones."""
        if estimator not in self._settings.estimators:
            return
        if is_alive:
            self._missing.discard(estimator)
        else:
            self._missing.add(estimator)
            self.counters["estimators_lost"] += 1
        self._publish()

    def note_fault(self, what: str) -> None:
        """Flag for a while that one message failed; plans are unchanged."""
        self.notices.add(f"{what} could not be treated: fault of the service, see its log")
        self._update_flags()

    def fault(self, what: str) -> None:
        """Flag a fault of the service; plans are slower from now on."""
        if what not in self._faults:
            self._faults.append(what)
        self._publish()

    def tick(self) -> None:
        """Run what is due: age, labels that expire, another attempt to write."""
        now = time.monotonic()
        self._follow_investigation()
        if self.history.retry():
            self._filter.restore(self.history.seen())
            self._restore(self.history.unsaved)
            self._restorer.forget_assumed()
            self.changed = set(self.learner.state.names())
            self._publish()
        changed = self.learner.follow_terrain(now)
        if changed:
            self._commit(changed, "the ground's label expired", "service")
        if now - self._refreshed >= self._settings.refresh:
            self._refreshed = now
            self.learner.state.braking.forces.age()
            self._publish()
        else:
            self._update_flags()

    def degraded(self) -> list[str]:
        """Reasons why plans are slower than they need be."""
        missing = (f"estimator {name} is not alive" for name in sorted(self._missing))
        return [*missing, *self._faults]

    def flags(self) -> list[str]:
        """Active warnings, the reasons of the degraded mode first."""
        learner = self.learner
        return [
            *(f"degraded: {reason}" for reason in self.degraded()),
            *self._filter.clocks.active(),
            *self._filter.notices.active(),
            *self.notices.active(),
            *filter(None, (learner.state.unsupported_reason, *learner.ground.flags())),
            *learner.flags(),
            *learner.state.effects.flags(),
            *self.investigator.flags(),
            *self.history.flags(),
            *self._restorer.flags(),
        ]

    def close(self) -> None:
        """End an investigation, and close the store."""
        self.investigator.close()
        self.history.close()

    # ------------------------------------------------------------------ publishing

    def _commit(
        self,
        groups: set[str],
        cause: str,
        who: str,
        *,
        seen: dict[str, int] | None = None,
        learned: bool = True,
        moments: Mapping[str, BootTime] | None = None,
    ) -> None:
        if groups:
            state = self.learner.state
            states = {name: state.group(name).state(name) for name in sorted(groups)}
            # Slower plans do not wait for the disk.
            self._publish(self.history.version + 1)
            self.history.commit(states, cause, who, seen=seen, learned=learned, moments=moments)
            self.changed |= groups
        self._update_flags()

    def _update_flags(self) -> None:
        """Publish other warnings with the same model; plans are unchanged."""
        flags, version = tuple(self.flags()), self.history.version
        if (flags, version) != (self.active.flags, self.active.version):
            self.active = self.active.with_flags(flags, version)
            self._apply(self.active)

    def _publish(self, version: int | None = None) -> None:
        """Publish the model of now."""
        model, age, oldest = self.learner.active()
        self.active = ActiveParameters(
            model=slowed(model, self._settings.degraded_speed) if self.degraded() else model,
            version=self.history.version if version is None else version,
            at=time.monotonic() - oldest,
            revision=self.active.revision + 1,
            uncertainty=dataclasses.replace(self._config.planning.uncertainty(), age=age),
            flags=tuple(self.flags()),
        )
        self._apply(self.active)

    def _restore(self, done: Collection[str]) -> None:
        try:
            careful = self._restorer.restore_newest(done)
        except StoreError as error:
            careful = {}
            if self._config.store.path:
                _log.warning("%s", error)
        for cause in sorted(set(careful.values())):
            groups = {group for group, reason in careful.items() if reason == cause}
            if self.history.is_open:
                moments = self._restorer.moments(groups)
                self._commit(groups, cause, "service", moments=moments)
            else:
                # No change is stored: what the store holds is restored once it can be opened.
                last = LastChange(self.history.version, cause, "service")
                self.history.last.update(dict.fromkeys(groups, last))
