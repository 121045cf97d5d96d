"""Two runs or two reports side by side: differences that are put in are found, and nothing else is."""

import numpy as np
import pytest

from actin_xcheck.cli.conduct import of_two, page_of
from actin_xcheck.core.errors import UserError
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run
from actin_xcheck.studies.compare import FILE_NAME
from actin_xcheck.studies.side_by_side import side_by_side
from actin_xcheck.studies.study import Report, answered, counted, write_report
from tests.claims import claim
from tests.lab import scene_of


def laid(*paths):
    return answered(side_by_side([str(path) for path in paths]), lambda tasks: [])


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """Two runs of a scene that spread 1 + c x as exp(-t), c = 0.1 and 0.2, by elements on two meshes."""
    folder, files = tmp_path_factory.mktemp("runs"), []
    for name, a, refine in (("first", "1 + 0.1*x", 2), ("second", "1 + 0.2*x", 3)):
        scene = scene_of("psi = 0\np = 0\nd = 0", a, 0.1, "outputs = [0.05]\n")
        run(scene, Numerics(METHODS["fem-p2-imex3"], refine, 0.05), folder / f"{name}.vtkhdf")
        files.append(folder / f"{name}.vtkhdf")
    return files


def test_runs_differ_by_what_was_put_in(stored):
    report = laid(*stored)
    differ = {row.what: (row.first, row.second) for row in report.tables["differs"].rows}
    assert differ["scene.initial.a"] == ("1 + 0.1*x", "1 + 0.2*x")
    assert differ["refine"] == ("2", "3")
    assert not {"scene.parameters.psi", "commit", "method_name", "outcome", "scene.time.end"} & differ.keys()
    apart = {row.quantity: row for row in report.tables["apart"].rows}
    assert apart["area"].time == 0.1
    assert abs(apart["area"].relative) < 1e-4
    assert apart["total actin"].first == pytest.approx(np.pi, rel=1e-4)


def test_the_difference_is_taken_at_the_same_material_points(stored):
    """0.1 x exp(-t), although the meshes are not the same."""
    (both,) = laid(*stored).chapters
    film = {one.key: one for one in both.exhibits}["film-difference"]
    assert [shot.title.split(",")[0] for shot in film.shots] == ["t = 0", "t = 0.05", "t = 0.1"]
    for shot, t in zip(film.shots, (0.0, 0.05, 0.1), strict=True):
        expected = 0.1 * np.exp(-t) * shot.x[0][shot.triangles].mean(axis=0)
        assert np.abs(shot.values - expected).max() < 2e-4


def test_a_run_beside_itself_does_not_differ(stored):
    report = laid(stored[0], stored[0])
    assert not report.tables["differs"].rows
    assert all(row.difference == 0 for row in report.tables["apart"].rows)


def test_reports_differ_by_verdicts_then_by_numbers(tmp_path):
    kept, turned, moved = (claim(quantity=name, value=0.5, bound=1.0) for name in ("kept", "turned", "moved"))
    for name, values in {"old": (0.5, 0.5, 0.5), "new": (0.5, 2.0, 0.6)}.items():
        (tmp_path / name).mkdir()
        claims = tuple(
            claim(quantity=one.quantity, value=value, bound=1.0)
            for one, value in zip((kept, turned, moved), values, strict=True)
        )
        report = Report(counted(claims, "claims hold"), "", claims=claims)
        write_report(tmp_path / name / FILE_NAME, "compare", report, f"python -m actin_xcheck compare {name}")
    report = laid(tmp_path / "old", tmp_path / "new")
    rows = report.tables["turned"].rows
    assert [(row.first, row.second, row.second_value) for row in rows] == [
        ("PASS", "FAIL", 2.0),
        ("PASS", "PASS", 0.6),
    ]
    assert "command" in {row.what for row in report.tables["differs"].rows}
    write_report(tmp_path / FILE_NAME, "compare", report, "python -m actin_xcheck compare old new")
    assert of_two(tmp_path / FILE_NAME)
    assert not of_two(tmp_path / "old" / FILE_NAME)
    assert "1 verdicts differ, 1 numbers" in page_of(tmp_path / FILE_NAME).read_text(encoding="utf-8")


def test_what_is_not_two_of_a_kind_is_refused(stored, tmp_path):
    for given in [stored[0]], [stored[0], tmp_path], [*stored, stored[0]]:
        with pytest.raises(UserError, match=r"valid are scenes, two runs \(.vtkhdf\), or two folders"):
            laid(*given)
    with pytest.raises(UserError, match="no report of a study; valid: a folder with one"):
        laid(tmp_path, tmp_path)
