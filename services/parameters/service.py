"""The parameters in use: learned from observations, set by operators, kept, restored, grown older.

Knows nothing of the wire they come on. One thread calls it; what it brings out, `in_use`, any
thread may read.
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
from slopewise.services.discovery.investigator import BY_ITSELF, Investigator
from slopewise.services.parameters.change import Moment
from slopewise.services.parameters.effects_group import EFFECTS
from slopewise.services.parameters.in_use import ParametersInUse, fingerprint
from slopewise.services.parameters.intake import Intake, columns_of
from slopewise.services.parameters.learner import NOT_LEARNED, Learner
from slopewise.services.parameters.log import Last, ParameterLog
from slopewise.services.parameters.past import ParameterPast
from slopewise.services.parameters.store import StoreError
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.observations import DriveSamples, ObservationAck, RobotObservation
from slopewise.services.wire.recent_warnings import RecentWarnings

_log = logging.getLogger("slopewise")

TAKEN, IGNORED, REFUSED = "taken", "ignored", "refused"
_FLAGGED_FOR = 600.0


class ParameterService:
    """Learns, keeps, and says what is planned with.

    Attributes:
        in_use: parameters to plan with. changed: groups that nobody was told of yet.
        learner: groups and what they learn. counters: of observations.
        investigator: stops that are kept, and looks for what the model leaves out of them.
        refused: id of the offer that was last refused to be adopted, and why.
        notices: messages that could not be treated.
    """

    def __init__(
        self,
        config: ServiceConfig,
        prior: Model,
        names_surfaces: Callable[[], bool] = bool,
        apply: Callable[[ParametersInUse], None] = lambda _: None,
        on_the_map: Callable[[], Collection[str]] = tuple,
    ) -> None:
        """Begin with the model file, and what was learned on top of it before.

        Args:
            config: settings.
            prior: model of the model file.
            names_surfaces: whether the map in use tells surfaces apart.
            apply: called with what is to be planned with, each time that changes.
            on_the_map: names of the surfaces that the map tells apart.
        """
        settings = config.learning
        self._config, self._settings, self._file = config, settings, prior
        self._apply = apply
        self.learner = Learner(prior, settings, names_surfaces, on_the_map)
        self._log = ParameterLog(config.store, fingerprint(prior))
        self._past = ParameterPast(self.learner, self._log, settings.oldest)
        self.investigator = Investigator(config.discrepancy, fingerprint(prior))
        self._missing: dict[str, str] = dict.fromkeys(settings.estimators, "is not alive")
        self._faults: list[str] = []
        self.notices = RecentWarnings()
        self._looked = -math.inf
        self.counters: Counter[str] = Counter()
        self.changed: set[str] = set()
        self.refused = ("", "")
        self._intake = Intake(settings.early, self._log.seen())
        self.in_use = ParametersInUse(prior)
        self._restore(set())
        self._bring()
        self.changed = set(self.learner.names())

    # ------------------------------------------------------------------ observations

    def observe(self, kind: str, one: RobotObservation, key: str, arrived: float) -> ObservationAck:
        """Learn from an observation, and keep what it led to.

        Args:
            kind: `stop`, `drive` or `terrain`. one: as it was decoded. key: it came on, for errors.
            arrived: monotonic clock at its arrival [s].
        """
        reason = self._intake.judge(kind, one, arrived)
        if reason:
            self.counters[f"{kind}_{reason}"] += 1
            ignored = reason in ("duplicate", "out_of_order")
            return self._receipt(IGNORED if ignored else REFUSED, reason.replace("_", " "))
        try:
            if isinstance(one, DriveSamples) and self._config.discrepancy.samples:
                self._keep(one, key)
            changes, reason = self.learner.learn(one, key, arrived)
        except (InputError, ParameterError) as error:
            self.counters[f"{kind}_refused"] += 1
            return self._receipt(REFUSED, str(error))
        seen = self._intake.heard(kind, one)
        if reason.startswith(NOT_LEARNED) and not changes:
            # Nothing of it is worth a disk's time, whoever sends how many.
            self.counters[f"{kind}_refused"] += 1
            return self._receipt(REFUSED, reason)
        self.counters[f"{kind}_taken"] += 1
        if changes or kind == "stop":
            cause = f"{kind} {one.sequence}: {reason}"
            self._commit(changes, cause, one.source, seen=seen)
        return self._receipt(TAKEN, reason)

    def _keep(self, one: DriveSamples, key: str) -> None:
        surface = one.surface or self.learner.ground.surface(time.monotonic())
        base = self.learner.base
        model = hashlib.sha256(repr((base.braking, base.effect)).encode()).hexdigest()[:12]
        self.investigator.hear(one.source, columns_of(one, key), surface, model)

    def _receipt(self, status: str, reason: str) -> ObservationAck:
        return ObservationAck(
            status=status, reason=reason, version=self._log.version, durable=self._log.durable
        )

    # ------------------------------------------------------------------ operators

    def set_values(self, group: str, values: Mapping[str, float], who: str) -> None:
        """An operator's values.

        Raises:
            ParameterError: says what was expected.
        """
        for name, value in values.items():
            if not math.isfinite(value):
                raise ParameterError(name, f"a finite number, got {value}")
        self.learner.group(group).set(group, values)
        words = ", ".join(f"{name} = {value:g}" for name, value in values.items())
        self._commit({group}, f"set {words}", who, learned=False)

    def roll_back(self, version: int, group: str, who: str) -> None:
        """Back to how one group, or all without a name, was at a version.

        Raises:
            ParameterError: there is no such version, or what it was cannot be used.
            StoreError: the history cannot be read.
        """
        groups, moments = self._past.go_back(version, group)
        self.refused = ("", "")
        cause = f"rolled back to version {version}"
        self._commit(groups, cause, who, learned=False, moments=moments)
        self.changed |= set(self.learner.names())

    def adopt(self, offer: str, who: str, *, faster: bool = False) -> None:
        """Plan with the finding that is offered.

        Args:
            offer: its id. who: the operator. faster: stops may become shorter than by the file.

        Raises:
            ParameterError: says what was expected.
        """
        try:
            words = self.learner.effects.adopt(offer, faster=faster)
        except ParameterError as error:
            self.refused = (offer, str(error))
            raise
        self.refused = ("", "")
        self._commit({EFFECTS}, f"adopted {offer}, {words}", who, learned=False)
        # What is learned of braking counts on top of another model from now on.
        self.changed |= set(self.learner.names())

    # ------------------------------------------------------------------ findings

    def investigate(self, who: str) -> None:
        """Begin to hold the stored stops against the model.

        Raises:
            ParameterError: says why that is not possible now.
        """
        self.investigator.begin(self._file, self.learner.base, self.in_use.model, who)

    def _look(self) -> None:
        """Begin what is due, and offer what was found."""
        if self.investigator.due():
            try:
                self.investigate(BY_ITSELF)
            except ParameterError as error:
                self.counters["looks_failed"] += 1
                _log.warning("%s", error)
        outcome = self.investigator.poll()
        if outcome is None or outcome.offer is None:
            return
        offer = outcome.offer
        self.learner.effects.offered(offer)
        self.refused = ("", "")
        self._commit({EFFECTS}, f"offered {offer.id}, {offer.text()}", offer.cause)
        allowed = self._config.discrepancy.adopt_slower
        if allowed and offer.changes and offer.valid and offer.slower_than_now:
            try:
                self.adopt(offer.id, "service, as the settings allow")
            except ParameterError as error:
                self.counters["changes_refused"] += 1
                _log.warning("%s", error)

    # ------------------------------------------------------------------ time, estimators

    def alive(self, estimator: str, *, is_alive: bool) -> None:
        """An estimator that has to be there came or went."""
        if estimator not in self._settings.estimators:
            return
        if is_alive:
            self._missing.pop(estimator, None)
        else:
            self._missing[estimator] = "is not alive"
            self.counters["estimators_lost"] += 1
        self._bring()

    def note_fault(self, what: str) -> None:
        """Flag for a while a fault with one message; plans are not touched."""
        self.notices.add(f"{what} could not be treated: fault of the service, see its log")
        self._flag()

    def fault(self, what: str) -> None:
        """Something of the service itself broke: from now on plans are slower."""
        if what not in self._faults:
            self._faults.append(what)
        self._bring()

    def tick(self) -> None:
        """What time brings: age, labels that expire, another attempt to write."""
        now = time.monotonic()
        self._look()
        if self._log.retry():
            self._intake.heard_before(self._log.seen())
            self._restore(self._log.unsaved)
            self._past.give_back()
            self.changed = set(self.learner.names())
            self._bring()
        changed = self.learner.on_surface(now)
        if changed:
            self._commit(changed, "the ground's label expired", "service")
        if now - self._looked >= self._settings.refresh:
            self._looked = now
            self.learner.age()
            self._bring()
        else:
            self._flag()

    def degraded(self) -> list[str]:
        """Why plans are slower than they need be."""
        missing = [f"estimator {name} {what}" for name, what in sorted(self._missing.items())]
        return [*missing, *self._faults]

    def told(self) -> Counter[str]:
        """Counters for the status."""
        learner = self.learner
        learned = {
            "stops": learner.stop_count,
            "stops_implausible": learner.implausible,
            "stops_contradictory": learner.contradictory,
            "stops_too_many": learner.too_many,
        }
        return self.counters + Counter(learned) + self.investigator.told()

    def flags(self) -> list[str]:
        """What is not as it should be, the reasons of the degraded mode first."""
        flags = [f"degraded: {reason}" for reason in self.degraded()]
        late = time.monotonic() - _FLAGGED_FOR
        set_ = [name for name, noticed in self._intake.jumped.items() if noticed > late]
        flags += [f"the clock of {name} was set" for name in set_]
        flags += [*self._intake.notices.active(), *self.notices.active()]
        flags += [words for words in (self.learner.unable, self.learner.ground.unable) if words]
        flags += [*self.learner.flags(), *self.learner.effects.flags()]
        return [*flags, *self.investigator.flags(), *self._log.flags(), *self._past.flags()]

    # ------------------------------------------------------------------ bringing out

    @property
    def log(self) -> ParameterLog:
        """Versions and history."""
        return self._log

    def close(self) -> None:
        """End what is going on, and let the store go."""
        self.investigator.close()
        self._log.close()

    def _commit(
        self,
        groups: set[str],
        cause: str,
        who: str,
        *,
        seen: dict[str, int] | None = None,
        learned: bool = True,
        moments: Mapping[str, Moment] | None = None,
    ) -> None:
        if groups:
            states = {name: self.learner.group(name).state(name) for name in sorted(groups)}
            # Slower plans do not wait for the disk.
            self._bring(self._log.version + 1)
            self._log.commit(states, cause, who, seen=seen, learned=learned, moments=moments)
            self.changed |= groups
        self._flag()

    def _flag(self) -> None:
        """Tell what is not as it should be; the model is the same, and so are plans."""
        flags, version = tuple(self.flags()), self._log.version
        if (flags, version) != (self.in_use.flags, self.in_use.version):
            self.in_use = self.in_use.flagged(flags, version)
            self._apply(self.in_use)

    def _bring(self, version: int | None = None) -> None:
        model, age, oldest = self.learner.in_use()
        if self.degraded():
            speed = min(model.limits.speed, self._settings.degraded_speed)
            limits = dataclasses.replace(model.limits, speed=speed)
            model = dataclasses.replace(model, limits=limits)
        uncertainty = dataclasses.replace(self._config.planning.uncertainty(), age=age)
        self.in_use = ParametersInUse(
            model=model,
            version=self._log.version if version is None else version,
            at=time.monotonic() - oldest,
            serial=self.in_use.serial + 1,
            uncertainty=uncertainty,
            flags=tuple(self.flags()),
        )
        self._apply(self.in_use)

    def _restore(self, done: set[str]) -> None:
        try:
            held = self._past.restore(done)
        except StoreError as error:
            held = {}
            if self._config.store.path:
                _log.warning("%s", error)
        for cause in sorted(set(held.values())):
            groups = {group for group, reason in held.items() if reason == cause}
            if self._log.is_open:
                self._commit(groups, cause, "service", moments=self._past.moments(groups))
            else:
                # It is no change: what the store holds is applied once it can be opened.
                last = Last(self._log.version, cause, "service")
                self._log.last.update(dict.fromkeys(groups, last))
