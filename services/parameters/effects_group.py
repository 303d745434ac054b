"""The finding that is offered, and the one that is adopted: a braking model with its effects.

Vehicle, terrain and limits stay those of the model file whatever is adopted.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Mapping

import msgspec

from slopewise.models.effects.registry import LAWS
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.discovery.finding import model_of
from slopewise.services.discovery.stops_compared import cautious
from slopewise.services.parameters.group import Description, ParameterGroups, State
from slopewise.services.wire.model_proposal import ModelProposal

EFFECTS = "effects"


class EffectsGroup(ParameterGroups):
    """At most one offer, and at most one finding in use.

    Attributes:
        offer: the last finding; None before there was one. adopted: id of the one in use, or "".
    """

    of_operators = True

    def __init__(
        self, file: Model, take_up: Callable[[Model | None, State | None], State | None]
    ) -> None:
        """Begin with the model file.

        Args:
            file: its model.
            take_up: plans and learns on top of a model, or of the file again; given and giving back
                what stops taught of the base before, where the new model leaves no room for it.
        """
        self._file, self._take_up = file, take_up
        self._digest = hashlib.sha256(repr(file).encode()).hexdigest()[:16]
        self.offer: ModelProposal | None = None
        self.adopted = ""
        self._tables: State | None = None
        self._faster = False
        self._before: State | None = None
        self._since = time.monotonic()

    def offered(self, offer: ModelProposal) -> None:
        """The last finding takes the place of the one before."""
        self.offer = offer

    def flags(self) -> list[str]:
        """Brakes that are surely weaker somewhere than is planned with, and nobody adopted it."""
        offer = self.offer
        if offer is None or offer.id == self.adopted or not (offer.changes and offer.valid):
            return []
        if offer.beside_use.most <= 0.0:
            return []
        by = f"up to {offer.beside_use.most:.2f} m longer stops"
        return [f"offer {offer.id} is not adopted: {offer.verdict}, {by}"]

    def adopt(self, wanted: str, *, faster: bool) -> str:
        """Plan with the finding that is offered.

        Args:
            wanted: its id. faster: stops may become shorter than by the model file.

        Returns:
            What it is, in words.

        Raises:
            ParameterError: it is not what is offered, or may not be adopted.
        """
        offer = self.offer
        if offer is None or offer.id != wanted:
            there = "none" if offer is None else offer.id
            raise ParameterError("offer", f"the one that there is, {there}, got {wanted}")
        if not offer.changes:
            raise ParameterError("offer", f"something to adopt, the finding is {offer.verdict}")
        if offer.id == self.adopted and faster == self._faster:
            raise ParameterError("offer", f"one that is not adopted yet, {offer.id} is")
        if not faster and not offer.slower:
            by = offer.beside_file
            words = f"faster to be said: stops {-by.least:.2f} m shorter at {by.where}"
            raise ParameterError("faster", words)
        if faster and not offer.valid:
            words = f"a finding sure enough to make plans faster, got {offer.verdict}"
            raise ParameterError("offer", f"{words} without a closed gap")
        self._use(offer.model, faster=faster, before=None)
        self.adopted = offer.id
        return offer.text()

    def _use(self, tables: State | None, *, faster: bool, before: State | None) -> None:
        model = None
        if tables is not None:
            found = model_of(tables, self._file)
            model = found if faster else cautious(found, self._file)
        # From one finding to the next, what stood before the first is kept.
        held = before if before is not None else self._before
        given = self._take_up(model, held if model is None else None)
        self._before = None if model is None else given or held
        self._tables, self._faster, self._since = tables, faster, time.monotonic()
        if tables is None:
            self.adopted = ""

    # ------------------------------------------------------------------ groups

    def apply(self, model: Model) -> Model:
        """As it is: brakes are learned on top of the finding that was adopted."""
        return model

    def names(self) -> list[str]:
        """The one."""
        return [EFFECTS]

    def describe(self, group: str) -> Description:
        """Parameters of the adopted effects, and which finding they are of."""
        values, stds, units = self._values()
        notes: dict[str, str | float] = {}
        if self.adopted:
            notes["adopted"] = self.adopted
            notes["may be faster than the model file"] = float(self._faster)
        return Description(
            values=values,
            stds=stds,
            unit=units,
            valid=bool(self.adopted),
            notes=notes,
            age=time.monotonic() - self._since if self.adopted else 0.0,
        )

    def _values(self) -> tuple[dict[str, float], dict[str, float], dict[str, str]]:
        values, stds, units = {}, {}, {}
        if self._tables is not None:
            known = len(self._file.effect)
            for effect in model_of(self._tables, self._file).effect[known:]:
                for i, (name, value) in enumerate(effect.parameters.items()):
                    key = f"{effect.name}.{name}"
                    values[key], units[key] = value, LAWS[effect.name].parameters[name].unit
                    if effect.covariance:
                        stds[key] = max(effect.covariance[i][i], 0.0) ** 0.5
        return values, stds, units

    def state(self, group: str) -> State | None:
        """What a restart needs."""
        if self.offer is None and self._tables is None:
            return None
        values, stds, _ = self._values()
        return {
            "file": self._digest,
            "values": values,
            "stds": stds,
            "adopted": self.adopted,
            "model": self._tables,
            "faster": self._faster,
            "before": self._before,
            "offer": None if self.offer is None else msgspec.to_builtins(self.offer),
        }

    def read(self, state: State | None) -> tuple[ModelProposal | None, str]:
        """The offer of a kept state, and the id of the finding in use; as :meth:`restore` fails."""
        if state is None:
            return None, ""
        if state["file"] != self._digest:
            raise ParameterError(EFFECTS, "a finding beside this model file, got another's")
        offer, in_use = state["offer"], state["model"] is not None
        known = None if offer is None else msgspec.convert(offer, ModelProposal)
        return known, str(state["adopted"]) if in_use else ""

    def restore(self, group: str, state: State | None, age: float) -> None:
        """As it was ``age`` seconds ago; ValueError or KeyError if it cannot be."""
        known, adopted = self.read(state)
        if state is None:
            self.offer = None
            if self._tables is not None:
                self._use(None, faster=False, before=None)
            return
        if state["model"] != self._tables or bool(state["faster"]) != self._faster:
            self._use(state["model"], faster=bool(state["faster"]), before=state["before"])
        self.offer, self.adopted = known, adopted
        self._since = time.monotonic() - age

    def set(self, group: str, values: Mapping[str, float]) -> None:
        """Effects come out of findings."""
        raise ParameterError("group", "a finding to adopt: effects are not set one by one")
