"""A new mesh in a deformed cell: its shape, what is carried over to it, and runs that go on on it."""

from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
import pytest

from actin_xcheck.core.contract import NOTHING, Move, Problem, State
from actin_xcheck.core.errors import Ending
from actin_xcheck.core.mesh import Mesh, disk, quadrature_points, signed_areas
from actin_xcheck.core.model import Array, Delta, Model
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.core.remeshing import SLIVER, NoMesh, RemeshedState, edge_of, new_mesh
from fem.fields import measure, orientation
from fem.force_balance import ForceBalance
from fem.imex import FemImex
from fem.remeshing import (
    Reading,
    Rebalanced,
    Remeshing,
    projected,
    remeshed,
    shapes,
    soundness,
)
from fem.space import Space
from fv.mechanics import FvForceBalance
from fv.remeshing import FvRemeshing
from fv.remeshing import remeshed as of_volumes
from fv.solver import FvSecondOrder
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


class Twisting(Twist, FvForceBalance):
    pass


def elements(refine: int, order: int = 2) -> tuple[FemImex, Remeshing]:
    """The solver as it is, and one that replaces its mesh."""
    mesh = disk(refine, L0)
    first = FemImex(PROBLEM, mesh, First(MODEL, mesh, order), order, 3)
    return first, Remeshing(
        first, lambda mesh, balance: FemImex(PROBLEM, mesh, Later(MODEL, mesh, balance.space), order, 3)
    )


def volumes(refine: int) -> tuple[FvSecondOrder, FvRemeshing]:
    """The same of finite volumes."""

    def built(mesh: Mesh) -> FvSecondOrder:
        return FvSecondOrder(PROBLEM, mesh, Twisting(MODEL, mesh))

    first = built(disk(refine, L0))
    return first, FvRemeshing(first, built)


CODES = elements, volumes
BOTH = pytest.mark.parametrize("code", CODES)


def run(solver, end: float) -> tuple[Film, Ending]:
    rtol, order = (1e-4, 3) if isinstance(solver, FemImex | Remeshing) else (1e-5, 2)
    seen, outcome = film_of(solver, 0.05, [end], rtol, order)
    return seen, outcome.ending


def error(solver: FemImex | FvSecondOrder, state: State) -> float:
    """Of a in L2 over the cell; of volumes, of their means."""
    if isinstance(solver, FemImex):
        rule = solver.space.rule(2 * solver.space.order + 2)
        x, a = (rule.blend(field[..., solver.space.cells]) for field in (state.x, state.a))
        return float(np.sqrt(((a - exact(x, state.t)) ** 2 * rule.at(state.x).dx).sum()))
    place = quadrature_points(state.x, solver.mesh.triangles)
    true = exact(place.reshape(2, -1), state.t).reshape(3, -1).mean(axis=0)
    return float(np.sqrt(signed_areas(state.x, solver.mesh.triangles) @ (state.a - true) ** 2))


@cache
def remeshed_run(code, refine: int) -> tuple[Any, Film, State]:
    """A run that has replaced its mesh once, and its last state."""
    _, solver = code(refine)
    seen, ending = run(solver, 0.45)
    last = seen.last
    assert ending is Ending.COMPLETED
    assert isinstance(last, RemeshedState)
    assert last.remeshings == 1
    assert last.part.worst(last.inner.x) > SLIVER
    assert seen.residual < 1e-12
    return solver, seen, last


def test_a_run_goes_on_on_its_new_mesh():
    _, _, last = remeshed_run(elements, 3)
    assert error(last.part.solver, last.inner) < 1e-3
    assert 0 < last.area_change < 1e-4


@pytest.mark.slow
def test_volumes_go_on_at_second_order():
    ends = [remeshed_run(volumes, refine)[-1] for refine in (3, 4)]
    of_a = [error(last.part.solver, last.inner) for last in ends]
    assert 1.6 < local_orders(of_a)[0] < 3.0
    assert 1.6 < local_orders([last.area_change for last in ends])[0] < 3.0
    assert of_a[-1] < 3e-3


def far_from_the_twist(solver, plain: State, t: float) -> Array:
    """How far probes (x, a) and frames (x, a) may be moved: by what old cells are off the twist at least."""
    if not isinstance(solver, FemImex):
        return np.array([2e-2, 1e-2, 5e-3, 1e-2])
    space, rule = solver.space, solver.space.inside
    xi, x = (rule.blend(field[:, space.cells]) for field in (space.xi, plain.x))
    return np.abs(x - twisted(xi, t)).max() * np.array([6, 1, 3, 3])


@pytest.mark.parametrize(("code", "refine"), [(elements, 3), (volumes, 4)])
def test_the_change_of_mesh_keeps_total_actin_and_material_points(code, refine):
    solver, seen, _ = remeshed_run(code, refine)
    at = next(i for i, state in enumerate(seen.states) if state.remeshings == 1)
    before, after = seen.states[at - 1 : at + 1]
    plain, outcome = solver.first.step(before.inner, after.t - before.t)
    assert outcome.ok
    total = [one.measure(state).total_actin for one, state in ((solver.first, plain), (solver, after))]
    assert total[1] == pytest.approx(total[0], rel=1e-14 if code is volumes else 1e-12)
    points = np.array([[0.0, 0.4, 0.8, -0.7], [0.0, 0.1, 0.0, 0.7]])
    most = far_from_the_twist(solver.first, plain, after.t)
    (a, x), (a_new, x_new) = solver.first.probes(points)(plain), solver.probes(points)(after)
    assert 0 < np.abs(x_new - x).max() < most[0]
    assert 0 < np.abs(a_new - a).max() < most[1]
    frame, shown = solver.first.frame(plain), solver.frame(after)
    assert shown.x.shape == solver.grid.xi.shape
    assert np.sqrt(((shown.x - frame.x) ** 2).mean()) < most[2]
    assert np.abs(shown.a_cells - frame.a_cells).max() < most[3]
    assert solver.corners(after).shape == solver.mesh.triangles.shape


@BOTH
def test_steps_are_pure_and_a_state_kept_goes_on_to_the_same_bits(code):
    solver, seen, _ = remeshed_run(code, 3)
    _, fresh = code(3)
    for state in seen.states[3], seen.states[-1]:
        one, _ = solver.step(state, 1e-3)
        again, _ = solver.step(state, 1e-3)
        kept = {name: np.array(value) for name, value in solver.memento(state).items()}
        resumed, _ = fresh.step(fresh.restored(kept), 1e-3)
        assert resumed.remeshings == state.remeshings
        for other in again, resumed:
            assert (one.x == other.x).all()
            assert (one.a == other.a).all()


@pytest.mark.parametrize(
    ("code", "times"), [(partial(elements, order=1), 2), pytest.param(volumes, 1, marks=pytest.mark.slow)]
)
def test_a_run_passes_the_time_at_which_its_mesh_folds(code, times):
    plain, replaced = code(3)
    seen, ending = run(plain, 1.0)
    folds = seen.last.t
    assert ending is Ending.TANGLED
    seen, ending = run(replaced, 1.1 * folds)
    last = seen.last
    assert ending is Ending.COMPLETED
    assert last.remeshings == 1
    at_the_fold = run(plain, 0.99 * folds)[0].last
    assert error(last.part.solver, last.inner) < times * error(plain, at_the_fold)


@pytest.mark.parametrize("remeshed", [lambda mesh, *how: remeshed(Space.on(mesh, 1, L0), *how), of_volumes])
def test_a_cell_that_has_folded_has_no_mesh(remeshed):
    mesh = disk(2, L0)
    with pytest.raises(NoMesh, match="no sound mesh"):
        remeshed(mesh, mesh.xi * np.array([[1.0], [-1.0]]), L0, 0.3)
