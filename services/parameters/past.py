"""Groups of parameters as they were: after a restart, or at a version somebody goes back to."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from typing import Any

from models.errors import ParameterError
from services.parameters.change import Moment
from services.parameters.effects_group import EFFECTS
from services.parameters.learner import Learner
from services.parameters.log import Last, ParameterLog

_log = logging.getLogger("slopewise")


class ParameterPast:
    """Puts states of the log back into the learner."""

    def __init__(self, learner: Learner, log: ParameterLog, oldest: float) -> None:
        """Restore into ``learner`` from ``log``; nothing counts as older than ``oldest`` [s]."""
        self._learner, self._log, self._oldest = learner, log, oldest

    def take_up(self, done: set[str]) -> None:
        """The newest state that can be used of each group that is not done.

        Raises:
            StoreError: the store cannot be read.
        """
        groups = [g for g in _findings_first(self._log.groups()) if g not in done]
        old = [g for g in groups if self._learner.may_restore(g) and not self._take_up_one(g)]
        if old:
            words = "stored parameters could not be used, older ones are"
            self._log.notes.append(f"{words}: {', '.join(old)}")

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
            return newest
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
