"""Finite volumes on a new mesh: what is carried over to it, and a free cell that goes on on it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from actin_xcheck.core.mesh import Mesh, disk, quadrature_points, signed_areas
from actin_xcheck.core.model import Array, Closure, Delta, Model, Rheology
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.core.remeshing import edge_of
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.scene import load_scene
from fv.mesh import Faces
from fv.remeshing import averages, remeshed, shapes
from fv.rim import RimFaces
from tests.lab import local_orders
from tests.test_remesh import L0, concentration, twisted


@cache
def carried(refine: int) -> tuple[Mesh, Array, Array]:
    """A new mesh in a twisted cell, where its vertices are, and the cells' means."""
    mesh = disk(refine, L0)
    x = twisted(mesh.xi)
    new, at = remeshed(mesh, x, L0, edge_of(mesh))
    corners = concentration(mesh.xi)[mesh.triangles]
    return new, at, averages(x[:, mesh.triangles], corners, at[:, new.triangles])


def errors(refine: int) -> tuple[float, float, float]:
    """In L2 over the cell, of a and of x at the vertices; the largest of x on the rim."""
    new, at, a = carried(refine)
    points = quadrature_points(new.xi, new.triangles)
    wrong = a - concentration(points.reshape(2, -1)).reshape(3, -1).mean(axis=0)
    of_x = np.hypot(*(at - twisted(new.xi)))
    return (
        float(np.sqrt(signed_areas(at, new.triangles) @ wrong**2)),
        float(np.sqrt((of_x**2).mean())),
        float(of_x[new.rim_nodes].max()),
    )


def test_what_is_carried_over_is_wrong_by_second_order():
    of_a, of_x, of_rim = np.array([errors(refine) for refine in (3, 4, 5)]).T
    assert 1.7 < local_orders(of_a)[-1] < 2.5
    assert 1.9 < local_orders(of_x)[-1] < 3.5
    assert of_rim.max() < 1e-12  # a rotation by one angle is a periodic spline's own


def test_new_cells_are_well_shaped_and_keep_the_ring():
    new, at, _ = carried(4)
    assert shapes(twisted(disk(4, L0).xi), disk(4, L0).triangles).min() < 0.4
    assert shapes(at, new.triangles).min() > 0.5
    assert shapes(new.xi, new.triangles).min() > 0
    radii = np.hypot(*new.xi[:, new.triangles])
    assert not ((radii.min(axis=0) < L0 - 1e-9) & (radii.max(axis=0) > L0 + 1e-9)).any()


def test_linear_fields_and_their_sums_are_carried_over_to_round_off():
    """Between two triangulations of a square, which have all of it in common."""
    rng, side = np.random.default_rng(4), np.linspace(0, 1, 7)
    squares = []
    for step in (1, 2):
        x = np.array(np.meshgrid(side[::step], side[::step], indexing="ij"))
        inner = ((x > 0) & (x < 1)).all(axis=0)
        x = (x + 0.05 * inner * rng.uniform(-1, 1, x.shape)).reshape(2, -1)
        number = np.arange(x.shape[1]).reshape(side[::step].size, -1)
        a, b, c, d = (
            one.ravel() for one in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
        )
        squares.append(x[:, np.hstack([[a, b, c], [a, c, d]])])
    for old, new in (squares, squares[::-1]):
        linear = 2 + 0.3 * old[0] - 0.7 * old[1]
        found = averages(old, linear, new)
        assert np.abs(found - (2 + 0.3 * new[0] - 0.7 * new[1]).mean(axis=0)).max() < 1e-13
        rough = rng.uniform(0.5, 2.0, old.shape[1:])  # linear in each, with jumps between them
        held = rough.mean(axis=0) @ areas(old)
        assert averages(old, rough, new) @ areas(new) == pytest.approx(held, rel=1e-13)


def areas(triangles: Array) -> Array:
    """Of triangles (2, 3, n), (n,)."""
    return signed_areas(triangles.reshape(2, -1), np.arange(triangles[0].size).reshape(3, -1))


def test_what_a_free_rim_carries_is_read_between_its_faces():
    model = Model(Parameters(psi=1.0, p=0.3), Rheology.VISCOELASTIC, Closure.TRACTION_FREE, Delta.RING)

    def u0(xi: Array) -> Array:
        return 0.05 * np.array([np.sin(2 * xi[0] + xi[1]), xi[0] * xi[1] ** 2])

    gaps = []
    for refine in (3, 4):
        one, other = (Faces.of(disk(n, L0, turn)) for n, turn in ((refine, 0.0), (refine + 1, 0.1)))
        here, there = (RimFaces(model, faces, np.ones(faces.rim.size, dtype=bool)) for faces in (one, other))
        gaps.append(np.abs(there.read(here, here.start(u0)) - there.start(u0)).max())
    assert local_orders(gaps)[0] > 1.7
    assert gaps[-1] < 2e-3


END = 0.04
LOPSIDED = load_scene("fig14-four-fronts").varied(
    {
        "model.closure": "traction-free",
        "initial.a": "1 + 0.06*x*(3 - r**2) + 0.1*(3*x**2*y - y**3)*(5 - 3*r**2)",
        "expect": None,
    }
)
POINTS = np.array([[0.0, 0.4, 0.8, -0.52, 0.06], [0.0, 0.0, 0.0, 0.36, -0.83]])


def numbers(method: str, refine: int, steps: int, remesh: bool = False) -> list:
    """Area, total actin and where probes are at the end; a mesh is replaced in the middle of the run."""
    solver = bind(LOPSIDED, Numerics(METHODS[method], refine, END / steps, remesh=remesh))
    state = solver.init()
    for number in range(steps):
        if remesh and number == steps // 2:
            state = replace(state, limit=2.0)  # any shape is too bad
        state, outcome = solver.step(state, END / steps)
        assert outcome.ok
    assert getattr(state, "remeshings", 0) == int(remesh)
    measured, (_, x) = solver.measure(state), solver.probes(POINTS)(state)
    return [measured.area, measured.total_actin, *x.ravel()]


@pytest.mark.slow
def test_a_free_cell_goes_on_as_well_as_on_its_first_mesh():
    """Elastic stress, dilation, F N on the rim and the ring's jump on a mesh that is new."""
    true = np.array(numbers("fem-p4-imex4", 3, 40))
    levels = ((3, 10), (4, 20))
    plain, renewed = (
        np.abs([np.array(numbers("fv", *level, remesh)) - true for level in levels])
        for remesh in (False, True)
    )
    of_area, of_total, of_x = renewed[:, 0], renewed[:, 1], renewed[:, 2:].max(axis=1)
    assert 1.5 < local_orders(of_area)[0] < 2.5
    assert 1.8 < local_orders(of_total)[0] < 2.2
    assert 1.4 < local_orders(of_x)[0] < 2.6
    assert np.all(renewed[:, :2] < 1.2 * plain[:, :2])
    assert np.all(of_x < 1.6 * plain[:, 2:].max(axis=1))
