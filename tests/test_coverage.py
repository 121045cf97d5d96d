"""Uncertainties held against true errors: what counts, what is covered, and that a flattering one is seen."""

from pathlib import Path

import numpy as np
import pytest

from actin_xcheck.runs import accuracy
from actin_xcheck.runs.method import find_method
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.coverage import (
    AskedLadder,
    StatedErrors,
    Triplet,
    TruthRun,
    climb,
    coverage,
    drawn,
    true,
)
from actin_xcheck.studies.deliveries import (
    AskedDeliveries,
    Deliveries,
    Delivery,
    claims_of,
    delivered,
    deliveries,
)
from actin_xcheck.studies.stored import Stored
from actin_xcheck.studies.study import answered
from actin_xcheck.verdicts import orders
from tests.lab import scene_of


def triplet(stated: float, error: float, method: str = "fem-p1-paper") -> Triplet:
    return Triplet("s", method, 3, np.nan, "area", 1.0, stated, error, "")


def test_a_study_counts_what_is_covered_and_by_how_much():
    said = [triplet(2.0, 1.0), triplet(0.5, 1.0), triplet(9.0, 1.0), triplet(3.0, 1.0, "fv")]

    def answers(tasks):
        kinds = {task.answer for task in tasks}
        assert kinds <= {TruthRun, StatedErrors}
        if kinds == {TruthRun}:
            return [TruthRun(1e-7)] * len(tasks)
        return [StatedErrors(tuple(said)), *[StatedErrors(())] * (len(tasks) - 1)]

    methods = [find_method("fem-p1-paper"), find_method("fv")]
    report = answered(coverage([load_scene("static-decay"), *drawn(3, 2)], methods, "coverage"), answers)
    rows = {row.of: row for row in report.tables["methods"].rows}
    assert (rows["all"].triplets, rows["all"].covered, rows["all"].median) == (4, 0.75, 2.5)
    assert (rows["fv"].covered, rows["fv"].worst) == (1.0, pytest.approx(1 / 3))
    assert [one.stated for one in report.tables["missed"].rows] == [0.5]
    verdicts = {(one.quantity, one.methods): one.verdict for one in report.claims}
    assert verdicts["missed", ()] == verdicts["missed", ("fem-p1-paper",)] == "FAIL"
    assert verdicts["missed", ("fv",)] == verdicts["generous", ()] == "PASS"


def test_scenes_whose_truth_broke_down_state_nothing():
    asked = []

    def answers(tasks):
        asked.append(tasks)
        return (
            [TruthRun(np.nan)] * len(tasks)
            if tasks[0].answer is TruthRun
            else [StatedErrors((triplet(2, 1),))] * len(tasks)
        )

    answered(coverage([load_scene("static-decay"), *drawn(3, 4)], [find_method("fv")], "coverage"), answers)
    scenes = {task.ask.finest.scene.name for task in asked[-1]}
    assert not scenes & {task.ask.name for task in asked[0]}


@pytest.mark.slow
def test_a_ladder_with_an_exact_solution_is_covered_and_a_flattered_one_is_not(tmp_path: Path, monkeypatch):
    scene = load_scene("manufactured-moving")
    ladder = AskedLadder(Stored(scene, Numerics(find_method("fem-p2-imex3"), 4, 0.025), "run.vtkhdf"), "")
    triplets = climb(ladder, tmp_path).triplets
    assert {one.refine for one in triplets} == {4, 3}
    assert {one.quantity for one in triplets} >= {"total_actin", "probe_a"}
    assert all(one.covered for one in triplets), [one for one in triplets if not one.covered]
    assert np.median([one.stated / one.error for one in triplets]) < 50
    for name in ("ASYMPTOTIC", "ELSEWHERE"):
        monkeypatch.setattr(orders, name, 0.1)
    assert not all(one.covered for one in climb(ladder, tmp_path).triplets)


@pytest.mark.slow
def test_a_scene_whose_numbers_nobody_knows_is_held_against_a_run(tmp_path: Path):
    scene = scene_of("psi = 20\np = 0.3", a="1 + 0.1*x*(3 - r**2)", end=0.1)
    assert true(scene, tmp_path).estimate < 1e-6
    ladder = AskedLadder(
        Stored(scene, Numerics(find_method("fem-p1-imex2"), 4, 0.01), "run.vtkhdf"),
        f"truth--{scene.name}.vtkhdf",
    )
    triplets = climb(ladder, tmp_path).triplets
    assert {one.quantity for one in triplets} >= {"area", "total_actin"}
    assert np.mean([one.covered for one in triplets]) > 0.9


def delivery(error: float, estimate: float, known_to: float = 0.0) -> Delivery:
    return Delivery("s", 1e-3, "completed", "fem-p7-imex5", 1, 1e-4, estimate, error, known_to, 1.0)


@pytest.mark.parametrize(
    ("errors", "failing"),
    [
        ([(2e-4, 5e-4), (1e-5, 3e-5)], set()),
        ([(6e-4, 5e-4)], {"flattered"}),
        ([(1e-3, 1.1e-3)], {"missed"}),  # out of reach, and said to be
        ([(1e-5, 9e-4)], {"generous"}),
    ],
)
def test_what_an_accuracy_delivers_is_judged(errors, failing):
    rows = [
        *(delivery(*one) for one in errors),
        delivery(5e-4, 1e-4, known_to=1e-3),
        delivery(np.nan, np.nan),
    ]
    report = answered(
        deliveries([load_scene("mode-11-wall")], [1e-3], "coverage"),
        lambda tasks: [Deliveries(tuple(rows))] * len(tasks),
    )
    assert {claim.quantity for claim in report.claims if not claim.holds} == failing
    assert f"of {len(errors)} accuracies" in report.title


@pytest.mark.slow
def test_a_mode_is_delivered_as_asked_and_a_loose_climb_is_seen(tmp_path: Path, monkeypatch):
    asked = AskedDeliveries(load_scene("mode-11-wall"), (1e-2, 1e-3))
    found = delivered(asked, tmp_path).rows
    assert all(claim.holds for claim in claims_of(found, "coverage") if claim.quantity != "generous")
    assert [row.accuracy for row in found] == [1e-2, 1e-3]
    for name in ("BERTH", "LEAST", "TIMES"):
        monkeypatch.setattr(accuracy, name, 1e-3)
    loose = delivered(asked, tmp_path).rows
    assert "flattered" in {claim.quantity for claim in claims_of(loose, "coverage") if not claim.holds}
