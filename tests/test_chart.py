"""Work-precision charts: the front, the advice, what is measured of a run, file, page and command."""

import operator
import re
import shlex
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from actin_xcheck.cli.app import app
from actin_xcheck.core.errors import Ending
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics, run_seconds
from actin_xcheck.runs.processes import Lost, work_alone
from actin_xcheck.runs.provenance import forget_peak, peak_memory
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene, parse_scene
from actin_xcheck.studies.chart import chart, default_methods, in_words
from actin_xcheck.studies.chart.measure import (
    QUICK,
    answered,
    cloud,
    ladder,
    measured,
    published,
)
from actin_xcheck.studies.chart.plots import SIGNS, WORKS, Chart, chapter_of, row_of
from actin_xcheck.studies.chart.truth import ChartedQuantity, PointKind, advise, errors_of, front, truth_of
from actin_xcheck.studies.stored import AskedRun
from actin_xcheck.verdicts.known import l2_error
from tests.lab import FEM, FV, scene_of
from tests.small import CHARTED
from tests.studies import carry

IMEX = "fem-p2-imex3"
P1_IMEX = "fem-p1-imex2"
A, AREA, PROBES = ChartedQuantity.CONCENTRATION, ChartedQuantity.AREA, ChartedQuantity.PROBES


def sample_of(scene, point, folder=None):
    """A point as it is measured."""
    return measured(AskedRun(scene, point), folder)


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
    assert advise(work, error) == [(1e-2, 1), (1e-3, 2), (1e-4, 2)]
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
    answer = sample_of(scene, Numerics(method, 3, 0.05)).answer
    truth = truth_of(scene, answer, answer, "itself")
    over_cell = l2_error(scene, read_run(tmp_path / "run.vtkhdf"))
    assert errors_of(truth, answer)[A] == pytest.approx(over_cell, rel=0.03)


# the plan


@pytest.mark.parametrize("name", list(METHODS))
def test_errors_in_space_and_time_fall_together_along_a_ladder(name):
    scene, method = load_scene("growing-disk"), METHODS[name]
    rungs = ladder(scene, method, QUICK)
    order = method.order_h or 2
    assert np.diff([point.refine for point in rungs]).tolist() == [1] * (len(rungs) - 1)
    if method.adaptive:
        fall = [coarse.rtol / fine.rtol for coarse, fine in pairwise(rungs)]
        assert fall == pytest.approx([2.0**order] * len(fall), rel=0.6)  # rounded to one digit, both
    else:
        fall = [coarse.dt / fine.dt for coarse, fine in pairwise(rungs)]
        assert fall == pytest.approx([2.0 ** (order / method.order_dt)] * len(fall))
    wide = ladder(scene, method)
    assert set(rungs) < set(wide)
    costs = [run_seconds(point, scene.output_times) for point in wide]
    assert costs == sorted(costs)


def test_the_articles_scheme_is_charted_with_its_own_numbers():
    scene = load_scene("fig14-four-fronts")
    (point,) = published(scene, METHODS[FEM])
    assert (point.refine, point.dt) == (6, 1.0228e-3)
    assert published(scene, METHODS[FV]) == published(scene, METHODS[FEM], QUICK) == []
    assert published(load_scene("growing-disk"), METHODS[FEM]) == []


def test_driven_methods_are_charted_when_asked_for_only():
    assert {FEM, "fem-p4-imex4"} <= set(default_methods()) <= METHODS.keys() - {"fv-driven", "fv-tpfa"}


# the machine


def needed(megabytes):
    """Bytes at the peak of something that is freed at once, in a process that has nothing left to reuse."""
    forget_peak()
    before = peak_memory()
    np.ones(megabytes * 2**17)
    return peak_memory() - before


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a peak cannot be forgotten")
def test_a_peak_of_memory_is_that_of_the_run():
    for megabytes in (64, 8):
        assert work_alone(needed, megabytes) == pytest.approx(megabytes * 2**20, abs=2**21)


def sample_of_nothing(point):
    return sample_of(load_scene("static-decay"), point)


def test_a_process_hands_back_what_went_wrong():
    nothing = replace(METHODS[FEM], solver="fem.nothing:Nothing")
    with pytest.raises(ModuleNotFoundError, match="nothing"):
        work_alone(sample_of_nothing, Numerics(nothing, 1, 0.1))
    assert work_alone(operator.call, sys.exit) == Lost("its process ended with exit code 0", False)


def test_a_machine_of_half_the_speed_gives_the_same_chart():
    sample = sample_of(load_scene("static-decay"), Numerics(METHODS[FEM], 2, 0.1))
    assert (sample.kernel > 0).all()
    one = replace(sample, kernel=np.array([[0.04, 0.04], [0.06, 0.05]]))
    other = replace(one, wall=2 * one.wall, cpu=2 * one.cpu, kernel=2 * one.kernel)
    assert one.kernels == pytest.approx(one.wall / 0.05)
    assert one.cpu_kernels == pytest.approx(one.cpu / 0.045)
    assert other.kernels == pytest.approx(one.kernels)
    assert other.cpu_kernels == pytest.approx(one.cpu_kernels)


# errors


def test_rejected_steps_are_counted():
    scene = scene_of("psi = 300.0\np = 0.26", a="1 + 0.1*x", end=0.004)
    sample = sample_of(scene, Numerics(METHODS[P1_IMEX], 2, 0.004, 1e-7))
    assert sample.rejected > 0  # the first step, 1e-3, is too large
    assert sample.cells_steps == 64 * (sample.steps + sample.rejected)


def test_an_error_is_measured_as_what_it_is():
    scene = load_scene("fig14-four-fronts")
    answer = sample_of(scene, Numerics(METHODS[FEM], 2, 0.05)).answer
    off = replace(answer, cloud_a=1.01 * answer.cloud_a, area=1.02 * answer.area)
    truth = truth_of(scene, answer, answer, "itself")
    assert errors_of(truth, answer)[A] == 0
    assert errors_of(truth, off)[A] == pytest.approx(0.01)
    times = {values.time: values for values in scene.expect.reference.at}
    expected = max(abs(area / times[t].area - 1) for t, area in zip(answer.times, answer.area, strict=True))
    assert errors_of(truth, answer)[AREA] == pytest.approx(expected)
    assert truth.known[AREA].source == scene.expect.reference.origin
    assert truth.known[A].floor == 0  # both levels are the same run here
    assert np.isnan(errors_of(truth, replace(answer, ending="tangled"))[A])


def test_the_references_own_error_is_part_of_the_change_from_the_coarser_one():
    scene = scene_of("psi = 50.0\np = 0.0", a="1 + 0.1*J(0, 3.8317059702075125*r)")
    fine = sample_of(scene, Numerics(METHODS[FEM], 2, 0.05)).answer
    truth = truth_of(scene, replace(fine, cloud_a=1.01 * fine.cloud_a), fine, "the finer run")
    assert truth.known[A].floor == pytest.approx(0.006)
    assert truth.known[A].source == "the finer run"
    assert np.isnan(truth.known[PROBES].floor)  # the scene has none


# a chart


@pytest.fixture(scope="module")
def charted(carried):
    """Two methods on two meshes each, against the exact solution."""
    return carried("chart")


def rows_of(report, method=None):
    return [row for row in report.tables["points"].rows if method in (None, row.method)]


@pytest.mark.slow
def test_every_point_says_what_it_cost(charted):
    rows, page = rows_of(charted.report), (charted.folder / "index.html").read_text(encoding="utf-8")
    assert len(rows) == 4
    for row in rows:
        assert page.count(f"{row.method}, {row.numerics}") >= 12  # three errors against four kinds of work
        assert row.ending == "completed"
        assert len(row.sample.wall) == len(row.sample.cpu) == 3
        assert 0 < row.wall_least <= row.wall <= row.wall_most
        assert 0 < row.cpu_least <= row.cpu <= row.cpu_most
        assert row.megabytes > 0
        assert row.solves >= row.steps
        assert row.factorisations > 0
        assert row.sample.baseline > 1e7
        assert row.cells == 4 * 4**row.refine
        assert row.sample.answer.times[-1] == load_scene("growing-disk").time.end
        assert f"--refine {row.refine}" in row.command


def test_errors_fall_as_the_methods_declare(charted):
    coarse, fine = (row.error_a for row in rows_of(charted.report, FEM))
    assert 2.5 < coarse / fine < 6
    coarse, fine = (row.error_a for row in rows_of(charted.report, IMEX))
    assert coarse / fine > 6
    known = {row.quantity: row for row in charted.report.tables["held"].rows}
    assert known[A].source == known[PROBES].source == "the exact solution"
    assert known[AREA].source == f"{P1_IMEX}, refine 2, rtol 0.0001"


def test_the_advice_is_read_off_the_chart(charted):
    report = charted.report
    (sheet,) = report.chapters[0].exhibits
    rows = {(row.method, row.numerics): row for row in rows_of(report)}
    for error, method, numerics, *_ in sheet.rows[1:]:
        advised = rows[method, numerics]
        assert advised.error_a <= float(error)
        good = [row for row in rows.values() if row.error_a <= float(error)]
        assert advised.cpu_kernels == min(row.cpu_kernels for row in good)
    _, method, numerics, *_ = sheet.rows[1]
    said = f"use {method} ({numerics}; {rows[method, numerics].cpu:.2g} s)"
    assert report.findings[0].startswith("For an L2 error of 1e-2")
    assert said in report.findings[0]


def test_the_commands_make_the_runs_again(charted, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for row in (rows_of(charted.report, FEM)[0], rows_of(charted.report, IMEX)[0]):
        words = shlex.split(row.command)
        assert words[:3] == ["python", "-m", "actin_xcheck"]
        assert CliRunner().invoke(app, [*words[3:], "--quiet"]).exit_code == 0
        again = read_run(tmp_path / words[-1])
        assert again.series["area"][-1] == pytest.approx(row.sample.answer.area[-1], rel=1e-14)
        assert len(again.series["time"]) == row.steps + 1


def test_a_ladder_is_cut_where_a_method_has_had_its_seconds(tmp_path):
    cut = chart(load_scene("static-decay"), [METHODS[FEM]], replace(CHARTED, budget=0.0))
    report = carry(tmp_path, cut, name="chart")
    assert len(rows_of(report)) == 1
    assert f"so many seconds: {FEM} (refine 3, " in report.tables["points"].note


def of_points(scene, points, reference=CHARTED.reference):
    """A chart of points of no ladder."""
    coarse, fine = (
        answered(AskedRun(scene, Numerics(METHODS[name], refine, scene.time.end, rtol)), Path())
        for name, refine, rtol in reference
    )
    truth = truth_of(scene, coarse, fine, "the finer one")
    return Chart(truth.known, [row_of(scene, truth, one, sample_of(scene, one)) for one in points])


def lines_of(chart, quantity=A):
    (plot,) = (one for one in chapter_of(chart, WORKS[0]).exhibits if one.key == quantity)
    return plot.lines


def test_a_run_that_fails_stands_on_the_rail():
    text = load_scene("fig18-nonuniform-contraction").text.replace("1e-3*cos", "0.1*cos")
    text = re.sub(r"(?m)^(end|outputs) = .*|(?s:^\[expect.*)", "", text).replace(
        "[time]", "[time]\nend = 0.02"
    )
    points = [Numerics(METHODS[FEM], 2, dt) for dt in (0.005, 0.001)]
    found = of_points(parse_scene(text, "steep.toml"), points)
    failed = [row for row in found.rows if row.standing is PointKind.FAILED]
    assert [(row.dt, row.ending) for row in failed] == [(0.005, "tangled")]
    assert np.isnan(failed[0].error_a)
    (rail,) = (line for line in lines_of(found) if line.rail)
    assert rail.label == "failed: tangled"
    assert "failed: tangled: triangle" in rail.said[0]
    assert rail.shape == SIGNS[Ending.TANGLED]


def test_all_endings_have_a_sign_of_their_own():
    assert SIGNS.keys() == set(Ending) - {Ending.COMPLETED}
    assert len(set(SIGNS.values())) == len(SIGNS)


def test_what_is_wrong_or_below_the_references_own_error_is_drawn_as_that():
    scene, reference = load_scene("fig14-four-fronts"), ((IMEX, 1, 1e-3), (IMEX, 2, 1e-4))
    end = scene.time.end
    wrong = of_points(scene, [Numerics(METHODS[FEM], 2, end)], reference)
    (row,) = wrong.rows
    assert row.ending == "completed"
    assert row.error_a > 0.05
    assert row.standing is PointKind.SILENT
    (line,) = (line for line in lines_of(wrong, AREA) if line.said)
    assert line.red
    assert line.shape == "circle-open"
    assert in_words(wrong) == "No run comes within an error of 1e-2."
    same = of_points(scene, [Numerics(METHODS[IMEX], 2, end, 2e-4)], reference)
    (row,) = same.rows  # nearly the reference itself
    assert 0 < row.error_a <= same.known[A].floor
    assert row.standing is PointKind.BELOW
    assert [line.shape for line in lines_of(same) if line.said] == ["circle-open"]
    assert [line.shape for line in lines_of(same, AREA) if line.said] == ["circle"]
    assert not any(line.steps for line in lines_of(same))  # no front


def test_without_a_reference_nothing_is_judged():
    text = load_scene("fig18-nonuniform-contraction").text.replace('"viscous"', '"viscoelastic"')
    scene = parse_scene(re.sub(r"(?ms)^\[expect.*", "", text), "breaks.toml")
    found = of_points(scene, [Numerics(METHODS[FEM], 1, scene.time.end / 20)])
    assert "the reference run ends (singular_dilation" in in_words(found)
    assert found.quantities == []


def test_driven_methods_can_be_measured():
    sample = sample_of(load_scene("static-decay"), Numerics(METHODS["fv-tpfa"], 2, 0.1))
    assert (sample.answer.ending, sample.steps) == ("completed", 6)
