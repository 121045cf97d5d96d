"""Frontiers at work: maps, the page and the command."""

import json
import re
import shlex
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from actin_xcheck.cli.app import main
from actin_xcheck.core.errors import Ending, UserError
from actin_xcheck.report.exhibits import Line
from actin_xcheck.report.lattice import colour_of
from actin_xcheck.report.page import write_page
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.frontier import shares, words_of
from actin_xcheck.studies.frontier.answers import Kind
from actin_xcheck.studies.frontier.planes import check, plane_of, point_of
from actin_xcheck.studies.study import write_report
from tests.frontiers import FIG14, METHODS_SHOWN, TINY, searched, small
from tests.lab import FEM, scene_of
from tests.processes import InTurn
from tests.studies import carry
from tests.test_report import SCRIPT, Tags

# maps at work


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """A folder with a report of two methods, and what it says."""
    folder = tmp_path_factory.mktemp("frontier")
    return folder, carry(folder, small(), name="frontier")


def points_of(report, method):
    return {(one.column, one.row): one for one in report.tables["points"].rows if one.method == method}


def test_first_order_is_silently_wrong_where_second_order_is_accurate(report):
    _, found = report
    first, second = (points_of(found, method.name) for method in METHODS_SHOWN)
    assert first[2, 0].kind == Kind.SILENT  # psi = 640 in 11 steps
    assert second[2, 0].kind == Kind.ACCURATE
    assert first[0, 0].kind == second[0, 0].kind == Kind.ACCURATE
    assert not any(p.kind == Kind.FAILED for p in found.tables["points"].rows)
    accurate = [sum(p.kind == Kind.ACCURATE for p in one.values()) / len(one) for one in (first, second)]
    assert accurate[0] < accurate[1]
    assert "never fails" in found.findings[0]
    assert "silently wrong in" in found.findings[0]


def test_a_point_is_made_again_by_its_command(report):
    folder, found = report
    row = next(p for p in found.tables["points"].rows if p.kind == Kind.SILENT)
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


def test_a_run_whose_process_ended_every_time_is_a_failure_and_is_tried_again(tmp_path):
    """A run is lost, and the truth of two columns: the last one and the scene's own psi."""
    own = point_of(FIG14, METHODS_SHOWN[0], {"psi": 40.0, "dt": 0.032}, 3)
    texts = {point_of(FIG14, METHODS_SHOWN[0], given).scene for given in ({}, {"psi": 640.0})}

    class Losing(InTurn):
        def results(self, work, tasks):
            asked = [one.task.ask for one in tasks]
            self.lost = [
                one for one in asked if one == own or (one.scene in texts and hasattr(one, "levels"))
            ]
            return super().results(work, tasks)

    found = carry(tmp_path, small(METHODS_SHOWN[:1]), Losing(), "frontier")
    rows = points_of(found, FEM)
    assert (rows[0, 1].label, rows[0, 1].outcome) == ("failed: interrupted", "interrupted")
    assert rows[0, 1].sentence == "interrupted: killed"
    assert rows[0, 0].kind == Kind.ACCURATE  # its neighbour is what it was
    assert {rows[2, row].kind for row in (0, 1)} == {Kind.UNKNOWN}
    assert "converged run ends with interrupted: killed" in rows[2, 0].sentence
    (plot,) = found.chapters[1].exhibits
    assert "The truth is not known: the converged run ends with interrupted" in plot.note
    assert "failed: interrupted in" in found.findings[0]
    again = carry(tmp_path, small(METHODS_SHOWN[:1]), name="frontier")
    assert {row.kind for row in again.tables["points"].rows} <= {Kind.ACCURATE, Kind.SILENT}


def test_shares_are_of_the_whole_and_words_say_how_far():
    plane = TINY
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
    folder, found = report
    page = write_page(folder / "frontier.h5")
    tags = Tags(page)
    text = " ".join(tags.text.split())
    assert all(sentence in text for sentence in found.findings)
    rows = found.tables["points"].rows
    for point in rows:
        assert point.sentence in text
        assert point.command in text
    figures = [json.loads(script) for script in tags.scripts if script.startswith("{")]
    told = [sentence for one in figures for trace in one["data"] for sentence in trace.get("text", ())]
    assert len(told) == len(rows)
    other = folder / "alone"
    other.mkdir()
    (other / "frontier.h5").write_bytes((folder / "frontier.h5").read_bytes())
    assert write_page(other / "frontier.h5").read_text("utf-8") == page.read_text("utf-8")


def test_the_page_asks_the_network_for_nothing_and_takes_no_markup(report, tmp_path):
    folder, found = report
    maps, *others = found.chapters
    (one, *_), line = maps.exhibits, Line(SCRIPT, np.array([40.0, 640.0]), np.array([0.01, np.inf]))
    hurt = replace(one, title=SCRIPT, note=SCRIPT, sentences=(SCRIPT,) * len(one.sentences), lines=(line,))
    hostile = replace(found, chapters=(replace(maps, exhibits=(hurt,)), *others))
    write_report(tmp_path / "frontier.h5", "frontier", hostile, SCRIPT)
    for page in (write_page(tmp_path / "frontier.h5"), write_page(folder / "frontier.h5")):
        tags, source = Tags(page), page.read_text(encoding="utf-8")
        assert not {tag for tag, _ in tags.tags} & {"iframe", "object", "embed", "img"}
        assert not tags.foreign()
        loaded = [
            a[name] for _, a in tags.tags for name in ("src", "srcset", "data", "xlink:href") if a.get(name)
        ]
        assert all(url.startswith(("data:", "#")) for url in loaded)
        assert not re.search(r"@import|url\((?!#)", source)
        ids = [attributes["id"] for _, attributes in tags.tags if "id" in attributes]
        assert [one for one, times in Counter(ids).items() if times > 1] == []


def test_failures_have_colours_of_their_own():
    labels = [str(kind) for kind in Kind if kind is not Kind.FAILED]
    labels += [f"failed: {ending}" for ending in Ending if ending is not Ending.COMPLETED]
    assert len({colour_of(label) for label in labels}) == len(labels)


# the command


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--scene", "no-such-scene"], "unknown scene"),
        (["--over", "psi,q"], "--over: 'psi,q' is not a plane; valid: psi,dt"),
        (["--method", "fem"], "not a method"),
        (["--scene", "mode-11-wall"], "starts on a mode"),
        (["--scene", "growing-disk"], "moves as prescribed"),
        (["--scene", "static-decay"], "--scene: static-decay"),
    ],
)
def test_mistakes_are_one_line_and_make_no_folder(words, message, tmp_path, monkeypatch, capsys):
    folder = tmp_path / "none"
    monkeypatch.setattr("sys.argv", ["actin_xcheck", "frontier", *words, "--out", str(folder)])
    with pytest.raises(SystemExit):
        main()
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert not folder.exists()


def test_a_scene_without_contractility_is_refused():
    with pytest.raises(UserError, match="psi > 0"):
        check(scene_of())
