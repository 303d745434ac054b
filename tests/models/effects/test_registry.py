"""Requirements on every registered effect; no other module knows one by its name."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from slopewise.models import effects
from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.likelihood.axes import axes_of
from slopewise.models.discrepancy.likelihood.refit import effect_of
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import predict, stops_seen
from slopewise.models.effects.effect_law import CHANNELS, EffectLaw, Enters, Place
from slopewise.models.effects.registry import LAWS, validate
from slopewise.models.parameters import Effect
from slopewise.models.quantity import GRAVITY
from slopewise.models.stops.simulation import GroundTrack, simulate_stop
from tests.world.formulas import FORMULAS, Moment
from tests.world.logs import table
from tests.world.vehicles import BASE, with_effect

ROOT = Path(__file__).parents[3]
PRODUCT = ("models", "planner", "services")
ALL = pytest.mark.parametrize(("name", "law"), LAWS.items())


def some(law: EffectLaw) -> dict[str, float]:
    """A plausible value of each parameter."""
    values = {}
    for name, p in law.parameters.items():
        low, high = p.fit_bounds
        value = p.default if p.default is not None else 0.25
        values[name] = min(max(value, low), high)
    return values | ({"radius": 30.0} if "radius" in law.parameters else {})


def channels(law: EffectLaw, m: Moment) -> tuple[Any, ...]:
    """Arguments of a law before its parameters."""
    return {
        Enters.GROUND: (Place(m.grade, m.roll, m.x, m.y, m.yaw, m.session_time),),
        Enters.LASTING: (m.force,),
        Enters.MOTION: (m.speed, m.curvature, m.yaw),
        Enters.LAG: (m.since_onset,),
        Enters.FADE: (m.heat,),
        Enters.CAP: (m.grade, m.roll),
        Enters.CREST: (m.speed, m.vertical_curvature),
    }[law.enters]


@ALL
def test_its_law_is_its_formula(name: str, law: EffectLaw) -> None:
    """A new effect needs an entry in the formulas of the tests."""
    rng = np.random.default_rng(11)
    signs = {"grade", "roll", "yaw", "x", "y", "curvature", "vertical_curvature"}
    sizes = {"x": 40.0, "y": 40.0, "yaw": 3.0, "speed": 4.0, "session_time": 900.0, "heat": 300.0}
    values = []
    for _ in range(40):
        moment = Moment(
            **{
                f.name: sizes.get(f.name, 0.4) * rng.uniform(-1.0 if f.name in signs else 0.0, 1.0)
                for f in fields(Moment)
            }
        )
        p = {key: value * rng.uniform(0.5, 1.5) for key, value in some(law).items()}
        values.append(float(law.law(*channels(law, moment), *p.values())))
        assert values[-1] == pytest.approx(FORMULAS[name](p, moment), rel=1e-12, abs=1e-15)
    assert len(set(values)) > 1


@ALL
def test_its_parameters_have_unit_range_step_and_safe_ends(name: str, law: EffectLaw) -> None:
    assert law.parameters
    for key, p in law.parameters.items():
        assert p.unit, key
        assert p.bounds[0] < p.bounds[1]
        assert p.fit_bounds[0] < p.fit_bounds[1]
        assert p.step > 0.0
        assert p.longer_stop in (-1, 0, 1)
        assert p.lighter_rear in (-1, 0, 1)
    # One end is the safe one, or a margin covers both.
    margins = law.max_force(some(law))
    assert set(margins) <= set(law.parameters)
    assert margins or any(p.longer_stop for p in law.parameters.values())
    assert validate(Effect(name=name, parameters=some(law))) == some(law)


@ALL
def test_stops_grow_longer_where_its_parameters_say_so(name: str, law: EffectLaw) -> None:
    """The safe end for stopping is the one at which a simulated stop is longer."""
    values = some(law)
    zero = np.zeros(1)
    track = GroundTrack(zero, zero + 0.05, zero + 0.05, zero, zero + 0.2, zero, zero, zero - 0.1)
    for key, p in law.parameters.items():
        if p.longer_stop == 0:
            continue
        step = 0.2 * abs(values[key])
        ends = [{**values, key: values[key] + side * p.longer_stop * step} for side in (-1, 1)]
        shorter, longer = (
            simulate_stop(with_effect(name, **v), track, 3.0, heat=500.0).distance for v in ends
        )
        assert longer > shorter or (key == "tau" and longer >= shorter)


@ALL
def test_it_has_an_axis_and_an_experiment(name: str, law: EffectLaw) -> None:
    stops = table("crests")
    axes = {axis.name for axis in axes_of(stops, BASE.braking.dead_time)}
    assert law.axis in axes
    assert law.depends_on <= set(CHANNELS)
    assert len(law.missing) > 5
    assert len(law.experiment) > 10
    assert isinstance(law.only_reduces(some(law)), bool)
    assert isinstance(law.adds(some(law)), bool)
    assert not (law.only_reduces(some(law)) and law.adds(some(law)))
    assert law.where is None or law.where(some(law))
    module = inspect.getmodule(law.search.columns) if law.search else None
    assert module is None or module.__doc__


@ALL
def test_logs_are_searched_for_it_or_the_reason_is_stated(name: str, law: EffectLaw) -> None:
    if law.search is None:
        assert len(law.unsearched) > 10
        return
    assert law.unsearched == ""
    search = law.search
    assert search.strength in law.parameters
    columns = list(search.columns(stops_seen(table("crests"), _base())))
    assert columns
    assert search.placed == ({"x", "y", "radius"} <= set(columns[0][0]))
    assert all(np.all(np.isfinite(share)) for _, share in columns)
    assert any(np.any(share != 0.0) for _, share in columns)
    effect = effect_of(name, columns[0][0], _first(columns[0][1], 0.1))
    assert set(effect.parameters) <= set(law.parameters)
    assert set(law.parameters) - set(effect.parameters) <= {
        key for key, p in law.parameters.items() if p.default is not None
    }


def _first(columns: Floats, strength: float) -> Floats:
    """Coefficients of an effect that is its first column."""
    count = 1 if columns.ndim == 2 else columns.shape[2]
    return np.append(strength, np.zeros(count - 1))


def _base() -> Hypothesis:
    return Hypothesis.configured(BASE)


@ALL
def test_its_column_is_the_slope_of_the_prediction(name: str, law: EffectLaw) -> None:
    """One unit of a small strength changes the fall of the speed by the column."""
    search = law.search
    if search is None or search.is_complete:
        return  # not linear in its only number
    stops, strength = table("crests"), 1e-6
    inner, share = next(iter(search.columns(stops_seen(stops, _base()))))
    hypothesis = replace(_base(), added=(effect_of(name, inner, _first(share, strength)),))
    share = share if share.ndim == 2 else share[:, :, 0]
    change = (predict(stops, hypothesis) - predict(stops, _base())) / strength
    column = GRAVITY * cumulative_trapezoid(share, stops.time, axis=1, initial=0.0)
    onset = _base().dead_time
    for i, time in enumerate(stops.time):
        column[i] = np.where(time > onset, column[i] - np.interp(onset, time, column[i]), 0.0)
    # Cold brakes fade by less than a percent; the mean force replaces that of each stop.
    loose = 0.1 if law.enters is Enters.FADE else 0.01
    moving = stops.speed > 0.5
    assert np.max(np.abs(change - column)[moving]) < loose * np.max(np.abs(column))


def test_a_drift_may_be_a_share_of_the_force() -> None:
    """Brakes that lose a share with time are searched for, too; the law has their mean loss."""
    seen, search, rate = stops_seen(table("crests"), _base()), LAWS["session_drift"].search, 1e-4
    assert search is not None
    even, in_share = (share for _, share in search.columns(seen))
    loss = rate * seen.clock[:, None] * seen.demanded
    mean = rate * np.mean(seen.demanded)
    assert mean * in_share == pytest.approx(loss)
    assert np.max(np.abs(mean * even - loss)) > 0.1 * np.max(np.abs(loss))


def test_every_file_of_the_folder_is_registered() -> None:
    folder = Path(effects.__file__).parent
    helpers = {"__init__", "registry", "effect_law", "stops_seen"}
    assert {file.stem for file in folder.glob("*.py")} - helpers == set(LAWS)


def _named_effects(file: Path) -> Iterator[int]:
    """Lines of a file that name an effect, except in its docstrings."""
    source = file.read_text()
    if not any(name in source for name in LAWS):
        return  # read in a hundredth of the time
    tree = ast.parse(source)
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and node.value in LAWS and id(node) not in docstrings:
            yield node.lineno


def test_no_other_module_names_an_effect() -> None:
    """Product code asks the entry of an effect: a new one is one file and one line."""
    files = [f for folder in PRODUCT for f in (ROOT / folder).rglob("*.py")]
    outside = [f for f in files if (ROOT / "models" / "effects") not in f.parents]
    named = [f"{f.relative_to(ROOT)}:{line}" for f in outside for line in _named_effects(f)]
    assert len(outside) > 100
    assert named == []
