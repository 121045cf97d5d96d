"""The study of extremes: when 1 + div u reaches zero, how twins part, and what is stored and said of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from actin_xcheck.core.lagrange import least_dilation
from actin_xcheck.core.mesh import disk
from actin_xcheck.runs.march import March
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.draw import drawn, written
from actin_xcheck.scene.scene import load_scene, parse_scene
from actin_xcheck.scene.shelf import scene_text
from actin_xcheck.studies.extremes import agreement, breakdowns, extremes
from actin_xcheck.studies.extremes.attempt import (
    BREAKDOWNS,
    CARRIED,
    Trial,
    TrialLevel,
    attempt,
    trials,
)
from actin_xcheck.studies.study import answered
from fem.fields import Lattice
from fem.space import Space
from tests.small import STRONG


@pytest.fixture(scope="module")
def ladder():
    """Fig. 18 by two kinds of elements on two meshes each."""
    levels = [TrialLevel("fem-p2-imex3", r, 1e-6) for r in (2, 3)] + [
        TrialLevel("fem-p3-imex4", r, 1e-6) for r in (2, 3)
    ]
    levels.append(TrialLevel("fem-p3-imex4", 2, 1e-5))
    return [attempt(Trial(STRONG, level), Path()) for level in levels]


@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_dilation_is_exact_where_the_cell_shrinks_evenly_or_is_stretched(order):
    mesh = disk(2, 0.8)
    grid = Lattice(Space.on(mesh, order, 0.8), mesh.triangles).grid
    for stretch in np.diag([0.8, 0.8]), np.array([[1.3, 0.4], [0.0, 0.7]]):
        least, _ = least_dilation(grid, stretch @ grid.xi)
        assert least == pytest.approx(3 - np.trace(np.linalg.inv(stretch)), abs=1e-12)
    # 1 + phi = 3 - 2/s: shrinking to 2/3 is the end
    assert least_dilation(grid, 2 / 3 * grid.xi)[0] == pytest.approx(0, abs=1e-12)


def test_the_place_of_the_smallest_dilation_is_a_material_point():
    mesh = disk(4, 0.8)
    grid = Lattice(Space.on(mesh, 2, 0.8), mesh.triangles).grid
    pinch = np.exp(-20 * ((grid.xi - [[0.4], [0.3]]) ** 2).sum(axis=0))
    x = grid.xi + 0.05 * pinch * (np.array([[0.4], [0.3]]) - grid.xi) / 0.2
    assert np.hypot(*(least_dilation(grid, x)[1] - [0.4, 0.3])) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "refine", "seed", "number"),
    [("fv", 4, 20290117, 312), ("fem-p3-imex4", 3, 20270315, 500)],
)
def test_a_step_may_not_end_where_there_is_no_pressure(method, refine, seed, number):
    """A cell comes close to 1 + phi = 0 and stays there: long steps land behind zero, shorter ones do not."""
    scene = parse_scene(written(drawn(seed, number)), "close.toml")
    numerics = Numerics(METHODS[method], refine, scene.time.end / 16, 1e-4)
    solver = bind(scene, numerics)
    march = March(solver, numerics, scene.output_times)
    ends = [solver.mechanics.intact(moment.state.t, moment.state.x, moment.state.carried) for moment in march]
    assert march.outcome.ok, march.outcome
    assert all(outcome.ok for outcome in ends)


@pytest.mark.slow
def test_two_kinds_of_elements_agree_on_the_end_of_the_model_to_three_digits(ladder):
    assert all(one.outcome == "singular_dilation" for one in ladder)
    times = [one.breakdown for one in ladder[1:4:2]]
    assert times == pytest.approx([0.01485, 0.01485], rel=1e-3)
    assert abs(times[0] - times[1]) < 1e-3 * times[0]
    for one in ladder:
        assert abs(one.dilation) < 1e-3
        assert np.hypot(*one.place) < 2.0**-one.refine
        assert one.residual < 1e-12
        assert one.breakdown == pytest.approx(one.t, rel=1e-4)


def test_breakdown_times_carry_an_uncertainty_that_covers_what_is_known(ladder):
    found = breakdowns(ladder)
    assert [one.method for one in found] == ["fem-p2-imex3", "fem-p3-imex4"]
    apart, allowed = agreement(found)[STRONG]
    assert 0 < apart <= allowed < 1e-2
    # a run that went on says nothing about the end
    assert not breakdowns([replace(one, breakdown=np.nan) for one in ladder])
    # nor does one whose mesh is missing between two others: h does not halve there
    first = [
        replace(one, refine=1) if (one.method, one.refine) == ("fem-p2-imex3", 2) else one for one in ladder
    ]
    assert [one.method for one in breakdowns(first)] == ["fem-p3-imex4"]
    below = [*ladder, replace(ladder[0], refine=0, breakdown=1.0)]
    assert [one.refine.tolist() for one in breakdowns(below)] == [[2, 3], [2, 3]]
    assert breakdowns(below)[0].uncertainty == found[0].uncertainty
    # a fault: one method late by a part in fifty is seen
    late = [replace(one, breakdown=1.02 * one.breakdown) if "p3" in one.method else one for one in ladder]
    apart, allowed = agreement(breakdowns(late))[STRONG]
    assert apart > allowed


def test_twins_part_no_faster_than_linear_theory_allows(tmp_path):
    text = scene_text("sec54-failure").replace("end = 0.0722", "end = 0.0005")
    text = text.replace("outputs = [1.2046e-3, 3.6137e-3, 0.0722]", "")
    (tmp_path / "short.toml").write_text(text)
    trial = Trial(str(tmp_path / "short.toml"), TrialLevel("fem-p2-imex3", 2, 1e-4), epsilon=1e-10)
    one, again = attempt(trial, Path()), attempt(trial, Path())
    assert (one.apart == again.apart).all()
    assert 0.1e-10 < one.apart[0] < 1e-10
    grown = one.apart[-1] / one.apart[0]
    # by what a has at the start until it is no longer near 1
    assert 3 < grown < np.exp(one.rate * one.times[-1])
    assert one.rate == pytest.approx(7272, rel=1e-3)
    assert one.horizon == pytest.approx(36.04 / 7272, rel=1e-2)
    assert one.outcome == "completed"


def test_a_report_says_of_its_runs_what_they_came_to(ladder):
    report = answered(extremes(trials()[: len(ladder)]), lambda tasks: ladder)
    assert [(one.value, one.holds) for one in report.claims] == [
        (agreement(breakdowns(ladder))[STRONG][0], True)
    ]
    assert report.title == "1 of 1 breakdown times agree between methods"
    assert f"{len(ladder)} runs, {len(ladder)} ended before their time" in report.lead


def test_a_report_says_whether_twins_have_parted(ladder):
    times = np.array([0.0, 1e-3, 2e-3])
    twin = replace(ladder[0], epsilon=1e-10, times=times)
    for apart, words in ((1e-5, "they have not parted"), (1e-2, "they have parted")):
        ran = [replace(twin, apart=np.array([1e-10, apart, apart / 2]))]
        (chapter,) = answered(extremes(trials()[:1]), lambda tasks, ran=ran: ran).chapters
        assert words in chapter.note
        assert f"{apart:.1e} apart at most, and {apart / 2:.1e} at t = 0.002" in chapter.note


def test_the_plan_names_shipped_scenes_in_both_rheologies():
    scenes = {name: load_scene(name) for name in {trial.scene for trial in trials()}}
    strong = {round(scene.parameters.psi): set() for scene in scenes.values()}
    for scene in scenes.values():
        strong[round(scene.parameters.psi)].add(str(scene.physics.rheology))
    assert {104000, 30330, 7800, 1300, 22} == strong.keys()
    assert all(rheologies == {"viscous", "viscoelastic"} for rheologies in strong.values())
    assert all(str(scenes[name].physics.rheology) == "viscoelastic" for name in BREAKDOWNS)
    assert all(str(scenes[name].physics.rheology) == "viscous" for name in CARRIED)
