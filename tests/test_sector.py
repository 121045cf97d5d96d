"""Sectors between mirror lines against the whole disk: the same numbers, for less work."""

from dataclasses import replace
from time import process_time

import numpy as np
import pytest
from scipy.spatial import cKDTree

from actin_xcheck.core.errors import Ending
from actin_xcheck.core.lagrange import areas
from actin_xcheck.core.mesh import Symmetry, sector
from actin_xcheck.core.model import Closure, Rheology
from actin_xcheck.core.motion import PrescribedMotion
from actin_xcheck.core.observables import polarity
from actin_xcheck.runs.fidelity import departure
from actin_xcheck.runs.method import METHODS, load
from actin_xcheck.scene.resolve import mesh_of, resolve
from actin_xcheck.scene.scene import load_scene
from fem import boundary
from fem.force_balance import ForceBalance
from fem.sector import Unfolded
from tests.lab import after, film_of, scene_of

FIG14 = load_scene("fig14-four-fronts")
PROBES = np.array([[0, 0], [0.4, 0.1], [-0.8, 0], [0, -1], [np.cos(2), np.sin(2)], [0.3, -0.77]]).T

MIRRORED = "1 + 0.1*cos(x) + 0.05*sin(x)"
"""Symmetric about the x axis alone."""
THREEFOLD = "1 + 0.1*r**3*cos(3*theta)"
DATA = {1: MIRRORED, 2: "1 + 0.1*r**2*cos(2*theta)", 3: THREEFOLD}


def solver_of(scene, method, mesh):
    problem, chosen = resolve(scene), METHODS[method]
    if problem.motion is not None:
        mechanics = PrescribedMotion(mesh.xi, problem.motion)
    else:
        mechanics = ForceBalance(problem.model, mesh, chosen.space)
    return load(chosen.solver)(problem, mesh, mechanics, **dict(chosen.options))


def unfolded(scene, method, refine, symmetry):
    whole = mesh_of(scene, refine)
    part = sector(refine, scene.parameters.l0, symmetry, np.deg2rad(scene.domain.rotation))
    return Unfolded(solver_of(scene, method, part), whole)


def nodal(solver, state, points):
    """Positions (2, n) and concentrations (n,) an `Unfolded` has at nodes of the disk."""
    folded, image = solver.symmetry.fold(points)
    distance, node = cKDTree(solver.inner.space.xi.T).query(folded.T)
    assert distance.max() < 1e-13
    return np.einsum("nij,jn->in", solver.images[image], state.x[:, node]), state.a[node]


def difference(scene, method, refine, symmetry, time=0.05, steps=4):
    """Largest difference between a sector and the disk its images tile, in everything that is measured."""
    one = unfolded(scene, method, refine, symmetry)
    other = solver_of(scene, method, one.mesh)
    first, second = after(one, time, steps), after(other, time, steps)
    assert np.abs(second.x - other.space.xi).max() > 1e-4  # something happened
    return apart(one, first, other, second)


def apart(one, first, other, second):
    """Largest difference between the states of an `Unfolded` and of a solver on its disk."""
    x, a = nodal(one, first, other.space.xi)
    found, expected = one.measure(first), other.measure(second)
    ours, theirs = one.frame(first), other.frame(second)
    cells = one.grid.cells, other.grid.cells
    pairs = [
        (x, second.x),
        (a, second.a),
        (found.area, expected.area),
        (found.total_actin, expected.total_actin),
        (found.centroid, expected.centroid),
        (polarity(found.rim), polarity(expected.rim)),
        (found.jacobian_min, expected.jacobian_min),
        (one.corners(first), other.corners(second)),
        (np.array(first.net_force), np.array(second.net_force)),
        (first.net_torque, second.net_torque),
        (ours.a_cells, theirs.a_cells),
        # cell by cell: nodes inside of cells and edges are numbered differently
        *((getattr(ours, f)[..., cells[0]], getattr(theirs, f)[..., cells[1]]) for f in ("x", "v", "a")),
        *zip(
            *(solver.probes(PROBES)(state) for solver, state in ((one, first), (other, second))), strict=True
        ),
    ]
    assert found.rim.shape == expected.rim.shape
    return max(float(np.abs(p - q).max()) for p, q in pairs)


@pytest.mark.parametrize(
    ("method", "refine"), [("fem-p1-paper", 4), ("fem-p3-imex4", 3), ("fem-p4-imex4", 3)]
)
def test_a_quarter_of_fig14_is_the_whole_of_it(method, refine):
    assert difference(FIG14, method, refine, Symmetry(4, 0.0)) < 1e-11


@pytest.mark.parametrize("method", ["fem-p1-paper", "fem-p3-imex4", "fem-p4-imex4"])
@pytest.mark.parametrize("mirrors", list(DATA))
def test_what_is_stored_is_a_whole_cell(method, mirrors):
    """Its cells fill it, share their nodes and are those of the mesh; its rim runs round it once."""
    scene = scene_of("psi = 62.4\np = 0.26", DATA[mirrors])
    solver = unfolded(scene, method, 2, Symmetry(mirrors, 0.0))
    state = after(solver, 0.02, 2)
    measured, frame, grid = solver.measure(state), solver.frame(state), solver.grid
    assert solver.check(state).ok
    assert solver.check(replace(state, x=state.x[::-1])).ending is Ending.TANGLED  # mirrored, turned over
    assert areas(frame.x, grid.cells).sum() == pytest.approx(measured.area, rel=1e-12)
    assert areas(frame.x, grid.cells).min() > 0
    assert areas(frame.x, grid.cells) @ frame.a_cells == pytest.approx(measured.total_actin, rel=1e-9)
    assert np.array_equal(grid.cells[:3], solver.mesh.triangles)
    assert np.array_equal(np.unique(grid.cells), np.arange(grid.xi.shape[1]))
    edges, k = 3 * grid.cells.shape[1], grid.order  # inner ones twice, as Euler counts them
    on_rim = measured.rim.shape[1] // k
    inside = grid.cells.shape[1] * (k - 1) * (k - 2) // 2
    assert grid.xi.shape[1] == solver.mesh.xi.shape[1] + (edges + on_rim) // 2 * (k - 1) + inside
    angle = np.arctan2(*measured.rim[::-1])
    turns = np.remainder(np.diff(angle, append=angle[0]), 2 * np.pi)
    assert turns.sum() == pytest.approx(2 * np.pi, rel=1e-12)
    assert turns.max() < 0.5


@pytest.mark.parametrize("mirrors", list(DATA))
@pytest.mark.parametrize("rheology", list(Rheology))
@pytest.mark.parametrize("closure", list(Closure))
def test_every_closure_holds_on_a_turned_sector(closure, rheology, mirrors):
    p = 0.0 if closure is Closure.IRROTATIONAL_WALL else 0.26
    model = f'[model]\nrheology = "{rheology}"\nclosure = "{closure}"\n[domain]\nrotation = 20\n'
    scene = scene_of(f"psi = 62.4\np = {p}", DATA[mirrors], more=model)
    assert difference(scene, "fem-p2-imex3", 2, Symmetry(mirrors, np.deg2rad(20))) < 1e-11


def test_an_adaptive_quarter_takes_the_steps_of_the_disk_and_conserves_actin():
    """The error estimate is that of the whole: the same steps, to the output times."""
    films = []
    one = unfolded(FIG14, "fem-p3-imex4", 2, Symmetry(4, 0.0))
    other = solver_of(FIG14, "fem-p3-imex4", one.mesh)
    for solver in (one, other):
        film, outcome = film_of(solver, 1.0, FIG14.output_times, 1e-5, 4)
        assert outcome.ok
        films.append(film)
    first, second = films
    assert [s.t for s in first.states] == pytest.approx([s.t for s in second.states], abs=1e-9)
    assert first.last.local_error == pytest.approx(second.last.local_error, rel=1e-6)
    assert apart(one, first.last, other, second.last) < 1e-10
    assert first.residual < 1e-14


@pytest.mark.parametrize("method", ["fem-p1-paper", "fem-p2-imex3"])
@pytest.mark.parametrize("mirrors", list(DATA))
def test_a_sector_conserves_actin(method, mirrors):
    solver = unfolded(scene_of("psi = 62.4\np = 0.26", DATA[mirrors], 0.1), method, 3, Symmetry(mirrors, 0.0))
    state = solver.init()
    for _ in range(10):
        state, outcome = solver.step(state, 0.01)
        assert outcome.ok
        assert abs(state.balance_residual) < 1e-14


def test_three_mirror_lines_leave_a_sector_of_a_finer_disk_which_converges_to_the_scenes_own():
    scene, points = scene_of("psi = 150.0\np = 0.26", THREEFOLD), PROBES

    def errors(refine):
        one = unfolded(scene, "fem-p3-imex4", refine, Symmetry(3, 0.0))
        other = solver_of(scene, "fem-p3-imex4", mesh_of(scene, refine))
        assert one.mesh.xi.shape[1] > 1.4 * other.mesh.xi.shape[1]
        (a, x, area), (exact_a, exact_x, exact_area) = (
            (*solver.probes(points)(state), solver.measure(state).area)
            for solver, state in ((s, after(s, 0.05, 8)) for s in (one, other))
        )
        return np.array([np.abs(a - exact_a).max(), np.abs(x - exact_x).max(), abs(area - exact_area)])

    coarse, fine = errors(2), errors(3)
    assert (fine < [1e-5, 1e-5, 1e-7]).all()
    assert (fine < coarse / 6).all()


STIRRED = """[motion]
x = "x0*(1 + 0.2*t) + 0.3*t*x0**2"
y = "y0*(1 - 0.1*t*x0)"
[source]
a = "0.3*t*x + x0 + r*cos(theta)"
"""


@pytest.mark.parametrize("method", ["fem-p1-paper", "fem-p3-imex4"])
def test_a_half_follows_a_prescribed_motion_with_a_source(method):
    scene = scene_of(a=MIRRORED, more=STIRRED)
    assert difference(scene, method, 2, Symmetry(1, 0.0)) < 1e-9  # velocities are differences over 2e-6


def test_a_sector_breaks_down_when_the_disk_does():
    """psi = 7.8e3, viscoelastic: 1 + phi reaches 0."""
    scene, ends = scene_of("psi = 7.8e3\np = 0.026", a="1 + 1e-3*cos(x)", end=0.06), []
    for make in (
        lambda: unfolded(scene, "fem-p1-paper", 3, Symmetry(2, 0.0)),
        lambda: solver_of(scene, "fem-p1-paper", mesh_of(scene, 3)),
    ):
        film, outcome = film_of(make(), 0.001, scene.output_times)
        assert outcome.ending is Ending.SINGULAR_DILATION
        ends.append((film.last.t, outcome.message.split(" in the triangle")[0]))
    assert ends[0] == ends[1]


ALIKE = scene_of("psi = 62.4\np = 0.26", MIRRORED)


def test_sides_left_free_are_seen(monkeypatch):
    assert difference(ALIKE, "fem-p2-imex3", 2, Symmetry(1, 0.0)) < 1e-11
    nothing = np.zeros(0, dtype=np.int64), np.zeros((2, 0))
    monkeypatch.setattr(boundary, "along_sides", lambda closure, space: nothing)
    assert difference(ALIKE, "fem-p2-imex3", 2, Symmetry(1, 0.0)) > 1e-4


def test_a_mirror_line_that_is_none_is_seen():
    right, wrong = Symmetry(1, 0.0), Symmetry(1, 0.05)
    assert departure(resolve(ALIKE), right, 0.1) < 1e-15
    assert departure(resolve(ALIKE), wrong, 0.1) > 1e-3
    assert difference(ALIKE, "fem-p2-imex3", 2, wrong) > 1e-3


TINY = 1e-6
LOPSIDED = {
    "a0": lambda xi: 1 + TINY * xi[1],
    "u0": lambda xi: TINY * xi[::-1],
    "motion": lambda xi, t: xi + TINY * t * xi[::-1],
    "source": lambda x, xi, t: TINY * t * x[1],
}


@pytest.mark.parametrize("data", list(LOPSIDED))
def test_data_that_miss_a_symmetry_by_a_millionth_are_told_by_how_much(data):
    problem = replace(resolve(ALIKE), **{data: LOPSIDED[data]})
    assert 0.5 * TINY < departure(problem, Symmetry(1, 0.0), 1.0) < 3 * TINY


@pytest.mark.slow
def test_a_quarter_takes_less_than_a_third_of_the_time():
    """Steps and all that is measured of them; what is left of four times as much work as overhead."""

    def seconds(make):
        solver = make()
        state, read = solver.init(), solver.probes(PROBES)
        best = np.inf
        for _ in range(3):
            start = process_time()
            state, _ = solver.step(state, 1e-3)
            solver.measure(state), solver.frame(state), read(state)
            best = min(best, process_time() - start)
        return best

    whole = seconds(lambda: solver_of(FIG14, "fem-p4-imex4", mesh_of(FIG14, 4)))
    assert seconds(lambda: unfolded(FIG14, "fem-p4-imex4", 4, Symmetry(4, 0.0))) < whole / 3
