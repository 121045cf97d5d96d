"""A new mesh in a deformed cell: its shape, what is carried over to it, and runs that go on on it."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from actin_xcheck.core.contract import NOTHING, Move, Problem, State
from actin_xcheck.core.errors import Ending
from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Array, Delta, Model
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.core.remeshing import SLIVER, NoMesh, edge_of, new_mesh
from fem.fields import measure, orientation
from fem.force_balance import ForceBalance
from fem.imex import FemImex
from fem.remeshing import (
    Reading,
    Rebalanced,
    RemeshedState,
    Remeshing,
    projected,
    remeshed,
    shapes,
    soundness,
)
from fem.space import Space
from tests.lab import Film, film_of, local_orders

L0, SPIN = 0.8, 4.0


def twisted(xi: Array, t: float = 0.3) -> Array:
    """Every circle turned by SPIN (1 - r^2) t: the area is kept and the mesh is sheared."""
    angle = SPIN * (1 - (xi**2).sum(axis=0)) * t
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([cos * xi[0] - sin * xi[1], sin * xi[0] + cos * xi[1]])


def concentration(xi: Array) -> Array:
    return 1 + 0.3 * np.sin(3 * xi[0] + 0.3) * np.cos(2 * xi[1])


@dataclass(frozen=True)
class Carried:
    """A twisted cell before and after its mesh was replaced."""

    old: Space
    x: Array
    new: Space
    x_new: Array
    a_new: Array
    total: float


@cache
def carried(order: int, refine: int) -> Carried:
    mesh = disk(refine, L0)
    old = Space.on(mesh, order, L0)
    x, a = twisted(old.xi), concentration(old.xi)
    total = measure(old, x, a).total_actin
    _, new = remeshed(old, x, L0, edge_of(mesh))
    x_new = Reading.at(old, new.xi).of(x)
    a_new, outcome = projected(old, new, x_new, a, total)
    assert outcome.ok
    return Carried(old, x, new, x_new, a_new, total)


def errors(one: Carried) -> tuple[float, float, float]:
    """In L2 over the cell, of a and of x; of the area."""
    rule = one.new.rule(2 * one.new.order + 2)
    dx = rule.at(one.x_new).dx
    xi, x, a = (rule.blend(field[..., one.new.cells]) for field in (one.new.xi, one.x_new, one.a_new))
    of_x = ((x - twisted(xi)) ** 2).sum(axis=0)
    return (
        float(np.sqrt(((a - concentration(xi)) ** 2 * dx).sum())),
        float(np.sqrt((of_x * dx).sum())),
        abs(float(dx.sum()) - np.pi),
    )


@pytest.mark.parametrize("order", [1, 2, pytest.param(3, marks=pytest.mark.slow)])
def test_what_is_carried_over_is_wrong_by_the_order_of_the_elements(order):
    of_a, of_x, of_area = np.array([errors(carried(order, refine)) for refine in (3, 4)]).T
    for found in local_orders(of_a)[0], local_orders(of_x)[0]:
        assert order + 0.6 < found < order + 1.8
    assert local_orders(of_area)[0] > order + 0.4


@pytest.mark.parametrize(("order", "refine"), [(1, 4), (2, 4), (3, 3)])
def test_total_actin_is_carried_over_to_round_off(order, refine):
    one = carried(order, refine)
    assert measure(one.new, one.x_new, one.a_new).total_actin == pytest.approx(one.total, rel=1e-12)


@pytest.mark.parametrize(("order", "refine"), [(1, 4), (2, 4), (3, 3)])
def test_new_cells_are_well_shaped_and_none_is_turned_over_at_rest(order, refine):
    one = carried(order, refine)
    assert shapes(one.old, one.x).min() < 0.4
    assert shapes(one.new, one.x_new).min() > 0.5
    assert shapes(one.new, one.new.xi).min() > 0


@pytest.mark.parametrize(("order", "refine"), [(1, 4), (2, 4), (3, 3)])
def test_rim_and_ring_keep_their_material_labels(order, refine):
    one = carried(order, refine)
    rim = one.new.xi[:, one.new.rim_nodes]
    assert np.abs(np.hypot(*rim) - 1).max() < 1e-12
    radii = np.hypot(*one.new.xi[:, one.new.cells])
    # no cell has nodes on both sides of the ring: the line of nodes is whole
    assert not ((radii.min(axis=0) < L0 - 1e-6) & (radii.max(axis=0) > L0 + 1e-6)).any()
    outside = radii.max(axis=0) > L0 + 1e-6
    dx = one.new.inside.at(one.new.xi).dx
    assert dx[:, outside].sum() == pytest.approx(np.pi * (1 - L0**2), rel=4 * edge_of(disk(refine, L0)) ** 2)
    mesh = new_mesh(one.new.xi, one.new.cells[:3])
    assert (Rebalanced(Model(Parameters(psi=1.0, p=0.1)), mesh, one.new).delta == outside).all()


@pytest.mark.parametrize("order", [1, 2])
def test_the_mesh_is_said_to_break_before_it_folds(order):
    space = Space.on(disk(3, L0), order, L0)
    times = np.arange(0, 2, 0.02)
    folded = next(t for t in times if not orientation(space, t, twisted(space.xi, t)).ok)
    warned = next(t for t in times if not soundness(space, t, twisted(space.xi, t)).ok)
    assert 0 < warned < folded
    outcome = soundness(space, warned, twisted(space.xi, warned))
    assert outcome.ending is Ending.TANGLED
    assert "about to fold" in outcome.message
    assert "--remesh" in outcome.message


def test_a_cell_that_has_folded_has_no_mesh():
    space = Space.on(disk(2, L0), 1, L0)
    x = space.xi * np.array([[1.0], [-1.0]])
    with pytest.raises(NoMesh, match="no sound mesh"):
        remeshed(space, x, L0, 0.3)


# Runs: the twist as a velocity, and a source that makes a = 1 + A(t) x (3 - r^2) exact

MODEL = Model(Parameters(psi=0.0, p=0.0), delta=Delta.NONE)


def amplitude(t: float) -> float:
    return 0.2 * np.cos(3 * t)


def exact(x: Array, t: float) -> Array:
    return 1 + amplitude(t) * x[0] * (3 - (x**2).sum(axis=0))


def source(x: Array, xi: Array, t: float) -> Array:
    r2 = (x**2).sum(axis=0)
    turning = -SPIN * (1 - r2) * x[1] * (3 - r2)
    growth = (amplitude(t) - 0.6 * np.sin(3 * t)) * x[0] * (3 - r2)
    return growth + amplitude(t) * (8 * MODEL.parameters.d * x[0] + turning)


PROBLEM = Problem(MODEL, lambda xi: exact(xi, 0.0), np.zeros_like, source=source)


class Twist:
    """A force balance that answers with the twist's velocity."""

    def carried(self, u0):
        return NOTHING

    def flow(self, t: float, x: Array, corners: Array, carried: Array = NOTHING, about=None) -> Move:
        return Move(x, SPIN * (1 - (x**2).sum(axis=0)) * np.array([-x[1], x[0]]))


class First(Twist, ForceBalance):
    pass


class Later(Twist, Rebalanced):
    pass


def remeshing(order: int, refine: int) -> tuple[FemImex, Remeshing]:
    """The solver as it is, and one that replaces its mesh."""
    mesh = disk(refine, L0)
    first = FemImex(PROBLEM, mesh, First(MODEL, mesh, order), order, 3)
    return first, Remeshing(
        first, lambda mesh, balance: FemImex(PROBLEM, mesh, Later(MODEL, mesh, balance.space), order, 3)
    )


def run(solver, end: float) -> tuple[Film, Ending]:
    seen, outcome = film_of(solver, 0.05, [end], 1e-4, 3)
    return seen, outcome.ending


def error(solver: FemImex, state: State) -> float:
    rule = solver.space.rule(2 * solver.space.order + 2)
    x, a = (rule.blend(field[..., solver.space.cells]) for field in (state.x, state.a))
    return float(np.sqrt(((a - exact(x, state.t)) ** 2 * rule.at(state.x).dx).sum()))


@cache
def remeshed_run() -> tuple[Remeshing, Film, Ending]:
    _, solver = remeshing(2, 3)
    return solver, *run(solver, 0.45)


def test_a_run_goes_on_on_its_new_mesh():
    _, seen, ending = remeshed_run()
    last = seen.states[-1]
    assert ending is Ending.COMPLETED
    assert isinstance(last, RemeshedState)
    assert last.remeshings == 1
    assert shapes(last.part.solver.space, last.inner.x).min() > SLIVER
    assert error(last.part.solver, last.inner) < 1e-3
    assert max(abs(state.balance_residual) for state in seen.states) < 1e-12
    assert 0 < last.area_change < 1e-4


def test_the_change_of_mesh_leaves_material_points_where_they_are():
    solver, seen, _ = remeshed_run()
    points = np.array([[0.0, 0.4, 0.8, -0.7], [0.0, 0.1, 0.0, 0.7]])
    at = next(i for i, state in enumerate(seen.states) if state.remeshings == 1)
    before, after = seen.states[at - 1 : at + 1]
    plain, outcome = solver.first.step(before.inner, after.t - before.t)
    assert outcome.ok
    # how far the cells of the old mesh, as sheared as they are, can be from the twist between their nodes
    space, rule = solver.first.space, solver.first.space.inside
    xi, x = (rule.blend(field[:, space.cells]) for field in (space.xi, plain.x))
    own = np.abs(x - twisted(xi, after.t)).max()
    (a, x), (a_new, x_new) = solver.first.probes(points)(plain), solver.probes(points)(after)
    assert 0 < np.abs(x_new - x).max() < 6 * own
    assert 0 < np.abs(a_new - a).max() < own
    frame, shown = solver.first.frame(plain), solver.frame(after)
    assert shown.x.shape == solver.grid.xi.shape
    assert np.sqrt(((shown.x - frame.x) ** 2).mean()) < 3 * own
    assert np.abs(shown.a_cells - frame.a_cells).max() < 3 * own
    assert solver.corners(after).shape == solver.mesh.triangles.shape


def test_steps_are_pure_and_a_state_kept_goes_on_to_the_same_bits():
    solver, seen, _ = remeshed_run()
    _, fresh = remeshing(2, 3)
    for state in seen.states[3], seen.states[-1]:
        one, _ = solver.step(state, 1e-3)
        again, _ = solver.step(state, 1e-3)
        kept = {name: np.array(value) for name, value in solver.memento(state).items()}
        resumed, _ = fresh.step(fresh.restored(kept), 1e-3)
        assert resumed.remeshings == state.remeshings
        for other in again, resumed:
            assert (one.x == other.x).all()
            assert (one.a == other.a).all()


def test_a_run_passes_the_time_at_which_its_mesh_folds():
    plain, replaced = remeshing(1, 3)
    seen, ending = run(plain, 1.0)
    folds = seen.states[-1].t
    assert ending is Ending.TANGLED
    seen, ending = run(replaced, 1.1 * folds)
    last = seen.states[-1]
    assert ending is Ending.COMPLETED
    assert last.remeshings == 1
    assert error(last.part.solver, last.inner) < 2 * error(plain, plain_state(folds, plain))


def plain_state(end: float, solver: FemImex) -> State:
    """The last state that stands before the fold."""
    return run(solver, 0.99 * end)[0].states[-1]
