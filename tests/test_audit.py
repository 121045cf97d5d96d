"""The audit's machinery: checks, limits, readings, the file, the page and the command."""

import math
import re
import subprocess
import sys
import tomllib

import h5py
import pytest

from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Closure, Model, Rheology
from actin_xcheck.core.observables import centroid
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.report.exhibits import Sheet
from actin_xcheck.runs.method import FORCE_BALANCE, load
from actin_xcheck.runs.records import read_table
from actin_xcheck.runs.store import reading
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.audit.page import write_audit_page
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.rows import ROWS
from actin_xcheck.studies.audit.simulations.checks import FAILS, HOLDS, OPEN, Case, Check, simulation
from actin_xcheck.studies.audit.simulations.readouts import (
    area_change,
    displacement_likeness,
    fronts,
    mode_share,
    rim_excess,
)
from actin_xcheck.studies.audit.simulations.studies import FEM, Evidence, Limit, Study
from actin_xcheck.studies.audit.simulations.translation import UnprojectedKrylov
from actin_xcheck.studies.audit.study import Entry, paper
from actin_xcheck.studies.stored import run_stored
from actin_xcheck.theory.modes import Mode
from tests.studies import carry


@pytest.mark.parametrize(
    ("value", "uncertainty", "state"),
    [
        (0.5, 0.1, HOLDS),
        (0.05, 0.1, OPEN),
        (-0.05, 0.1, OPEN),
        (-0.5, 0.1, FAILS),
        (0.95, 0.1, OPEN),
        (1.5, 0.1, FAILS),
        (0.5, math.nan, OPEN),
        (math.nan, 0.0, FAILS),
    ],
)
def test_a_check_holds_or_fails_only_beyond_the_uncertainty(value, uncertainty, state):
    assert Check("between 0 and 1", area_change, 1.0, 0, 1).state(Limit(value, uncertainty)) == state


class Synthetic(Evidence):
    """Evidence whose readouts follow a known error expansion."""

    @property
    def runs(self):
        return dict.fromkeys(self.files)


def test_the_limit_is_extrapolated_and_its_uncertainty_covers_what_is_left(monkeypatch):
    levels = {(n, dt): None for n, dt in ((3, 0.1), (4, 0.1), (5, 0.1), (4, 0.05), (4, 0.025))}
    evidence = Synthetic(Study("fig14-four-fronts", "x", "", (), FEM, tuple(levels)), levels)

    def expansion(run, readout, t):
        n, dt = next(at)
        h = 2.0**-n
        return 2.0 + 3 * h**2 + dt - 0.5 * dt**2 + 20 * h**4 + 0.7 * h**3

    monkeypatch.setattr("actin_xcheck.studies.audit.simulations.studies._read", expansion)
    at = iter(levels)
    found = evidence.limit(area_change, 1.0)
    assert found.value == pytest.approx(2.0, abs=1e-3)
    assert abs(found.value - 2.0) < found.uncertainty < 0.05


def test_a_varied_scene_keeps_its_physics_and_expects_nothing():
    scene = load_scene("fig14-four-fronts")
    changes = (("model.closure", "traction-free"), ("time.outputs", (0.01, 0.1)), ("time.end", 0.1))
    study = Study("fig14-four-fronts", "other", "", changes, FEM, ((2, 0.1),))
    other = study.jobs()[2, 0.1].scene
    assert other.physics.closure is Closure.TRACTION_FREE
    assert other.parameters == scene.parameters
    assert other.output_times == (0.01, 0.1)
    assert "expect" not in tomllib.loads(other.text)


def test_a_case_is_run_as_published_by_both_codes_and_under_every_reading():
    fem, fv, *readings = Case("fig14-four-fronts", 60).studies()
    assert (fem.method, fv.method) == ("fem-p1-paper", "fv-coupled")
    assert fem.published == (6, 1.0228e-3)
    assert len({reading.reading for reading in (fem, *readings)}) == 2 * 3
    assert {r for r in Rheology} == {Rheology(s.reading.split(", ")[0]) for s in (fem, *readings)}


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """Evidence of a short expansion, coarse but of every kind."""
    folder = tmp_path_factory.mktemp("audit")
    changes = (("time.end", 0.004), ("time.outputs", (0.004,)))
    case = Case("fig16-uniform-expansion", 2, changes, "test", (Closure.REFERENCE_NORMAL,))
    studies = tuple(Study(s.scene, s.label, s.reading, s.changes, s.method, s.levels) for s in case.studies())
    for job in {job.file: job for study in studies for job in study.jobs().values()}.values():
        run_stored(job, folder)
    return case, [Evidence.of(study, folder) for study in studies]


def test_a_row_follows_its_numbers(cell):
    case, evidence = cell
    expands = Check("expands", area_change, 0.004, low=0)
    contracts = Check("contracts", area_change, 0.004, high=0)
    round_ = Check("has fronts", fronts, 0.004, 3.5, 4.5)
    for checks, judgement in (
        ([expands], Judgement.IN_KIND),
        ([contracts], Judgement.NOT_REPRODUCED),
        ([expands, contracts], Judgement.NOT_REPRODUCED),
    ):
        finding = simulation("fig", case, checks).examine(*evidence)
        assert finding.judgement is judgement
        assert "FEM" in finding.computed
        assert "FV" in finding.computed
        assert {type(exhibit).__name__ for exhibit in finding.exhibits} == {"Sheet", "Shots", "Plot"}
    assert round_.interval == "3.5 … 4.5"


def test_readouts_know_the_fields_they_are_about(cell):
    _, (fem, *_) = cell
    run = fem.finest
    assert area_change(run, 0.0) == 0
    assert area_change(run, 0.004) > 0
    assert rim_excess(run, 0.0) == pytest.approx((1 + 1e-3 * 0.7652) / 1.001 - 1, abs=2e-5)  # mean of cos x
    assert displacement_likeness(lambda x: x[0])(run, 0.004) > 0.8  # radial
    assert mode_share(Mode(1, 1).value, 1)(run, 0.0) < 1e-12  # cos x is even
    with pytest.raises(ValueError, match="has no frame"):
        area_change(run, 0.1)


EXHIBIT = Sheet("numbers", "Numbers <b>", "", (("a", "b"), ("1", "2")))
FOUND = Finding(Judgement.MISPRINT, "3 & 4", "because", (EXHIBIT,), {"x": 1.5})


def rows_of(folder):
    with reading(folder / "paper.h5", "audit") as file:
        return read_table(file["tables/rows"], Entry)


def test_the_file_keeps_every_row_and_the_page_shows_it(tmp_path, monkeypatch):
    monkeypatch.setitem(ROWS, "eq3.7", Row("eq3.7", lambda: FOUND))
    report = carry(tmp_path, paper(["eq3.7", "fig20a"], said=True), name="paper")
    first, second = rows_of(tmp_path)
    assert [first, second] == report.tables["rows"].rows
    assert (first.judgement, first.computed, first.numbers) == (Judgement.MISPRINT, "3 & 4", (("x", 1.5),))
    assert first.command.endswith("paper --only eq3.7")
    assert second.place in report.findings[1]
    assert report.verdicts == {"misprint": 1, "cannot be decided": 1}
    page = write_audit_page(tmp_path / "paper.h5").read_text(encoding="utf-8")
    assert 'id="show-misprint"' in page
    assert "3 &amp; 4" in page
    assert "Numbers &lt;b&gt;" in page
    assert "Numbers <b>" not in page
    assert "/exhibits/eq3.7/numbers" in page


def test_a_row_rests_on_runs_that_are_made_once(tmp_path, monkeypatch, cell):
    study = cell[1][0].study
    monkeypatch.setitem(ROWS, "fig14", Row("fig14", lambda one: FOUND, lambda: (study,)))
    monkeypatch.setitem(ROWS, "fig16", Row("fig16", lambda one, other: FOUND, lambda: (study, study)))
    carry(tmp_path, paper(["fig14", "fig16"]), name="paper")
    files = sorted(path.relative_to(tmp_path).as_posix() for path in (tmp_path / "runs").iterdir())
    assert len(files) == len(study.levels)
    assert [sorted(set(row.runs)) for row in rows_of(tmp_path)] == [files, files]
    with h5py.File(tmp_path / "paper.h5") as file:
        assert sorted(file["runs"].get(name, getlink=True).filename for name in file["runs"]) == files


def test_every_figure_and_table_has_a_row_and_no_row_evades():
    keys = set(ROWS)
    assert all(any(re.match(rf"fig{n:02d}(?!\d)", key) for key in keys) for n in range(1, 24))
    assert all(any(re.match(rf"table{n}(?!\d)", key) for key in keys) for n in range(1, 7))
    for row in ROWS.values():
        assert re.fullmatch(r"[A-Za-z0-9.-]+", row.key)
        assert row.statement
        assert row.place


def test_krylov_carries_the_cell_by_its_stopping_rule_and_no_closure_does():
    """One step under a lopsided a: the drift grows with restarts where nothing resists it."""
    mesh, rest = disk(3, 0.8), Model(Parameters(62.4, 0.26), closure=Closure.TRACTION_FREE)
    corners = 1 + 1e-3 * mesh.xi[0, mesh.triangles]

    def drift(mechanics):
        x = mechanics.advance(0.0, 0.01, mesh.xi, corners).x
        return abs(centroid(x, mesh.triangles)[0] - centroid(mesh.xi, mesh.triangles)[0])

    few, many = (drift(UnprojectedKrylov(rest, mesh, n)) for n in (1, 10))
    assert drift(load(FORCE_BALANCE)(rest, mesh)) < 1e-3 * few
    assert many > 4 * few


def test_the_command_examines_one_row(tmp_path):
    command = [sys.executable, "-m", "actin_xcheck", "paper", "--only", "fig20a", "--out", str(tmp_path)]
    done = subprocess.run([*command, "--quiet"], capture_output=True, text=True, check=True)
    assert "cannot be decided" in done.stdout
    assert (tmp_path / "index.html").exists()
    assert [row.key for row in rows_of(tmp_path)] == ["fig20a"]


def test_an_unknown_row_is_one_line_with_those_nearby():
    command = [sys.executable, "-m", "actin_xcheck", "paper", "--only", "fig41"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "fig1" in done.stderr
