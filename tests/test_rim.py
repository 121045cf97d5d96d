"""A free rim whose load sees the dilation: both codes carry F = dx/dxi there and keep their order.

The truth is P8, whose trace of grad u, an order lower, is good to 1e-10.
"""

import re
from functools import cache
from itertools import cycle

import numpy as np
import pytest

from actin_xcheck.core.errors import Ending
from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Model
from actin_xcheck.core.parameters import Closure, Delta, Parameters
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from fem.boundary import FreeRim
from fem.fields import locate
from fem.force_balance import ForceBalance
from fem.imex import FemImex
from fem.space import Space
from fv.boundary import Ties
from fv.mesh import Faces
from fv.rim import RimFaces
from tests.lab import after, local_orders, scene_of

STEPS = 8
CASES = [("reference-normal", "full"), ("traction-free", "membrane"), ("current-normal", "ring")]
LEVELS = {
    "fem-p1-imex2": (4, 5),
    "fem-p2-imex3": (3, 4),
    "fem-p3-imex4": (2, 3),
    "fv": (3, 4),
    "fv-order2": (3, 4),
}


def scene(closure, delta):
    """Pressure as large as contraction: what the rim's load does not know is not hidden."""
    return scene_of(
        "psi = 2.0\np = 6.0",
        a="1 + 0.3*cos(2*x+y) - 0.2*x*x*y",
        end=0.2,
        more=f'[model]\nrheology = "viscoelastic"\nclosure = "{closure}"\ndelta = "{delta}"',
    )


def end_of(closure, delta, method, refine, steps=STEPS):
    solver = bind(scene(closure, delta), Numerics(METHODS[method], refine, 1.0))
    return solver, after(solver, 0.2, steps)


@cache
def truth(closure, delta):
    """Positions at material points, and the area; by the trace."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Model, "rim_sees_dilation", False)
        solver, state = end_of(closure, delta, "fem-p8-imex5", 2)
    assert state.carried.size == 0

    def at(xi):
        cells, values = locate(solver.space, xi * (1 - 1e-13))
        return np.einsum("iaq,aq->iq", state.x[:, solver.space.cells[:, cells]], values)

    return at, solver.measure(state).area


def errors(closure, delta, method):
    """Root mean square of what positions are off by, from level to level."""
    at, _ = truth(closure, delta)
    found = []
    for refine in LEVELS[method]:
        solver, state = end_of(closure, delta, method, refine, STEPS * 2 ** (refine - 1))
        xi = solver.space.xi if isinstance(solver, FemImex) else solver.mesh.xi
        found.append(np.sqrt(((state.x - at(xi)) ** 2).sum(axis=0).mean()))
    return found


sound = cache(errors)
EVERY_PUSH = {(*CASES[0], method) for method in ("fem-p3-imex4", "fv-order2")}
EVERY_PUSH |= {(*case, method) for case in CASES for method in ("fem-p2-imex3", "fv")}


@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    [
        case if case in EVERY_PUSH else pytest.param(case, marks=pytest.mark.slow)
        for case in ((*case, method) for case in CASES for method in LEVELS)
    ],
    ids="-".join,
)
def test_positions_keep_the_order_of_the_method_at_a_free_rim(case):
    found, order = sound(*case), METHODS[case[-1]].order_h
    assert local_orders(found)[-1] > order - 0.2
    assert found[-1] < 1.5e-4


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", [pytest.param("fem-p1-imex2", marks=pytest.mark.slow), "fem-p2-imex3", "fv"]
)
def test_the_trace_alone_costs_an_order(method, monkeypatch):
    carried = sound(*CASES[0], method)
    monkeypatch.setattr(Model, "rim_sees_dilation", False)
    trace = errors(*CASES[0], method)
    assert local_orders(trace)[-1] < METHODS[method].order_h - 0.6
    assert trace[-1] > 1.5 * carried[-1]


@pytest.mark.slow
def test_without_the_reaction_along_tied_directions_the_order_is_lost(monkeypatch):
    monkeypatch.setattr(FreeRim, "_reaction", lambda self, x, residual: np.zeros_like(self.points))
    assert local_orders(errors(*CASES[0], "fem-p2-imex3"))[-1] < 2.6


@pytest.mark.slow
def test_what_f_jumps_by_at_a_membrane_is_a_traction(monkeypatch):
    _, area = truth("traction-free", "membrane")

    def off():
        solver, state = end_of("traction-free", "membrane", "fem-p4-imex4", 2, 4 * STEPS)
        return abs(solver.measure(state).area - area)

    right, rate = off(), FreeRim.rate
    monkeypatch.setattr(FreeRim, "rate", lambda *given: rate(*given[:4], 0 * given[4], given[5]))
    assert off() > 1e-4 > 100 * right


def slope_of(n, x):
    """(grad u0) n of `displaced`."""
    return np.array([np.cos(x[0] + 2 * x[1]) * (n[0] + 2 * n[1]), x[1] * n[0] + x[0] * n[1]]) * 0.1


def displaced(x):
    return np.array([np.sin(x[0] + 2 * x[1]), x[0] * x[1]]) * 0.1


def test_an_initial_displacement_is_differentiated_and_not_traced():
    model, mesh = Model(Parameters(2.0, 6.0)), disk(3, 0.8)
    rim = FreeRim(model, Space.on(mesh, 2, 0.8))
    assert np.abs(rim.start(displaced) - rim.normals - slope_of(rim.normals, rim.points)).max() < 1e-10
    faces = Faces.of(mesh)
    of_faces = RimFaces(model, faces, Ties(model.closure, faces).on_rim)
    middle = mesh.xi[:, faces.nodes[:, of_faces.faces]].mean(axis=1)
    off = of_faces.start(displaced) - of_faces.normals - slope_of(of_faces.normals, middle)
    assert np.abs(off).max() < 1e-7


def test_short_waves_of_an_initial_displacement_are_seen_on_fine_meshes():
    def waves(x):
        return 0.01 * np.array([np.sin(60 * x[0]), np.cos(60 * x[1])])

    def off(refine):
        rim = FreeRim(Model(Parameters(2.0, 6.0)), Space.on(disk(refine, 0.8), 2, 0.8))
        x, n = rim.points, rim.normals
        slope = 0.6 * np.array([np.cos(60 * x[0]) * n[0], -np.sin(60 * x[1]) * n[1]])
        return np.abs(rim.start(waves) - n - slope).max()

    assert off(5) < off(3) / 100


def test_a_rim_on_which_the_pressure_is_singular_ends_the_run():
    """A membrane that pushes inwards: cells behind it are far from singular yet."""
    model = Model(Parameters(2.0, -10.0), delta=Delta.MEMBRANE)
    mesh = disk(3, 0.8)
    balance = ForceBalance(model, mesh, 2)
    carried = balance.carried(np.zeros_like)
    a = np.ones(balance.space.cells.shape)
    assert balance.flow(0.0, balance.space.xi, a, carried).outcome.ok
    outcome = balance.flow(0.0, balance.space.xi, a, carried / 2.2).outcome
    assert outcome.ending is Ending.SINGULAR_DILATION
    where = re.search(r"started at \(([^,]+), ([^)]+)\)", outcome.message)
    assert np.hypot(*map(float, where.groups())) > 0.85


@pytest.mark.parametrize("method", ["fv", "fem-p3-imex4"])
def test_a_step_may_not_end_where_the_pressure_is_singular_on_the_rim_alone(method):
    solver = bind(scene("reference-normal", "full"), Numerics(METHODS[method], 2, 1.0))
    x, carried = solver.init().x, solver.init().carried
    assert solver.mechanics.intact(0.0, x, carried).ok
    outcome = solver.mechanics.intact(0.0, x, 0.4 * carried)  # 1 + phi = 2 - 1/0.4
    assert outcome.ending is Ending.SINGULAR_DILATION
    assert "1 + phi = -0.5" in outcome.message


@pytest.mark.parametrize("method", ["fv", "fem-p3-imex4"])
def test_the_end_of_a_step_is_asked_with_what_the_rim_carries_there(method, monkeypatch):
    solver = bind(scene("reference-normal", "full"), Numerics(METHODS[method], 2, 1.0))
    balance, asked = type(solver.mechanics), []
    intact = balance.intact

    def noted(self, t, x, carried):
        asked.append((t, x, carried))
        return intact(self, t, x, carried)

    monkeypatch.setattr(balance, "intact", noted)
    new, outcome = solver.step(solver.init(), 1e-2)
    assert outcome.ok
    ((t, x, carried),) = asked
    assert t == new.t
    assert np.array_equal(x, new.x)
    assert np.array_equal(carried, new.carried)
    assert np.abs(carried - solver.init().carried).max() > 1e-3


def test_at_rest_nothing_is_stretched():
    model, mesh = Model(Parameters(2.0, 6.0), closure=Closure.TRACTION_FREE), disk(2, 0.8)
    space = Space.on(mesh, 3, 0.8)
    rim = FreeRim(model, space)
    inverse = rim.inverse(space.xi, rim.normals)
    assert np.abs(inverse - np.eye(2)[..., None, None]).max() < 1e-13
    turned = np.array([[0.6, -0.8], [0.8, 0.6]])
    inverse = rim.inverse(turned @ space.xi, np.einsum("ij,jqe->iqe", turned, rim.normals))
    assert np.abs(inverse - turned.T[..., None, None]).max() < 1e-13


def test_another_mesh_reads_what_a_rim_carries():
    model = Model(Parameters(2.0, 6.0))
    coarse, fine = (FreeRim(model, Space.on(disk(refine, 0.8), 4, 0.8)) for refine in (3, 4))

    def carried(rim):
        return np.array([rim.points[0] ** 3, rim.points[0] * rim.points[1]])

    assert np.abs(fine.read(coarse, carried(coarse)) - carried(fine)).max() < 1e-5
    assert np.abs(coarse.read(coarse, carried(coarse)) - carried(coarse)).max() < 1e-14


def test_the_error_of_a_step_holds_that_of_what_the_rim_carries(monkeypatch):
    """What is carried moves nodes only steps later: its own error must be seen at once."""
    solver = bind(scene("reference-normal", "full"), Numerics(METHODS["fem-p2-imex3"], 2, 1.0))
    state, dt = solver.init(), 1e-4
    assert solver.step(state, dt)[0].local_error < 1e-4 * dt
    signs = cycle((1.0, -1.0))
    monkeypatch.setattr(FreeRim, "rate", lambda self, x, v, across, *more: next(signs) * np.ones_like(across))
    wrong = solver.tableau.b - solver.tableau.b_embedded
    assert solver.step(state, dt)[0].local_error == pytest.approx(
        dt * abs(wrong[::2].sum() - wrong[1::2].sum())
    )
