"""Negative controls: what the harness calls right must turn red when the code is made wrong."""

import os
import pickle
from dataclasses import dataclass, replace
from inspect import getattr_static

import numpy as np
import pytest

from actin_xcheck.core.parameters import Fidelity
from actin_xcheck.runs.executor import executor, in_turn
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.checks import SUITE, Compared, Reduced
from actin_xcheck.studies.faults import FAULTS as CATALOGUE
from actin_xcheck.studies.faults import control, hunt, missed
from actin_xcheck.studies.faults.fault import ControlError, injected, replaced, watched
from actin_xcheck.verdicts.judge import judge
from fem.space import Space
from fv.krylov import TransportOperator
from fv.solver import FvDiamond, FvSecondOrder
from tests.claims import claim
from tests.faults import FAULTS
from tests.lab import FEM, FV
from tests.small import NOTHING, STILL
from tests.studies import carry

STEPS = {"growing-disk": 50, "fig14-four-fronts": 80, "mode-11-wall": 50}
GEOMETRIC = ("drop the dilution", "freeze the mesh", "use the old cell volumes")
"""Faults of tests/faults.py that any motion of the mesh shows."""


def verdicts(name, folder, methods=(FEM, FV)):
    """Claims about a scene's runs at a resolution of seconds."""
    scene, runs = load_scene(name), {}
    for method in methods:
        path = folder / f"{method}.vtkhdf"
        run(scene, Numerics(METHODS[method], 4, scene.time.end / STEPS[name]), path)
        runs[method] = read_run(path)
    return judge(scene, runs)


@pytest.mark.parametrize("name", list(STEPS))
def test_without_a_fault_every_claim_holds(name, tmp_path):
    claims = verdicts(name, tmp_path)
    assert len(claims) >= 7
    assert [claim for claim in claims if not claim.holds] == []


@pytest.mark.parametrize(
    ("fault", "name", "method"),
    [
        *((fault, "growing-disk", method) for fault in GEOMETRIC for method in (FEM, FV)),
        *(("flip the boundary integral of f", "fig14-four-fronts", method) for method in (FEM, FV)),
        *zip(GEOMETRIC, ("fig14-four-fronts",) * 3, (FEM, FV, FEM), strict=True),
        *zip(GEOMETRIC, ("mode-11-wall",) * 3, (FV, FEM, FV), strict=True),
    ],
)
def test_a_fault_turns_a_verdict_red(fault, name, method, tmp_path, monkeypatch):
    FAULTS[fault](monkeypatch)
    failed = [claim.statement for claim in verdicts(name, tmp_path, (method,)) if not claim.holds]
    assert failed, f"nothing caught: {fault}"


# the registry of faults, and the hunt for them

NARROW = Reduced("smooth-fronts", FEM, Fidelity.SECTOR, 2, 10)
MODES = Reduced("mode-1-cell", "fem-p4-imex4", Fidelity.MODAL, 1, 20, 1e-4)


@pytest.fixture
def hunted(tmp_path):
    """The hunt for one fault, in this process."""

    def hunt_for(fault, *suite):
        report = carry(tmp_path, hunt([fault], suite), name="faults")
        assert all(one.red == 0 for one in report.tables["checks"].rows)
        (caught,) = report.tables["faults"].rows
        return report, caught

    return hunt_for


def breaks_down(right, *arguments):
    raise TypeError("not such arguments")


def test_every_fault_names_what_is_there_and_can_be_told_to_a_worker():
    assert len(CATALOGUE) >= 50
    for name, fault in CATALOGUE.items():
        with replaced(fault.target):
            pass
        assert pickle.loads(pickle.dumps(fault)) == fault
        assert fault.name == name
        assert fault.code in {"fem", "fv", "both", "harness"}
        assert fault.sentence.endswith(".")


def test_a_fault_is_gone_afterwards_whatever_it_replaces():
    held = {TransportOperator: "__call__", Space: "inside", FvSecondOrder: "_source", Compared: "name"}
    before = {owner: getattr_static(owner, name) for owner, name in held.items()}
    targets = tuple(f"{owner.__module__}:{owner.__qualname__}.{name}" for owner, name in held.items())
    with watched(targets) as calls:
        assert STILL.name == "compare static-decay fem-p1-paper fv-coupled refine 2"
        assert getattr_static(FvSecondOrder, "_source") is not FvDiamond._source
    assert [one.count for one in calls.values()] == [0, 0, 0, 1]
    assert {owner: getattr_static(owner, name) for owner, name in held.items()} == before
    assert "_source" not in vars(FvSecondOrder)


@pytest.mark.parametrize("target", ["fv.krylov:gone", "fv.krylov:TransportOperator.gone", "fv.gone:solve"])
def test_a_control_whose_target_is_gone_is_an_error(target):
    with pytest.raises(ControlError, match="is gone"), injected(replace(NOTHING, target=target)):
        pass


def test_a_control_that_never_ran_is_an_error():
    with pytest.raises(ControlError, match="never called"), injected(NOTHING):
        pass


def test_an_error_within_is_not_hidden_by_one_about_the_control():
    with pytest.raises(KeyError, match="mine"), injected(NOTHING):
        raise KeyError("mine")


@pytest.mark.parametrize(
    ("name", "check", "words"),
    [
        ("fv-leak", STILL, "balance"),
        ("uncertainty-too-small", STILL, "their uncertainties are too small"),
        ("modal-rate-off", MODES, "grows at the predicted rate"),
        ("sector-too-narrow", NARROW, "a sector and the whole cell are the same"),
    ],
)
def test_a_fault_is_caught_by_the_claim_that_is_there_for_it(name, check, words, hunted):
    report, caught = hunted(CATALOGUE[name], check)
    assert [claim.holds for claim in report.claims] == [True, True]
    assert report.title == "1 of 1 deliberate faults caught"
    assert caught.check == check.name
    assert words in caught.claim.statement
    assert caught.claim.value > 2 * caught.claim.bound


def test_no_fault_is_not_caught(hunted):
    report, missed = hunted(NOTHING, STILL)
    assert report.title == "0 of 1 deliberate faults caught"
    assert report.claims[0].sentence.startswith(
        "nothing [fv]: is caught: Nothing is wrong.: inf > 1 (1 checks"
    )
    assert [claim.holds for claim in report.claims] == [False, True]
    assert (missed.claim, missed.passed, missed.trouble) == (None, (STILL.name,), "")


def test_a_check_that_breaks_down_has_caught_nothing(hunted):
    _, missed = hunted(replace(NOTHING, wrong=breaks_down), STILL)
    assert not missed.caught
    assert missed.trouble == f"{STILL.name} broke down: TypeError: not such arguments"


def test_a_fault_that_no_check_reaches_is_not_caught(hunted):
    _, missed = hunted(replace(NOTHING, target="fem.radial:Radial._shape"), STILL)
    assert missed.trouble == "no green check calls fem.radial:Radial._shape"


@dataclass(frozen=True)
class Red:
    """A check that is red without a fault."""

    name: str = "red"
    bounded: bool = True

    def claims(self, folder):
        return [claim("something holds", np.nan, methods=(FV,))]


def test_a_check_that_is_red_without_a_fault_catches_nothing(tmp_path):
    report = carry(tmp_path, hunt([NOTHING], [Red()]))
    assert [claim.holds for claim in report.claims] == [False, False]
    assert "something holds" in report.claims[1].note
    assert not report.tables["faults"].rows[0].caught


@dataclass(frozen=True)
class Broken(Red):
    """A check that comes to no verdict."""

    name: str = "broken"

    def claims(self, folder):
        raise ZeroDivisionError("nothing to divide by")


def test_a_check_that_breaks_down_without_a_fault_is_red_and_the_others_go_on(tmp_path):
    report = carry(tmp_path, hunt([CATALOGUE["fv-leak"]], [Broken(), STILL]))
    assert [claim.holds for claim in report.claims] == [True, False, True]
    said = "there is no number (broke down: ZeroDivisionError: nothing to divide by)"
    assert report.claims[1].sentence.endswith(said)


def test_a_machine_without_memory_is_no_verdict_that_is_kept(tmp_path, monkeypatch):
    def starves(self, folder):
        raise MemoryError

    monkeypatch.setattr(Broken, "claims", starves)
    with pytest.raises(MemoryError):
        carry(tmp_path, hunt([NOTHING], [Broken()]))


def test_a_fault_whose_target_is_gone_spoils_no_other(hunted):
    _, gone = hunted(replace(NOTHING, target="fv.solver:nothing"), STILL)
    assert gone.trouble == "fv.solver:nothing is gone"


@pytest.mark.parametrize("value", [-5.0, 3.0])
def test_a_claim_with_a_negative_bound_catches_what_exceeds_it(value):
    """Such as "at least 10", said as -x <= -10: a value in parts of that bound means nothing."""
    caught = replace(missed(NOTHING, (), ""), claim=claim("x is large", value, -10.0), check="broken")
    assert control(caught).holds


def process(task):
    return task, os.getpid()


def test_work_is_done_in_turn_and_here_where_that_is_asked_for():
    with in_turn(), executor(2) as processes:
        done = list(processes.results(process, ["b", "a"]))
    assert done == [(0, ("b", os.getpid())), (1, ("a", os.getpid()))]


@pytest.mark.slow
@pytest.mark.nightly
def test_every_fault_is_caught(tmp_path):
    """About five minutes on two cores."""
    with executor(2) as processes:
        report = carry(tmp_path, hunt(list(CATALOGUE.values()), SUITE), processes)
    assert [claim.sentence for claim in report.claims if not claim.holds] == []
