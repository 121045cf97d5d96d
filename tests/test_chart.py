"""Work-precision charts: the front, the advice, what is measured of a run, file, page and command."""

import operator
import re
import shlex
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from actin_xcheck.cli.app import app
from actin_xcheck.cli.chart import chart_command
from actin_xcheck.core.errors import UserError
from actin_xcheck.runs.alone import work_alone
from actin_xcheck.runs.executor import Lost
from actin_xcheck.runs.machine import forget_peak, peak_memory, reference_kernel
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.chart import examine as examination
from actin_xcheck.studies.chart import points as planning
from actin_xcheck.studies.chart.advice import advice_of, in_words
from actin_xcheck.studies.chart.cloud import cloud
from actin_xcheck.studies.chart.front import advise, front
from actin_xcheck.studies.chart.measure import measured
from actin_xcheck.studies.chart.page import write_chart_page
from actin_xcheck.studies.chart.points import Point, ladder, published
from actin_xcheck.studies.chart.record import FILE_NAME, read_chart
from actin_xcheck.studies.chart.truth import Quantity, errors_of, truth_of
from actin_xcheck.verdicts.judge import l2_error
from tests.lab import FEM, FV, quiet, scene_of

IMEX = "fem-p2-imex3"
P1_IMEX = "fem-p1-imex2"
A, AREA, PROBES = Quantity.CONCENTRATION, Quantity.AREA, Quantity.PROBES


# the front and the advice


def test_the_front_by_hand():
    work = [1.0, 2.0, 3.0, 4.0, 2.5, 0.5]
    error = [0.1, 0.01, 0.02, 1e-4, np.nan, 0.1]
    assert front(work, error) == [5, 1, 3]


Number = st.one_of(st.floats(0.1, 10), st.sampled_from([1.0, 2.0, np.inf, np.nan]))


@given(st.lists(st.tuples(Number, Number), max_size=30))
def test_no_point_of_the_front_is_beaten_and_every_other_is(points):
    work, error = (np.array([point[i] for point in points]) for i in (0, 1))
    kept = front(work, error)
    real = [i for i in range(len(points)) if np.isfinite(work[i]) and np.isfinite(error[i])]

    def beats(i, j):
        return work[i] <= work[j] and error[i] <= error[j] and (work[i], error[i]) != (work[j], error[j])

    assert not any(beats(i, j) for i in real for j in kept)
    others = [j for j in real if j not in kept]
    assert all(any(work[i] <= work[j] and error[i] <= error[j] for i in kept) for j in others)
    assert all(work[i] < work[j] and error[i] > error[j] for i, j in pairwise(kept))


def test_advice_is_the_cheapest_point_that_is_good_enough():
    work, error = [1.0, 2.0, 8.0, 9.0], [0.5, 5e-3, 9e-5, 1e-2]
    assert [(one.error, one.point) for one in advise(work, error)] == [(1e-2, 1), (1e-3, 2), (1e-4, 2)]
    assert advise([1.0], [0.5]) == []


# where fields are read


def test_the_cloud_integrates_over_the_disk_with_a_kink_at_the_ring():
    (x, y), weights = cloud(0.8)
    r = np.hypot(x, y)
    assert weights.sum() == pytest.approx(np.pi, rel=1e-14)
    assert weights @ x**2 == pytest.approx(np.pi / 4, rel=1e-13)
    assert weights @ (x * y) == pytest.approx(0, abs=1e-14)
    kink = np.where(r > 0.8, r - 0.8, 0.0)
    assert weights @ kink == pytest.approx(2 * np.pi * (1 / 3 - 0.8 / 2 + 0.8**3 / 6), rel=1e-12)
    assert r.max() < 1


@pytest.mark.parametrize("name", [FEM, FV])
def test_an_error_on_the_cloud_is_the_error_over_the_cell(name, tmp_path):
    scene, method = load_scene("manufactured-moving"), METHODS[name]
    run(scene, Numerics(method, 3, 0.05), tmp_path / "run.vtkhdf")
    sample = measured((scene, Point(method, 3, 0.05)), quiet)
    truth = truth_of(scene, sample, sample)
    over_cell = l2_error(scene, read_run(tmp_path / "run.vtkhdf"))
    assert errors_of(truth, sample)[A] == pytest.approx(over_cell, rel=0.03)


# the plan


@pytest.mark.parametrize("name", list(METHODS))
def test_errors_in_space_and_time_fall_together_along_a_ladder(name):
    scene, method = load_scene("growing-disk"), METHODS[name]
    rungs = ladder(scene, method, quick=True)
    order = method.order_h or 2
    assert np.diff([point.refine for point in rungs]).tolist() == [1] * (len(rungs) - 1)
    if method.adaptive:
        fall = [coarse.rtol / fine.rtol for coarse, fine in pairwise(rungs)]
        assert fall == pytest.approx([2.0**order] * len(fall), rel=0.4)  # rounded to one digit
    else:
        fall = [coarse.dt / fine.dt for coarse, fine in pairwise(rungs)]
        assert fall == pytest.approx([2.0 ** (order / method.order_dt)] * len(fall))
    wide = ladder(scene, method)
    assert set(rungs) < set(wide)
    costs = [point.cost(scene.output_times) for point in wide]
    assert costs == sorted(costs)


def test_the_articles_scheme_is_charted_with_its_own_numbers():
    scene = load_scene("fig14-four-fronts")
    (point,) = published(scene, METHODS[FEM])
    assert (point.refine, point.dt) == (6, 1.0228e-3)
    assert published(scene, METHODS[FV]) == []
    assert published(load_scene("growing-disk"), METHODS[FEM]) == []


def test_driven_methods_are_charted_when_asked_for_only():
    names = [method.name for method in examination.default_methods()]
    assert FEM in names
    assert "fem-p4-imex4" in names
    assert not {"fv-driven", "fv-tpfa"} & set(names)


# the machine


def needed(megabytes, report):
    """Bytes at the peak of something that is freed at once, in a process that has nothing left to reuse."""
    forget_peak()
    before = peak_memory()
    np.ones(megabytes * 2**17)
    return peak_memory() - before


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a peak cannot be forgotten")
def test_a_peak_of_memory_is_that_of_the_run():
    for megabytes in (64, 8):
        assert work_alone(needed, megabytes, quiet) == pytest.approx(megabytes * 2**20, abs=2**21)


def test_a_process_hands_back_what_went_wrong():
    nothing = replace(METHODS[FEM], solver="fem.nothing:Nothing")
    with pytest.raises(ModuleNotFoundError, match="nothing"):
        work_alone(measured, (load_scene("static-decay"), Point(nothing, 1, 0.1)), quiet)
    assert work_alone(operator.call, sys.exit, quiet) == Lost("its process ended with exit code 1", False)


def test_the_kernel_takes_time():
    wall, cpu = reference_kernel()
    assert 1e-3 < cpu <= 1.05 * wall


def test_a_machine_of_half_the_speed_gives_the_same_chart():
    scene = load_scene("static-decay")
    sample = measured((scene, Point(METHODS[FEM], 2, 0.1)), quiet)
    here = replace(sample, kernel=np.array([[0.04, 0.04], [0.06, 0.05]]))
    there = replace(here, wall=2 * here.wall, cpu=2 * here.cpu, kernel=2 * here.kernel)
    assert here.kernels == pytest.approx(here.wall / 0.05)
    assert here.cpu_kernels == pytest.approx(here.cpu / 0.045)
    assert there.kernels == pytest.approx(here.kernels)
    assert there.cpu_kernels == pytest.approx(here.cpu_kernels)


# errors


def test_rejected_steps_are_counted():
    scene = scene_of("psi = 300.0\np = 0.26", a="1 + 0.1*x", end=0.004)
    sample = measured((scene, Point(METHODS[P1_IMEX], 2, 0.004, 1e-7)), quiet)
    assert sample.rejected > 0  # the first step, 1e-3, is too large
    assert sample.cells_steps == 64 * (sample.steps + sample.rejected)


def test_an_error_is_measured_as_what_it_is():
    scene = load_scene("fig14-four-fronts")
    sample = measured((scene, Point(METHODS[FEM], 2, 0.05)), quiet)
    _, weights = cloud(scene.parameters.l0)
    off = replace(sample, cloud_a=1.01 * sample.cloud_a, area=1.02 * sample.area)
    truth = truth_of(scene, sample, sample)
    assert errors_of(truth, sample)[A] == 0
    assert errors_of(truth, off)[A] == pytest.approx(0.01)
    times = {values.time: values for values in scene.expect.reference.at}
    expected = max(abs(area / times[t].area - 1) for t, area in zip(sample.times, sample.area, strict=True))
    assert errors_of(truth, sample)[AREA] == pytest.approx(expected)
    assert truth.known[AREA].source == scene.expect.reference.origin
    assert truth.known[A].floor == 0  # both levels are the same run here
    assert np.isnan(errors_of(truth, replace(sample, ending="tangled"))[A])
    assert weights.size == sample.cloud_a.size


def test_the_references_own_error_is_part_of_the_change_from_the_coarser_one():
    scene = scene_of("psi = 50.0\np = 0.0", a="1 + 0.1*J(0, 3.8317059702075125*r)")
    fine = measured((scene, Point(METHODS[FEM], 2, 0.05)), quiet)
    truth = truth_of(scene, replace(fine, cloud_a=1.01 * fine.cloud_a), fine)
    assert truth.known[A].floor == pytest.approx(0.006)
    assert "fem-p1-paper, refine 2" in truth.known[A].source
    assert np.isnan(truth.known[PROBES].floor)  # the scene has none


# a chart


@pytest.fixture(scope="module")
def chart(tmp_path_factory):
    """Two methods on two meshes each, against the exact solution."""
    folder = tmp_path_factory.mktemp("chart")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(planning, "REFINES", {True: (2, 3), False: (1, 2)})
        patch.setattr(planning, "REFERENCE", {True: ((P1_IMEX, 1, 1e-3), (P1_IMEX, 2, 1e-4))})
        methods = [METHODS[FEM], METHODS[IMEX]]
        return examination.examine(load_scene("growing-disk"), methods, folder, "a command", True, quiet)


def of_method(chart, name):
    return [point for point in chart.points if point.sample.point.method.name == name]


def test_every_point_says_what_it_cost(chart):
    assert len(chart.points) == 4
    for point in chart.points:
        sample = point.sample
        assert sample.ending == "completed"
        assert (len(sample.wall), len(sample.cpu)) == (3, 3)
        assert np.all(sample.wall > 0)
        assert np.all(sample.cpu > 0)
        assert np.all(sample.kernel > 0)
        assert sample.memory > 0
        assert sample.solves >= sample.steps
        assert sample.factorisations > 0
        assert sample.baseline > 1e7
        assert sample.cells == 4 * 4**sample.point.refine
        assert sample.times[-1] == load_scene("growing-disk").time.end
        assert f"--refine {sample.point.refine}" in point.command


def test_errors_fall_as_the_methods_declare(chart):
    coarse, fine = (point.errors[A] for point in of_method(chart, FEM))
    assert 2.5 < coarse / fine < 6
    coarse, fine = (point.errors[A] for point in of_method(chart, IMEX))
    assert coarse / fine > 6
    assert chart.known[A].source == chart.known[PROBES].source == "the exact solution"
    assert chart.known[AREA].source.startswith(P1_IMEX)


def test_the_advice_is_read_off_the_chart(chart):
    for one in advice_of(chart):
        point = chart.points[one.point]
        assert point.errors[A] <= one.error
        for other in chart.points:
            if other.errors[A] <= one.error:
                assert np.median(other.sample.cpu_kernels) >= np.median(point.sample.cpu_kernels)
    said = in_words(chart)
    first = chart.points[advice_of(chart)[0].point].sample
    assert said.startswith("For an L2 error of 1e-2")
    assert f"use {first.point.method.name} ({first.point.numerics}; {np.median(first.cpu):.2g} s)" in said


def test_the_file_gives_the_chart_back(chart):
    assert chart.attributes["command"] == "a command"
    assert [sample.point.refine for sample in chart.reference] == [1, 2]
    again = read_chart(chart.path)
    for one, other in zip(chart.points, again.points, strict=True):
        assert (one.errors, one.command, one.sample.point) == (
            other.errors,
            other.command,
            other.sample.point,
        )
        assert np.array_equal(one.sample.cloud_a, other.sample.cloud_a)


def test_the_page_is_made_of_the_file_alone_and_asks_for_nothing(chart):
    page = write_chart_page(chart.path.parent).read_text(encoding="utf-8")
    assert page.count('<div class="chart"') == 12  # three errors against four kinds of work
    assert not re.search(
        r"""(src|href)=["'](?!data:|#|chart\.h5)""", page.replace('xlink:href="#', 'href="#')
    )
    assert "@import" not in page
    assert in_words(chart) in page
    for point in chart.points:
        assert point.command in page
        assert page.count(f"<title>{point.sample.point.method.name}, {point.sample.point.numerics}") == 12


def test_the_commands_make_the_runs_again(chart, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for point in (of_method(chart, FEM)[0], of_method(chart, IMEX)[0]):
        words = shlex.split(point.command)
        assert words[:3] == ["python", "-m", "actin_xcheck"]
        assert CliRunner().invoke(app, [*words[3:], "--quiet"]).exit_code == 0
        again = read_run(tmp_path / words[-1])
        assert again.series["area"][-1] == pytest.approx(point.sample.area[-1], rel=1e-14)
        assert len(again.series["time"]) == point.sample.steps + 1


# the command


def test_mistakes_are_one_line(tmp_path, chart):
    (tmp_path / "file").write_text("")
    for scene, methods, folder, message in (
        ("no-such-scene", None, tmp_path / "none", "unknown scene"),
        ("static-decay", ["fem"], tmp_path / "none", "not a method"),
        ("static-decay", [FEM], tmp_path / "file", "cannot make the folder"),
        ("static-decay", [FEM], chart.path.parent, "holds a chart of growing-disk"),
    ):
        with pytest.raises(UserError, match=message) as caught:
            chart_command(scene, methods, folder, True, True)
        assert "\n" not in str(caught.value)
        assert not (tmp_path / "none").exists()


def test_the_command_says_which_method_to_use(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(planning, "REFINES", {True: (2, 3), False: (1, 2)})
    monkeypatch.setattr(planning, "REFERENCE", {True: ((P1_IMEX, 1, 1e-3), (P1_IMEX, 2, 1e-4))})
    monkeypatch.setattr(examination, "reference_kernel", lambda: np.array([0.05, 0.05]))
    chart_command("static-decay", [P1_IMEX], tmp_path, True, True)
    said = capsys.readouterr().out
    assert "For an L2 error of 1e-2" in said
    assert str(tmp_path / "index.html") in said
    assert (tmp_path / FILE_NAME).exists()
