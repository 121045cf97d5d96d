"""The audit's machinery: checks, limits, readings, rows, the file, the page and the command."""

import math
import tomllib

import h5py
import pytest

from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Model
from actin_xcheck.core.observables import centroid
from actin_xcheck.core.parameters import Closure, Parameters, Rheology
from actin_xcheck.report.exhibits import Sheet
from actin_xcheck.runs.method import FORCE_BALANCE, load
from actin_xcheck.runs.records import read_table
from actin_xcheck.runs.store import reading
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.audit import (
    AuditEntry,
    AuditRow,
    Finding,
    Judgement,
    article,
    paper,
    rows,
    runs,
    table,
    write_audit_page,
)
from actin_xcheck.studies.audit.checks import FAILS, HOLDS, OPEN, RowCheck, judged
from actin_xcheck.studies.audit.readouts import (
    area_change,
    displacement_likeness,
    fronts,
    mode_share,
    pattern,
    rim_excess,
)
from actin_xcheck.studies.audit.runs import FEM, Evidence, Limit, RunCell, RunFamily
from actin_xcheck.studies.audit.scheme import UnprojectedKrylov
from actin_xcheck.studies.stored import run_stored
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
    assert RowCheck("between 0 and 1", area_change, 1.0, 0, 1).state(Limit(value, uncertainty)) == state


def test_the_limit_is_extrapolated_and_its_uncertainty_covers_what_is_left(monkeypatch):
    levels = ((3, 0.1), (4, 0.1), (5, 0.1), (4, 0.05), (4, 0.025))
    evidence = Evidence(RunFamily("fig14-four-fronts", "x", "", (), FEM, levels), {})
    evidence.__dict__["runs"] = {level: level for level in levels}

    def expansion(level, readout, t):
        h, dt = 2.0 ** -level[0], level[1]
        return 2.0 + 3 * h**2 + dt - 0.5 * dt**2 + 20 * h**4 + 0.7 * h**3

    monkeypatch.setattr(runs, "_read", expansion)
    found = evidence.limit(area_change, 1.0)
    assert found.value == pytest.approx(2.0, abs=1e-3)
    assert abs(found.value - 2.0) < found.uncertainty < 0.05


def test_a_varied_scene_keeps_its_physics_and_expects_nothing():
    scene = load_scene("fig14-four-fronts")
    changes = (("model.closure", "traction-free"), ("time.outputs", (0.01, 0.1)), ("time.end", 0.1))
    (job,) = RunFamily(scene.name, "other", "", changes, FEM, ((2, 0.1),)).jobs().values()
    other = job.scene
    assert other.physics.closure is Closure.TRACTION_FREE
    assert other.parameters == scene.parameters
    assert other.output_times == (0.01, 0.1)
    assert "expect" not in tomllib.loads(other.text)


def test_a_cell_is_run_as_published_by_both_codes_and_under_every_reading():
    fem, fv, *readings = RunCell("fig14-four-fronts", 60).families()
    assert (fem.method, fv.method) == ("fem-p1-paper", "fv-coupled")
    assert fem.published == (6, 1.0228e-3)
    assert len({reading.reading for reading in (fem, *readings)}) == 2 * 3
    assert {r for r in Rheology} == {Rheology(s.reading.split(", ")[0]) for s in (fem, *readings)}


def test_every_cell_is_a_scene_that_some_row_needs():
    used = {name for said in article().values() for name in (said.get("cell"), *said.get("cells", ()))}
    assert used - {None} == set(table("cells.toml"))
    (failing,) = RunCell.named("sec54-failure").families()
    assert failing.levels == ((6, 6.0228e-4),)
    assert dict(RunCell.named("fig14").changes)["time.outputs"][0] == 15 * 1.0228e-3


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """Evidence of a short expansion, coarse but of every kind."""
    folder = tmp_path_factory.mktemp("audit")
    changes = (("time.end", 0.004), ("time.outputs", (0.004,)))
    families = RunCell("fig16-uniform-expansion", 2, changes, "test", (Closure.REFERENCE_NORMAL,)).families()
    families = [RunFamily(s.scene, s.label, s.reading, s.changes, s.method, s.levels) for s in families]
    for job in {job.file: job for family in families for job in family.jobs().values()}.values():
        run_stored(job, folder)
    return [Evidence.of(family, folder) for family in families]


@pytest.mark.slow
def test_a_row_follows_its_numbers(cell, monkeypatch):
    expands = {"says": "expands", "reads": "area_change", "t": 0.004, "low": 0}
    contracts = {"says": "contracts", "reads": "area_change", "t": 0.004, "high": 0}
    for checks, judgement in (
        ([expands], Judgement.IN_KIND),
        ([contracts], Judgement.NOT_REPRODUCED),
        ([expands, contracts], Judgement.NOT_REPRODUCED),
    ):
        monkeypatch.setitem(article()["fig16"], "checks", checks)
        finding = rows()["fig16"].examine(*cell)
        assert finding.judgement is judgement
        assert "FEM" in finding.computed
        assert "FV" in finding.computed
        assert {type(exhibit).__name__ for exhibit in finding.exhibits} == {"Sheet", "Shots", "Plot"}
    assert judged([RowCheck.of(expands)], "Because.", *cell).reason.endswith("Because.")
    assert RowCheck("has fronts", fronts, 0.004, 3.5, 4.5).interval == "3.5 … 4.5"


def test_readouts_know_the_fields_they_are_about(cell):
    run = cell[0].finest
    assert area_change(run, 0.0) == 0
    assert area_change(run, 0.004) > 0
    assert rim_excess(run, 0.0) == pytest.approx((1 + 1e-3 * 0.7652) / 1.001 - 1, abs=2e-5)  # mean of cos x
    assert displacement_likeness(lambda x: x[0])(run, 0.004) > 0.8  # radial
    assert mode_share(pattern({"w1,1": 1}), 1)(run, 0.0) < 1e-12  # cos x is even
    with pytest.raises(ValueError, match="has no frame"):
        area_change(run, 0.1)


EXHIBIT = Sheet("numbers", "Numbers <b>", "", (("a", "b"), ("1", "2")))
FOUND = Finding(Judgement.MISPRINT, "3 & 4", "because", (EXHIBIT,), {"x": 1.5})


def rows_of(folder):
    with reading(folder / "paper.h5", "audit") as file:
        return read_table(file["tables/rows"], AuditEntry)


def test_the_file_keeps_every_row_and_the_page_shows_it(tmp_path, monkeypatch):
    monkeypatch.setitem(rows(), "eq3.7", AuditRow("eq3.7", lambda: FOUND))
    report = carry(tmp_path, paper(["eq3.7", "fig20a"], said=True), name="paper")
    first, second = rows_of(tmp_path)
    assert [first, second] == report.tables["rows"].rows
    assert (first.judgement, first.computed, first.numbers) == (Judgement.MISPRINT, "3 & 4", (("x", 1.5),))
    assert first.command.endswith("paper --only eq3.7")
    assert second.place in report.findings[1]
    assert report.verdicts == {"misprint": 1, "cannot be decided": 1}
    page = write_audit_page(tmp_path / "paper.h5").read_text(encoding="utf-8")
    for shown in ('id="show-misprint"', "3 &amp; 4", "Numbers &lt;b&gt;", "/exhibits/eq3.7/numbers"):
        assert shown in page
    assert "Numbers <b>" not in page


def test_a_row_rests_on_runs_that_are_made_once(tmp_path, monkeypatch, cell):
    family = cell[0].family
    monkeypatch.setitem(rows(), "fig14", AuditRow("fig14", lambda one: FOUND, lambda: (family,)))
    monkeypatch.setitem(
        rows(), "fig16", AuditRow("fig16", lambda one, other: FOUND, lambda: (family, family))
    )
    carry(tmp_path, paper(["fig14", "fig16"]), name="paper")
    files = sorted(path.relative_to(tmp_path).as_posix() for path in (tmp_path / "runs").iterdir())
    assert len(files) == len(family.levels)
    assert [sorted(set(row.runs)) for row in rows_of(tmp_path)] == [files, files]
    with h5py.File(tmp_path / "paper.h5") as file:
        assert sorted(file["runs"].get(name, getlink=True).filename for name in file["runs"]) == files


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


# scenes of the article


def test_the_realistic_cell_has_the_groups_of_section_6():
    parameters = load_scene("sec6-realistic").parameters
    assert parameters.psi == pytest.approx(22.4, abs=0.05)
    assert parameters.p == pytest.approx(0.26, abs=1e-12)
    assert parameters.d == pytest.approx(2.42e-6, abs=5e-9)
    assert (parameters.mu1, parameters.mu2) == pytest.approx((2.06, 5.36), abs=5e-3)


@pytest.mark.parametrize(
    ("name", "psi"),
    [
        ("fig13-mixed-02-21", 310),
        ("fig12-mixed-31-02-21", 200),
        ("fig14-four-fronts", 367),
        ("fig11-two-fronts", 110),
        ("fig11-two-fronts-single", 110),
    ],
)
def test_table_5_is_converted(name, psi):
    assert load_scene(name).parameters.psi == pytest.approx(psi * 1.3 / 1.5, rel=2e-6)
