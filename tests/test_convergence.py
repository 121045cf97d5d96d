"""Convergence studies: the rules for orders, the plan of levels, the file, the page and the command."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
import typer

from actin_xcheck.cli import converge
from actin_xcheck.core.errors import UserError
from actin_xcheck.report.draw import draw
from actin_xcheck.report.exhibits import Exhibit, Line, Plot
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.records import read_record, write_record
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene, parse_scene
from actin_xcheck.studies.compare import Job
from actin_xcheck.studies.converge import examine as examination
from actin_xcheck.studies.converge import studies as planning
from actin_xcheck.studies.converge.page import write_convergence_page
from actin_xcheck.studies.converge.record import FILE_NAME, read_convergence, write_convergence
from actin_xcheck.studies.converge.studies import Level, Refined, Truth, final, studies_of
from actin_xcheck.verdicts import conditions
from actin_xcheck.verdicts.orders import Verdict, local_orders
from actin_xcheck.verdicts.quantities import Quantity, error_of
from tests.faults import FAULTS
from tests.lab import FEM, FV, quiet, scene_of

H = 2.0 ** -np.arange(1, 6)


def in_process(jobs, report):
    """What `compare.run_all` does, where a test's faults are seen."""
    for job in jobs:
        run(job.scene, job.method, job.refine, job.dt, job.path, job.command)


# the plan


def test_dt_follows_h_by_the_declared_orders(tmp_path):
    for method in METHODS.values():
        tied = next(s for s in studies_of("growing-disk", [method], tmp_path) if s.refined is Refined.H)
        h, dt = np.array([tied.steps_of(level) for level in tied.levels]).T
        assert len(h) >= 5
        assert np.diff(np.log2(h)) == pytest.approx(-np.ones(len(h) - 1))  # consecutive
        ratio = (method.order_h or 2) / method.order_dt
        assert local_orders(h, dt) == pytest.approx(ratio, abs=0.2)


def test_what_is_measured_follows_what_a_scene_expects(tmp_path):
    def truths(name, method=FEM):
        return {(s.refined, s.quantity): s.truth for s in studies_of(name, [METHODS[method]], tmp_path)}

    a, h, dt = Quantity.CONCENTRATION, Refined.H, Refined.DT
    assert truths("growing-disk") == {(h, a): Truth.EXACT, (dt, a): Truth.RICHARDSON}
    assert truths("growing-disk", "fv-tpfa") == {(h, a): Truth.EXACT}
    assert truths("fig14-four-fronts", "fv-tpfa") == {}
    assert truths("mode-0-cell")[h, Quantity.GROWTH_RATE] is Truth.MODE
    assert truths("fig14-four-fronts")[h, Quantity.PROBES] is Truth.REFERENCE
    assert truths("smooth-fronts")[h, Quantity.AREA] is Truth.RICHARDSON


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("growing-disk", ""),
        ("smooth-fronts", ""),
        ("fitted-ring", ""),
        ("mode-0-cell", ""),
        ("mode-1-full-cell", ""),
        ("fitted-ring-elastic", ""),
        ("fig14-four-fronts", "at t = 0"),
        ("fig17-uniform-contraction", "at t = 0"),  # viscous, but d(cos x)/dn does not vanish
    ],
)
def test_orders_are_claimed_of_smooth_compatible_data_only(name, reason, tmp_path):
    study = studies_of(name, [METHODS[FEM]], tmp_path)[0]
    assert reason in study.no_claim
    assert bool(study.no_claim) == bool(reason)


def test_the_trace_of_div_u_costs_a_viscoelastic_rim_an_order_in_h(tmp_path):
    def declared(name, method):
        return {(one.refined, one.declared) for one in studies_of(name, [METHODS[method]], tmp_path)}

    assert declared("fitted-ring", "fem-p2-imex3") == {(Refined.H, 3), (Refined.DT, 3)}
    assert declared("fitted-ring-elastic", "fem-p2-imex3") == {(Refined.H, 2), (Refined.DT, 3)}
    assert declared("mode-0-cell", "fem-p2-imex3") == {(Refined.H, 3), (Refined.DT, 3)}  # p = 0


def test_high_orders_in_time_are_claimed_where_all_conditions_are_met(tmp_path):
    def claimed(name, method="fem-p2-imex3"):
        studies = studies_of(name, [METHODS[method]], tmp_path)
        return {study.quantity for study in studies if not study.no_claim}

    for name in ("static-decay", "growing-disk", "manufactured-moving", "manufactured-static"):
        assert claimed(name) == claimed(name, "fem-p4-imex4") == {Quantity.CONCENTRATION}
    assert claimed("mode-0-cell")
    assert not claimed("mode-0-cell", "fem-p4-imex4")
    assert not claimed("smooth-fronts")
    assert claimed("smooth-fronts", "fem-p1-imex2")
    assert not claimed("stirred")  # the rim turns against what is inside
    assert claimed("stirred", "fv-order2")
    assert Quantity.CONCENTRATION in claimed("fitted-ring")
    assert claimed("fitted-ring", "fem-p3-imex4") == {Quantity.AREA, Quantity.TOTAL_ACTIN}


def test_the_flux_of_change_is_the_exact_one():
    """Of `stirred` on the rim n.grad(da/dt) = -4 omega A sin theta, at most 1.6 at t = 0."""
    assert conditions._flux_of_change(load_scene("stirred")) == pytest.approx(1.6, rel=1e-4)
    for name in ("growing-disk", "manufactured-moving"):
        assert conditions._flux_of_change(load_scene(name)) < conditions._NOTHING / 5


@pytest.mark.parametrize(
    ("this", "other"),
    [
        ("/18 +", "/17 +"),  # da/dt jumps on the ring
        ("1 + maximum", "1 + 0.001*cos(pi*r**2) + maximum"),  # a varies beyond it
        ("psi = 0", "psi = 1"),  # the angular part inside loads the rim
        ("[time]", 'u = ["0.01*x", "0"]\n[time]'),  # elasticity acts at once
    ],
)
def test_a_ring_that_data_do_not_fit_is_seen(this, other):
    text = load_scene("fitted-ring").text
    assert conditions._starts_smoothly(load_scene("fitted-ring"))
    assert not conditions._starts_smoothly(parse_scene(text.replace(this, other), "other.toml"))


def test_without_arguments_every_method_that_moves_its_nodes_is_studied():
    chosen = {name: converge._default_methods(name, named=False) for name in converge.DEFAULT_SCENES}
    studied = {method for methods in chosen.values() for method in methods}
    assert studied == {one.name for one in METHODS.values() if one.driven_by is None or not one.order_h}
    assert "fem-p4-imex4" not in chosen["smooth-fronts"]
    assert "fem-p4-imex4" in converge._default_methods("smooth-fronts", named=True)


def test_a_scene_is_run_without_intermediate_outputs(tmp_path):
    scene = final(load_scene("fig16-uniform-expansion"), tmp_path)
    assert scene.output_times == (0.518,)
    assert [at.time for at in scene.expect.reference.at] == [0.518]
    assert scene.origin == str(tmp_path / "scenes" / "fig16-uniform-expansion.toml")
    assert scene.parameters.l0 == 0.8  # f jumps there
    assert final(load_scene("mode-0-cell"), tmp_path).parameters.l0 == 0.5


def test_a_scene_ends_with_its_last_reference(tmp_path):
    text = load_scene("fig16-uniform-expansion").text
    longer = text.replace("end = 0.518", "end = 0.6")
    assert final(parse_scene(longer, "long.toml"), tmp_path).output_times == (0.518,)


# the machinery


COARSE = (Level(2, 4), Level(3, 16), Level(4, 64))
IN_TIME = tuple(Level(2, steps) for steps in (10, 20, 40, 80))


def coarse_studies(name, methods, folder):
    levels = {Refined.H: COARSE, Refined.DT: IN_TIME}
    studies = studies_of(name, [METHODS[method] for method in methods], folder)
    return [replace(study, levels=levels[study.refined]) for study in studies]


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """A report on three coarse levels by both codes, run by the workers."""
    folder = tmp_path_factory.mktemp("converge")
    studies = coarse_studies("growing-disk", (FEM, FV), folder)
    return folder, examination.examine(studies, folder, "a command", quiet)


def test_both_codes_show_their_orders_on_coarse_levels(report):
    _, results = report
    assert len(results) == 4
    assert [result.observed.verdict for result in results] == [Verdict.PASS] * 4


def test_the_file_gives_back_what_was_found(report):
    folder, results = report
    stored = read_convergence(folder / FILE_NAME)
    assert stored.attributes["command"] == "a command"
    for result, read in zip(results, stored.results, strict=True):
        assert (read.key, read.observed, read.runs) == (result.key, result.observed, result.runs)
        assert (read.claimed, read.declared, read.endings) == (True, result.declared, result.endings)
        assert np.array_equal(read.errors, result.errors)
        assert (folder / read.runs[0]).exists()


def test_the_page_holds_every_study_and_is_made_of_the_file_alone(report, tmp_path):
    folder, results = report
    write_convergence(tmp_path / FILE_NAME, results, "a command")
    page = write_convergence_page(tmp_path).read_text(encoding="utf-8")
    assert page == write_convergence_page(folder).read_text(encoding="utf-8").replace(
        read_convergence(folder / FILE_NAME).attributes["date"],
        read_convergence(tmp_path / FILE_NAME).attributes["date"],
    )
    assert "4 of 4" in page
    for result in results:
        assert f"/studies/{result.key}" in page
        assert result.command in page
        assert f"{result.errors[-1]:.3g}" in page
        assert f"{result.observed.slope:.2f} [{result.observed.low:.2f}" in page
    assert page.count("<svg") == 2  # in h and in dt, both codes together
    assert "order 2" in page


def test_a_logarithmic_plot_with_a_guide_comes_back_and_is_drawn(tmp_path):
    lines = (
        Line("errors", H, np.array([0.1, np.nan, 0.01, 0.0, 1e-3])),
        Line("order 2", H, H**2, guide=True),
    )
    plot = Plot("key", "title", "note", "h", lines, (("✕", 0.25),), log=True)
    with h5py.File(tmp_path / "plot.h5", "w") as file:
        write_record(file.create_group("plot"), plot)
        read = read_record(file["plot"], Exhibit)
    assert read.log
    assert [line.guide for line in read.lines] == [False, True]
    drawn = draw(read, "/plot", "p")
    assert [key.shape for key in drawn.legend] == ["line", "guide"]
    assert ">0.001<" in drawn.svg  # a plain number: nothing typesets mathematics
    assert "mathdefault" not in drawn.svg


@pytest.mark.parametrize("method", [FEM, FV])
@pytest.mark.parametrize("fault", ["freeze the mesh", "drop the dilution"])
def test_a_fault_turns_an_order_claim_red(fault, method, tmp_path, monkeypatch):
    FAULTS[fault](monkeypatch)
    monkeypatch.setattr(examination, "run_all", in_process)
    studies = coarse_studies("growing-disk", (method,), tmp_path)
    in_space = [study for study in studies if study.refined is Refined.H]
    (result,) = examination.examine(in_space, tmp_path, "", quiet)
    assert result.observed.verdict is Verdict.FAIL


def test_failed_runs_are_no_numbers_and_drawn_as_failures(tmp_path):
    """psi = 7.8e3 breaks down under every one of these steps."""
    text = load_scene("fig18-nonuniform-contraction").text.replace('"viscous"', '"viscoelastic"')
    path = tmp_path / "breaks.toml"
    path.write_text(text, encoding="utf-8")
    levels = tuple(Level(refine, 40) for refine in (1, 2, 3, 4))
    studies = studies_of(path, [METHODS[FEM]], tmp_path)
    study = replace(studies[0], levels=levels)
    (result,) = examination.examine([study], tmp_path, "", quiet)
    assert np.isnan(result.errors).any()
    assert any(result.endings)
    page = write_convergence_page(tmp_path).read_text(encoding="utf-8")
    assert "✕" in page
    assert next(ending for ending in result.endings if ending).split(":")[0] in page


def test_nothing_is_run_twice_by_the_same_code(tmp_path, monkeypatch):
    monkeypatch.setattr(examination, "provenance", lambda: VERSIONS)
    monkeypatch.setattr("actin_xcheck.runs.run.provenance", lambda: VERSIONS)
    done: list[Job] = []

    def counted(jobs, report):
        done.extend(jobs)
        in_process(jobs, report)

    monkeypatch.setattr(examination, "run_all", counted)
    studies = coarse_studies("static-decay", (FEM,), tmp_path)
    examination.examine(studies, tmp_path, "", quiet)
    assert len(done) == len(COARSE) + len(IN_TIME)
    done[0].path.unlink()
    examination.examine(studies, tmp_path, "", quiet)
    assert len(done) == len(COARSE) + len(IN_TIME) + 1


VERSIONS = {"python": "3", "commit": "0123"}


@pytest.mark.parametrize(
    ("method", "levels"),
    [
        (FEM, ((3, 16), (4, 64))),
        ("fem-p2-imex3", ((3, 16), (4, 32))),
        ("fem-p3-imex4", ((2, 4), (3, 8))),
        ("fem-p4-imex4", ((2, 6), (3, 14))),
    ],
)
def test_the_whole_field_of_a_moving_cell_is_stored_to_its_order(method, levels, tmp_path):
    """The L2 error read off a file falls at k + 1: nothing between the corners is lost, nothing gained."""
    scene = load_scene("manufactured-moving")
    errors = []
    for refine, steps in levels:
        path = tmp_path / f"{refine}.vtkhdf"
        run(scene, METHODS[method], refine, scene.time.end / steps, path)
        errors.append(error_of(scene, read_run(path), Quantity.CONCENTRATION))
    assert local_orders([2, 1], errors)[0] == pytest.approx(METHODS[method].order_h, abs=0.4)


def test_a_growth_rate_that_cannot_be_fitted_is_no_number(tmp_path):
    scene = load_scene("mode-0-cell")
    run(scene, METHODS[FEM], 1, scene.time.end, tmp_path / "one.vtkhdf")  # one step
    assert np.isnan(error_of(scene, read_run(tmp_path / "one.vtkhdf"), Quantity.GROWTH_RATE))


# the command


def test_the_command_exits_by_its_verdicts(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(planning, "REFINES", (1, 2, 3, 4))
    monkeypatch.setattr(planning, "FIXED_STEPS", (10, 20, 40, 80))
    monkeypatch.setattr(examination, "run_all", in_process)
    with pytest.raises(typer.Exit) as ended:
        converge.converge_command(["growing-disk"], [FEM], tmp_path / "good", True)
    assert ended.value.exit_code == 0
    assert "index.html" in capsys.readouterr().out
    FAULTS["drop the dilution"](monkeypatch)
    with pytest.raises(typer.Exit) as ended:
        converge.converge_command(["growing-disk"], [FEM], tmp_path / "bad", True)
    assert ended.value.exit_code == 1
    assert "FAIL growing-disk [fem-p1-paper]: concentration" in capsys.readouterr().out


def test_mistakes_are_one_line(tmp_path):
    folder = tmp_path / "none"
    copy = tmp_path / "copy.toml"
    copy.write_text(load_scene("static-decay").text, encoding="utf-8")
    for scenes, methods, message in (
        (["no-such-scene"], None, "unknown scene"),
        (["static-decay"], ["fem"], "not a method"),
        (["static-decay", str(copy)], [FEM], "more than one scene"),
    ):
        with pytest.raises(UserError, match=message):
            converge.converge_command(scenes, methods, folder, True)
        assert not folder.exists()
    with pytest.raises(UserError, match="stall"):
        converge.converge_command(["smooth-fronts"], ["fv-tpfa"], folder, True)


def test_a_scene_that_expects_nothing_is_its_own_reference(tmp_path, monkeypatch):
    monkeypatch.setattr(examination, "run_all", in_process)
    path = tmp_path / "own.toml"
    path.write_text(scene_of("psi = 50.0\np = 0.0", a="1 + 0.1*J(0, 3.8317059702075125*r)").text, "utf-8")
    studies = [replace(s, levels=(Level(1, 1), *COARSE)) for s in studies_of(path, [METHODS[FEM]], tmp_path)]
    in_space = [study for study in studies if study.refined is Refined.H]
    results = examination.examine(in_space, tmp_path, "", quiet)
    assert [len(result.errors) for result in results] == [3, 3]  # one fewer than runs
    assert all(result.claimed and np.isfinite(result.errors).all() for result in results)
    assert all(len(result.runs) == 4 for result in results)
