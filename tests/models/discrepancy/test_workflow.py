"""Logs with a hidden effect, driven by a plant that shares no code with the search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.report.text import answers
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.workflow import investigate
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Effect
from slopewise.models.stops.simulation import GroundTrack, simulate_stop
from tests.world.logs import STOPS, WORLDS, by_day_or_night, findings_of, log
from tests.world.vehicles import BASE


def test_other_coefficients_are_drift_and_no_effect() -> None:
    f = findings_of("drift")
    assert f.verdict is Verdict.PARAMETER_DRIFT
    assert f.model.effect == ()
    truth = WORLDS["drift"]
    on = f.model.braking
    std = np.sqrt(np.diag(np.array(on.covariance)))
    error = np.array([on.m_m, on.b_m, on.m_b, on.b_b]) - truth.coefficients
    assert np.all(np.abs(error) < 4.0 * std)
    assert on.dead_time == pytest.approx(truth.dead_time, abs=0.005)
    assert f.stop_distance.closed is not None
    assert f.stop_distance.closed > 0.9


@pytest.mark.parametrize("name", by_day_or_night("clean", "waves", "build_up"))
def test_a_log_that_the_model_explains_lacks_nothing(name: str) -> None:
    """Nor are waves of the ground an effect of crests, or a build-up of milliseconds a lag."""
    f = findings_of(name)
    assert f.verdict is Verdict.NONE
    assert f.effects == f.added == f.model.effect == f.changes == ()
    if name == "clean":
        assert f.model == BASE  # the offset of 0.2 m covers this log
        assert f.gap.closed is None  # nothing to close: no percentage


@pytest.mark.parametrize(
    "name",
    by_day_or_night(
        "drag", "lag", "lockup", "cross", "step", "patch", "fade", "crests", "lag_and_drag", "pair"
    ),
)
def test_the_hidden_effects_are_named_with_their_numbers(name: str) -> None:
    f, truth = findings_of(name), WORLDS[name].effects
    assert f.verdict is Verdict.MISSING_EFFECT
    assert {e.name for e in f.effects} == set(truth)
    # A build-up of the brakes may be fitted along, which none of these worlds has.
    further = [e for e in f.model.effect if e.name not in truth]
    assert len(f.model.effect) - len(further) == len(truth)
    assert all(e.name == "brake_lag" and e.parameters["tau"] < 0.03 for e in further)
    for e in f.effects:
        assert e.confidence > 0.8 or len(truth) > 1
        for parameter, value in e.parameters.items():
            true = truth[e.name][parameter]
            if (name, parameter) not in (("step", "run"), ("fade", "tau")):
                loose = 0.1 * abs(true) if len(truth) > 1 else 0.0
                assert abs(value.value - true) < 4.0 * value.std + loose, parameter
    if name == "step":
        assert abs(f.effects[0].parameters["run"].value - truth["step_change"]["run"]) <= 2.0
    if name in ("lag", "step", "lockup"):
        # Weaker brakes make the next stop longer.
        level = GroundTrack.of_grade(-0.1)
        before, after = (simulate_stop(m, level, 3.5).distance for m in (BASE, f.model))
        assert after > before + 0.05


@pytest.mark.nightly
def test_a_surface_in_two_places_is_named_in_both() -> None:
    f, world = findings_of("places"), WORLDS["places"]
    assert f.verdict is Verdict.MISSING_EFFECT
    assert [e.name for e in f.effects] == ["surface_patch"] * 2
    first = world.effects["surface_patch"]
    centres = [(e.parameters["x"].value, e.parameters["y"].value) for e in f.effects]
    for x, y in ((first["x"], first["y"]), *(place[:2] for place in world.further_places)):
        assert min(np.hypot(x - a, y - b) for a, b in centres) < 3.0


def test_a_log_in_which_nothing_could_show_is_too_noisy() -> None:
    f = findings_of("noisy")
    assert f.verdict is Verdict.TOO_NOISY
    assert "would have shown from" in f.summary
    assert f.effects == ()
    assert "ten times" in f.next_experiment.text


@pytest.mark.nightly
def test_what_is_practical_is_up_to_the_user() -> None:
    columns, runs = log("cross")
    coarse = investigate(columns, runs, BASE, settings=DiscrepancySettings(practical_share=0.5))
    assert coarse.verdict is Verdict.NONE
    assert any("cross_slope was seen" in note for note in coarse.notes)


@pytest.mark.parametrize("name", by_day_or_night(*WORLDS))
def test_no_name_makes_held_out_stops_worse(name: str) -> None:
    f = findings_of(name)
    assert f.gap.after <= 1.02 * (f.gap.refit if f.effects else f.gap.before)
    assert f.stop_distance.after <= 1.02 * f.stop_distance.before


def test_the_cost_is_that_of_a_stop_and_the_changes_are_those_of_the_file() -> None:
    f = findings_of("lag")
    assert f.cost is not None
    assert f.cost.speed == pytest.approx(3.0)
    assert f.cost.grade == pytest.approx(np.deg2rad(-10.0))
    level = GroundTrack.of_grade(f.cost.grade)
    before = simulate_stop(BASE, level, f.cost.speed).distance
    assert f.cost.before == pytest.approx(before, rel=0.03)
    lag = Effect(name="brake_lag", parameters=WORLDS["lag"].effects["brake_lag"])
    after = simulate_stop(replace(BASE, effect=(lag,)), level, f.cost.speed).distance
    assert f.cost.after == pytest.approx(after, rel=0.03)
    assert f.cost.after > 1.15 * f.cost.before
    assert any(change.startswith("brake_lag added") for change in f.changes)


@pytest.mark.parametrize("name", by_day_or_night("drag", "cross", "step", "pair"))
def test_the_gap_closes_on_stops_held_out(name: str) -> None:
    f = findings_of(name)
    assert f.gap.closed is not None
    assert f.gap.ci95 is not None
    assert f.gap.closed > 0.8
    assert f.gap.ci95[0] <= f.gap.closed <= f.gap.ci95[1]
    assert f.gap.after < f.gap.refit <= f.gap.before * 1.05


AXES = {
    "lag": "time_since_onset",
    "cross": "roll",
    "step": "run",
    "patch": "place",
    "fade": "brake_heat",
    "ambient": "ambient",
}


@pytest.mark.parametrize("name", by_day_or_night(*AXES))
def test_the_axis_is_located(name: str) -> None:
    first = findings_of(name).located[0]
    assert first.axis == AXES[name]
    assert first.p_value < 0.05


def test_a_cause_outside_the_library_is_unknown_and_its_column_reported() -> None:
    f = findings_of("ambient")
    assert f.verdict is Verdict.UNKNOWN
    assert not any(reply.startswith(";") for reply in answers(f).values())
    assert f.effects == ()
    assert f.model.effect == ()
    assert "ambient" in f.summary
    # What is not understood makes stops longer, not shorter.
    assert f.model.braking.force_std > 2.0 * WORLDS["ambient"].scatter * 0.4


def test_a_misaligned_sensor_is_confounded_with_new_coefficients() -> None:
    f = findings_of("bias")
    assert f.verdict is Verdict.UNIDENTIFIABLE
    assert "grade_bias" in f.summary
    assert "coast" in f.next_experiment.text
    assert f.model.effect == ()


@pytest.mark.nightly
def test_drag_that_costs_a_centimetre_has_no_name() -> None:
    assert findings_of("slow_drag").effects == ()


@pytest.mark.parametrize(
    ("false_alarm", "verdict"),
    [
        (0.015, Verdict.AMBIGUOUS),
        pytest.param(0.08, Verdict.MISSING_EFFECT, marks=pytest.mark.nightly),
    ],
)
def test_a_name_has_its_alternatives_and_an_experiment_is_proposed(
    false_alarm: float, verdict: Verdict
) -> None:
    finer = DiscrepancySettings(false_alarm=false_alarm, practical_share=0.0, practical_length=0.0)
    f = investigate(*log("slow_drag"), BASE, settings=finer)
    assert f.verdict is verdict
    assert f.effects[0].name == "aerodynamic_drag"
    assert f.effects[0].alternatives[0] == "viscous_resistance"
    weights = {e.names: e.weight for e in f.explanations}
    assert weights["aerodynamic_drag",] > weights["viscous_resistance",] > 0.2
    assert 0.9 < sum(weights.values()) <= 1.0 + 1e-9
    alternative = f"viscous_resistance ({weights['viscous_resistance',]:.0%})"
    assert any(alternative in reply for reply in answers(f).values())
    assert "aerodynamic_drag or" in f.next_experiment.text
    assert "or viscous_resistance" in f.next_experiment.text
    speeds = [stop.speed for stop in f.next_experiment.stops]
    assert max(speeds) > 0.9 * np.max(log("slow_drag")[0]["v_cmd"])


@pytest.mark.parametrize("name", ["cross", pytest.param("lag", marks=pytest.mark.nightly)])
def test_a_second_run_with_the_written_model_finds_no_further_effect(name: str) -> None:
    again = investigate(*log(name, STOPS.get(name, 48)), findings_of(name).model)
    assert again.verdict is Verdict.NONE


def test_too_few_stops_are_an_error_that_counts_them() -> None:
    columns, runs = log("clean")
    end = runs[7].stop
    few = {name: values[:end] for name, values in columns.items()}
    with pytest.raises(ParameterError, match="at least 12 usable stops, got 8"):
        investigate(few, runs[:8], BASE)
