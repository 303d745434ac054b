"""The parameters in use: learned from observations, set by operators, kept, restored, grown older.

Knows nothing of the wire they come on. One thread calls it; what it brings out, `in_use`, any
thread may read.
"""

from __future__ import annotations

import dataclasses
import logging
import math
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping

from models import braking
from models.calibration.stream import StopStream, StreamedStop
from models.errors import InputError, ParameterError
from models.parameters import Model
from models.quantity import GRAVITY
from planner.uncertainty import Uncertainty
from services.braking_groups import BASE, BrakingGroups
from services.change import Moment
from services.config import ServiceConfig
from services.ground_now import GroundNow, monitor_maker
from services.intake import Intake, columns_of
from services.learnable import Stop, unable
from services.limits_group import LIMITS, LimitsGroup
from services.observations import DriveSamples, Observation, Receipt, StopObservation, TerrainLabel
from services.parameter_group import ParameterGroups
from services.parameter_log import Last, ParameterLog
from services.parameters_in_use import ParametersInUse, fingerprint
from services.store import StoreError
from services.terrain_group import TERRAIN, TerrainGroup

_log = logging.getLogger("slopewise")

TAKEN, IGNORED, REFUSED = "taken", "ignored", "refused"
_MOST_STREAMS = 8
_MOST_STOPS = 200


class ParameterService:
    """Learns, keeps, and says what is planned with.

    Attributes:
        in_use: parameters to plan with. changed: groups that nobody was told of yet.
        counters: of observations. stops: the last ones, beside what was predicted.
    """

    def __init__(
        self, config: ServiceConfig, prior: Model, names_surfaces: Callable[[], bool] = bool,
        apply: Callable[[ParametersInUse], None] = lambda _: None,
    ) -> None:  # fmt: skip
        """Begin with the model file, and what was learned on top of it before.

        Args:
            config: settings.
            prior: model of the model file.
            names_surfaces: whether the map in use tells surfaces apart.
            apply: called with what is to be planned with, each time that changes.
        """
        settings = config.learning
        self._config, self._settings, self._prior = config, settings, prior
        self._names_surfaces, self._apply = names_surfaces, apply
        self._braking = BrakingGroups(prior, settings)
        self._terrain = TerrainGroup(prior, settings)
        self._limits = LimitsGroup(prior)
        self.ground = GroundNow(
            prior, monitor_maker(settings.terrains), settings.label_for, settings.sure
        )
        self._log = ParameterLog(config.store, fingerprint(prior))
        self._streams: dict[str, StopStream] = {}
        self._unable = unable(prior) if settings.enabled else "nothing is learned: it is off"
        self._missing: dict[str, str] = dict.fromkeys(settings.estimators, "is not alive")
        self._faults: list[str] = []
        self._last_surface = ""
        self._looked = -math.inf
        self.counters: Counter[str] = Counter()
        self.stops: deque[Stop] = deque(maxlen=_MOST_STOPS)
        self.changed: set[str] = set()
        self._intake = Intake(settings.early, self._log.seen())
        self.in_use = ParametersInUse(prior)
        self._restore(set())
        self._bring()
        self.changed = set(self.names())

    # ------------------------------------------------------------------ observations

    def observe(self, kind: str, one: Observation, key: str, arrived: float) -> Receipt:
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
            changes, reason = self._learn(one, key)
        except (InputError, ParameterError) as error:
            self.counters[f"{kind}_refused"] += 1
            return self._receipt(REFUSED, str(error))
        self.counters[f"{kind}_taken"] += 1
        seen = self._intake.heard(kind, one)
        if changes or kind == "stop":
            cause = f"{kind} {one.sequence}: {reason}"
            self._commit(changes, cause, one.source, seen=seen)
        return self._receipt(TAKEN, reason)

    def _receipt(self, status: str, reason: str) -> Receipt:
        return Receipt(
            status=status, reason=reason, version=self._log.version, durable=self._log.durable
        )

    def _learn(self, one: Observation, key: str) -> tuple[set[str], str]:
        """Groups that changed, and what became of it."""
        now = time.monotonic()
        if not self._settings.enabled:
            return set(), self._unable
        if isinstance(one, TerrainLabel):
            self.ground.label(one, now)
            return self._on_surface(now), f"ground is {one.surface}"
        if isinstance(one, DriveSamples):
            return self._drive(one, key, now)
        assert isinstance(one, StopObservation)
        force = float(braking.force_ratio_of_deceleration(one.deceleration, one.grade))
        dead_time = math.nan if one.dead_time is None else one.dead_time
        stop = StreamedStop(
            now, one.speed, one.grade, force, one.deceleration_std / GRAVITY, dead_time
        )
        changed = self._on_surface(now)
        return self._stop(stop, one.surface or self.ground.surface(now), one, one.distance, changed)

    def _drive(self, one: DriveSamples, key: str, now: float) -> tuple[set[str], str]:
        columns = columns_of(one, key)
        told = self.ground.drive(one.source, columns)
        changed: set[str] = set()
        if told.changed:
            changed |= {TERRAIN} if self._terrain.ground_changed() else set()
            if self._braking.ground_changed("", self._last_surface):
                changed.add(BASE)
        if told.features is not None and self._terrain.take(told.features):
            changed.add(TERRAIN)
        changed |= self._on_surface(now)
        reason = "the ground changed" if told.changed else "samples"
        stream = self._stream(one.source)
        size = columns["t"].size
        grade = columns["grade"].tolist() if "grade" in columns else [math.nan] * size
        rows = [columns[name].tolist() for name in ("t", "v", "v_cmd", "pitch")]
        surface = one.surface or self.ground.surface(now)
        for *row, slope in zip(*rows, grade, strict=True):
            stop = stream.feed(*row, slope)
            if stop is not None:
                changed, reason = self._stop(stop, surface, one, None, changed)
        return changed, reason

    def _stream(self, source: str) -> StopStream:
        stream = self._streams.pop(source, None)
        if stream is None:
            s = self._settings
            stream = StopStream(self._prior.braking.dead_time, mount=s.mount, dive=s.dive)
        self._streams[source] = stream
        while len(self._streams) > _MOST_STREAMS:
            self._streams.pop(next(iter(self._streams)))
        return stream

    def _stop(
        self, stop: StreamedStop, surface: str, one: Observation, distance: float | None,
        changed: set[str],
    ) -> tuple[set[str], str]:  # fmt: skip
        if self._unable:
            return changed, self._unable
        done = self._braking.take(stop, surface, one.source, distance)
        self.stops.append(dataclasses.replace(done, version=self._log.version))
        self.counters["stops"] += 1
        changed = changed | {f"{BASE}.{surface}" if surface else BASE}
        # Where the map names no surfaces, the base stands for the ground there is.
        if surface and not self._names_surfaces():
            self._braking.take(stop, "", one.source, distance)
            changed.add(BASE)
        return changed, done.outcome

    def _on_surface(self, now: float) -> set[str]:
        """Groups that change because the robot came onto other ground."""
        surface, before = self.ground.surface(now), self._last_surface
        if surface == before:
            return set()
        self._last_surface = surface
        if self._unable or not self._braking.ground_changed(surface, before):
            return set()
        return {BASE}

    # ------------------------------------------------------------------ operators

    def set(self, group: str, values: Mapping[str, float], who: str) -> None:
        """An operator's values.

        Raises:
            ParameterError: says what was expected.
        """
        if not all(math.isfinite(value) for value in values.values()):
            raise ParameterError("values", "finite numbers")
        self._groups(group).set(group, values)
        words = ", ".join(f"{name} = {value:g}" for name, value in values.items())
        self._commit({group}, f"set {words}", who, learned=False)

    def roll_back(self, version: int, group: str, who: str) -> None:
        """Back to how one group, or all without a name, was at a version.

        Raises:
            ParameterError: there is no such version, or what it was cannot be used.
            StoreError: the history cannot be read.
        """
        if group:
            self._groups(group)
        if not self._log.knows(version):
            raise ParameterError("version", f"one of the history, got {version}")
        groups = {group} if group else set(self.names())
        found: dict[str, tuple[dict | None, Moment]] = {}
        for change, state in self._log.newest(version):
            if change.group in groups and change.group not in found:
                found[change.group] = state, change.moment
        before = {name: self._groups(name).state(name) for name in groups | found.keys()}
        now = Moment.now()
        try:
            for name in before:
                state, moment = found.get(name, (None, now))
                age = moment.age(now, self._settings.oldest)
                self._groups(name).restore(name, state, age)
        except (ValueError, KeyError, TypeError) as error:
            for name, state in before.items():
                self._groups(name).restore(name, state, 0.0)
            raise ParameterError("version", f"one that can be used: {error}") from None
        moments = {name: moment for name, (_, moment) in found.items()}
        cause = f"rolled back to version {version}"
        self._commit(set(before), cause, who, learned=False, moments=moments)

    def _groups(self, group: str) -> ParameterGroups:
        """Who looks after a group."""
        if group == TERRAIN:
            return self._terrain
        if group == LIMITS:
            return self._limits
        if group == BASE or group.startswith(f"{BASE}."):
            return self._braking
        raise ParameterError("group", f"one of {', '.join(self.names())}, got {group[:80]}")

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

    def fault(self, what: str) -> None:
        """Something of the service itself broke: from now on plans are slower."""
        if what not in self._faults:
            self._faults.append(what)
        self._bring()

    def tick(self) -> None:
        """What time brings: age, labels that expire, another attempt to write."""
        now = time.monotonic()
        if self._log.retry():
            self._intake.heard_before(self._log.seen())
            self._restore(self._log.unsaved)
            self.changed = set(self.names())
            self._bring()
        changed = self._on_surface(now)
        if changed:
            self._commit(changed, "the ground's label expired", "service")
        if now - self._looked >= self._settings.refresh:
            self._looked = now
            self._braking.age()
            self._bring()

    def degraded(self) -> list[str]:
        """Why plans are slower than they need be."""
        missing = [f"estimator {name} {what}" for name, what in sorted(self._missing.items())]
        return [*missing, *self._faults]

    def flags(self) -> list[str]:
        """What is not as it should be, the reasons of the degraded mode first."""
        flags = [f"degraded: {reason}" for reason in self.degraded()]
        flags += [f"the clock of {name} was set" for name in self._intake.jumped]
        flags += [words for words in (self._unable, self.ground.unable) if words]
        return flags + self._log.flags()

    # ------------------------------------------------------------------ bringing out

    def names(self) -> list[str]:
        """All groups."""
        return [*self._braking.names(), *self._terrain.names(), *self._limits.names()]

    @property
    def log(self) -> ParameterLog:
        """Versions and history."""
        return self._log

    def groups_of(self, group: str) -> ParameterGroups:
        """Who can describe a group; ParameterError if there is none of that name."""
        if group not in self.names():
            raise ParameterError("group", f"one of {', '.join(self.names())}, got {group[:80]}")
        return self._groups(group)

    def close(self) -> None:
        """Let the store go."""
        self._log.close()

    def _commit(
        self, groups: set[str], cause: str, who: str, *, seen: dict[str, int] | None = None,
        learned: bool = True, moments: Mapping[str, Moment] | None = None,
    ) -> None:  # fmt: skip
        if groups:
            states = {name: self._groups(name).state(name) for name in sorted(groups)}
            # Slower plans do not wait for the disk.
            self._bring(self._log.version + 1)
            self._log.commit(states, cause, who, seen=seen, learned=learned, moments=moments)
            self.changed |= groups
        self._bring()

    def _bring(self, version: int | None = None) -> None:
        now = time.monotonic()
        ages = self._braking.ages(now)
        # All surfaces share the least age; what others are older is scatter of their own.
        least = min(ages.values()) if len(ages) == len(self._braking.names()) else 0.0
        own = {name: age - least for name, age in ages.items()}
        limits = self._limits.in_use()
        if self.degraded():
            speed = min(limits.speed, self._settings.degraded_speed)
            limits = dataclasses.replace(limits, speed=speed)
        model = dataclasses.replace(
            self._prior, braking=self._braking.in_use(own), terrain=self._terrain.in_use(),
            limits=limits,
        )  # fmt: skip
        uncertainty: Uncertainty = self._config.planning.uncertainty()
        self.in_use = ParametersInUse(
            model=model,
            version=self._log.version if version is None else version,
            at=now - max(ages.values(), default=0.0),
            serial=self.in_use.serial + 1,
            uncertainty=dataclasses.replace(uncertainty, age=least),
            flags=tuple(self.flags()),
        )
        self._apply(self.in_use)

    def _restore(self, done: set[str]) -> None:
        """Take up the newest state that can be used of each group that is not done."""
        skipped: set[str] = set()
        now = Moment.now()
        try:
            for change, state in self._log.newest():
                group = change.group
                if group in done or not self._may_restore(group):
                    continue
                try:
                    age = change.moment.age(now, self._settings.oldest)
                    self._groups(group).restore(group, state, age)
                except (ValueError, KeyError, TypeError) as error:
                    _log.warning("%s of version %d: %s", group, change.version, error)
                    skipped.add(group)
                    continue
                done = done | {group}
                self._log.last[group] = Last(change.version, change.cause, change.who)
        except StoreError as error:
            if self._config.store.path:
                _log.warning("%s", error)
        if skipped:
            words = "stored parameters could not be used, older ones are"
            self._log.notes.append(f"{words}: {', '.join(sorted(skipped))}")

    def _may_restore(self, group: str) -> bool:
        return group == LIMITS or (
            self._settings.enabled and not (group.startswith(BASE) and self._unable)
        )
