"""One code's mechanics made wrong: the other one shows it, without theory, exact values or references."""

from functools import cache

import numpy as np
import pytest

from actin_xcheck.runs.method import FORCE_BALANCE, FV_FORCE_BALANCE
from actin_xcheck.studies.balances import LOADS, Balanced
from actin_xcheck.studies.faults import mechanics, one_sided
from actin_xcheck.studies.faults.fault import replaced, unchanged

BALANCES = {"fem": FORCE_BALANCE, "fv": FV_FORCE_BALANCE}


@cache
def right(load, refine=4):
    return {code: Balanced(load, refine).flow(balance) for code, balance in BALANCES.items()}


def held(load, code, wrong, refine=4):
    """The claims where one code came to something wrong."""
    both = right(load, refine) | {code: wrong}
    return Balanced(load).held(both["fem"], both["fv"])


@pytest.mark.parametrize("load", LOADS)
def test_both_codes_say_the_same_the_better_the_finer_the_mesh(load):
    """A bound is no more than half as much again as what is found, but where velocities are exact."""
    coarse, fine = (held(load, "fv", right(load, refine)["fv"], refine) for refine in (3, 4))
    for one, other in zip(coarse, fine, strict=True):
        assert other.holds, other.sentence
        if other.bound > 1e-6:
            assert other.value > other.bound / 1.5
            assert one.value / other.value > 2.8
        else:
            assert other.value < 1e-11


IN_ONE = [(fault.code, fault) for fault in one_sided.FAULTS]
IN_EITHER = [(code, fault) for fault in mechanics.FAULTS if ":Model." in fault.target for code in BALANCES]
LENT = [("fem", fault) for fault in mechanics.FAULTS if fault.target.startswith("fem.")]


@pytest.mark.parametrize(
    ("code", "fault"), [*IN_ONE, *IN_EITHER, *LENT], ids=lambda one: getattr(one, "name", one)
)
def test_a_fault_of_one_code_is_seen_by_the_other(code, fault):
    """In velocities of one moment, by twice the bound at least."""
    called, worst = 0, 0.0
    for load in LOADS:
        with replaced(fault.target, fault.wrong) as calls, np.errstate(all="ignore"):
            wrong = Balanced(load).flow(BALANCES[code])
        called += calls.count
        found = [one.value / one.bound for one in held(load, code, wrong)]
        worst = max(worst, *np.nan_to_num(found, nan=np.inf))
        if worst > 2:
            break
    assert called
    assert worst > 2


def test_what_is_no_fault_is_none():
    with replaced("fv.stress:Diamonds.cross", unchanged):
        assert np.array_equal(Balanced("dilation").flow(FV_FORCE_BALANCE).x, right("dilation")["fv"].x)


def test_every_fault_of_the_mechanics_is_among_them():
    """But for that of a prescribed motion, which has no force balance."""
    every = {fault.name for fault in (*mechanics.FAULTS, *one_sided.FAULTS)}
    assert every == {"motion-frozen"} | {fault.name for _, fault in (*IN_ONE, *IN_EITHER, *LENT)}


def test_both_codes_have_the_same_wrong_readings():
    names = {
        code: {one.name.removeprefix(code) for one in one_sided.OF_BOTH if one.code == code}
        for code in BALANCES
    }
    assert names["fem"] == names["fv"]
