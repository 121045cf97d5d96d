"""Frontiers: bisection, planes, classes, maps; and the same by a cluster that loses a worker."""

import json
import re
import shlex
from dataclasses import replace

import numpy as np
import pytest

from actin_xcheck.core.mesh import disk
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.runs.executor import executor
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.processes import Lost
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene, parse_scene
from actin_xcheck.studies.frontier import planes as planning
from actin_xcheck.studies.frontier import shares, words_of
from actin_xcheck.studies.frontier.answers import (
    BOUND,
    AnswerKind,
    ConvergedPlace,
    PlaceTruth,
    answer_of,
    judge,
    truth_of,
)
from actin_xcheck.studies.frontier.planes import PLANES, Bisection, end_at, plane_of, point_of
from actin_xcheck.studies.stored import LastState
from fem.space import Space
from tests.lab import FEM
from tests.processes import cluster
from tests.small import MAPPED, PLACES, Played, mapped
from tests.studies import carry
from tests.tags import Tags

FIG14 = load_scene("fig14-four-fronts")
COLUMN = 22.0
"""Radius of the disk in the lattice of the search's tests."""


def searched(classify, columns=65, rows=65, across=8, up=8):
    search, rounds = Bisection(columns, rows, across, up), 0
    while wanted := search.wanted():
        search.tell({node: classify(node) for node in wanted})
        rounds += 1
    return search, rounds


def answer(ending="completed", t=1.0, area=3.0, a=(1.0, 1.0)):
    return LastState(ending, f"{ending} there", t, area, 3.0, a, (0.0, 0.0, 1.0, 0.0), 10, 0.0, 0.1)


# bisection


def in_disk(node):
    return "in" if np.hypot(node[0] - 30, node[1] - 35) < COLUMN else "out"


def test_a_known_border_is_found_to_one_place_with_a_fraction_of_the_points():
    search, rounds = searched(in_disk)
    assert len(search.found) < 0.2 * 65 * 65
    assert rounds <= 6  # one a level, and what neighbours ask of each other
    for i in np.arange(0.5, 64):
        for j in np.arange(0.5, 64):
            if abs(np.hypot(i - 30, j - 35) - COLUMN) > np.sqrt(2):
                assert search.class_at(i, j) == in_disk((i, j))


def test_cells_tile_the_lattice_and_only_the_finest_are_mixed():
    search, _ = searched(in_disk)
    assert sum((c.right - c.left) * (c.top - c.bottom) for c in search.cells) == 64 * 64
    for cell in search.cells:
        seen = {known for node, known in search.found.items() if cell.holds(node)}
        assert len(seen) == 1 or not cell.parts()
    sizes = {cell.right - cell.left for cell in search.cells}
    assert sizes == {1, 2, 4, 8}


def test_a_border_that_only_a_neighbour_sees_is_followed():
    """A bulge of the lower half over the middle of a side, between corners that do not see it."""

    def bulge(node):
        i, j = node
        return "in" if (i < 8 and j < 4) or np.hypot(i - 8, j - 4) < 3.2 else "out"

    search, _ = searched(bulge, 17, 9, 8, 8)
    wrong = [
        (i, j)
        for i in range(17)
        for j in range(9)
        if abs(np.hypot(i - 8, j - 4) - 3.2) > 1.5 and search.class_at(i, j) != bulge((i, j)) and i > 8
    ]
    assert wrong == []


def test_a_direction_of_whole_numbers_is_not_split():
    search, _ = searched(lambda node: "in" if node[0] > 9 + 3 * node[1] else "out", 33, 5, 8, 1)
    assert {cell.top - cell.bottom for cell in search.cells} == {1}
    assert {cell.right - cell.left for cell in search.cells} >= {1, 8}


def test_no_border_is_drawn_against_what_nobody_looked_at():
    search, rounds = searched(lambda node: None if node[1] < 20 else "in")
    assert rounds == 1
    assert search.class_at(3, 18) == "in"  # the nearest that is known
    assert search.class_at(3, 3) is None


def test_first_cells_must_tile_the_lattice():
    with pytest.raises(ValueError, match="do not tile"):
        Bisection(10, 9, 4, 4)


# planes


def test_at_the_scenes_own_psi_a_run_is_the_scene():
    point = point_of(FIG14, METHODS[FEM], {"dt": FIG14.time.end / 160})
    moved = parse_scene(point.scene, "point.toml")
    assert (point.end, point.steps, point.refine) == (FIG14.time.end, 160, planning.REFINE)
    assert moved.parameters == FIG14.parameters
    assert str(moved.initial.a) == str(FIG14.initial.a)
    assert moved.physics == FIG14.physics


def test_runs_take_as_many_growth_times_everywhere():
    for psi in (10.0, 1e4):
        parameters = Parameters(psi, 0.26)
        assert end_at(FIG14, psi) * (1 + 0.0699 * psi) == pytest.approx(
            FIG14.time.end * (1 + 0.0699 * FIG14.parameters.psi), rel=1e-3
        )
        moved = parse_scene(point_of(FIG14, METHODS[FEM], {"psi": psi}).scene, "point.toml")
        assert moved.parameters == parameters
        assert moved.output_times == (pytest.approx(end_at(FIG14, psi)),)


def test_steps_longer_than_the_run_are_one_step_and_one_run():
    long = [point_of(FIG14, METHODS[FEM], {"psi": 5e3, "dt": dt}) for dt in (0.02, 0.1)]
    assert long[0] == long[1]
    assert long[0].steps == 1
    assert not point_of(FIG14, METHODS[FEM], {"psi": 10.0, "dt": 1e-4}).within_budget


@pytest.mark.parametrize("name", ["fem-p2-imex3", "fem-p4-imex4"])
def test_methods_are_compared_on_as_many_nodes(name):
    method = METHODS[name]
    nodes = Space.on(disk(planning.layers(planning.REFINE, method), 0.8), method.space, 0.8).xi.shape[1]
    assert nodes == disk(planning.REFINE, 0.8).xi.shape[1]


@pytest.mark.parametrize("name", PLANES)
def test_every_plane_has_three_decades_or_all_meshes_and_whole_first_cells(name):
    plane = plane_of(name, METHODS["fem-p2-imex3"])
    for axis in (plane.x, plane.y):
        assert (len(axis.values) - 1) % axis.stride == 0
        assert np.all(np.diff(axis.values) > 0)
        if axis.name in ("psi", "dt"):
            assert axis.values[-1] / axis.values[0] >= 999
    point = point_of(FIG14, METHODS["fem-p2-imex3"], plane.at(0, 0))
    assert parse_scene(point.scene, point.name).name == point.name


def test_the_cloud_stands_for_equal_areas_of_the_disk():
    x, y = np.array(planning.cloud()).T
    assert np.mean(x**2 + y**2) == pytest.approx(0.5, abs=0.01)
    assert np.abs([x.mean(), y.mean(), (x * y).mean()]).max() < 0.02


# classes


def judged(found, true=None, uncertainty=1e-4, steps=100):
    point = replace(point_of(FIG14, METHODS[FEM], {}), end=1.0, steps=steps)
    return judge(point, found, PlaceTruth(true or answer(), "a level", uncertainty))


ENDED = answer("singular_dilation", t=0.5)


@pytest.mark.parametrize(
    ("found", "true", "kind"),
    [
        (answer(), None, AnswerKind.ACCURATE),
        (answer(area=3.0 * (1 + 0.99 * BOUND)), None, AnswerKind.ACCURATE),
        (answer(area=3.0 * (1 + 1.01 * BOUND)), None, AnswerKind.SILENT),
        (answer(a=(1.03, 1.0)), None, AnswerKind.SILENT),  # area and total are right, the pattern is not
        (answer("tangled", t=0.5), None, AnswerKind.FAILED),
        (ENDED, None, AnswerKind.FAILED),
        (answer(), ENDED, AnswerKind.SILENT),  # goes on beyond the end
        (answer("singular_dilation", t=0.54), ENDED, AnswerKind.ENDS),
        (answer("singular_dilation", t=0.57), ENDED, AnswerKind.FAILED),
        (answer("singular_dilation", t=0.43), ENDED, AnswerKind.FAILED),
        (answer("tangled", t=0.5), ENDED, AnswerKind.FAILED),
    ],
)
def test_a_run_is_worth_what_the_truth_says(found, true, kind):
    result = judged(found, true)
    assert result.kind is kind
    assert (result.label == f"failed: {found.ending}") == (kind is AnswerKind.FAILED)


def test_a_failure_can_be_told_no_closer_than_its_step():
    early = answer("singular_dilation", t=0.3)
    assert judged(early, ENDED, steps=5).kind is AnswerKind.ENDS  # the end lies in its last step
    assert judged(early, ENDED, steps=100).kind is AnswerKind.FAILED


@pytest.mark.parametrize(
    ("true", "uncertainty"),
    [(answer(), 0.6 * BOUND), (answer(), float("nan")), (answer("tangled"), 1e-9), (ENDED, 0.06)],
)
def test_what_is_not_known_judges_nothing(true, uncertainty):
    assert judged(answer(), true, uncertainty).kind is AnswerKind.UNKNOWN


def test_a_sentence_says_what_is_wrong():
    said = judged(answer(area=3.3)).sentence
    assert "area 3.3 for 3" in said
    assert "0.1, of the area" in said


MODEL_ENDS = """
name = "ends"
[parameters]
psi = 3160.0
p = 0.433
[initial]
a = "1 + 1e-3*cos(x)"
[time]
end = 0.05526
"""


@pytest.mark.slow
def test_where_the_model_ends_completing_is_wrong_and_failing_is_right(tmp_path):
    scene = parse_scene(MODEL_ENDS, "ends.toml")
    points = [replace(point_of(scene, METHODS[FEM], {}), refine=3, steps=steps) for steps in (1, 400)]
    truth = truth_of(ConvergedPlace(points[0].scene, (0, 2)), tmp_path)
    assert truth.answer.ending == "singular_dilation"
    assert truth.known
    assert truth.answer.t == pytest.approx(0.0411, rel=0.01)
    kinds = [judge(point, answer_of(point, tmp_path), truth).kind for point in points]
    assert kinds == [AnswerKind.SILENT, AnswerKind.ENDS]


# maps at work


@pytest.fixture(scope="module")
def whole(carried):
    """A few places by two methods."""
    return carried("frontier")


def points_of(report, method):
    return {(one.column, one.row): one for one in report.tables["points"].rows if one.method == method}


def test_first_order_is_silently_wrong_where_second_order_is_accurate(whole):
    found = whole.report
    first, second = (points_of(found, method.name) for method in MAPPED)
    assert first[2, 0].kind == AnswerKind.SILENT  # psi = 640 in 11 steps
    assert second[2, 0].kind == AnswerKind.ACCURATE
    assert first[0, 0].kind == second[0, 0].kind == AnswerKind.ACCURATE
    assert not any(p.kind == AnswerKind.FAILED for p in found.tables["points"].rows)
    accurate = [
        sum(p.kind == AnswerKind.ACCURATE for p in one.values()) / len(one) for one in (first, second)
    ]
    assert accurate[0] < accurate[1]
    assert "never fails" in found.findings[0]
    assert "silently wrong in" in found.findings[0]


def test_a_point_is_made_again_by_its_command(whole):
    folder = whole.folder
    row = next(p for p in whole.report.tables["points"].rows if p.kind == AnswerKind.SILENT)
    words = shlex.split(row.command)
    given = dict(
        zip(words[words.index("--method") :: 2], words[words.index("--method") + 1 :: 2], strict=True)
    )
    scene = load_scene(folder / words[words.index("run") + 1])
    path = folder / given["--out"]
    run(scene, Numerics(METHODS[given["--method"]], int(given["--refine"]), float(given["--dt"])), path)
    stored = read_run(path)
    assert len(stored.series["time"]) == row.steps + 1
    assert stored.series["area"][-1] == row.area


def test_a_run_whose_process_ended_every_time_is_a_failure_and_is_tried_again(whole, tmp_path):
    """A run is lost, and the truth of two columns: the last one and the scene's own psi."""
    own = point_of(FIG14, MAPPED[0], {"psi": 40.0, "dt": 0.032}, 3)
    texts = {point_of(FIG14, MAPPED[0], given).scene for given in ({}, {"psi": 640.0})}

    class Losing(Played):
        def alone(self, work, asked):
            ask = asked.task.ask
            lost = ask == own or (ask.scene in texts and hasattr(ask, "levels"))
            return Lost("killed") if lost else super().alone(work, asked)

    found = carry(tmp_path, mapped(MAPPED[:1]), Losing(whole.folder, whole.answers), "frontier")
    rows = points_of(found, FEM)
    assert (rows[0, 1].label, rows[0, 1].outcome) == ("failed: interrupted", "interrupted")
    assert rows[0, 1].sentence == "interrupted: killed"
    assert rows[0, 0].kind == AnswerKind.ACCURATE  # its neighbour is what it was
    assert {rows[2, row].kind for row in (0, 1)} == {AnswerKind.UNKNOWN}
    assert "converged run ends with interrupted: killed" in rows[2, 0].sentence
    (plot,) = found.chapters[1].exhibits
    assert "The truth is not known: the converged run ends with interrupted" in plot.note
    assert "failed: interrupted in" in found.findings[0]
    again = carry(tmp_path, mapped(MAPPED[:1]), whole.played(), "frontier")
    assert {row.kind for row in again.tables["points"].rows} <= {AnswerKind.ACCURATE, AnswerKind.SILENT}


def test_a_map_has_a_sentence_for_every_point_that_was_run(whole):
    page = Tags(whole.folder / "index.html")
    figures = [json.loads(script) for script in page.scripts if script.startswith("{")]
    told = [sentence for one in figures for trace in one["data"] for sentence in trace.get("text", ())]
    assert len(told) == len(whole.report.tables["points"].rows)


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_finds_what_one_process_finds(whole, tmp_path):
    pytest.importorskip("distributed")
    came = []
    with cluster(tmp_path, 2) as (address, (_, *workers)):

        def count(label, done, total):
            came.append(label)
            if len(came) == 3:
                workers[0].kill()  # SIGKILL, in the middle of what it does

        with executor(1, address) as processes:
            found = carry(tmp_path, mapped(), processes, "frontier", count)
        assert workers[0].wait(10) < 0
        assert workers[1].poll() is None
    rows = [
        [repr(replace(row, seconds=0.0)) for row in one.tables["points"].rows]
        for one in (found, whole.report)
    ]
    assert rows[0] == rows[1]
    assert len(rows[0]) > 10


def test_shares_are_of_the_whole_and_words_say_how_far():
    search, _ = searched(lambda node: "accurate" if node[0] < 1 else "silently wrong", 3, 2, 2, 1)
    parts = shares(PLACES, search)
    assert sum(parts.values()) == pytest.approx(1)
    assert parts["accurate"] == pytest.approx(1 / 4)
    wide = plane_of("psi,dt", METHODS[FEM])
    columns, rows = len(wide.x.values), len(wide.y.values)
    search, _ = searched(
        lambda node: "accurate" if node[0] + node[1] < 40 else "silently wrong", columns, rows, 8, 8
    )
    words = words_of(FIG14, wide, search)
    assert "nowhere (Δt ≥ 0.0001) at ψ = 10000" in words
    dt = float(re.search(r"up to Δt = ([\d.e-]+) at ψ = 100[, ]", words)[1])
    assert dt == pytest.approx(wide.y.values[23], rel=0.08)  # psi = 100 is column 16: half a place about 23.5


def test_ending_with_the_model_is_right():
    wide = plane_of("psi,dt", METHODS[FEM])
    shape = len(wide.x.values), len(wide.y.values), 8, 8
    search, _ = searched(lambda node: "accurate" if node[0] < 30 else "ends with the model", *shape)
    assert words_of(FIG14, wide, search).startswith(
        "right within 1% at every Δt at ψ = 10, 100, 318, 1000 and 10000."
    )
