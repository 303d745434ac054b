"""What becomes of a finding, told from the history with the command for what comes next."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Effect, Model
from slopewise.services.dashboard.live_state import LiveState, ProposalEntry
from slopewise.services.dashboard.parameter_state import ParameterFeed
from slopewise.services.io.model_file import find_model, model_to_dict, read_model
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.settings.learning_settings import StoreSettings
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.model_proposal import ModelProposal, StopDistanceChange

FILE = read_model(find_model("atv"))
LAG = Effect(name="brake_lag", parameters={"tau": 0.3}, covariance=((0.01**2,),))


def made(number: int = 1, **changes: Any) -> ModelProposal:
    """An offer with numbers as the workflow writes them."""
    effect = {
        "name": "brake_lag",
        "parameters": {"tau": {"value": 0.2984, "std": 0.012, "unit": "s"}},
        "confidence": 0.98,
        "alternatives": [],
        "where": "",
    }
    gap = {"metric": "stopping distance", "before": 0.412, "after": 0.057, "noise_floor": 0.049}
    fields: dict[str, Any] = {
        "id": f"offer{number}",
        "at": 1e9 + number,
        "cause": "by schedule",
        "verdict": "missing_effect",
        "summary": "The model leaves out: brakes that answer late.",
        "findings": {"effects": [effect], "stop_distance": gap, "seconds": 3.0},
        "data": "0",
        "stops": 26,
        "beside_file": StopDistanceChange(least=0.11, most=0.93, where="2 m/s"),
        "beside_use": StopDistanceChange(least=0.11, most=0.93, where="2 m/s"),
        "valid": True,
        "changes": True,
        "notes": [],
        "model": model_to_dict(dataclasses.replace(FILE, effect=(LAG,))),
    }
    return ModelProposal(**(fields | changes))


FASTER = {"beside_file": StopDistanceChange(least=-0.4, most=0.1, where="3 m/s")}


class Seen:
    """A service in this process, and the board that its page is drawn from."""

    def __init__(self, folder: Path | None, model: Model = FILE) -> None:
        store = StoreSettings(path="" if folder is None else str(folder / "p.sqlite"))
        config = ServiceConfig(model="atv", store=store)
        self.service, self.board = ParameterService(config, model), LiveState()
        self.shown = ParameterFeed(self.service, self.board, config)

    def offer(self, offer: ModelProposal) -> None:
        self.service.learner.propose(offer)
        self.service._commit({"effects"}, f"offered {offer.id}", offer.cause)

    @property
    def finding(self) -> ProposalEntry:
        self.shown.show()
        assert self.board.proposal is not None
        return self.board.proposal

    def told(self) -> tuple[str, str, str, str]:
        one = self.finding
        return one.state, one.message, one.purpose, one.command


def test_what_becomes_of_a_finding_is_told_with_the_command_for_what_comes_next(
    tmp_path: Path,
) -> None:
    one = Seen(tmp_path)
    one.shown.show()
    assert one.board.proposal is None
    one.offer(made())
    adopts = "slopewise params --adopt offer1"
    assert one.told() == ("offered", "waits for an operator", "adopt it", adopts)
    one.service.adopt("offer1", "ann")
    back = "slopewise params effects --rollback 2"
    adopted = ("adopted", "by ann, version 3", "take it back", back)
    assert one.told() == adopted
    one.service.close()
    # A restart changes nothing of it.
    one = Seen(tmp_path)
    assert one.told() == adopted
    one.service.roll_back(2, "effects", "bob")
    assert one.told() == ("reverted", "by bob, version 4", "adopt it", adopts)
    one.service.roll_back(1, "effects", "cid")
    again = "slopewise params effects --rollback 3"
    assert one.told() == ("reverted", "by bob, version 4", "bring it back", again)
    one.service.close()
    one = Seen(tmp_path)
    assert one.told() == ("reverted", "by bob, version 4", "bring it back", again)
    one.service.roll_back(3, "effects", "dan")
    assert one.told()[:3] == ("adopted", "by dan, version 6", "take it back")
    one.service.roll_back(5, "effects", "dan")
    one.service.close()
    # Beside another model file it says nothing.
    other = dataclasses.replace(FILE, braking=dataclasses.replace(FILE.braking, b_b=0.38))
    one = Seen(tmp_path, other)
    one.shown.show()
    assert one.board.proposal is None


def test_a_newer_finding_is_told_beside_the_one_in_use(tmp_path: Path) -> None:
    one = Seen(tmp_path)
    one.offer(made(1))
    one.service.adopt("offer1", "ann")
    one.offer(made(2))
    adopts = "slopewise params --adopt offer2"
    words = "waits for an operator; plans use the finding offer1"
    assert one.told() == ("offered", words, "adopt it", adopts)
    one.service.roll_back(3, "effects", "ann")
    # Going back to the older one does not make that the newest.
    assert one.finding.offer.id == "offer2"
    assert one.told()[0] == "reverted"
    assert one.told()[3] == "slopewise params effects --rollback 4"


def test_a_refusal_is_told_with_its_reason_until_something_else_happens(tmp_path: Path) -> None:
    one = Seen(tmp_path)
    one.offer(made(1, **FASTER))
    adopts = "slopewise params --adopt offer1 --faster"
    assert one.told() == ("offered", "waits for an operator", "adopt it", adopts)
    with pytest.raises(ParameterError):
        one.service.adopt("offer1", "ann")
    state, words, _, command = one.told()
    assert (state, command) == ("refused", adopts)
    assert "0.40 m shorter at 3 m/s" in words
    one.service.adopt("offer1", "ann", faster=True)
    assert one.told()[0] == "adopted"
    with pytest.raises(ParameterError):
        one.service.adopt("offer1", "ann", faster=True)
    assert one.told()[0] == "adopted"
    one.service.roll_back(2, "effects", "ann")
    assert one.told()[0] == "reverted"
    one.offer(made(2, valid=False, verdict="ambiguous", **FASTER))
    unsure = "neither conclusive enough for faster plans, nor slower everywhere"
    assert one.told() == ("refused", unsure, "", "")
    one.offer(made(3, changes=False, verdict="none"))
    assert one.told() == ("nothing", "nothing to adopt", "", "")


def test_without_a_store_there_is_no_way_back_to_tell_of() -> None:
    one = Seen(None)
    one.offer(made())
    assert one.told()[0] == "offered"
    one.service.adopt("offer1", "ann")
    assert one.told() == ("adopted", "by ann, version 3", "", "")
