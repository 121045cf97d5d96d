"""Frontiers at work: maps, resuming, the file, the page and the command."""

import re
import shlex
import shutil
import sqlite3
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from actin_xcheck.cli import frontier as survey
from actin_xcheck.core.errors import UserError
from actin_xcheck.report.exhibits import Chapter, Line, Plot
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.frontier import examine as examination
from actin_xcheck.studies.frontier.classes import Kind
from actin_xcheck.studies.frontier.journal import Journal
from actin_xcheck.studies.frontier.page import write_frontier_page
from actin_xcheck.studies.frontier.planes import check, plane_of, point_of
from actin_xcheck.studies.frontier.record import FILE_NAME, read_frontier, write_frontier
from actin_xcheck.studies.frontier.words import shares, words_of
from actin_xcheck.studies.frontier.works import Task, work
from tests.frontiers import FIG14, METHODS_SHOWN, VERSIONS, answer, in_process, searched, shrink, tiny
from tests.lab import FEM, scene_of
from tests.test_report import SCRIPT, Tags

# maps at work


@pytest.fixture
def small(monkeypatch):
    """A small frontier in this process; what is run for it."""
    shrink(monkeypatch)
    return in_process(monkeypatch)


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """A folder with a report of two methods, and its maps."""
    folder = tmp_path_factory.mktemp("frontier")
    with pytest.MonkeyPatch.context() as monkeypatch:
        shrink(monkeypatch)
        in_process(monkeypatch)
        maps = examination.examine(FIG14, METHODS_SHOWN, ["psi,dt"], folder, "a command", 1)
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
    again = examination.examine(FIG14, METHODS_SHOWN, ["psi,dt"], tmp_path, "a command", 1)
    assert small == []
    assert [[repr(point) for point in one.points] for one in again] == [
        [repr(point) for point in one.points] for one in maps
    ]
    with sqlite3.connect(tmp_path / "points.sqlite") as rows:
        rows.execute("DELETE FROM runs WHERE key IN (SELECT key FROM runs LIMIT 3)")
    rows.close()
    examination.examine(FIG14, METHODS_SHOWN, ["psi,dt"], tmp_path, "a command", 1)
    assert len(small) == 3


@pytest.mark.parametrize("commit", ["0123-dirty", "unknown", "4567"])
def test_what_another_code_or_an_unknown_one_ran_is_not_taken_up(commit, report):
    folder, _ = report
    point, versions = point_of(FIG14, METHODS[FEM], {}), VERSIONS | {"commit": commit}
    journal = Journal(folder / "points.sqlite", versions)
    journal.keep(point, answer())
    assert (journal.answer(point) is None) == (commit != "4567")
    assert Journal(folder / "points.sqlite", VERSIONS).answer(point) is None


def kept(folder):
    """How many runs the journal holds."""
    with sqlite3.connect(folder / "points.sqlite") as rows:
        (count,) = rows.execute("SELECT count(*) FROM runs").fetchone()
    rows.close()
    return count


def test_what_came_in_survives_an_interrupt(small, tmp_path, monkeypatch):
    class Interrupted:
        def results(self, work, tasks):
            for number in range(4):
                yield number, work(tasks[number])
            raise KeyboardInterrupt

    patient = examination.executor
    monkeypatch.setattr(examination, "executor", lambda jobs, scheduler: nullcontext(Interrupted()))
    with pytest.raises(KeyboardInterrupt):
        examination.examine(FIG14, METHODS_SHOWN[:1], ["psi,dt"], tmp_path, "", 1)
    assert not (tmp_path / FILE_NAME).exists()
    assert kept(tmp_path) == 4
    monkeypatch.setattr(examination, "executor", patient)
    examination.examine(FIG14, METHODS_SHOWN[:1], ["psi,dt"], tmp_path, "", 1)
    assert kept(tmp_path) == len(small) + 4


def test_a_run_whose_process_ended_every_time_is_a_failure_and_is_tried_again(tmp_path, monkeypatch):
    """A run is lost, and the truth of two columns: the last one and the scene's own psi."""
    shrink(monkeypatch)
    own = point_of(FIG14, METHODS_SHOWN[0], {"psi": 40.0, "dt": 0.032})
    truths = [point_of(FIG14, METHODS_SHOWN[0], given).scene for given in ({}, {"psi": 640.0})]
    tried = in_process(monkeypatch, lost=lambda what: what in (own, *truths))
    (found,) = examination.examine(FIG14, METHODS_SHOWN[:1], ["psi,dt"], tmp_path, "", 1)
    rows = {(row.column, row.row): row for row in read_frontier(tmp_path / FILE_NAME).maps[0].points}
    assert (rows[0, 1].label, rows[0, 1].outcome) == ("failed: interrupted", "interrupted")
    assert rows[0, 1].sentence == "interrupted: the process ended"
    assert rows[0, 0].kind == Kind.ACCURATE  # its neighbour is what it was
    assert {rows[2, row].kind for row in (0, 1)} == {Kind.UNKNOWN}
    assert "converged run ends with interrupted: the process ended" in rows[2, 0].sentence
    assert rows[0, 1].sentence in write_frontier_page(tmp_path).read_text("utf-8")
    (plot,) = read_frontier(tmp_path / FILE_NAME).chapters[0].exhibits
    assert "The truth is not known: the converged run ends with interrupted" in plot.note
    assert kept(tmp_path) == len(tried) - 3
    assert "failed: interrupted in" in found.words
    again = in_process(monkeypatch)
    (found,) = examination.examine(FIG14, METHODS_SHOWN[:1], ["psi,dt"], tmp_path, "", 1)
    assert set(again) >= {own, *truths}
    assert {row.kind for row in found.points} <= {Kind.ACCURATE, Kind.SILENT}


def test_another_version_of_the_code_is_refused():
    with pytest.raises(UserError, match="another version of the code"):
        work(Task(point_of(FIG14, METHODS[FEM], {}), "other code"))


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
        assert not {tag for tag, _ in tags.tags} & {"iframe", "object", "embed", "img"}
        assert not tags.foreign()
        loaded = [
            a[name] for _, a in tags.tags for name in ("src", "srcset", "data", "xlink:href") if a.get(name)
        ]
        assert all(url.startswith(("data:", "#")) for url in loaded)
        assert not re.search(r"@import|url\((?!#)", source)
        ids = [attributes["id"] for _, attributes in tags.tags if "id" in attributes]
        assert len(ids) == len(set(ids))


def test_failures_have_colours_of_their_own():
    from actin_xcheck.core.outcome import Ending
    from actin_xcheck.studies.frontier.page import colour_of

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
        survey.frontier_command(scene, over, method, folder, quiet=True)
    assert "\n" not in str(raised.value)
    assert not folder.exists()


def test_a_scene_without_contractility_is_refused():
    with pytest.raises(UserError, match="psi > 0"):
        check(scene_of())


def test_the_command_goes_on_where_it_was_and_says_what_it_found(report, small, tmp_path, capsys):
    shutil.copytree(report[0], tmp_path, dirs_exist_ok=True)
    survey.frontier_command(
        "fig14-four-fronts", None, [one.name for one in METHODS_SHOWN], tmp_path, quiet=True
    )
    said = capsys.readouterr().out
    assert small == []
    assert said.startswith("fem-p1-paper over (psi,dt): right within 1%")
    assert said.rstrip().endswith("index.html")
