"""Findings that are adopted and reverted, and what is planned and learned on top of them."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Effect, Model
from slopewise.services.discovery.investigation_process import InvestigationOutcome, is_valid
from slopewise.services.discovery.model_comparison import cautious, compare_stops
from slopewise.services.io.model_file import model_to_dict
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.settings.learning_settings import Investigation, StoreSettings
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.model_proposal import ModelProposal
from tests.services.parameters.parameter_fixtures import ATV, LAG, G, level_force, proposal, stop

FILE = ATV
WEAKER = Effect(name="step_change", parameters={"scale": 0.7}, covariance=((0.01**2,),))
PATCH = Effect(name="surface_patch", parameters={"delta": 0.1, "x": 5.0, "y": 5.0, "radius": 2.0})
DRAG = Effect(name="aerodynamic_drag", parameters={"c": 0.05}, covariance=((0.002**2,),))


def with_effects(*effects: Effect, **braking: float) -> Model:
    return dataclasses.replace(
        FILE, braking=dataclasses.replace(FILE.braking, **braking), effect=effects
    )


def offer_of(model: Model, *, valid: bool = True, active: Model = FILE) -> ModelProposal:
    careful = cautious(model, FILE)
    return proposal(
        id=f"{len(model.effect)}-{model.braking.b_b:g}-{valid}",
        cause="test",
        beside_file=compare_stops(careful, FILE),
        beside_use=compare_stops(careful, active),
        valid=valid,
        model=model_to_dict(model),
    )


Make = Callable[..., ParameterService]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    def service(file: Model = FILE, **settings: Any) -> ParameterService:
        config = ServiceConfig(
            model="atv",
            store=StoreSettings(path=str(tmp_path / "p.sqlite")),
            discrepancy=Investigation(**settings),
        )
        return ParameterService(config, file)

    return service


def propose(service: ParameterService, offer: ModelProposal) -> None:
    service.learner.state = service.learner.state.propose(offer)


def adopt(service: ParameterService, effect: Effect, *, valid: bool = True) -> None:
    offer = offer_of(with_effects(effect), valid=valid)
    propose(service, offer)
    service.adopt(offer.id, "ann")


def find(service: ParameterService, offer: ModelProposal, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let an investigation end with an offer."""
    outcomes = iter([InvestigationOutcome(reason="", damaged=[], offer=offer)])
    monkeypatch.setattr(service.investigator, "poll", lambda: next(outcomes, None))
    service.tick()
    assert service.learner.state.effects.proposal == offer


def send(service: ParameterService, force: float, number: int, surface: str = "") -> str:
    now = time.monotonic()
    report = stop(force, surface, sequence=number, time=now, dead_time=0.3)
    return service.observe("stop", report, "obs/stop", now).reason


def test_distances_are_those_of_the_closed_form() -> None:
    weaker = with_effects(b_b=0.30)
    by = compare_stops(weaker, FILE)
    lengths = []
    low, high = FILE.braking.speed_range
    for v in np.linspace(0.5 * low, high, 4):
        # Below the trained speeds the coefficients of the lowest one hold.
        c = max(v, low)
        for theta in np.linspace(*FILE.braking.grade_range, 5):
            a, b = (
                G * ((-0.03 * c - 0.35) * theta + 0.015 * c + base + np.sin(theta))
                for base in (0.30, 0.40)
            )
            lengths.append(0.5 * v * v * (1.0 / a - 1.0 / b))
    assert by.least == pytest.approx(min(lengths), rel=1e-3)
    assert by.most == pytest.approx(max(lengths), rel=1e-3)
    reverse = compare_stops(FILE, weaker)
    assert (reverse.least, reverse.most) == pytest.approx((-by.most, -by.least))


@pytest.mark.parametrize(
    ("effect", "sign"),
    [
        (LAG, 1.0),
        (DRAG, -1.0),
        (Effect(name="cross_slope", parameters={"k": -0.5}), 0.0),
        (PATCH, None),
        *(
            pytest.param(effect, sign, marks=pytest.mark.nightly)
            for effect, sign in (
                (WEAKER, 1.0),
                (
                    Effect(name="directional_surface", parameters={"k": 0.05, "direction": 1.0}),
                    None,
                ),
                (Effect(name="session_drift", parameters={"k": 1e-5}), None),
            )
        ),
    ],
)
def test_effects_that_only_reduce_force_make_no_stop_shorter(
    effect: Effect, sign: float | None
) -> None:
    by = compare_stops(with_effects(effect), FILE)
    if sign == 1.0:
        assert by.least > 0.004
    elif sign == 0.0:
        assert by.least == pytest.approx(0.0, abs=1e-6)
        assert by.most > 0.01
    else:
        assert by.least < -0.005


def test_a_finding_is_as_uncertain_as_it_and_the_model_file_together() -> None:
    small = tuple(tuple(row) for row in (1e-8 * np.eye(4)).tolist())
    finding = with_effects(LAG, b_b=0.39, dead_time=0.2, force_std=0.0)
    finding = dataclasses.replace(
        finding, braking=dataclasses.replace(finding.braking, covariance=small)
    )
    careful = cautious(finding, FILE).braking
    assert FILE.braking.covariance is not None
    more = np.array(careful.covariance) - np.array(FILE.braking.covariance)
    assert np.linalg.eigvalsh(more)[0] >= 0.0
    assert careful.dead_time == FILE.braking.dead_time
    assert careful.distance_offset >= FILE.braking.distance_offset
    assert careful.b_b == 0.39


def test_a_proposal_changes_no_plan_until_it_is_adopted_and_is_restored(make: Make) -> None:
    service = make()
    offer = offer_of(with_effects(LAG))
    propose(service, offer)
    service._commit({"effects"}, "offered", "test")
    assert service.active.model == FILE
    service.adopt(offer.id, "ann")
    assert service.active.model.effect == (LAG,)
    version = service.history.version
    with pytest.raises(ParameterError, match="not adopted yet"):
        service.adopt(offer.id, "ann")
    service.close()
    again = make()
    assert again.active.model.effect == (LAG,)
    assert again.learner.state.effects.proposal == offer
    assert again.active.version == version
    again.roll_back(1, "effects", "ann")
    assert again.active.model.effect == ()
    again.close()
    assert make().active.model.effect == ()


def test_a_finding_of_another_model_file_is_flagged_and_not_used(make: Make) -> None:
    service = make()
    adopt(service, LAG)
    service.close()
    again = make(dataclasses.replace(FILE, braking=with_effects(b_b=0.38).braking))
    assert again.active.model.effect == ()
    assert any("effects" in flag for flag in again.flags())


def test_plans_get_faster_than_the_file_by_a_valid_finding_and_consent_only(make: Make) -> None:
    service = make()
    drag = offer_of(with_effects(DRAG))
    assert not drag.slower
    propose(service, drag)
    with pytest.raises(ParameterError, match=r"faster: expected `faster` to be set: stops \d"):
        service.adopt(drag.id, "ann")
    assert service.active.model.effect == ()
    invalid = offer_of(with_effects(DRAG), valid=False)
    propose(service, invalid)
    with pytest.raises(ParameterError, match="a valid finding"):
        service.adopt(invalid.id, "ann", faster=True)
    with pytest.raises(ParameterError, match="the one that there is"):
        service.adopt(drag.id, "ann", faster=True)
    assert service.active.model.effect == ()
    propose(service, drag)
    service.adopt(drag.id, "ann", faster=True)
    assert service.active.model.effect == (DRAG,)
    assert "the adopted finding has the effect aerodynamic_drag" in send(service, 0.4, 1)
    with pytest.raises(ParameterError, match="not set one by one"):
        service.set_values("effects", {"aerodynamic_drag.c": 1.0}, "ann")
    # An invalid one may still slow plans down.
    adopt(service, LAG, valid=False)
    assert service.active.model.effect == (LAG,)


def test_the_learned_base_is_parked_while_a_finding_contains_it(make: Make) -> None:
    service = make()
    for number in range(1, 6):
        send(service, 0.30, number)
    learned = level_force(service)
    assert learned == pytest.approx(0.30, abs=0.02)
    adopt(service, WEAKER)
    # Its 0.7 of the file's force, and not 0.7 of what was learned of the same stops.
    assert level_force(service) == pytest.approx(FILE.braking.level_force(2.0))
    version = service.history.version
    assert "not learned" in send(service, 0.6, 6)
    service.roll_back(1, "effects", "ann")
    assert level_force(service) <= learned + 1e-9
    assert level_force(service) == pytest.approx(learned, abs=0.03)
    assert "not learned" not in send(service, 0.30, 7)
    service.roll_back(version, "effects", "ann")
    assert service.active.model.effect == (WEAKER,)
    service.close()
    again = make()
    assert again.active.model.effect == (WEAKER,)
    assert level_force(again) == pytest.approx(FILE.braking.level_force(2.0))
    again.roll_back(1, "effects", "ann")
    assert level_force(again) <= learned + 1e-9


def test_braking_is_learned_on_top_of_effects_that_only_reduce_force(make: Make) -> None:
    service = make()
    adopt(service, LAG)
    for number in range(1, 5):
        assert "not learned" not in send(service, 0.25, number)
    assert level_force(service) < 0.30
    assert service.active.model.effect == (LAG,)


def test_learned_surfaces_stay_weak_and_are_never_included_twice(make: Make) -> None:
    service = make()
    for number in range(1, 6):
        send(service, 0.12, number, "ice")
    ice = service.active.model.braking.on("ice").level_force(2.0)
    assert ice < 0.2
    drag = offer_of(with_effects(DRAG))
    propose(service, drag)
    with pytest.raises(ParameterError, match=r"got braking\.ice, whose force"):
        service.adopt(drag.id, "ann", faster=True)
    assert service.active.model.effect == ()
    learned = service.history.version
    service.roll_back(1, "braking.ice", "ann")
    service.adopt(drag.id, "ann", faster=True)
    service.roll_back(learned, "braking.ice", "ann")
    assert "ice" not in service.active.model.braking.terrain
    service.roll_back(learned, "", "ann")
    assert service.active.model.effect == ()
    assert service.active.model.braking.on("ice").level_force(2.0) <= ice + 1e-9
    adopt(service, WEAKER)
    assert service.active.model.braking.on("ice").level_force(2.0) <= ice + 1e-9
    service.close()
    again = make()
    assert again.active.model.effect == (WEAKER,)
    assert again.active.model.braking.on("ice").level_force(2.0) <= ice + 1e-9


@pytest.mark.parametrize(
    ("effect", "valid", "allowed", "adopted"),
    [
        (LAG, True, True, True),
        (LAG, True, False, False),
        (LAG, False, True, False),
        (DRAG, True, True, False),
    ],
)
def test_only_valid_findings_that_slow_plans_are_adopted_automatically(
    make: Make,
    monkeypatch: pytest.MonkeyPatch,
    effect: Effect,
    valid: bool,
    allowed: bool,
    adopted: bool,
) -> None:
    service, offer = make(adopt_slower=allowed), offer_of(with_effects(effect), valid=valid)
    find(service, offer, monkeypatch)
    assert (service.active.model.effect == (effect,)) is adopted
    last = service.history.last["effects"]
    assert last.who == ("service, as the settings allow" if adopted else "test")


def test_no_finding_faster_than_the_learned_force_is_adopted_automatically(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = make(adopt_slower=True)
    weak = dataclasses.replace(FILE, braking=dataclasses.replace(FILE.braking, b_b=0.15))
    offer = offer_of(with_effects(LAG), active=weak)
    assert offer.slower
    find(service, offer, monkeypatch)
    assert service.active.model.effect == ()


def test_an_investigation_starts_by_schedule_or_is_counted_as_failed(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    service, causes = make(), []
    monkeypatch.setattr(service.investigator, "is_due", lambda: len(causes) < 2)

    def begin(*given: object) -> None:
        causes.append(given[-1])
        if len(causes) == 2:
            raise ParameterError("start", "at least 12 stored stops, got 0")

    monkeypatch.setattr(service.investigator, "begin", begin)
    for _ in range(3):
        service.tick()
    assert causes == ["by schedule"] * 2
    assert service.counters["looks_failed"] == 1


@pytest.mark.parametrize(
    ("verdict", "interval", "valid"),
    [
        ("missing_effect", [0.5, 0.9], True),
        ("parameter_drift", [0.1, 0.9], True),
        ("missing_effect", [-0.1, 0.9], False),
        ("missing_effect", None, False),
        ("ambiguous", [0.5, 0.9], False),
        ("none", None, False),
    ],
)
def test_a_finding_is_valid_if_it_closes_the_gap(
    verdict: str, interval: list[float] | None, valid: bool
) -> None:
    assert is_valid({"verdict": verdict, "gap": {"ci95": interval}}) is valid
