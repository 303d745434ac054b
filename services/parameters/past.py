"""Groups of parameters as they were: after a restart, or at a version somebody goes back to."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from typing import Any

from slopewise.models.errors import ParameterError
from slopewise.services.parameters.braking_groups import BASE
from slopewise.services.parameters.change import Moment
from slopewise.services.parameters.effects_group import EFFECTS
from slopewise.services.parameters.learner import Learner
from slopewise.services.parameters.log import Last, Memory, ParameterLog
from slopewise.services.parameters.store import StoreError

_log = logging.getLogger("slopewise")

HELD = "the newest state may be missing"
LOST = "what was learned is lost"
"""Causes of a change that only makes plans more careful."""

_HELD_EFFECT = "no faster than by the model file until stops arrive"
_LOST_EFFECT = "the share of the model file that counts on unknown ground, until stops arrive"
_MAX_LISTED = 5


class ParameterPast:
    """Puts states of the log back into the learner."""

    def __init__(self, learner: Learner, log: ParameterLog, oldest: float) -> None:
        """Restore into ``learner`` from ``log``; nothing counts as older than ``oldest`` [s]."""
        self._learner, self._log, self._oldest = learner, log, oldest

    def restore(self, done: set[str]) -> dict[str, str]:
        """Apply what is known from before, except of groups that are done.

        Returns:
            Groups that are planned with more carefully than they were kept, and why.

        Raises:
            StoreError: the store cannot be read.
        """
        held: dict[str, str] = {}
        memory, old = self._log.memory, []
        try:
            old = self.take_up(done)
        except StoreError:
            if memory is Memory.STORE:
                raise
        if memory is Memory.COPY or old:
            held |= dict.fromkeys(self._learner.distrust(), HELD)
        if memory is Memory.LOST or any(group.startswith(BASE) for group in old):
            held |= dict.fromkeys(self._learner.lose(), LOST)
        return held

    def give_back(self) -> None:
        """The store is there again: what counted as lost and is not in it was never learned."""
        stored = self._log.groups()
        for group in [g for g, last in self._log.last.items() if last.cause == LOST]:
            if group not in stored:
                self._learner.group(group).restore(group, None, 0.0)
                del self._log.last[group]

    def moments(self, groups: Iterable[str]) -> dict[str, Moment]:
        """Since when what groups hold now is."""
        now = Moment.now()
        return {g: now.earlier(self._learner.group(g).describe(g).age) for g in groups}

    def flags(self) -> list[str]:
        """Groups that are held back, as long as nothing new was learned of them."""
        flags = []
        for cause, what in ((HELD, _HELD_EFFECT), (LOST, _LOST_EFFECT)):
            groups = [group for group, last in self._log.last.items() if last.cause == cause]
            flags += [f"{', '.join(groups[:_MAX_LISTED])}: {cause}: {what}"] if groups else []
        return flags

    def take_up(self, done: set[str]) -> list[str]:
        """The newest state that can be used of each group that is not done.

        Returns:
            Groups of which the newest could not be used.

        Raises:
            StoreError: the store cannot be read.
        """
        groups = [g for g in _findings_first(self._log.groups()) if g not in done]
        old = [g for g in groups if self._learner.may_restore(g) and not self._take_up_one(g)]
        if old:
            words = "stored parameters could not be used, older ones are"
            self._log.notes.append(f"{words}: {', '.join(old)}")
        return old

    def _take_up_one(self, group: str) -> bool:
        """Whether the newest state of a group could be used; else an older one is, or none."""
        now, newest = Moment.now(), True
        for change, state in self._log.newest(group):
            try:
                age = change.moment.age(now, self._oldest)
                self._learner.group(group).restore(group, state, age)
            except (ValueError, KeyError, TypeError) as error:
                _log.warning("%s of version %d: %s", group, change.version, error)
                newest = False
                continue
            self._log.last[group] = Last(change.version, change.cause, change.who)
            return newest and group not in self._log.damaged
        return False

    def go_back(self, version: int, group: str) -> tuple[set[str], dict[str, Moment]]:
        """Restore one group, or all without a name, as they were at a version.

        Returns:
            Groups that were restored; since when what they hold now is.

        Raises:
            ParameterError: there is no such version, or what it was cannot be used; nothing
                changed then.
            StoreError: the history cannot be read.
        """
        learner, now = self._learner, Moment.now()
        if group:
            learner.group(group)
        if not self._log.knows(version):
            raise ParameterError("version", f"one of the history, got {version}")
        found: dict[str, tuple[dict[str, Any] | None, Moment]] = {}
        for name in self._log.groups():
            if not group or name == group:
                first = next(self._log.newest(name, version), None)
                found[name] = (None, now) if first is None else (first[1], first[0].moment)
        groups = {group} if group else set(learner.names())
        before = {name: learner.group(name).state(name) for name in groups | found.keys()}
        try:
            for name in _findings_first(before):
                state, moment = found.get(name, (None, now))
                usable = state if learner.may_restore(name) else None
                learner.group(name).restore(name, usable, moment.age(now, self._oldest))
        except (ValueError, KeyError, TypeError) as error:
            for name in _findings_first(before):
                learner.group(name).restore(name, before[name], 0.0)
            raise ParameterError("version", f"one that can be used: {error}") from None
        return set(before), {name: moment for name, (_, moment) in found.items()}


def _findings_first(groups: Iterable[str]) -> list[str]:
    """Groups in the order to restore them: braking is learned on top of an adopted finding."""
    return sorted(groups, key=lambda name: (name != EFFECTS, name))
