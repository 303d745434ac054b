"""Parameters of a vehicle at one moment, replaced whole or not at all.

Stops and samples update the estimators of a state. Anything that replaces them (an adopted
finding, a state from the store, a roll back) makes a new state from copies, so that an error
leaves the one before unchanged.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.parameters.braking_groups import BASE, BrakingGroups, surface_of
from slopewise.services.parameters.effects_group import EFFECTS, EffectsGroup
from slopewise.services.parameters.group_registry import GROUPS
from slopewise.services.parameters.parameter_group import ParameterGroups, State
from slopewise.services.parameters.stop_checks import counts_twice, unsupported_reason
from slopewise.services.settings.learning_settings import Learning
from slopewise.services.wire.model_proposal import ModelProposal


@dataclass(frozen=True, slots=True)
class LearnerState:
    """Everything learned, set and adopted."""

    settings: Learning
    map_surfaces: Callable[[], Collection[str]]
    basis: Model  # model that braking is learned on top of, of the file or an adopted finding
    unsupported_reason: str  # why braking is not learned on it; empty if it is
    # proposal and adopted finding, with the base force that is parked meanwhile
    effects: EffectsGroup
    braking: BrakingGroups  # force by surface
    registered: tuple[ParameterGroups, ...]  # groups of the registry

    @classmethod
    def of_file(
        cls, file: Model, settings: Learning, map_surfaces: Callable[[], Collection[str]]
    ) -> LearnerState:
        """State of a vehicle that has learned nothing."""
        return cls(
            settings,
            map_surfaces,
            basis=file,
            unsupported_reason=_unsupported(file, settings, "the model file"),
            effects=EffectsGroup(file),
            braking=BrakingGroups(file, settings, map_surfaces),
            registered=tuple(maker(file, settings) for maker in GROUPS),
        )

    # ------------------------------------------------------------------ groups

    def kinds(self) -> tuple[ParameterGroups, ...]:
        """All kinds of groups, in the order of their messages."""
        return self.braking, *self.registered, self.effects

    def names(self) -> list[str]:
        """All groups."""
        return [name for kind in self.kinds() for name in kind.names()]

    def group(self, name: str) -> ParameterGroups:
        """The kind that a group is of, even while the group is empty."""
        for kind in self.kinds():
            if kind.owns(name):
                return kind
        raise ParameterError("group", f"one of {', '.join(self.names())}, got {name[:80]}")

    def may_restore(self, name: str) -> bool:
        """Return True if a stored state of a group is still used."""
        if any(kind.of_operators and kind.owns(name) for kind in self.kinds()):
            return True
        if not self.settings.enabled:
            return False
        if not (name.startswith(BASE) and self.unsupported_reason):
            return True
        # Stops of the base are part of an adopted finding already; those of other ground are not.
        is_finding = self.basis is not self.effects.file
        return is_finding and name != BASE and not counts_twice(self.basis)

    # ------------------------------------------------------------------ changes

    def propose(self, proposal: ModelProposal) -> LearnerState:
        """With another proposal; plans are the same."""
        return replace(self, effects=replace(self.effects, proposal=proposal))

    def adopt(self, proposal_id: str, *, faster: bool) -> LearnerState:
        """Plan and learn on top of the proposed finding, see :meth:`EffectsGroup.adopt`."""
        return self._on_basis(self.effects.adopt(proposal_id, faster=faster))

    def load(self, states: Mapping[str, tuple[State | None, float]]) -> LearnerState:
        """With groups as in stored states; findings are loaded first, braking on top of them.

        ``states``: state and age [s] by group; a state that may not be used counts as None.
        """
        after = self
        if EFFECTS in states:
            effects = self.effects.load(*states[EFFECTS])
            is_other = (effects.tables, effects.may_be_faster) != (
                self.effects.tables,
                self.effects.may_be_faster,
            )
            after = self._on_basis(effects) if is_other else replace(self, effects=effects)
        after = replace(
            after, braking=after.braking.copy(), registered=tuple(map(copy.copy, after.registered))
        )
        for name in sorted(states.keys() - {EFFECTS}):
            state, age = states[name]
            usable = state if after.may_restore(name) else None
            after.group(name).restore(name, usable, age)
        return after

    def _on_basis(self, effects: EffectsGroup) -> LearnerState:
        """Learn on top of another finding, or of the model file again.

        Learned force is used below the finding from now on. Where braking cannot be learned on it,
        the force of the base is parked: the finding is made of the same stops.
        """
        reverts = effects.tables is None
        basis = effects.model()
        owner = "the model file" if reverts else "the adopted finding"
        reason = _unsupported(basis, self.settings, owner)
        known = self.braking
        states = ((name, known.state(name)) for name in known.names())
        learned = {name: state for name, state in states if state is not None}
        surfaces = sorted(set(learned) - {BASE})
        if surfaces and not reverts and counts_twice(basis):
            expected = "no learned surfaces next to effects that add force"
            got = f"{', '.join(surfaces)}, whose force they would include twice"
            raise ParameterError("effects", f"{expected}, got {got}")
        parked = None if reverts or not reason else learned.pop(BASE, None)
        if reverts and effects.parked is not None and BASE not in learned and not reason:
            learned[BASE] = effects.parked
        ages = known.forces.ages(time.monotonic())
        braking = BrakingGroups(basis, self.settings, self.map_surfaces)
        for name, state in learned.items():
            braking.restore(name, state, ages.get(surface_of(name), self.settings.oldest))
        effects = replace(effects, parked=None if reverts else parked or effects.parked)
        return replace(
            self, basis=basis, unsupported_reason=reason, effects=effects, braking=braking
        )


def _unsupported(basis: Model, settings: Learning, owner: str) -> str:
    if not settings.enabled:
        return "nothing is learned: it is off"
    return unsupported_reason(basis, owner)
