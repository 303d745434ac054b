"""The proposal that was found, and the finding that is adopted: a braking model with its effects.

Vehicle, terrain and limits stay those of the model file with any finding.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import msgspec

from slopewise.models.effects.registry import LAWS
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.discovery.model_comparison import cautious, model_of
from slopewise.services.parameters.parameter_group import GroupDescription, ParameterGroups, State
from slopewise.services.wire.model_proposal import ModelProposal

EFFECTS = "effects"


@dataclass(frozen=True, slots=True)
class EffectsGroup(ParameterGroups):
    """At most one proposal, and at most one finding in use; every change is a new one."""

    of_operators = True

    file: Model  # of the model file
    proposal: ModelProposal | None = None  # the last finding
    adopted: str = ""  # id of the finding in use
    tables: State | None = None  # its model; None: the model file's
    may_be_faster: bool = False  # an operator accepted stops shorter than by the model file
    parked: State | None = None  # base force learned on the file, while the finding contains it
    since: float = field(default_factory=lambda: time.monotonic())  # finding in use [s]

    def model(self) -> Model:
        """The model that braking is learned on top of."""
        if self.tables is None:
            return self.file
        finding = model_of(self.tables, self.file)
        return finding if self.may_be_faster else cautious(finding, self.file)

    def adopt(self, proposal_id: str, *, faster: bool) -> EffectsGroup:
        """With the proposed finding in use; stops may become shorter only if ``faster``."""
        offer = self.proposal
        if offer is None or offer.id != proposal_id:
            there = "none" if offer is None else offer.id
            raise ParameterError("offer", f"the one that there is, {there}, got {proposal_id}")
        if not offer.changes:
            raise ParameterError("offer", f"something to adopt, the finding is {offer.verdict}")
        if offer.id == self.adopted and faster == self.may_be_faster:
            raise ParameterError("offer", f"one that is not adopted yet, {offer.id} is")
        if not faster and not offer.slower:
            by = offer.beside_file
            expected = f"`faster` to be set: stops {-by.least:.2f} m shorter at {by.where}"
            raise ParameterError("faster", expected)
        if faster and not offer.valid:
            expected = "a valid finding, as only those may make plans faster"
            raise ParameterError("offer", f"{expected}, got {offer.verdict} without a closed gap")
        adopted, since = offer.id, time.monotonic()
        return replace(self, tables=offer.model, may_be_faster=faster, adopted=adopted, since=since)

    def load(self, state: State | None, age: float) -> EffectsGroup:
        """As a state of ``age`` seconds ago; a parked force is retained while it fits."""
        proposal, adopted = self.read(state)
        tables, faster, parked = None, False, None
        if state is not None:
            tables, faster = state["model"], bool(state["faster"])
            is_same = tables == self.tables and faster == self.may_be_faster
            parked = None if is_same else state["before"]
        return replace(
            self,
            proposal=proposal,
            adopted=adopted,
            tables=tables,
            may_be_faster=faster,
            parked=self.parked if parked is None else parked,
            since=time.monotonic() - age,
        )

    def read(self, state: State | None) -> tuple[ModelProposal | None, str]:
        """The proposal in a stored state, and the id of the finding in use."""
        if state is None:
            return None, ""
        if state["file"] != self._digest():
            raise ParameterError(EFFECTS, "a finding for this model file, got another's")
        offer = state["offer"]
        proposal = None if offer is None else msgspec.convert(offer, ModelProposal)
        return proposal, "" if state["model"] is None else str(state["adopted"])

    def _digest(self) -> str:
        return hashlib.sha256(repr(self.file).encode()).hexdigest()[:16]

    def flags(self) -> list[str]:
        """Warning of brakes that are weaker than planned by a valid finding that is not adopted."""
        offer = self.proposal
        if offer is None or offer.id == self.adopted or not (offer.changes and offer.valid):
            return []
        if offer.beside_use.most <= 0.0:
            return []
        by = f"up to {offer.beside_use.most:.2f} m longer stops"
        return [f"offer {offer.id} is not adopted: {offer.verdict}, {by}"]

    # ------------------------------------------------------------------ groups

    def apply(self, model: Model) -> Model:
        return model

    def names(self) -> list[str]:
        return [EFFECTS]

    def describe(self, group: str) -> GroupDescription:
        values, stds, units = self._values()
        notes: dict[str, str | float] = {}
        if self.adopted:
            faster = float(self.may_be_faster)
            notes = {"adopted": self.adopted, "may be faster than the model file": faster}
        return GroupDescription(
            values=values,
            stds=stds,
            unit=units,
            valid=bool(self.adopted),
            notes=notes,
            age=time.monotonic() - self.since if self.adopted else 0.0,
        )

    def _values(self) -> tuple[dict[str, float], dict[str, float], dict[str, str]]:
        values, stds, units = {}, {}, {}
        if self.tables is not None:
            known = len(self.file.effect)
            for effect in model_of(self.tables, self.file).effect[known:]:
                for i, (name, value) in enumerate(effect.parameters.items()):
                    key = f"{effect.name}.{name}"
                    values[key], units[key] = value, LAWS[effect.name].parameters[name].unit
                    if effect.covariance:
                        stds[key] = max(effect.covariance[i][i], 0.0) ** 0.5
        return values, stds, units

    def state(self, group: str) -> State | None:
        if self.proposal is None and self.tables is None:
            return None
        values, stds, _ = self._values()
        return {
            "file": self._digest(),
            "values": values,
            "stds": stds,
            "adopted": self.adopted,
            "model": self.tables,
            "faster": self.may_be_faster,
            "before": self.parked,
            "offer": None if self.proposal is None else msgspec.to_builtins(self.proposal),
        }

    def restore(self, group: str, state: State | None, age: float) -> None:
        """Not done in place: another finding replaces the braking groups, too."""
        raise TypeError("findings are restored by LearnerState.load")

    def set(self, group: str, values: Mapping[str, float]) -> None:
        """Reject: effects come from findings only."""
        raise ParameterError("group", "a finding to adopt: effects are not set one by one")
