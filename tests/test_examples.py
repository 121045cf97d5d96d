"""The toy method of `examples/`, which owes what every method owes, and how methods of packages are found."""

import dataclasses
import importlib
import sys
from itertools import pairwise

import numpy as np
import pytest

from actin_xcheck.core.claim import ClaimKind
from actin_xcheck.core.errors import Ending, UserError
from actin_xcheck.report.film import film_strip
from actin_xcheck.runs.method import METHODS, find_method
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.provenance import code
from actin_xcheck.runs.run import bind, run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies import compare as comparison
from actin_xcheck.studies.compare_page import write_comparison_page
from actin_xcheck.studies.converge import converge
from actin_xcheck.studies.converge.plan import refinements_of
from actin_xcheck.studies.distort.cases import FAMILIES, answer_of, cases_of
from actin_xcheck.studies.frontier.limits import AMPLITUDE, lines_of, theory_chapter
from actin_xcheck.studies.frontier.planes import plane_of
from actin_xcheck.studies.study import carry_out_here
from actin_xcheck.verdicts.known import l2_error
from actin_xcheck.verdicts.orders import Verdict
from tests import test_contract
from tests.lab import error_against, film_of, local_orders, play, scene_of
from tests.studies import carry
from tests.test_docs import ROOT, TEN_LINES

TOY = "toy-midpoint"


def install(folder, monkeypatch, package, name, target, **modules):
    """Put a package where Python finds it: what pip leaves of one, without pip."""
    info = folder / f"{package}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n", encoding="utf-8"
    )
    (info / "entry_points.txt").write_text(f"[actin_xcheck.methods]\n{name} = {target}\n", encoding="utf-8")
    for module, text in modules.items():
        (folder / f"{module}.py").write_text(text, encoding="utf-8")
        monkeypatch.delitem(sys.modules, module, raising=False)
    monkeypatch.syspath_prepend(folder)
    importlib.invalidate_caches()


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """The toy method, found as an installed one is."""
    monkeypatch.syspath_prepend(ROOT / "examples" / "toy_method")
    install(tmp_path / "toy", monkeypatch, "toy-method", TOY, "toy_method:METHOD")
    for module in ("toy_method", "toy_method.solver"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    return find_method(TOY)


@pytest.fixture
def among_all(toy, monkeypatch):
    """The toy method as one of ours, for tests that are for all of them."""
    monkeypatch.setitem(METHODS, TOY, toy)


def refused(name, *parts):
    """Asking for a method is a user's mistake, and its line says all of this."""
    with pytest.raises(UserError) as caught:
        find_method(name)
    for part in parts:
        assert part in str(caught.value)


# entry points


def test_a_method_of_a_package_is_found_and_its_solver_is_not_imported(toy):
    assert toy.name == TOY
    assert "toy_method.solver" not in sys.modules
    assert TOY not in METHODS  # what is done with every method of ours is not done with it
    refused("toy", "'toy' is not a method", "fem-p1-paper", TOY)


def test_a_method_that_has_changed_is_other_code(tmp_path, monkeypatch):
    install(tmp_path, monkeypatch, "mine", "mine-one", "mine_module:METHOD", mine_module="1/0")
    before = code.__wrapped__()
    (tmp_path / "mine_module.py").write_text("2/0")
    assert code.__wrapped__() != before


def test_a_package_is_not_imported_for_the_methods_of_another(tmp_path, monkeypatch):
    install(tmp_path, monkeypatch, "bad", "bad-one", "bad_module:METHOD", bad_module="1/0")
    assert find_method("fem-p1-paper") is METHODS["fem-p1-paper"]
    refused("no-such", "bad-one")
    assert "bad_module" not in sys.modules
    refused("bad-one", "bad_module:METHOD of bad 1.0", "ZeroDivisionError")


def test_a_name_that_is_taken_is_refused_when_it_is_asked_for(tmp_path, monkeypatch, toy):
    install(tmp_path / "1", monkeypatch, "greedy", "fem-p1-paper", "greedy_module:METHOD")
    refused("fem-p1-paper", "this package's fem-p1-paper", "greedy_module:METHOD of greedy 1.0", "uninstall")
    assert find_method("fv-coupled") is METHODS["fv-coupled"]
    install(tmp_path / "2", monkeypatch, "twin", TOY, "twin:METHOD")
    refused(TOY, "twin:METHOD of twin 1.0", "toy_method:METHOD of toy-method 1.0")


def test_the_same_package_found_twice_is_one(tmp_path, monkeypatch, toy):
    install(tmp_path / "again", monkeypatch, "toy-method", TOY, "toy_method:METHOD")
    assert find_method(TOY) == toy


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("METHOD = 3", ["is int", "a Method named 'odd'"]),
        ("OTHER = 3", ["AttributeError", "METHOD"]),
        ("import no_such_module", ["ModuleNotFoundError", "no_such_module"]),
        (
            "from actin_xcheck.runs.method import METHODS\nMETHOD = METHODS['fv-coupled']",
            ["named 'fv-coupled'", "valid: a Method named 'odd'"],
        ),
    ],
)
def test_what_is_no_method_of_that_name_is_refused(text, parts, tmp_path, monkeypatch):
    install(tmp_path, monkeypatch, "odd-package", "odd", "odd_module:METHOD", odd_module=text)
    refused("odd", "odd_module:METHOD of odd-package 1.0", *parts)


# the toy method owes what every method owes


@pytest.mark.usefixtures("among_all")
@pytest.mark.parametrize(
    "owed",
    [
        test_contract.test_a_step_is_pure,
        test_contract.test_corner_values_carry_the_total_the_scheme_conserves,
        test_contract.test_the_initial_state_is_the_scenes,
        test_contract.test_a_frame_is_the_state_and_its_grid_the_cells,
        test_contract.test_a_configuration_that_has_turned_over_is_seen,
    ],
    ids=lambda owed: owed.__name__,
)
def test_the_contract_holds(owed):
    owed(TOY)


def test_a_state_that_is_remembered_goes_on_to_the_same_bits(toy):
    solver = bind(load_scene(TEN_LINES), Numerics(toy, 3, 0.02))
    state, _ = solver.step(solver.init(), 0.02)
    again = solver.restored({name: value.copy() for name, value in solver.memento(state).items()})
    one, other = (solver.step(start, 0.02)[0] for start in (state, again))
    for field in dataclasses.fields(one):
        assert np.array_equal(getattr(one, field.name), getattr(other, field.name), equal_nan=True)


def test_order_2_in_space_and_time_together(toy, among_all):
    scene = load_scene("manufactured-moving")
    end, formula = scene.time.end, scene.expect.exact.a

    def exact(x, xi):
        (x, y), (x0, y0) = x, xi
        return formula(x=x, y=y, r=np.hypot(x, y), theta=np.arctan2(y, x), x0=x0, y0=y0, t=end)

    errors = [error_against(play(scene, TOY, refine, end / 2 ** (refine + 1)), exact) for refine in (2, 3, 4)]
    assert local_orders(errors) == pytest.approx(2, abs=0.1)


def test_order_2_in_time_where_nodes_are_moved_by_the_force_balance(among_all):
    """Each against steps half as long, on one mesh."""
    scene = scene_of("psi = 100\np = 0.26", a="1 + 0.1*x*(3 - r**2)", end=0.1)
    lasts = [play(scene, TOY, 2, 0.1 / steps).last for steps in (8, 16, 32, 64)]
    for of in (lambda state: state.x, lambda state: state.a):
        changes = [np.abs(of(one) - of(other)).max() for one, other in pairwise(lasts)]
        assert local_orders(changes) == pytest.approx(2, abs=0.1)


def test_total_actin_obeys_its_balance_to_round_off(among_all):
    film = play(load_scene(TEN_LINES), TOY, 3, 0.01)
    assert film.residual < 1e-14
    assert np.ptp([state.a.sum() for state in film.states]) > 1e-3  # it does change


def test_the_ten_line_scene_comes_out_as_with_finite_elements(among_all):
    """Areas approach each other with the order 1 that a rim which sees phi leaves to P1, or better."""
    scene = load_scene(TEN_LINES)
    apart = {}
    for refine in (3, 4):
        films = [play(scene, method, refine, 0.01) for method in (TOY, "fem-p1-imex2")]
        one, other = (film.solver.measure(film.last) for film in films)
        apart[refine] = abs(one.area - other.area)
        assert one.total_actin == pytest.approx(other.total_actin, abs=1e-4)
    assert apart[4] < apart[3] / 2
    assert apart[4] < 1e-3


def test_its_failures_are_values(among_all):
    scene = scene_of("psi = 7.8e3\np = 0.026", a="1 + 1e-3*cos(x)", end=0.06)
    film, outcome = film_of(bind(scene, Numerics(METHODS[TOY], 3, 0.001)), 0.001, scene.output_times)
    assert outcome.ending is Ending.SINGULAR_DILATION
    assert 0 < film.last.t < 0.06


@pytest.mark.slow
@pytest.mark.parametrize(("declared", "expected"), [(2, {Verdict.PASS}), (3, {Verdict.FAIL})])
def test_an_order_that_is_not_there_is_found(declared, expected, toy, tmp_path):
    method = dataclasses.replace(toy, order_dt=declared)
    report = carry(tmp_path, converge(refinements_of(load_scene("growing-disk"), [method])), name="converge")
    judged = {one.verdict for one in report.tables["orders"].rows if one.refined == "dt"}
    assert judged == expected


# among the others: by the code it belongs to, however it is called

MISLEADING = "fem-p1-plug", "fv-plug"


@pytest.fixture
def twins(toy):
    """The toy method under names that belong to others."""
    return [dataclasses.replace(toy, name=name) for name in MISLEADING]


def compared(folder, methods, scene="growing-disk"):
    jobs = comparison.jobs_of([load_scene(scene)], methods, 3, 0.05)
    return carry_out_here("compare", comparison.compare(jobs), folder, "").claims


def agreements(claims):
    return {claim.methods for claim in claims if claim.kind is ClaimKind.AGREEMENT}


def test_a_method_is_held_against_every_other_code_and_not_against_its_own(toy, twins, tmp_path):
    ours = "fem-p1-imex2", "fv-order2"
    claims = compared(tmp_path, [*twins, *map(find_method, ours)])
    pairs = {(one, other) for one in MISLEADING for other in ours} | {ours}
    assert {frozenset(pair) for pair in agreements(claims)} == {frozenset(pair) for pair in pairs}
    triangles = comparison.read_comparison(tmp_path / comparison.FILE_NAME).triangles
    assert {frozenset(one.methods) for one in triangles} == {frozenset(pair) for pair in pairs}
    assert {one.verdict for one in triangles} == {"PASS"}
    assert {claim.verdict for claim in claims} == {"PASS"}
    corners = {name for one in triangles for name in (one.corners[0].name, one.corners[1].name)}
    assert corners == {"FEM", "FV", *MISLEADING}
    assert len(list(tmp_path.glob("*--coarser-*"))) == 8  # two of each, for each has a corner


def test_two_methods_of_one_package_are_one_code(twins, tmp_path):
    """Nothing is held against anything, so that nothing runs beside."""
    assert agreements(compared(tmp_path, twins)) == set()
    assert comparison.read_comparison(tmp_path / comparison.FILE_NAME).triangles == ()
    assert not list(tmp_path.glob("*--coarser-*"))


@pytest.mark.slow
def test_a_page_reads_from_the_files_whose_code_made_a_run(twins, tmp_path):
    compared(tmp_path, [*twins, METHODS["fem-p1-imex2"]])
    runs = list(comparison.read_comparison(tmp_path / comparison.FILE_NAME).runs.values())
    assert {run.attributes["method_name"]: run.family for run in runs} == {
        "fem-p1-plug": "toy_method",
        "fv-plug": "toy_method",
        "fem-p1-imex2": "fem",
    }
    differences = [row.label for row in film_strip(runs).rows if row.is_difference]
    assert differences == [f"{name} − fem-p1-imex2" for name in MISLEADING]
    older = [dataclasses.replace(run, attributes=without(run.attributes, "family")) for run in runs]
    assert [run.family for run in older] == [run.family for run in runs]  # by the solver that they state
    assert write_comparison_page(tmp_path / comparison.FILE_NAME).exists()


def without(attributes, name):
    return {key: value for key, value in attributes.items() if key != name}


def test_the_error_of_a_field_is_not_that_of_its_means_for_its_name(twins, tmp_path):
    scene = load_scene("growing-disk")
    errors = []
    for method in twins:
        path = tmp_path / f"{method.name}.vtkhdf"
        run(scene, Numerics(method, 3, 0.05), path)
        errors.append(l2_error(scene, read_run(path)))
    assert errors[0] == errors[1]


def test_theory_draws_no_limits_of_steps_that_it_does_not_know(toy):
    scene = load_scene("fig14-four-fronts")
    drawn = {line.label for line in lines_of(scene, toy, plane_of("dt,h", toy))}
    ours = find_method("fem-p1-imex2")
    assert {line.label for line in lines_of(scene, ours, plane_of("dt,h", ours))} - drawn >= {AMPLITUDE}
    known = {plot.key: plot for plot in theory_chapter(scene, [toy, ours]).exhibits}
    assert [line.label for line in known["amplitude"].lines] == ["fem-p1-imex2", "1%"]


def test_its_errors_on_distorted_meshes_are_measured(toy, tmp_path):
    scene = load_scene("static-decay")
    case, _ = cases_of(scene, toy, FAMILIES["perturbed"], 0.3)
    assert answer_of(case, tmp_path).said.ending == Ending.COMPLETED
