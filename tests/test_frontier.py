"""Frontiers: bisection, classes, theory, resuming, the file, the page and the command."""

import re
import shlex
import shutil
import sqlite3
from dataclasses import replace

import numpy as np
import pytest

from actin_xcheck import survey
from actin_xcheck.accuracy import LEVELS
from actin_xcheck.errors import UserError
from actin_xcheck.exhibits import Chapter, Line, Plot
from actin_xcheck.frontier import answers, theory
from actin_xcheck.frontier import examine as examination
from actin_xcheck.frontier import planes as planning
from actin_xcheck.frontier.answers import BOUND, Answer, Truth, answer_of, truth_of
from actin_xcheck.frontier.bisection import Bisection
from actin_xcheck.frontier.classes import Kind, judge
from actin_xcheck.frontier.journal import Journal
from actin_xcheck.frontier.limits import model_at
from actin_xcheck.frontier.planes import PLANES, Axis, Plane, check, end_at, plane_of, point_of
from actin_xcheck.frontier.record import FILE_NAME, read_frontier, write_frontier
from actin_xcheck.frontier.words import shares, words_of
from actin_xcheck.geometry import disk
from actin_xcheck.parameters import Parameters
from actin_xcheck.prediction import Mode, wall_eigenfield, wavenumber
from actin_xcheck.registry import METHODS
from actin_xcheck.report import write_frontier_page
from actin_xcheck.runs import bind, run
from actin_xcheck.scene import load_scene, parse_scene
from actin_xcheck.stepping import integrate
from actin_xcheck.store import read_run
from actin_xcheck.watch import Amplitude, Corners
from fem.space import Space
from tests.lab import FEM, scene_of
from tests.test_report import SCRIPT, Tags

FIG14 = load_scene("fig14-four-fronts")
COLUMN = 22.0
"""Radius of the disk in the lattice of the search's tests."""


# bisection


def in_disk(node):
    return "in" if np.hypot(node[0] - 30, node[1] - 35) < COLUMN else "out"


def searched(classify, columns=65, rows=65, across=8, up=8):
    search, rounds = Bisection(columns, rows, across, up), 0
    while wanted := search.wanted():
        search.tell({node: classify(node) for node in wanted})
        rounds += 1
    return search, rounds


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


def answer(ending="completed", t=1.0, area=3.0, a=(1.0, 1.0)):
    return Answer(ending, f"{ending} there", t, area, 3.0, a, (0.0, 0.0, 1.0, 0.0), 0.1)


def judged(found, true=None, uncertainty=1e-4, steps=100):
    point = replace(point_of(FIG14, METHODS[FEM], {}), end=1.0, steps=steps)
    return judge(point, found, Truth(true or answer(), "a level", uncertainty))


ENDED = answer("singular_dilation", t=0.5)


@pytest.mark.parametrize(
    ("found", "true", "kind"),
    [
        (answer(), None, Kind.ACCURATE),
        (answer(area=3.0 * (1 + 0.99 * BOUND)), None, Kind.ACCURATE),
        (answer(area=3.0 * (1 + 1.01 * BOUND)), None, Kind.SILENT),
        (answer(a=(1.03, 1.0)), None, Kind.SILENT),  # area and total are right, the pattern is not
        (answer("tangled", t=0.5), None, Kind.FAILED),
        (ENDED, None, Kind.FAILED),
        (answer(), ENDED, Kind.SILENT),  # goes on beyond the end
        (answer("singular_dilation", t=0.54), ENDED, Kind.ENDS),
        (answer("singular_dilation", t=0.57), ENDED, Kind.FAILED),
        (answer("singular_dilation", t=0.43), ENDED, Kind.FAILED),
        (answer("tangled", t=0.5), ENDED, Kind.FAILED),
    ],
)
def test_a_run_is_worth_what_the_truth_says(found, true, kind):
    result = judged(found, true)
    assert result.kind is kind
    assert (result.label == f"failed: {found.ending}") == (kind is Kind.FAILED)


def test_a_failure_can_be_told_no_closer_than_its_step():
    early = answer("singular_dilation", t=0.3)
    assert judged(early, ENDED, steps=5).kind is Kind.ENDS  # the end lies in its last step
    assert judged(early, ENDED, steps=100).kind is Kind.FAILED


@pytest.mark.parametrize(
    ("true", "uncertainty"),
    [(answer(), 0.6 * BOUND), (answer(), float("nan")), (answer("tangled"), 1e-9), (ENDED, 0.06)],
)
def test_what_is_not_known_judges_nothing(true, uncertainty):
    assert judged(answer(), true, uncertainty).kind is Kind.UNKNOWN


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


def test_where_the_model_ends_completing_is_wrong_and_failing_is_right(monkeypatch):
    monkeypatch.setattr(answers, "TRUTH_LEVELS", LEVELS[:2])
    scene = parse_scene(MODEL_ENDS, "ends.toml")
    points = [replace(point_of(scene, METHODS[FEM], {}), refine=3, steps=steps) for steps in (1, 400)]
    truth = truth_of(points[0].scene)
    assert truth.answer.ending == "singular_dilation"
    assert truth.known
    assert truth.answer.t == pytest.approx(0.0411, rel=0.01)
    kinds = [judge(point, answer_of(point), truth).kind for point in points]
    assert kinds == [Kind.SILENT, Kind.ENDS]


# theory

WALL = load_scene("mode-11-wall-270")


@pytest.mark.parametrize("name", [FEM, "fem-p1-imex2", "fem-p2-imex3", "fem-p4-imex4", "fv-order2"])
def test_amplification_is_exact_to_the_order_of_the_scheme(name):
    """One step's R less e^(lambda dt) is of order p + 1: seen from both sides."""
    method, model, k2 = METHODS[name], WALL.physics, wavenumber(1, 1) ** 2
    pair, rate = theory.pair_of(method), theory.leading_rate(WALL.physics, k2)
    dt = np.array([2.0, 1.0]) * (5e-3 if method.order_dt > 2 else 5e-4)
    errors = [abs(theory.amplification(pair, model, k2, one) - np.exp(rate * one)) for one in dt.tolist()]
    assert np.log2(errors[0] / errors[1]) - 1 == pytest.approx(method.order_dt, abs=0.15)


@pytest.mark.parametrize("name", [FEM, "fem-p2-imex3", "fv-coupled", "fv-order2"])
def test_the_codes_amplify_a_mode_as_theory_says(name):
    """Three long steps from the exact mode: the scheme's matrix, not e^(lambda t)."""
    method, dt, steps = METHODS[name], 0.06, 3
    end = dt * steps
    text = WALL.text.split("[expect")[0]
    scene = parse_scene(re.sub(r"end = .*", f"end = {end}", re.sub(r"outputs = .*", "", text)), "wall.toml")
    field = wall_eigenfield(scene.physics, Mode(1, 1))
    phi = -(field.factor * field.mode.k**2).real
    matrix = theory.step_matrix(theory.pair_of(method), scene.physics, field.mode.k**2, dt)
    expected = np.linalg.matrix_power(matrix, steps) @ [phi, 1 + phi]
    solver = bind(scene, method, 4 if method.space == 1 else 3, dt)
    corners, amplitude = Corners(solver), Amplitude(scene, solver.mesh)
    assert integrate(solver, dt, scene.output_times, corners).ok
    found = amplitude(steps, corners.values[-1]) / amplitude(0, corners.values[0])
    assert found == pytest.approx(expected[1] - expected[0], rel=0.02)
    if method.order_dt == 1:
        assert found < 0.7 * np.exp(field.rate.real * end)  # so that only the scheme's own factor fits


def test_the_first_order_scheme_never_blows_up_and_explicit_motion_has_a_limit():
    model = model_at(FIG14, 270.0, 0.26)
    assert theory.explicit_limit(None, model) == np.inf
    for k2 in (3.39, 30.0, 300.0):
        factor = [abs(theory.amplification(None, model, k2, dt)) for dt in (3e-3, 3e-2, 0.3, 1.0)]
        assert max(factor) <= max(1, np.exp(theory.leading_rate(model, k2).real))
    pair = theory.pair_of(METHODS["fem-p4-imex4"])
    limit = theory.explicit_limit(pair, model)
    assert 0.1 < limit < 10
    assert abs(theory.amplification(pair, model, 1e8, 0.9 * limit)) <= 1 + 1e-6
    assert abs(theory.amplification(pair, model, 1e8, 1.2 * limit)) > 1


def test_steps_within_the_limit_of_theory_grow_a_mode_right():
    model, k2 = model_at(FIG14, 318.067, 0.26), wavenumber(1, 1) ** 2
    for name, most in ((FEM, 1e-3), ("fem-p1-imex2", 0.04), ("fem-p4-imex4", 0.1)):
        pair = theory.pair_of(METHODS[name])
        dt = theory.largest_accurate_step(pair, model, 0.1636, 0.01)
        assert most / 5 < dt < most
        assert theory.growth_error(pair, model, k2, dt, 0.1636) == pytest.approx(0.01, rel=1e-6)


def test_waves_to_resolve_are_those_that_grow():
    model = model_at(FIG14, 318.067, 0.26)
    h = theory.resolvable_h(model, 1)
    k2 = (np.pi / h) ** 2
    assert theory.leading_rate(model, 1.01 * k2).real < 0 < theory.leading_rate(model, 0.99 * k2).real
    assert theory.resolvable_h(model, 4) == pytest.approx(4 * h)
    assert theory.resolvable_h(model_at(FIG14, 10.0, 0.26), 1) == np.inf


# maps at work

VERSIONS = {"python": "3", "commit": "0123"}


def tiny(name, method):
    """A few places: psi from where all is well to where first order is wrong."""
    return Plane(
        Axis("psi", (40.0, 160.0, 640.0), 2, log=True),
        Axis("dt", (0.008, 0.032), 1, log=True),
    )


def shrink(monkeypatch):
    """Coarse meshes, a tiny plane, one process, a code that knows its commit; returns what is worked off."""
    done = []

    def in_process(work, tasks, report):
        results = []
        for task in tasks:
            results.append(work(task, report))
            done.append(task.what)
        return results

    monkeypatch.setattr(examination, "plane_of", tiny)
    monkeypatch.setattr(planning, "REFINE", 3)
    monkeypatch.setattr(answers, "TRUTH_LEVELS", LEVELS[:2])
    monkeypatch.setattr(examination, "LADDER", (1, 4))
    monkeypatch.setattr(examination, "work_off", in_process)
    monkeypatch.setattr(examination, "provenance", lambda: VERSIONS)
    return done


@pytest.fixture
def small(monkeypatch):
    return shrink(monkeypatch)


METHODS_SHOWN = (METHODS[FEM], METHODS["fem-p2-imex3"])


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """A folder with a report of two methods, and its maps."""
    folder = tmp_path_factory.mktemp("frontier")
    with pytest.MonkeyPatch.context() as monkeypatch:
        shrink(monkeypatch)
        maps = examination.examine(FIG14, METHODS_SHOWN, ["psi,dt"], folder, "a command")
    return folder, maps


def test_first_order_is_silently_wrong_where_second_order_is_accurate(report):
    _, maps = report
    first, second = ({(p.column, p.row): p for p in one.points} for one in maps)
    assert first[2, 0].kind == Kind.SILENT  # psi = 640 in 11 steps
    assert second[2, 0].kind == Kind.ACCURATE
    assert first[0, 0].kind == second[0, 0].kind == Kind.ACCURATE
    assert not any(p.kind == Kind.FAILED for one in maps for p in one.points)
    accurate = [sum(p.kind == Kind.ACCURATE for p in one.values()) / len(one) for one in (first, second)]
    assert accurate[0] < accurate[1]
    assert "never fails" in maps[0].words
    assert "silently wrong in" in maps[0].words


def test_a_point_is_made_again_by_its_command(report):
    folder, maps = report
    row = next(p for p in maps[0].points if p.kind == Kind.SILENT)
    words = shlex.split(row.command)
    given = dict(
        zip(words[words.index("--method") :: 2], words[words.index("--method") + 1 :: 2], strict=True)
    )
    scene = load_scene(folder / words[words.index("run") + 1])
    path = folder / given["--out"]
    run(scene, METHODS[given["--method"]], int(given["--refine"]), float(given["--dt"]), path)
    stored = read_run(path)
    assert len(stored.series["time"]) == row.steps + 1
    assert stored.series["area"][-1] == row.area


def test_the_file_gives_back_what_was_found(report):
    folder, maps = report
    stored = read_frontier(folder / FILE_NAME)
    assert stored.attributes["scene"] == FIG14.text
    for one, read in zip(maps, stored.maps, strict=True):
        assert (read.method, read.plane, read.words, len(read.points)) == (
            one.method,
            one.plane,
            one.words,
            len(one.points),
        )
        assert [repr(point) for point in read.points] == [repr(point) for point in one.points]
        assert np.array_equal(read.cells, one.cells)
        assert [line.label for line in read.lines] == [line.label for line in one.lines]
    assert [chapter.key for chapter in stored.chapters] == ["answers", "theory"]


def test_nothing_is_run_twice_by_the_same_code(report, small, tmp_path, monkeypatch):
    source, maps = report
    shutil.copytree(source, tmp_path, dirs_exist_ok=True)
    again = examination.examine(FIG14, METHODS_SHOWN, ["psi,dt"], tmp_path, "a command")
    assert small == []
    assert [[repr(point) for point in one.points] for one in again] == [
        [repr(point) for point in one.points] for one in maps
    ]
    with sqlite3.connect(tmp_path / "points.sqlite") as rows:
        rows.execute("DELETE FROM runs WHERE key IN (SELECT key FROM runs LIMIT 3)")
    rows.close()
    examination.examine(FIG14, METHODS_SHOWN, ["psi,dt"], tmp_path, "a command")
    assert len(small) == 3


@pytest.mark.parametrize("commit", ["0123-dirty", "unknown", "4567"])
def test_what_another_code_or_an_unknown_one_ran_is_not_taken_up(commit, report):
    folder, _ = report
    point, versions = point_of(FIG14, METHODS[FEM], {}), VERSIONS | {"commit": commit}
    journal = Journal(folder / "points.sqlite", versions)
    journal.keep(point, answer())
    assert (journal.answer(point) is None) == (commit != "4567")
    assert Journal(folder / "points.sqlite", VERSIONS).answer(point) is None


def test_what_was_finished_survives_an_interrupt(small, tmp_path, monkeypatch):
    def killed(work, tasks, report):
        for task in tasks[:4]:
            work(task, report)
        raise KeyboardInterrupt

    patient = examination.work_off
    monkeypatch.setattr(examination, "work_off", killed)
    with pytest.raises(KeyboardInterrupt):
        examination.examine(FIG14, METHODS_SHOWN[:1], ["psi,dt"], tmp_path, "")
    assert not (tmp_path / FILE_NAME).exists()
    with sqlite3.connect(tmp_path / "points.sqlite") as rows:
        assert rows.execute("SELECT count(*) FROM runs").fetchone() == (4,)
    rows.close()
    monkeypatch.setattr(examination, "work_off", patient)
    examination.examine(FIG14, METHODS_SHOWN[:1], ["psi,dt"], tmp_path, "")
    with sqlite3.connect(tmp_path / "points.sqlite") as rows:
        assert rows.execute("SELECT count(*) FROM runs").fetchone() == (len(small) + 4,)
    rows.close()


def test_a_journal_that_is_something_else_is_the_users_mistake(tmp_path):
    (tmp_path / "points.sqlite").write_text("no database, but long enough to be read as one" * 50)
    with pytest.raises(UserError, match="not a journal"):
        Journal(tmp_path / "points.sqlite", VERSIONS)


def test_shares_are_of_the_whole_and_words_say_how_far():
    plane = tiny("", None)
    search, _ = searched(lambda node: "accurate" if node[0] < 1 else "silently wrong", 3, 2, 2, 1)
    parts = shares(plane, search)
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


# the page


def test_the_page_tells_every_point_and_is_made_of_the_file_alone(report):
    folder, maps = report
    page = write_frontier_page(folder)
    tags = Tags(page)
    text = " ".join(tags.text.split())
    for one in maps:
        assert one.words in text
        for point in one.points:
            assert point.sentence in text
            assert point.command in text
    assert len(tags.attributes("circle", "cx")) == sum(len(one.points) for one in maps)
    assert "silently wrong" in text
    other = folder / "alone"
    other.mkdir()
    (other / FILE_NAME).write_bytes((folder / FILE_NAME).read_bytes())
    assert write_frontier_page(other).read_text("utf-8") == page.read_text("utf-8")


def test_the_page_asks_the_network_for_nothing_and_takes_no_markup(report, tmp_path):
    folder, maps = report
    hostile = [
        replace(
            maps[0],
            method=SCRIPT,
            words=SCRIPT,
            points=tuple(replace(point, sentence=SCRIPT, command=SCRIPT) for point in maps[0].points),
            lines=(Line(SCRIPT, np.array([40.0, 640.0]), np.array([0.01, np.inf])),),
        )
    ]
    chapter = Chapter("key", SCRIPT, SCRIPT, (Plot("plot", SCRIPT, SCRIPT, "x", maps[0].lines),))
    stated = {"command": SCRIPT, "scene": SCRIPT, "scene_name": SCRIPT, "citation": SCRIPT}
    stated |= {"bound": 0.01, "time_bound": 0.1, "most_steps": 500}
    other = tmp_path / "hostile"
    other.mkdir()
    write_frontier(other / FILE_NAME, hostile, [chapter], stated)
    for page in (write_frontier_page(other), write_frontier_page(folder)):
        tags, source = Tags(page), page.read_text(encoding="utf-8")
        assert not {tag for tag, _ in tags.tags} & {"script", "iframe", "object", "embed", "img"}
        loaded = [
            a[name] for _, a in tags.tags for name in ("src", "srcset", "data", "xlink:href") if a.get(name)
        ]
        assert all(url.startswith(("data:", "#")) for url in loaded)
        assert not re.search(r"@import|url\((?!#)", source)
        ids = [attributes["id"] for _, attributes in tags.tags if "id" in attributes]
        assert len(ids) == len(set(ids))


def test_failures_have_colours_of_their_own():
    from actin_xcheck.report.frontier import colour_of
    from actin_xcheck.result import Ending

    labels = [str(kind) for kind in Kind if kind is not Kind.FAILED]
    labels += [f"failed: {ending}" for ending in Ending if ending is not Ending.COMPLETED]
    assert len({colour_of(label) for label in labels}) == len(labels)


def test_a_folder_without_a_frontier_is_the_users_mistake(tmp_path):
    with pytest.raises(UserError, match=r"frontier\.h5: no such file"):
        write_frontier_page(tmp_path)


# the command


@pytest.mark.parametrize(
    ("scene", "over", "method", "message"),
    [
        ("no-such-scene", None, None, "unknown scene"),
        ("fig14-four-fronts", ["psi,q"], None, "--over: 'psi,q' is not a plane; valid: psi,dt"),
        ("fig14-four-fronts", None, ["fem"], "not a method"),
        ("mode-11-wall", None, None, "starts on a mode"),
        ("growing-disk", None, None, "moves as prescribed"),
        ("static-decay", None, None, "--scene: static-decay"),
    ],
)
def test_mistakes_are_one_line_and_make_no_folder(scene, over, method, message, tmp_path):
    folder = tmp_path / "none"
    with pytest.raises(UserError, match=re.escape(message)) as raised:
        survey.frontier_command(scene, over, method, folder, True)
    assert "\n" not in str(raised.value)
    assert not folder.exists()


def test_a_scene_without_contractility_is_refused():
    with pytest.raises(UserError, match="psi > 0"):
        check(scene_of())


def test_the_command_goes_on_where_it_was_and_says_what_it_found(report, small, tmp_path, capsys):
    shutil.copytree(report[0], tmp_path, dirs_exist_ok=True)
    survey.frontier_command("fig14-four-fronts", None, [one.name for one in METHODS_SHOWN], tmp_path, True)
    said = capsys.readouterr().out
    assert small == []
    assert said.startswith("fem-p1-paper over (psi,dt): right within 1%")
    assert said.rstrip().endswith("index.html")
