"""What every registered method owes the time loop, and what the time loop owes everybody."""

import dataclasses

import numpy as np
import pytest

from actin_xcheck.core.contract import State
from actin_xcheck.core.errors import Ending, Outcome
from actin_xcheck.core.lagrange import areas
from actin_xcheck.core.linear import TOLERANCE, solve
from actin_xcheck.core.mesh import disk, integral
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics, step_count, suited
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.scene import load_scene
from tests.lab import FEM, film_of, play, scene_of

EVERY = pytest.mark.parametrize("method", list(METHODS))


def mesh_for(method: str, refine: int) -> int:
    """A mesh; of elements above P4 one of fewer cells, on which they have as many nodes."""
    return refine - (METHODS[method].space > 4)


@EVERY
def test_a_step_is_pure(method):
    """The same step from the same state twice, with others between: the same bits, old state intact."""
    solver = bind(load_scene("fig14-four-fronts"), Numerics(METHODS[method], mesh_for(method, 3), 0.0409))
    start = solver.init()
    before = {f.name: np.copy(getattr(start, f.name)) for f in dataclasses.fields(State)}
    step = 0.05 / 2
    first, outcome = solver.step(start, step)
    solver.step(first, step)
    for tried in () if METHODS[method].driven_by else (1e-6, 10.0):
        solver.step(start, tried)
    again, _ = solver.step(start, step)
    assert outcome.ok
    one, other = (solver.memento(state) for state in (first, again))
    assert {name: array.tobytes() for name, array in one.items()} == {
        name: array.tobytes() for name, array in other.items()
    }
    assert np.array_equal(first.a, again.a)
    assert np.array_equal(first.x, again.x)
    for name, value in before.items():
        assert np.array_equal(getattr(start, name), value, equal_nan=True)
    with pytest.raises(dataclasses.FrozenInstanceError):
        first.t = 1.0


@EVERY
def test_corner_values_carry_the_total_the_scheme_conserves(method):
    solver = bind(load_scene("fig14-four-fronts"), Numerics(METHODS[method], mesh_for(method, 3), 0.0409))
    state, _ = solver.step(solver.init(), 0.05 / 2)
    total = integral(state.x, solver.mesh.triangles, solver.corners(state))
    if state.a.size == solver.mesh.triangles.shape[1]:
        areas = integral(state.x, solver.mesh.triangles, np.broadcast_to(state.a, (3, state.a.size)))
        assert total == pytest.approx(areas, rel=1e-13)
    else:
        assert np.array_equal(solver.corners(state), state.a[solver.mesh.triangles])
    assert total > 3


@EVERY
def test_the_initial_state_is_the_scenes(method):
    scene = scene_of(a="1 + 0.2*x*y", more="[domain]\nrotation = 20\n")
    solver = bind(scene, Numerics(METHODS[method], mesh_for(method, 4), 0.1))
    state = solver.init()
    assert state.t == 0
    assert np.array_equal(state.x[:, : solver.mesh.xi.shape[1]], solver.mesh.xi)  # corners come first
    turned = np.array(
        [[np.cos(0.349065850), np.sin(0.349065850)], [-np.sin(0.349065850), np.cos(0.349065850)]]
    )
    at = turned @ solver.mesh.xi[:, solver.mesh.triangles].reshape(2, -1)
    exact = (1 + 0.2 * at[0] * at[1]).reshape(3, -1)
    assert np.abs(solver.corners(state) - exact).max() < 0.005


@EVERY
def test_a_frame_is_the_state_and_its_grid_the_cells(method):
    """Corners, positions, areas and total actin of a frame are those of the state, curved cells included."""
    solver = bind(scene_of("psi = 300\np = 0.26", a="1 + 0.2*x*y"), Numerics(METHODS[method], 2, 0.02))
    mesh, grid, start = solver.mesh, solver.grid, solver.init()
    assert np.array_equal(grid.cells[:3], mesh.triangles)
    assert np.array_equal(grid.xi[:, : mesh.xi.shape[1]], mesh.xi)
    assert len(grid.cells) == (grid.order + 1) * (grid.order + 2) // 2
    assert np.abs(solver.frame(start).x - grid.xi).max() < 1e-14
    assert areas(grid.xi, grid.cells).min() > 0

    state, _ = solver.step(start, 0.02)
    frame, measured = solver.frame(state), solver.measure(state)
    assert frame.x.shape == frame.v.shape == grid.xi.shape
    assert np.array_equal(frame.x[:, : mesh.xi.shape[1]], state.x[:, : mesh.xi.shape[1]])
    size = areas(frame.x, grid.cells)
    assert size.sum() == pytest.approx(measured.area, rel=1e-13)
    # the methods' own total is summed by a rule of degree 2 k, short of the cells' curvature
    assert size @ frame.a_cells == pytest.approx(measured.total_actin, rel=1e-13 if grid.order < 3 else 1e-7)
    assert 0.9 < measured.jacobian_min < 1.1


@EVERY
def test_a_configuration_that_has_turned_over_is_seen(method):
    solver = bind(scene_of(), Numerics(METHODS[method], 2, 0.02))
    state = solver.init()
    assert solver.check(state).ok
    turned = dataclasses.replace(state, x=state.x[::-1])
    assert solver.check(turned).ending is Ending.TANGLED


@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_frames_of_curved_cells_are_the_same_polynomials(k):
    """A field of degree k is what it is at the equispaced nodes too; around the centre cells are straight."""
    scene = scene_of(a=f"1 + 0.1*x**{k} - 0.2*y*x**{k - 1}")
    solver = bind(scene, Numerics(METHODS[f"fem-p{k}-imex{min(k + 1, 4)}"], 2, 1))
    frame, grid = solver.frame(solver.init()), solver.grid
    exact = 1 + 0.1 * grid.xi[0] ** k - 0.2 * grid.xi[1] * grid.xi[0] ** (k - 1)
    inner = np.hypot(*grid.xi) < 0.3
    assert np.abs(frame.a - exact)[inner].max() < (1e-15 if k < 3 else 1e-5)


def test_steps_land_on_every_output_time():
    scene = load_scene("fig14-four-fronts")
    refine, dt = suited(scene)
    assert (refine, dt) == (6, 1.0228e-3)
    assert step_count(dt, (0.1636,)) == 160
    film = play(scene, FEM, 2, 0.0101)
    assert [state.t for state in film.frames] == [0, 0.05, 0.1, 0.1636]
    assert len(film.states) == 1 + step_count(0.0101, scene.output_times)
    steps = np.diff([state.t for state in film.states])
    assert steps.max() <= 0.0101 * (1 + 1e-12)


def test_a_rejected_step_ends_the_run_as_a_value():
    class Stumbling:
        mesh = disk(2, 0.8)

        def init(self):
            return State(0.0, self.mesh.xi, np.ones(4), 0 * self.mesh.xi)

        def step(self, state, dt):
            new = dataclasses.replace(state, t=state.t + dt, a=state.a - 0.3)
            return new, Outcome()

        def corners(self, state):
            return np.ones(self.mesh.triangles.shape)

        def check(self, state):
            return Outcome()

    solver = Stumbling()
    film, outcome = film_of(solver, 0.1, [1.0])
    assert outcome.ending is Ending.NEGATIVE_CONCENTRATION
    assert film.last.t == pytest.approx(0.3)
    assert film.last.a.min() > 0


def test_singular_dilation_ends_all_codes_alike_and_a_driven_run_where_its_driver_ended():
    """Strong contraction is singular for `viscoelastic`."""
    scene = scene_of("psi = 7.8e3\np = 0.026", a="1 + 1e-3*cos(x)", end=0.06)
    ends = {}
    for method in (FEM, "fv-driven", "fv-coupled", "fem-p1-imex2", "fv", "fv-order2"):
        film, outcome = film_of(bind(scene, Numerics(METHODS[method], 3, 5e-4)), 5e-4, scene.output_times)
        assert outcome.ending is Ending.SINGULAR_DILATION, outcome
        ends[method] = film.last.t
    assert ends["fv-driven"] == ends[FEM]
    assert ends["fv-coupled"] == pytest.approx(ends[FEM], rel=0.1)
    assert ends["fv"] == pytest.approx(ends["fem-p1-imex2"], rel=0.1)
    assert ends["fv-order2"] == pytest.approx(ends["fv-coupled"], rel=0.15)


def test_no_linear_solve_fails_in_silence():
    import scipy.sparse as sp

    good = sp.csr_matrix(np.array([[2.0, 1], [1, 3]]))
    solution, outcome = solve(good, np.array([1.0, 2]))
    assert outcome.ok
    assert np.allclose(good @ solution, [1, 2], atol=1e-15)
    singular = sp.csr_matrix(np.array([[1.0, 1], [1, 1]]))
    assert solve(singular, np.array([1.0, 2]))[1].ending is Ending.NOT_CONVERGED
    hilbert = sp.csr_matrix(1 / (np.arange(14)[:, None] + np.arange(14) + 1.0) - 0.3 * np.eye(14)[::-1])
    solution, outcome = solve(hilbert, np.ones(14))
    left = np.linalg.norm(hilbert @ solution - 1) / np.sqrt(14)
    assert outcome.ok == (left <= TOLERANCE)
    assert solve(good, np.array([np.nan, 1]))[1].ending is Ending.NON_FINITE
    assert np.array_equal(solve(good, np.zeros(2))[0], np.zeros(2))
