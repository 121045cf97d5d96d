"""Where codes part: a fault in either code is said to be of transport or of mechanics, which it is."""

from contextlib import ExitStack
from math import inf
from pathlib import Path

import h5py
import pytest

from actin_xcheck.runs.method import METHODS, with_lent_balance
from actin_xcheck.runs.numerics import step_count
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.compare import (
    FILE_NAME,
    Comparison,
    JudgedScene,
    companions,
    compare,
    jobs_of,
    localised,
    read_comparison,
)
from actin_xcheck.studies.compare_page import write_comparison_page
from actin_xcheck.studies.faults import FAULTS
from actin_xcheck.studies.faults.fault import replaced
from actin_xcheck.studies.stored import Ran
from actin_xcheck.studies.study import Report
from actin_xcheck.verdicts.judge import KnownTo
from fv import krylov
from tests.lab import FEM, FV
from tests.studies import carry

SCENE = "smooth-fronts"
PAPER, SECOND = ("fem-p1-paper", "fv-paper"), ("fem-p1-imex2", "fv")
LENT = {"fv-paper": "fv-coupled", "fv": "fv-order2"}


def compared(folder: Path, methods: tuple[str, ...], *faults: str) -> tuple[Report, Comparison]:
    """What a comparison says of a scene of which no theory says anything, with faults."""
    scene = load_scene(SCENE)
    jobs = jobs_of([scene], [METHODS[name] for name in methods], 3, scene.time.end / 16)
    reports = []

    def study():
        reports.append((yield from compare(jobs)))
        return reports[0]

    with ExitStack() as stack:
        for fault in faults:
            stack.enter_context(replaced(FAULTS[fault].target, FAULTS[fault].wrong))
        carry(folder, study(), name="compare")  # with a journal: pairs that part are kept and read again
    return reports[0], read_comparison(folder / FILE_NAME)


@pytest.mark.parametrize(
    ("methods", "faults", "where"),
    [
        (PAPER, ["fv-rim-load-dropped"], "mechanics"),
        (PAPER, ["fem-dilution-dropped"], "transport"),
        (PAPER, ["fv-dilution-dropped", "fv-rim-load-dropped"], "transport and mechanics"),
        *(
            pytest.param(*one, marks=pytest.mark.slow)
            for one in (
                (PAPER, ["rim-integral-sign"], "mechanics"),  # of the elements, which lend it
                (PAPER, ["fv-dilution-dropped"], "transport"),
                (SECOND, ["fv-rim-load-dropped"], "mechanics"),
                (SECOND, ["imex-mass-stale"], "transport"),
            )
        ),
    ],
)
def test_a_fault_is_said_to_be_where_it_is(methods, faults, where, tmp_path):
    report, found = compared(tmp_path, methods, *faults)
    said = f"{methods[0]} and {methods[1]} part in {where}: "
    assert report.findings[0].startswith(f"{SCENE}: {said}")
    first, *others = found.partings
    assert first.methods == (methods[0], LENT[methods[1]], methods[1])
    assert first.apart > 1
    assert (first.transport > 1, first.mechanics > 1) == ("transport" in where, "mechanics" in where)
    assert all(1 < other.apart <= first.apart for other in others)
    assert set(found.runs) == {f"{SCENE}/{name}" for name in methods}  # those that were asked for
    page = write_comparison_page(tmp_path / FILE_NAME).read_text(encoding="utf-8")
    assert said in page
    assert page.count("/tables/partings</span>") == len(found.partings)


def test_nothing_is_lent_where_the_codes_agree(tmp_path):
    report, found = compared(tmp_path, PAPER)
    assert (found.partings, len(report.findings)) == ((), 1)
    assert not list(tmp_path.glob("*fv-coupled*"))
    page = write_comparison_page(tmp_path / FILE_NAME).read_text(encoding="utf-8")
    assert "Where do they part?" not in page
    with h5py.File(tmp_path / FILE_NAME, "r+") as file:
        del file["tables/partings"]  # as in one that was made before
    assert read_comparison(tmp_path / FILE_NAME).triangles == found.triangles


def test_what_was_asked_for_already_is_not_asked_for_again():
    scene = load_scene(SCENE)
    jobs = jobs_of([scene], [METHODS[name] for name in (*PAPER, "fv-coupled")], 3, None)
    study = compare(jobs)
    runs = next(study)
    study.send([Ran("completed", "", 1.0)] * len(runs))
    asked = study.send([JudgedScene((), (), KnownTo(SCENE, 0.0, 0.0), parted=(PAPER,))])
    assert [task.work for task in asked] == [localised]
    assert [[job.numerics.method.name for job in levels] for levels in asked[0].ask] == [
        [name] * 3 for name in ("fem-p1-paper", "fv-coupled", "fv-paper")
    ]
    assert {job.file for levels in asked[0].ask for job in levels} == {run.ask.file for run in runs}


@pytest.mark.slow
def test_a_run_that_ends_early_parts_where_the_other_force_balance_does_not(tmp_path, monkeypatch):
    """A fault because of which BiCGStab does not solve the volumes' force balance; without what would."""
    monkeypatch.setattr(krylov, "minimise", lambda apply, rhs, inverse, goal, guess: guess)
    report, found = compared(tmp_path, SECOND, "fv-viscosities-swapped")
    assert (
        f"{SECOND[0]} and {SECOND[1]} part in mechanics: the end is not reached by all" in report.findings[0]
    )
    assert (found.partings[0].transport, found.partings[0].mechanics) == (0.0, inf)
    page = write_comparison_page(tmp_path / FILE_NAME).read_text(encoding="utf-8")
    assert "the end is not reached by all" in page


@pytest.mark.parametrize("name", METHODS)
def test_the_lent_force_balance_is_all_that_differs(name):
    lent = with_lent_balance(METHODS[name])
    assert (lent and lent.name) == LENT.get(name)


# what runs beside a comparison, for its uncertainties


def test_companions_keep_errors_in_space_and_time_in_step():
    scene = load_scene("fig14-four-fronts")
    jobs = jobs_of([scene], [METHODS[FEM], METHODS["fem-p3-imex4"], METHODS[FV]], 5, None)
    beside = companions(jobs)
    assert [job.numerics.refine for job in beside] == [4, 3] * 3
    paper = [step_count(job.numerics.dt, scene.output_times) for job in (jobs[0], *beside[:2])]
    assert paper[0] / paper[1] == pytest.approx(4, rel=0.05)
    assert paper[1] / paper[2] == pytest.approx(4, rel=0.05)
    fourth = [step_count(job.numerics.dt, scene.output_times) for job in (jobs[1], *beside[2:4])]
    assert fourth[0] / fourth[1] == pytest.approx(2, rel=0.05)
    assert len({job.file for job in [*jobs, *beside]}) == 9


def test_adaptive_companions_loosen_their_tolerance_instead():
    jobs = jobs_of([load_scene("stirred")], [METHODS["fem-p2-imex3"], METHODS[FV]], 4, None, 1e-6)
    assert [job.numerics.rtol for job in companions(jobs)[:2]] == pytest.approx([8e-6, 64e-6])


def test_one_code_alone_and_a_method_without_order_have_no_companions():
    scene = load_scene("stirred")
    assert companions(jobs_of([scene], [METHODS[FEM], METHODS["fem-p2-imex3"]], 4, None)) == []
    beside = companions(jobs_of([scene], [METHODS[FEM], METHODS["fv-tpfa"]], 4, None))
    assert {job.numerics.method.name for job in beside} == {FEM}
