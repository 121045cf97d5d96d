"""Convergence studies: the rules for orders, the plan of levels, the file, the page and the command."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest

from actin_xcheck.report.draw import draw
from actin_xcheck.report.exhibits import Exhibit, Line, Plot
from actin_xcheck.report.page import write_page
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.records import read_record, write_record
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run, reading
from actin_xcheck.scene.scene import load_scene, parse_scene
from actin_xcheck.studies.converge import claim_of, converge, plan
from actin_xcheck.studies.converge.plan import Refined, RefinedLevel, TruthKind, final, refinements_of
from actin_xcheck.verdicts import orders
from actin_xcheck.verdicts.known import Quantity, error_of
from actin_xcheck.verdicts.orders import Verdict, local_orders
from tests.faults import FAULTS
from tests.lab import FEM, FV, scene_of
from tests.small import IN_SPACE, coarse
from tests.studies import carry

H = 2.0 ** -np.arange(1, 6)


def planned(name, *methods):
    return refinements_of(load_scene(name), [METHODS[method] for method in methods])


def converged(folder, asked):
    """The orders and errors of a report."""
    tables = carry(folder, converge(asked), name="converge").tables
    return tables["orders"].rows, tables["errors"].rows


# the plan


def test_dt_follows_h_by_the_declared_orders():
    for method in METHODS.values():
        tied = next(s for s in refinements_of(load_scene("growing-disk"), [method]) if s.refined is Refined.H)
        h, dt = np.array([tied.steps_of(level) for level in tied.levels]).T
        assert len(h) >= (5 if method.space < 5 else 3)  # beyond, orders above 5 are in round-off
        assert np.diff(np.log2(h)) == pytest.approx(-np.ones(len(h) - 1))  # consecutive
        ratio = (method.order_h or 2) / method.order_dt
        assert local_orders(h, dt) == pytest.approx(ratio, abs=0.2)


def test_what_is_measured_follows_what_a_scene_expects():
    def truths(name, method=FEM):
        return {(s.refined, s.quantity): s.truth for s in planned(name, method)}

    a, h, dt = Quantity.CONCENTRATION, Refined.H, Refined.DT
    assert truths("growing-disk") == {(h, a): TruthKind.EXACT, (dt, a): TruthKind.RICHARDSON}
    assert truths("growing-disk", "fv-tpfa") == {(h, a): TruthKind.EXACT}
    assert truths("fig14-four-fronts", "fv-tpfa") == {}
    assert truths("mode-0-cell")[h, Quantity.GROWTH_RATE] is TruthKind.MODE
    assert truths("fig14-four-fronts")[h, Quantity.PROBES] is TruthKind.REFERENCE
    assert truths("smooth-fronts")[h, Quantity.AREA] is TruthKind.RICHARDSON


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
def test_orders_are_claimed_of_smooth_compatible_data_only(name, reason):
    one = planned(name, FEM)[0]
    assert reason in one.no_claim
    assert bool(one.no_claim) == bool(reason)


def test_the_trace_of_div_u_costs_a_viscoelastic_rim_an_order_in_h_unless_the_rim_is_carried():
    def declared(name, method):
        return {(one.refined, one.declared) for one in planned(name, method)}

    assert declared("fitted-ring", "fem-p2-imex3") == {(Refined.H, 3), (Refined.DT, 3)}
    assert declared("fitted-ring-elastic", "fem-p2-imex3") == {(Refined.H, 3), (Refined.DT, 3)}
    assert declared("fitted-ring-elastic", "fv") == {(Refined.H, 2), (Refined.DT, 2)}
    assert declared("fitted-ring-elastic", FEM) == {(Refined.H, 1), (Refined.DT, 1)}
    assert declared("mode-0-cell", "fem-p2-imex3") == {(Refined.H, 3), (Refined.DT, 3)}  # p = 0


def test_high_orders_in_time_are_claimed_where_all_conditions_are_met():
    def claimed(name, method="fem-p2-imex3"):
        asked = planned(name, method)
        return {one.quantity for one in asked if not one.no_claim}

    for name in ("static-decay", "growing-disk", "manufactured-moving", "manufactured-static"):
        assert claimed(name) == claimed(name, "fem-p4-imex4") == {Quantity.CONCENTRATION}
        assert claimed(name) == claimed(name, "fem-p8-imex5")
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
    assert orders._flux_of_change(load_scene("stirred")) == pytest.approx(1.6, rel=1e-4)
    for name in ("growing-disk", "manufactured-moving"):
        assert orders._flux_of_change(load_scene(name)) < orders._NOTHING / 5


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
    assert orders._starts_smoothly(load_scene("fitted-ring"))
    assert not orders._starts_smoothly(parse_scene(text.replace(this, other), "other.toml"))


def test_without_arguments_every_method_that_moves_its_nodes_is_studied():
    chosen = {name: plan.moving_their_own(name, named=False) for name in plan.CONVERGED}
    studied = {method for methods in chosen.values() for method in methods}
    assert studied == {one.name for one in METHODS.values() if one.driven_by is None or not one.order_h}
    assert "fem-p4-imex4" not in chosen["smooth-fronts"]
    assert "fem-p4-imex4" in plan.moving_their_own("smooth-fronts", named=True)


def test_a_scene_is_run_without_intermediate_outputs():
    scene = final(load_scene("fig16-uniform-expansion"))
    assert scene.output_times == (0.518,)
    assert [at.time for at in scene.expect.reference.at] == [0.518]
    assert scene.origin == "scenes/fig16-uniform-expansion.toml"
    assert scene.parameters.l0 == 0.8  # f jumps there
    assert final(load_scene("mode-0-cell")).parameters.l0 == 0.5


def test_a_scene_ends_with_its_last_reference():
    text = load_scene("fig16-uniform-expansion").text
    longer = text.replace("end = 0.518", "end = 0.6")
    assert final(parse_scene(longer, "long.toml")).output_times == (0.518,)


# the machinery


@pytest.fixture(scope="module")
def whole(carried):
    """Three coarse levels by both codes."""
    return carried("converge")


@pytest.mark.slow
def test_both_codes_show_their_orders_on_coarse_levels(whole):
    found = whole.report
    assert [order.verdict for order in found.tables["orders"].rows] == [Verdict.PASS] * 4
    assert found.title == "4 of 4 claimed orders hold"
    assert found.verdicts == {"PASS": 4}


def test_runs_are_linked_and_charts_have_both_codes(whole):
    with reading(whole.file, "report") as file:
        for error in whole.report.tables["errors"].rows:
            name = error.file.rpartition("/")[2]
            assert file["runs"].get(name, getlink=True).filename == error.file
    page = (whole.folder / "index.html").read_text(encoding="utf-8")
    assert f'<a href="{error.file}">' in page
    assert page.count('<div class="chart"') == 2  # in h and in dt
    assert "order 2" in page


def test_an_order_is_claimed_by_its_verdict(whole):
    order = replace(whole.report.tables["orders"].rows[0], declared=2.0, before=2.1, last=1.95)
    claim = claim_of(order)
    assert (claim.verdict, claim.value) == ("PASS", pytest.approx(0.1))
    assert claim_of(replace(order, at_least=True)).value == pytest.approx(0.05)
    assert claim_of(replace(order, verdict=Verdict.IN_ROUND_OFF)).verdict == "NOT JUDGED"
    assert claim_of(replace(order, verdict=Verdict.FAIL)).excess == "there is no number"  # another reason


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
    drawn = draw(read, "/plot").figure
    errors, guide = drawn["data"]
    assert errors["y"] == [0.1, None, 0.01, 0.0, 0.001]
    assert (errors["mode"], guide["mode"], guide["line"]["dash"]) == ("lines+markers", "lines", "dot")
    assert {drawn["layout"][axis]["type"] for axis in ("xaxis", "yaxis")} == {"log"}
    assert drawn["layout"]["annotations"][0]["text"] == "✕"


@pytest.mark.parametrize("method", [FEM, FV])
@pytest.mark.parametrize("fault", ["freeze the mesh", "drop the dilution"])
def test_a_fault_turns_an_order_claim_red(fault, method, tmp_path, monkeypatch):
    FAULTS[fault](monkeypatch)
    in_space = [one for one in coarse("growing-disk", method) if one.refined is Refined.H]
    found = carry(tmp_path, converge(in_space), name="converge")
    (order,), (claim,) = found.tables["orders"].rows, found.claims
    assert order.verdict is Verdict.FAIL
    assert claim.verdict == "FAIL"


def test_failed_runs_are_no_numbers_and_drawn_as_failures(tmp_path):
    """psi = 7.8e3 breaks down under every one of these steps."""
    text = load_scene("fig18-nonuniform-contraction").text.replace('"viscous"', '"viscoelastic"')
    asked = refinements_of(parse_scene(text, "breaks.toml"), [METHODS[FEM]])[0]
    levels = tuple(RefinedLevel(refine, 40) for refine in (1, 2, 3, 4))
    _, errors = converged(tmp_path, [replace(asked, levels=levels)])
    assert np.isnan([error.error for error in errors]).any()
    endings = [error.ending for error in errors if error.ending]
    page = write_page(tmp_path / "converge.h5").read_text(encoding="utf-8")
    assert json.dumps("✕")[1:-1] in page  # in the figure's JSON
    assert endings[0].split(":")[0] in page


def test_the_scene_of_a_run_lies_where_its_command_finds_it(whole):
    made = read_run(whole.folder / whole.report.tables["errors"].rows[0].file)
    scene = load_scene(whole.folder / "scenes" / "growing-disk.toml")
    assert made.attributes["scene"] == scene.text
    assert f"run {scene.origin} " in made.attributes["command"]


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
        run(scene, Numerics(METHODS[method], refine, scene.time.end / steps), path)
        errors.append(error_of(scene, read_run(path), Quantity.CONCENTRATION))
    assert local_orders([2, 1], errors)[0] == pytest.approx(METHODS[method].order_h, abs=0.4)


def test_a_growth_rate_that_cannot_be_fitted_is_no_number(tmp_path):
    scene = load_scene("mode-0-cell")
    run(scene, Numerics(METHODS[FEM], 1, scene.time.end), tmp_path / "one.vtkhdf")  # one step
    assert np.isnan(error_of(scene, read_run(tmp_path / "one.vtkhdf"), Quantity.GROWTH_RATE))


def test_a_scene_that_expects_nothing_is_its_own_reference(tmp_path):
    own = scene_of("psi = 50.0\np = 0.0", a="1 + 0.1*J(0, 3.8317059702075125*r)")
    levels = (RefinedLevel(1, 1), *IN_SPACE)
    asked = [replace(one, levels=levels) for one in refinements_of(own, [METHODS[FEM]])]
    in_space = [one for one in asked if one.refined is Refined.H]
    orders, errors = converged(tmp_path, in_space)
    assert len(errors) == 2 * 3  # one fewer than runs
    assert all(order.claimed for order in orders)
    assert np.isfinite([error.error for error in errors]).all()
    assert [error.finer_file for error in errors[:2]] == [error.file for error in errors[1:3]]
    assert errors[2].finer_file == f"runs/{own.name}--{FEM}--4--64.vtkhdf"
