"""Restores groups of parameters after a restart, and rolls them back to a version."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable

from slopewise.models.errors import ParameterError
from slopewise.services.parameters.braking_forces import MAX_LISTED
from slopewise.services.parameters.braking_groups import BASE
from slopewise.services.parameters.effects_group import EFFECTS
from slopewise.services.parameters.learner import Learner
from slopewise.services.parameters.parameter_group import State
from slopewise.services.parameters.parameter_history import LastChange, Memory, ParameterHistory
from slopewise.services.parameters.store import BootTime, StoreError

_log = logging.getLogger("slopewise")

HELD = "the newest state may be missing"
LOST = "what was learned is lost"
"""Causes of changes that only make plans more careful; stored, and compared after a restart."""

_EFFECTS = {
    HELD: "no faster than by the model file until stops arrive",
    LOST: "the share of the model file that is used on unknown ground, until stops arrive",
}


class ParameterRestorer:
    """Restores stored states into a learner; nothing is older than ``oldest`` [s]."""

    def __init__(self, learner: Learner, history: ParameterHistory, oldest: float) -> None:
        self._learner, self._history, self._oldest = learner, history, oldest

    def restore_newest(self, done: Collection[str]) -> dict[str, str]:
        """Restore the newest usable state of each group, except of groups that are done.

        Returns groups that plans use more carefully than they were stored, with the cause.
        """
        careful: dict[str, str] = {}
        memory, outdated = self._history.memory, list[str]()
        try:
            outdated = self._restore_groups(done)
        except StoreError:
            if memory is Memory.STORE:
                raise
        if memory is Memory.COPY or outdated:
            kinds = self._learner.state.kinds()
            careful = {name: HELD for kind in kinds for name in kind.restrict_to_file()}
        is_lost = memory is Memory.LOST or any(group.startswith(BASE) for group in outdated)
        if is_lost and not self._learner.state.unsupported_reason:
            careful |= dict.fromkeys(self._learner.state.braking.assume_untrained(), LOST)
        return careful

    def _restore_groups(self, done: Collection[str]) -> list[str]:
        """Groups of which the newest state could not be used; an older one is, or none."""
        # Braking is learned on top of an adopted finding.
        groups = sorted(self._history.groups(), key=lambda name: (name != EFFECTS, name))
        outdated = [
            g
            for g in groups
            if g not in done and self._learner.state.may_restore(g) and not self._restore_group(g)
        ]
        if outdated:
            note = "stored parameters could not be used, older ones are"
            self._history.notes.append(f"{note}: {', '.join(outdated)}")
        return outdated

    def _restore_group(self, group: str) -> bool:
        """Restore the newest state that can be used; True if that is the newest of all."""
        now, is_newest = BootTime.now(), True
        for change, state in self._history.newest(group):
            try:
                age = change.moment.age(now, self._oldest)
                self._learner.state = self._learner.state.load({group: (state, age)})
            except (ValueError, KeyError, TypeError) as error:
                _log.warning("%s of version %d: %s", group, change.version, error)
                is_newest = False
                continue
            self._history.last[group] = LastChange(change.version, change.cause, change.who)
            return is_newest and group not in self._history.damaged
        return False

    def forget_assumed(self) -> None:
        """Forget groups that counted as lost until the store was opened, and are not in it."""
        stored = self._history.groups()
        for group, last in [*self._history.last.items()]:
            if last.cause == LOST and group not in stored:
                self._learner.state = self._learner.state.load({group: (None, 0.0)})
                del self._history.last[group]

    def roll_back(self, version: int, group: str) -> dict[str, BootTime]:
        """Restore one group, or all without a name, to a version, or change nothing.

        Returns the groups that were restored, and the times at which their states were learned.
        """
        state, now = self._learner.state, BootTime.now()
        if group:
            state.group(group)
        if not self._history.knows(version):
            raise ParameterError("version", f"one of the history, got {version}")
        moments = dict.fromkeys([group] if group else state.names(), now)
        states: dict[str, tuple[State | None, float]] = dict.fromkeys(moments, (None, 0.0))
        for name in self._history.groups():
            if not group or name == group:
                change, stored = next(self._history.newest(name, version), (None, None))
                moments[name] = now if change is None else change.moment
                states[name] = stored, moments[name].age(now, self._oldest)
        try:
            self._learner.state = state.load(states)
        except (ValueError, KeyError, TypeError) as error:
            raise ParameterError("version", f"one that can be used: {error}") from None
        return moments

    def moments(self, groups: Iterable[str]) -> dict[str, BootTime]:
        """Times at which the present parameters of groups were learned."""
        now, state = BootTime.now(), self._learner.state
        return {g: now.earlier(state.group(g).describe(g).age) for g in groups}

    def flags(self) -> list[str]:
        """Warnings of groups that are used more carefully, until something new is learned."""
        flags = []
        for cause, effect in _EFFECTS.items():
            groups = [group for group, last in self._history.last.items() if last.cause == cause]
            flags += [f"{', '.join(groups[:MAX_LISTED])}: {cause}: {effect}"] if groups else []
        return flags
