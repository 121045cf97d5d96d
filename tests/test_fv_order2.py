"""Second-order finite volumes: their orders, their balance, their error estimate, their linear solver."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse as sp

from actin_xcheck.core import linear
from actin_xcheck.core.errors import Ending
from actin_xcheck.core.mesh import orientation, quadrature_points, signed_areas
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.resolve import in_scene_frame
from actin_xcheck.scene.scene import load_scene
from fv import krylov
from fv import solver as scheme
from fv.equations import cross_flux, over_relaxed, reconstruct, vertex_interpolation
from tests.lab import error_against, film_of, local_orders, play, scene_of
from tests.test_conservation import SHEAR_AND_ROTATION
from tests.test_orders import END

METHOD = "fv-order2"
SMOOTH = scene_of("psi = 270.0\np = 0.0", "1 + 0.1*x*y", 0.1, '[model]\nrheology = "viscoelastic"\n')
"""Coupled, and without |sin x sin y|'s kinks, which start with a layer in time."""


def relative(one, other):
    return np.linalg.norm(one - other) / np.linalg.norm(other)


def slopes_in_dt(scene, end, steps, refine=3, quantities="a"):
    """Local orders of each quantity on one mesh by successive differences: the spatial error drops out."""
    states = [play(scene, METHOD, refine, end / n, [end]).last for n in steps]
    paths = [[getattr(state, quantity) for state in states] for quantity in quantities]
    return np.array([local_orders([relative(*pair) for pair in pairwise(path)]) for path in paths])


MOVING = pytest.mark.parametrize("name", ["static-decay", "growing-disk", "stirred"])


@MOVING
def test_second_order_in_dt_on_prescribed_motions(name):
    slopes = slopes_in_dt(load_scene(name), END, (8, 16, 32, 64))
    assert np.abs(slopes - 2).max() < 0.15, slopes


def test_second_order_in_dt_coupled_to_the_force_balance():
    slopes = slopes_in_dt(SMOOTH, 0.1, (8, 16, 32, 64), quantities="ax")
    assert np.abs(slopes[:, -1] - 2).max() < 0.15, slopes


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fig14-four-fronts", "mode-1-free-cell", "mode-11-wall-270"])
def test_second_order_in_dt_on_the_scenes(name):
    """Pressure, ring, gauge, wall: whatever loads the cell."""
    scene = load_scene(name)
    end = min(scene.time.end, 0.1636)
    slopes = slopes_in_dt(scene, end, (20, 40, 80, 160), 4, "ax")
    assert np.abs(slopes[:, -1] - 2).max() < 0.15, slopes


def stages_of(gamma, explicit):
    stage = scheme._Stage
    return stage(gamma, (gamma,), ()), stage(1.0, explicit, (1 - gamma,))


def test_a_wrong_weight_costs_the_order(monkeypatch):
    """Consistent weights that miss one condition of second order: of the motion, then of transport."""
    right = scheme.GAMMA
    monkeypatch.setattr(scheme, "STAGES", stages_of(right, (0.5, 0.5)))
    wrong = slopes_in_dt(SMOOTH, 0.1, (8, 16, 32), quantities="ax")
    assert wrong[:, -1].max() < 1.3, wrong
    monkeypatch.setattr(scheme, "GAMMA", 0.35)
    monkeypatch.setattr(scheme, "STAGES", stages_of(0.35, (1 - 1 / 0.7, 1 / 0.7)))
    wrong = slopes_in_dt(load_scene("stirred"), END, (8, 16, 32))
    assert wrong[0, -1] < 1.3, wrong


@cache
def errors_on(name, refine):
    """In L2; the largest of the reconstruction at the rim's corners, at the ring's and at the probes."""
    scene = load_scene(name)
    film = play(scene, METHOD, refine, END / 2**refine, [END])
    mesh, state = film.solver.mesh, film.last

    def exact(x, xi):
        return in_scene_frame(scene, scene.expect.exact.a, x, xi, END)

    wrong = np.abs(film.solver.corners(state) - exact(state.x, state.x)[mesh.triangles])
    ring = np.abs(np.hypot(*mesh.xi) - scene.parameters.l0) < 1e-12
    rim = np.isin(np.arange(ring.size), mesh.rim_nodes)
    values, places = film.solver.probes(np.array(scene.probes.points, dtype=float).T)(state)
    at_probes = np.abs(values - exact(places.T, places.T)).max()
    at_corners = (wrong[on[mesh.triangles]].max() for on in (rim, ring))
    return np.array([error_against(film, exact), *at_corners, at_probes])


@MOVING
def test_second_order_in_h_and_dt_together(name):
    errors = [errors_on(name, refine)[0] for refine in (4, 5)]
    assert local_orders(errors) == pytest.approx([2], abs=0.15), errors


def test_second_order_at_probes_rim_and_ring_of_a_deformed_mesh():
    """The largest errors, over two refinements: where a cell is in its star changes with the mesh."""
    slopes = np.log2(errors_on("stirred", 3) / errors_on("stirred", 5)) / 2
    assert np.all(slopes[1:] > 1.85), slopes


@pytest.mark.slow
@MOVING
def test_fields_and_point_values_stay_of_second_order_on_fine_meshes(name):
    """Over two refinements: the ring is not on the same fraction of the layers at each of them."""
    slopes = np.log2(errors_on(name, 4) / errors_on(name, 6)) / 2
    assert slopes[0] == pytest.approx(2, abs=0.15), slopes
    assert name == "static-decay" or np.all(slopes[1:] > 1.8), slopes


@pytest.mark.parametrize("name", ["stirred", "growing-disk", "fig14-four-fronts", "mode-11-wall"])
def test_the_balance_holds_for_steps_of_any_length(name):
    """Sum of all rows: m' - m = dt sum_i b_i (k (|Omega_i| - m_i) + S_i)."""
    scene = load_scene(name)
    solver = bind(scene, Numerics(METHODS[METHOD], 4, 0.1))
    state = solver.init()
    for dt in np.random.default_rng(1).uniform(0.001, 0.06, 12) * scene.time.end:
        state, outcome = solver.step(state, dt)
        assert outcome.ok
        assert abs(state.balance_residual) < 1e-13


def test_total_actin_follows_its_equation_without_reaction_or_source():
    scene = scene_of(a="1 + 0.2*x", end=1.0, more=SHEAR_AND_ROTATION)
    film = play(scene, METHOD, 3, 0.07)
    totals = [signed_areas(s.x, film.solver.mesh.triangles) @ s.a for s in film.states]
    assert np.ptp(totals) / totals[0] < 1e-13


def test_a_step_is_ars_222_written_out_in_plain_matrices():
    solver = bind(load_scene("fig14-four-fronts"), Numerics(METHODS[METHOD], 3, 0.01))
    mesh, faces, mechanics, dt = solver.mesh, solver.faces, solver.mechanics, 0.01
    old, _ = solver.step(solver.init(), dt)
    new, _ = solver.step(old, dt)
    first, second = faces.cells[:, faces.interior]

    def rates(x):
        """P' = R a + g on a configuration."""
        volumes, c = signed_areas(x, mesh.triangles), over_relaxed(faces, x)
        flux = np.zeros((volumes.size, volumes.size))
        for i, j, sign in ((first, first, -1), (first, second, 1), (second, second, -1), (second, first, 1)):
            np.add.at(flux, (i, j), sign * c)
        flux += cross_flux(faces, x, vertex_interpolation(faces, x)).toarray()
        return volumes, 0.4 * flux - np.diag(volumes), volumes

    def flow(x, a, carried):
        corners = reconstruct(mesh.triangles, a, vertex_interpolation(faces, x) @ a)
        return mechanics.flow(0.0, x, corners, carried)

    gamma = 1 - np.sqrt(0.5)
    delta = -np.sqrt(0.5)
    p = signed_areas(old.x, mesh.triangles) * old.a
    here = flow(old.x, old.a, old.carried)
    x2 = old.x + gamma * dt * here.v
    carried = old.carried + gamma * dt * here.carried
    volumes, r, g = rates(x2)
    a2 = np.linalg.solve(np.diag(volumes) - gamma * dt * r, p + gamma * dt * g)
    change = dt * (r @ a2 + g)
    there = flow(x2, a2, carried)
    x3 = old.x + dt * (delta * here.v + (1 - delta) * there.v)
    carried = old.carried + dt * (delta * here.carried + (1 - delta) * there.carried)
    volumes, r, g = rates(x3)
    a3 = np.linalg.solve(np.diag(volumes) - gamma * dt * r, p + (1 - gamma) * change + gamma * dt * g)
    assert np.abs(new.x - x3).max() < 1e-13
    assert carried.size
    assert np.abs(new.carried - carried).max() < 1e-13
    assert np.abs(new.a - a3).max() < 1e-12
    moved = gamma * (1 - gamma) * dt * np.hypot(*(there.v - here.v)).max()
    spread = gamma**2 * (dt * (r @ a3 + g) - change) / volumes
    estimate = np.sqrt(volumes @ spread**2 / (volumes @ a3**2))
    assert new.local_error == pytest.approx(max(moved, estimate), rel=1e-8)


@pytest.mark.parametrize("z", [-1e-3, -1.0, -30.0, -1e9])
def test_stiff_decay_is_damped_and_not_taken_for_a_large_error(z):
    """P' = lambda P with z = lambda dt: L-stable, and the estimate stays below what there is to lose."""
    gamma, changes = scheme.GAMMA, []
    for stage in scheme.STAGES:
        carried = 1 + scheme._blend(stage.implicit, changes)
        changes.append(z * carried / (1 - gamma * z))
    end = carried + gamma * changes[-1]
    estimate = scheme.EMBEDDED * (changes[1] - changes[0])
    assert abs(end) < 1
    assert abs(end - np.exp(z)) < min(abs(z) ** 3, 0.25)
    assert abs(end - estimate) < 1
    assert abs(estimate) <= min(1 - gamma, z**2) * (1 + 1e-6)


def adaptive(scene, rtol, refine=3):
    """A run with chosen steps, and how many were tried."""
    solver, tried = bind(scene, Numerics(METHODS[METHOD], refine, 0.05)), 0
    step = solver.step

    def counted(state, dt):
        nonlocal tried
        tried += 1
        return step(state, dt)

    solver.step = counted
    film, outcome = film_of(solver, 0.05, [scene.time.end], rtol, 2)
    assert outcome.ok
    return film, tried


SCENES = [SMOOTH, pytest.param(load_scene("fig14-four-fronts"), marks=pytest.mark.slow)]


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES, ids=["smooth", "fig14"])
def test_the_error_falls_with_the_tolerance(scene):
    fine = play(scene, METHOD, 3, scene.time.end / 250, [scene.time.end]).last
    errors = []
    for rtol in (1e-3, 1e-4, 1e-5):
        film, _ = adaptive(scene, rtol)
        assert max(state.local_error for state in film.states[1:]) <= rtol
        assert film.residual < 1e-13
        errors.append(max(relative(film.last.a, fine.a), np.hypot(*(film.last.x - fine.x)).max()))
    falls = np.array(errors[:-1]) / errors[1:]
    assert np.all(falls > 2.5), errors
    assert errors[-1] < 3e-4, errors


@pytest.mark.slow
def test_steps_that_miss_the_tolerance_are_rejected():
    film, tried = adaptive(SMOOTH, 1e-6)
    assert tried > len(film.states) - 1
    steps = np.diff([state.t for state in film.states])
    assert steps.max() > 2 * steps.min()


def test_prescribed_positions_are_exact_and_no_error_of_theirs_is_estimated():
    scene = load_scene("growing-disk")
    film = play(scene, METHOD, 3, 0.05, [0.25])
    for state in film.states:
        assert np.array_equal(state.x, film.solver.mechanics.start(state.x) * np.exp(0.5 * state.t))
    still = play(scene_of(end=0.3), METHOD, 3, 0.1)
    assert still.last.local_error < 1e-14


def test_a_step_that_is_too_long_fails_as_a_value():
    solver = bind(load_scene("fig14-four-fronts"), Numerics(METHODS[METHOD], 3, 0.01))
    _, outcome = solver.step(solver.init(), 50.0)
    assert outcome.ending in {Ending.TANGLED, Ending.SINGULAR_DILATION}
    assert outcome.message


def sheared_operator(dt):
    """A stage's system on a sheared mesh, with a right-hand side."""
    solver = bind(load_scene("stirred"), Numerics(METHODS[METHOD], 4, 0.1))
    x = solver.mesh.xi * (1 + 0.2 * solver.mesh.xi[0]) + 0.4 * solver.mesh.xi[::-1]
    assert orientation(solver.mesh, 0.0, x).ok
    volumes = signed_areas(x, solver.mesh.triangles)
    amounts = volumes * (1 + 0.3 * np.sin(5 * quadrature_points(x, solver.mesh.triangles)[0].mean(axis=0)))
    coefficients, from_vertices = scheme.over_relaxed_split(solver.faces, x)
    matrix, rhs = solver.equation.stage(dt, amounts, volumes, coefficients, 0 * volumes)
    to_vertices = vertex_interpolation(solver.faces, x)
    return krylov.TransportOperator(matrix, from_vertices, to_vertices, 0.4), rhs, amounts / volumes


@pytest.mark.parametrize("dt", [1e-6, 1e-3, 1.0, 1e3])
def test_the_iteration_finds_what_a_direct_solver_finds(dt, monkeypatch):
    operator, rhs, guess = sheared_operator(dt)
    expected, _ = linear.solve(operator.matrix(), rhs)
    inverse = krylov.factorise(operator.two_point)
    monkeypatch.setattr(linear, "solve", None)  # no help
    a, outcome = krylov.solve(operator, rhs, guess, inverse)
    assert outcome.ok
    assert np.abs(a - expected).max() < 1e-10
    assert np.linalg.norm(rhs - operator(a)) < krylov.ACCEPTED * np.linalg.norm(rhs)
    assert abs((rhs - operator(a)).sum()) < 1e-14 * np.abs(rhs).sum()


def test_a_direct_solver_takes_over_and_nothing_fails_in_silence(monkeypatch):
    operator, rhs, guess = sheared_operator(0.1)
    expected, _ = linear.solve(operator.matrix(), rhs)
    inverse = krylov.factorise(operator.two_point)
    monkeypatch.setattr(krylov, "MOST", 1)
    for help_ in (inverse, None):
        a, outcome = krylov.solve(operator, rhs, guess, help_)
        assert outcome.ok
        assert np.abs(a - expected).max() < 1e-12
    assert krylov.factorise(sp.csr_matrix((4, 4))) is None
    assert krylov.solve(operator, rhs * np.nan, guess, inverse)[1].ending is Ending.NON_FINITE
    monkeypatch.setattr(linear, "TOLERANCE", 0.0)
    assert krylov.solve(operator, rhs, guess, inverse)[1].ending is Ending.NOT_CONVERGED
