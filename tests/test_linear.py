"""Iterations that replace factorisations: what they solve, when they give up, and that steps stay pure."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from actin_xcheck.core import linear
from actin_xcheck.core.errors import Ending
from actin_xcheck.core.linear import SymmetricSolver
from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Closure
from actin_xcheck.core.motion import Anchor
from actin_xcheck.runs.method import find_method
from actin_xcheck.runs.numerics import Numerics, suited
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.scene import load_scene
from fem.force_balance import ForceBalance
from fem.solver import TransportSolver
from fem.space import Space

L0 = 0.8


def bent(xi, strength):
    return xi + strength * np.array([np.sin(2 * xi[1]), np.cos(3 * xi[0]) * xi[1]])


def heat(space, x, diffusion=0.01):
    """M + s K at x."""
    return space.scalars.matrix(space.inside.at(x).mass() + diffusion * space.gradients.at(x).stiffness())


@pytest.fixture(scope="module")
def space():
    return Space.on(disk(5, L0), 1, L0)


@pytest.fixture(scope="module")
def solver(space):
    return SymmetricSolver(space.scalars.pattern.rows, space.scalars.pattern.columns, space.parts)


def counted(monkeypatch):
    """How often preconditioners are applied and factorisations stand in for them."""
    applied, factorised = [], []
    apply, factorise = linear.Preconditioner.__call__, SymmetricSolver._factorise
    monkeypatch.setattr(
        linear.Preconditioner, "__call__", lambda self, v: applied.append(v.size) or apply(self, v)
    )
    monkeypatch.setattr(
        SymmetricSolver, "_factorise", lambda self, A: factorised.append(A.shape) or factorise(self, A)
    )
    return applied, factorised


def test_a_preconditioner_is_the_inverse_to_single_precision(space, solver):
    matrix = heat(space, space.xi)
    near = solver.preconditioner(matrix)
    groups = near._groups
    assert sorted(number for group in groups for number in group.fronts) == list(range(len(solver._fronts)))
    assert any((group.pivots == matrix.shape[0]).any() for group in groups)  # padded, and harmless
    for scale in (1.0, 1e-60):  # beyond single precision's range
        exact = scale * np.cos(3 * space.xi[0])
        error = np.abs(near(matrix @ exact) - exact).max()
        assert 1e-9 < error / scale < 1e-5


def test_iterations_solve_what_a_factorisation_solves(space, solver, monkeypatch):
    near, matrix = solver.preconditioner(heat(space, space.xi)), heat(space, bent(space.xi, 0.05))
    rhs = matrix @ np.cos(3 * space.xi[0])
    direct, _ = solver.solve(matrix, rhs)
    assert np.unique(space.parts).size > 30  # several cuts
    assert np.abs(direct - np.cos(3 * space.xi[0])).max() < 1e-13
    assert np.abs(direct - linear.solve(matrix, rhs)[0]).max() < 1e-13  # SuperLU's
    applied, factorised = counted(monkeypatch)
    solution, outcome = solver.solve(matrix, rhs, near)
    assert outcome.ok
    assert 3 <= len(applied) <= 15
    assert not factorised
    assert np.abs(solution - direct).max() < 1e-12
    assert np.linalg.norm(matrix @ solution - rhs) < 1e-12 * np.linalg.norm(rhs)


def test_a_preconditioner_from_too_far_is_given_up_early(space, solver, monkeypatch):
    near, matrix = solver.preconditioner(heat(space, space.xi, 10.0)), heat(space, space.xi, 0.0)
    rhs = matrix @ np.cos(3 * space.xi[0])
    applied, factorised = counted(monkeypatch)
    solution, outcome = solver.solve(matrix, rhs, near)
    assert outcome.ok
    assert len(applied) < linear.PATIENCE / 2
    assert len(factorised) == 1
    assert np.abs(solution - np.cos(3 * space.xi[0])).max() < 1e-12


def test_no_iteration_hides_a_failure(space, solver):
    """An indefinite matrix has no preconditioner; given another's it is factorised; nan is said to be nan."""
    matrix = heat(space, space.xi)
    indefinite = matrix - 0.02 * sp.diags(matrix.diagonal()) @ sp.identity(matrix.shape[0])
    assert solver.preconditioner(space.scalars.pattern.matrix(-matrix.data)) is None
    rhs = np.cos(3 * space.xi[0])
    singular = space.scalars.pattern.matrix(heat(space, space.xi, 1.0).data - heat(space, space.xi, 0.0).data)
    for near in (solver.preconditioner(matrix), None):
        for other in (space.scalars.pattern.matrix(-matrix.data), indefinite.tocsr()):
            solution, outcome = solver.solve(other, rhs, near)
            assert outcome.ok
            assert np.abs(other @ solution - rhs).max() < 1e-10
        assert solver.solve(singular, rhs, near)[1].ending is Ending.NOT_CONVERGED
        assert solver.solve(matrix, rhs * np.nan, near)[1].ending is Ending.NON_FINITE
        assert np.array_equal(solver.solve(matrix, np.zeros_like(rhs), near)[0], np.zeros_like(rhs))


@pytest.mark.parametrize("closure", list(Closure))
@pytest.mark.parametrize("order", [1, 3])
def test_anchored_motion_is_that_of_direct_solves(closure, order, monkeypatch):
    model = replace(load_scene("fig14-four-fronts").physics, closure=closure)
    balance = ForceBalance(model, disk(3, L0), order)
    xi = balance.space.xi
    fading = 1 - xi[0] ** 2 - xi[1] ** 2 if closure is Closure.IRROTATIONAL_WALL else 1.0
    x = balance.start(xi + fading * (bent(xi, 0.03) - xi))
    a = 1 + 0.2 * np.sin(2 * x[0] + 1)
    corners = a[balance.space.cells]
    applied, factorised = counted(monkeypatch)
    anchored = (balance, balance.near(Anchor(bent(xi, 0.05))))
    moves = [each.advance(0.0, 0.01, x, corners) for each in anchored]
    assert applied
    assert not factorised
    monkeypatch.setattr(SymmetricSolver, "preconditioner", lambda self, matrix: None)
    direct = ForceBalance(model, disk(3, L0), order).advance(0.0, 0.01, x, corners)
    assert len(factorised) == 1
    for move in moves:
        assert move.outcome.ok
        assert np.abs(move.v - direct.v).max() < 1e-11 * np.abs(direct.v).max()


@pytest.mark.parametrize("diffusion", [0.0, 1e-4, 0.3])
def test_transport_is_preconditioned_whatever_the_step(space, diffusion, monkeypatch):
    x, exact = bent(space.xi, 0.05), np.cos(3 * space.xi[0])
    transport = TransportSolver(space)
    applied, factorised = counted(monkeypatch)
    for share in (1.0, 1.01):  # of one octave's fourth: one factorisation serves both
        matrix = 1.7 * heat(space, x, share * diffusion)
        solution, outcome = transport.solve(matrix, matrix @ exact, share * diffusion)
        assert outcome.ok
        assert np.abs(solution - exact).max() < 1e-11
    assert len(transport._rest._made) == 1
    assert len(applied) < 30
    assert not factorised


@pytest.mark.parametrize(
    ("name", "steps"), [("fig14-four-fronts", 100), ("fig18-nonuniform-contraction", 80)]
)
def test_iterations_stay_few_however_far_a_cell_deforms(name, steps, monkeypatch):
    """Anchors are renewed in time: no factorisation of a step's own matrix, a dozen of anchors' at most."""
    scene = load_scene(name)
    refine, dt = 3, suited(scene)[1]
    solver = bind(scene, Numerics(find_method("fem-p1-paper"), refine, dt))
    state, anchors = solver.init(), set()
    applied, factorised = counted(monkeypatch)
    for _ in range(steps):
        state, outcome = solver.step(state, dt)
        assert outcome.ok
        anchors.add(id(state.anchor))
    assert np.abs(state.x - solver.mesh.xi).max() > 0.02
    assert 2 <= len(anchors) <= 12
    assert len(applied) / steps < 2 * 12
    assert not factorised


def test_change_of_shape_wears_an_anchor_out_and_motion_does_not():
    mesh = disk(4, L0)
    xi, cells = mesh.xi, mesh.triangles
    anchor = Anchor(xi)
    turn = np.array([[np.cos(1), -np.sin(1)], [np.sin(1), np.cos(1)]])
    shear = np.array([[1, 0.01], [0, 1]])
    for same in (xi, turn @ xi, 1.5 * xi, xi + 3):
        assert not anchor.worn(cells, shear @ same, same)
    assert not anchor.worn(cells, xi, shear @ xi)  # a step's own strain is no reason
    bend = np.linalg.matrix_power(shear, 20)
    assert anchor.worn(cells, bend @ xi, shear @ bend @ xi)
