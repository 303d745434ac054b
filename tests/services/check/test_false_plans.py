"""Every plan that is false or unsafe is refused, no plan that is neither; ninety kinds and more."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.errors import ParameterError
from slopewise.services.check.check_report import CheckReport
from slopewise.services.check.external_plan import plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map
from tests.services.check.false_plans import FALSE, UNSAFE, of_another
from tests.services.check.forbidden_drives import FORBIDDEN, bank_in_band
from tests.services.check.sound_plans import Base, bases, clean_plans

ANOTHER = ("of another map", "of another vehicle", "speeds of another", "places of another")
ANOTHER = (*ANOTHER, "continues as another")


def report_of(base: Base) -> CheckReport:
    plan = plan_of_columns(base.columns)
    return check_plan_on_map(
        plan, base.model, base.heights, clear=base.clear, quantile=base.quantile
    )


def is_refused(base: Base) -> bool:
    try:
        return not report_of(base).valid
    except ParameterError as error:
        return bool(error.field and error.expected)


def test_there_are_ninety_kinds() -> None:
    assert len(FALSE) + len(UNSAFE) + len(FORBIDDEN) + len(ANOTHER) >= 90


@pytest.mark.parametrize("kind", [*FALSE, *UNSAFE])
def test_mutants_of_real_plans_are_refused(kind: str) -> None:
    mutate, tried = (FALSE | UNSAFE)[kind], 0
    order = np.random.default_rng(len(kind)).permutation(len(bases())).tolist()
    for number in order:
        base, rng = bases()[number], np.random.default_rng(number)
        columns = mutate(dict(base.columns), rng)
        if columns is None or tried == (2 if kind in UNSAFE else 1):
            continue
        tried += 1
        assert is_refused(Base(columns, base.model, base.heights, base.clear)), number
    assert tried


@pytest.mark.parametrize("kind", FORBIDDEN)
def test_forbidden_drives_are_refused(kind: str) -> None:
    assert is_refused(FORBIDDEN[kind]())


def test_gentle_ground_within_the_band_is_driven() -> None:
    assert report_of(bank_in_band(0.1)).valid


@pytest.mark.parametrize("kind", ANOTHER)
def test_plans_taken_for_one_another_are_refused(kind: str) -> None:
    here = bases()
    for base, second in ((here[0], here[2]), (here[1], here[0])):
        assert is_refused(of_another(base, second)[kind])


@pytest.mark.parametrize("every", [6, pytest.param(1, marks=pytest.mark.nightly)])
def test_no_sound_plan_is_refused(every: int) -> None:
    plans = clean_plans()
    assert len(plans) + len(bases()) >= 100
    for name, base in (plans + [("base", base) for base in bases()])[::every]:
        report = report_of(base)
        assert report.valid, (name, report.violations[:3])
        assert set(report.unverified) <= {"path_deviation"}
