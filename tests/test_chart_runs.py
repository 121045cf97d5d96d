"""Charts in the making: failures, interruptions, budgets and what is not measured twice."""

import re

import numpy as np
import pytest

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.outcome import Ending
from actin_xcheck.runs.method import METHODS
from actin_xcheck.scene.scene import load_scene, parse_scene
from actin_xcheck.studies.chart import examine as examination
from actin_xcheck.studies.chart import points as planning
from actin_xcheck.studies.chart.advice import in_words
from actin_xcheck.studies.chart.measure import measured
from actin_xcheck.studies.chart.page import ENDINGS, write_chart_page
from actin_xcheck.studies.chart.points import Point
from actin_xcheck.studies.chart.record import FILE_NAME, read_chart
from actin_xcheck.studies.chart.truth import Quantity, Standing
from tests.lab import FEM, quiet

IMEX = "fem-p2-imex3"
P1_IMEX = "fem-p1-imex2"
A, AREA = Quantity.CONCENTRATION, Quantity.AREA


def charted(tmp_path, scene, points, monkeypatch, reference=((P1_IMEX, 1, 1e-3), (P1_IMEX, 2, 1e-4))):
    """A chart of these points alone, on a machine that does not change."""
    monkeypatch.setattr(examination, "reference_kernel", lambda: np.array([0.05, 0.05]))
    monkeypatch.setattr(planning, "REFERENCE", {True: reference})
    monkeypatch.setattr(examination, "ladder", lambda scene, method, quick: points)
    return examination.examine(scene, [points[0].method], tmp_path, "", True, quiet)


@pytest.mark.slow
def test_a_run_that_fails_is_drawn_as_failed(tmp_path, monkeypatch):
    text = load_scene("fig18-nonuniform-contraction").text.replace("1e-3*cos", "0.1*cos")
    text = re.sub(r"(?m)^(end|outputs) = .*|(?s:^\[expect.*)", "", text).replace(
        "[time]", "[time]\nend = 0.02"
    )
    scene = parse_scene(text, "steep.toml")
    points = [Point(METHODS[FEM], 2, dt) for dt in (0.005, 0.001)]
    chart = charted(tmp_path, scene, points, monkeypatch)
    failed = [point for point in chart.points if chart.standing(point, A) is Standing.FAILED]
    assert [(point.sample.point.dt, point.sample.ending) for point in failed] == [(0.005, "tangled")]
    page = write_chart_page(tmp_path).read_text(encoding="utf-8")
    for point in failed:
        assert np.isnan(point.errors[A])
        assert page.count("failed: tangled: triangle") == 3 * 4  # in the titles of all charts


def test_all_endings_have_a_sign():
    assert set(ENDINGS) == set(Ending) - {Ending.COMPLETED}


@pytest.mark.slow
def test_what_is_wrong_or_below_the_references_own_error_is_drawn_as_that(tmp_path, monkeypatch):
    scene = load_scene("fig14-four-fronts")
    points = [Point(METHODS[FEM], 2, scene.time.end), Point(METHODS[IMEX], 2, scene.time.end, 2e-4)]
    chart = charted(tmp_path, scene, points, monkeypatch, ((IMEX, 1, 1e-3), (IMEX, 2, 1e-4)))
    wrong, same = chart.points  # the second is nearly the reference itself
    assert wrong.sample.ending == "completed"
    assert wrong.errors[A] > 0.05
    assert chart.standing(wrong, A) is chart.standing(wrong, AREA) is Standing.SILENT
    assert 0 < same.errors[A] <= chart.known[A].floor
    assert chart.standing(same, A) is Standing.BELOW
    assert chart.standing(same, AREA) is Standing.JUDGED  # there are values from elsewhere
    assert np.isnan(chart.judged(A)).all()  # no front, no advice
    assert "No run comes within" in in_words(chart)
    page = write_chart_page(tmp_path).read_text(encoding="utf-8")
    assert page.count("silently inaccurate\n") == 3 * 4  # in the titles of the wrong point
    assert page.count("below the reference&#x27;s own error\n") == 4
    assert 'badge fail">silently inaccurate' in page


@pytest.mark.slow
def test_without_a_reference_nothing_is_judged(tmp_path, monkeypatch):
    text = load_scene("fig18-nonuniform-contraction").text.replace('"viscous"', '"viscoelastic"')
    scene = parse_scene(re.sub(r"(?ms)^\[expect.*", "", text), "breaks.toml")
    points = [Point(METHODS[FEM], 1, scene.time.end / 20)]
    chart = charted(tmp_path, scene, points, monkeypatch)
    assert chart.quantities == []
    assert "the reference run ends (singular_dilation" in in_words(chart)
    assert "the reference run ends" in write_chart_page(tmp_path).read_text(encoding="utf-8")


VERSIONS = {"python": "3", "commit": "0123"}


@pytest.mark.slow
def test_nothing_is_measured_twice_by_the_same_code(tmp_path, monkeypatch):
    done = []

    def counted(work, task, report):
        done.append(task[1].key)
        return work(task, report)

    monkeypatch.setattr(examination, "work_alone", counted)
    monkeypatch.setattr(examination, "provenance", lambda: VERSIONS)
    scene = load_scene("static-decay")
    points = [Point(METHODS[FEM], 1, 0.1), Point(METHODS[FEM], 2, 0.1)]
    first = charted(tmp_path, scene, list(points), monkeypatch)
    assert len(done) == 4
    again = charted(tmp_path, scene, list(points), monkeypatch)
    assert len(done) == 4
    for one, other in zip(first.points, again.points, strict=True):
        assert np.array_equal(one.sample.wall, other.sample.wall)
    more = [*points, Point(METHODS[FEM], 2, 0.05)]
    assert len(charted(tmp_path, scene, more, monkeypatch).points) == 3
    assert len(done) == 5
    monkeypatch.setattr(examination, "provenance", lambda: VERSIONS | {"commit": "4567"})
    charted(tmp_path, scene, list(points), monkeypatch)
    assert len(done) == 9


def test_an_interrupted_chart_keeps_what_it_had(tmp_path, monkeypatch):
    """Interrupted at the first point, after the reference, and at the second one."""
    monkeypatch.setattr(examination, "provenance", lambda: VERSIONS)
    scene, allowed = load_scene("static-decay"), [2, 1, 9]
    points = [Point(METHODS[FEM], 1, 0.1), Point(METHODS[FEM], 2, 0.1)]

    def interrupted(work, task, report):
        if not allowed[0]:
            raise KeyboardInterrupt
        allowed[0] -= 1
        return measured(task, report)

    monkeypatch.setattr(examination, "work_alone", interrupted)
    with pytest.raises(KeyboardInterrupt):
        charted(tmp_path, scene, list(points), monkeypatch)
    with pytest.raises(UserError, match="no run was measured"):
        write_chart_page(tmp_path)
    allowed.pop(0)
    with pytest.raises(KeyboardInterrupt):
        charted(tmp_path, scene, list(points), monkeypatch)
    allowed.pop(0)
    assert [point.sample.point for point in read_chart(tmp_path / FILE_NAME).points] == points[:1]
    assert len(charted(tmp_path, scene, list(points), monkeypatch).points) == 2
    assert allowed == [8]


def test_a_ladder_is_cut_where_a_method_has_had_its_seconds(tmp_path, monkeypatch):
    monkeypatch.setattr(examination, "BUDGET", {True: 0.0})
    scene = load_scene("static-decay")
    points = [Point(METHODS[FEM], 1, 0.1), Point(METHODS[FEM], 2, 0.1)]
    chart = charted(tmp_path, scene, points, monkeypatch)
    assert len(chart.points) == 1
    assert list(chart.attributes["left_out"]) == ["fem-p1-paper (refine 2, dt 0.1)"]


def test_driven_methods_can_be_measured():
    scene = load_scene("static-decay")
    sample = measured((scene, Point(METHODS["fv-tpfa"], 2, 0.1)), quiet)
    assert (sample.ending, sample.steps) == ("completed", 6)
