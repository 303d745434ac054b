"""Status of the newest finding, from the history, with the command of the next step."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.dashboard.live_state import LiveState, ProposalEntry
from slopewise.services.dashboard.parameter_state import ParameterFeed
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.settings.learning_settings import StoreSettings
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.model_proposal import ModelProposal, StopDistanceChange
from tests.services.parameters.parameter_fixtures import ATV, proposal

FASTER = {"beside_file": StopDistanceChange(least=-0.4, most=0.1, where="3 m/s")}


class ShownService:
    """A service in this process, and the board that its page is drawn from."""

    def __init__(self, folder: Path | None, model: Model = ATV) -> None:
        store = StoreSettings(path="" if folder is None else str(folder / "p.sqlite"))
        config = ServiceConfig(model="atv", store=store)
        self.service, self.board = ParameterService(config, model), LiveState()
        self.feed = ParameterFeed(self.service, self.board, config)

    def offer(self, offer: ModelProposal) -> None:
        learner = self.service.learner
        learner.state = learner.state.propose(offer)
        self.service._commit({"effects"}, f"offered {offer.id}", offer.cause)

    @property
    def finding(self) -> ProposalEntry:
        self.feed.show()
        assert self.board.proposal is not None
        return self.board.proposal

    def status(self) -> tuple[str, str, str, str]:
        entry = self.finding
        return entry.state, entry.message, entry.purpose, entry.command


def test_each_status_has_the_command_of_the_next_step(tmp_path: Path) -> None:
    shown = ShownService(tmp_path)
    shown.feed.show()
    assert shown.board.proposal is None
    shown.offer(proposal())
    adopts = "slopewise params --adopt offer1"
    assert shown.status() == ("offered", "waits for an operator", "adopt it", adopts)
    shown.service.adopt("offer1", "ann")
    back = "slopewise params effects --rollback 2"
    adopted = ("adopted", "by ann, version 3", "take it back", back)
    assert shown.status() == adopted
    shown.service.close()
    # A restart changes nothing of it.
    shown = ShownService(tmp_path)
    assert shown.status() == adopted
    shown.service.roll_back(2, "effects", "bob")
    assert shown.status() == ("offered", "waits for an operator", "adopt it", adopts)
    shown.service.roll_back(1, "effects", "cid")
    shown.feed.show()
    assert shown.board.proposal is None
    shown.service.roll_back(3, "effects", "dan")
    assert shown.status() == ("adopted", "by dan, version 6", "take it back", back[:-1] + "5")
    shown.service.close()
    # Findings for another model file are not shown.
    changed = dataclasses.replace(ATV, braking=dataclasses.replace(ATV.braking, b_b=0.38))
    shown = ShownService(tmp_path, changed)
    shown.feed.show()
    assert shown.board.proposal is None


def test_a_newer_finding_is_shown_with_the_one_in_use(tmp_path: Path) -> None:
    shown = ShownService(tmp_path)
    shown.offer(proposal(1))
    shown.service.adopt("offer1", "ann")
    shown.offer(proposal(2))
    adopts = "slopewise params --adopt offer2"
    waits = "waits for an operator; plans use the finding offer1"
    assert shown.status() == ("offered", waits, "adopt it", adopts)
    shown.service.roll_back(3, "effects", "ann")
    assert shown.finding.offer.id == "offer1"
    assert shown.status()[:2] == ("adopted", "by ann, version 5")
    assert shown.status()[3] == "slopewise params effects --rollback 2"


def test_a_rejection_is_shown_with_its_reason_until_another_change(tmp_path: Path) -> None:
    shown = ShownService(tmp_path)
    shown.offer(proposal(1, **FASTER))
    adopts = "slopewise params --adopt offer1 --faster"
    assert shown.status() == ("offered", "waits for an operator", "adopt it", adopts)
    with pytest.raises(ParameterError):
        shown.service.adopt("offer1", "ann")
    state, message, _, command = shown.status()
    assert (state, command) == ("refused", adopts)
    assert "0.40 m shorter at 3 m/s" in message
    shown.service.adopt("offer1", "ann", faster=True)
    assert shown.status()[0] == "adopted"
    with pytest.raises(ParameterError):
        shown.service.adopt("offer1", "ann", faster=True)
    assert shown.status()[0] == "adopted"
    shown.service.roll_back(2, "effects", "ann")
    assert shown.status()[0] == "offered"
    shown.offer(proposal(2, valid=False, verdict="ambiguous", **FASTER))
    invalid = "neither conclusive enough for faster plans, nor slower everywhere"
    assert shown.status() == ("refused", invalid, "", "")
    shown.offer(proposal(3, changes=False, verdict="none"))
    assert shown.status() == ("nothing", "nothing to adopt", "", "")


def test_without_a_store_nothing_can_be_rolled_back() -> None:
    shown = ShownService(None)
    shown.offer(proposal())
    assert shown.status()[0] == "offered"
    shown.service.adopt("offer1", "ann")
    assert shown.status() == ("adopted", "by ann, version 3", "", "")
