"""One step of each code against the equation it claims to solve, every term on the configuration it names."""

import numpy as np
import pytest
from skfem import Basis, BilinearForm, ElementTriP1, ElementVector, FacetBasis, LinearForm, MeshTri
from skfem.helpers import ddot, div, dot, grad, sym_grad

from actin_xcheck.core.contract import Motion, Problem
from actin_xcheck.core.mesh import disk, quadrature_points, signed_areas
from actin_xcheck.core.model import Closure, Delta, Model
from actin_xcheck.core.motion import PrescribedMotion
from actin_xcheck.core.parameters import Parameters
from fem.force_balance import ForceBalance
from fem.solver import FemP1Paper
from fv.equations import cross_flux, over_relaxed, vertex_interpolation
from fv.solver import FvDiamond

MESH = disk(3, 0.8)
MODEL = Model(Parameters(150.0, 0.4), closure=Closure.REFERENCE_NORMAL, delta=Delta.RING)
DT = 0.02


sheared = Motion(
    lambda xi, t: np.array([xi[0] * (1 + t) + 0.6 * t * xi[1], xi[1] / (1 + 0.5 * t) + 0.2 * t * xi[0] ** 2]),
    lambda xi, t: np.array([xi[0] + 0.6 * xi[1], -0.5 * xi[1] / (1 + 0.5 * t) ** 2 + 0.2 * xi[0] ** 2]),
)


def source(x, xi, t):
    return 3 * np.cos(20 * t) * x[0] + xi[1] ** 2


def lumpy(xi):
    return 1 + 0.3 * xi[0] * xi[1] + 0.1 * xi[0]


def plain(x):
    """Fresh bases of plain scikit-fem on a fresh mesh with these node positions."""
    mesh = MeshTri(x, MESH.triangles, sort_t=False)
    vector = ElementVector(ElementTriP1())
    return (
        Basis(mesh, ElementTriP1(), intorder=2),
        Basis(mesh, vector, intorder=2),
        FacetBasis(mesh, ElementTriP1(), intorder=3),
        FacetBasis(mesh, vector, intorder=3),
    )


def mass_and_stiffness(x):
    scalar = plain(x)[0]
    return (
        BilinearForm(lambda a, w, _: a * w).assemble(scalar),
        BilinearForm(lambda a, w, _: dot(grad(a), grad(w))).assemble(scalar),
    )


def test_transport_is_b23b_with_every_matrix_where_the_equation_has_it():
    """((1 + dt) M' + dt d K') a' = M (a + dt) + dt S', primes on the moved mesh."""
    problem = Problem(MODEL, lumpy, np.zeros_like, sheared, source)
    solver = FemP1Paper(problem, MESH, PrescribedMotion(MESH.xi, sheared))
    old, _ = solver.step(solver.init(), DT)
    new, _ = solver.step(old, DT)
    (before, _), (after, stiffness) = mass_and_stiffness(old.x), mass_and_stiffness(new.x)
    scalar = plain(new.x)[0]
    points = np.asarray(scalar.global_coordinates())
    start = np.asarray(plain(MESH.xi)[0].global_coordinates())
    load = LinearForm(lambda w, fields: fields["s"] * w).assemble(scalar, s=source(points, start, new.t))
    left = (1 + DT) * (after @ new.a) + DT * 0.4 * (stiffness @ new.a)
    right = before @ (old.a + DT) + DT * load
    assert np.abs(left - right).max() < 1e-14
    assert np.array_equal(new.x, sheared(MESH.xi, new.t))


def test_force_balance_is_b23a_in_plain_scikit_fem():
    """(A + dt B) U' = A U + dt F on the old configuration, U' - U along the rays at the rim."""
    x = MESH.xi * (1 + 0.05 * MESH.xi[0]) + 0.03 * np.array([MESH.xi[1] ** 2, 0 * MESH.xi[0]])
    rim = np.unique(MESH.rim)
    x[:, rim] = MESH.xi[:, rim] * (1 + 0.05 * MESH.xi[0, rim])
    u, a = (x - MESH.xi).T.ravel(), lumpy(MESH.xi)
    scalar, vector, rim_scalar, rim_vector = plain(x)

    def stress(first, second):
        return BilinearForm(lambda v, w, _: first * ddot(sym_grad(v), sym_grad(w)) + second * div(v) * div(w))

    A, B = stress(2.5, 6.5).assemble(vector), stress(1.0, 0.75).assemble(vector)

    def active(concentration, phi, delta):
        contractility = 150 * concentration**2 * np.exp(-concentration / 1.4)
        return contractility + 0.4 / (1 + phi) * (1 + 2 / np.pi * delta * np.arctan(concentration))

    ring = (np.hypot(*MESH.centroids) > 0.8)[:, None]
    inside = active(np.asarray(scalar.interpolate(a)), div(vector.interpolate(u)), ring)
    on_rim = active(np.asarray(rim_scalar.interpolate(a)), div(rim_vector.interpolate(u)), 1.0)
    F = LinearForm(lambda w, fields: -fields["f"] * div(w)).assemble(vector, f=inside)
    F = F + LinearForm(lambda w, fields: fields["f"] * dot(fields["n"], w)).assemble(rim_vector, f=on_rim)
    move = ForceBalance(MODEL, MESH).advance(0.0, DT, x, a[MESH.triangles])
    moved = u + DT * move.v.T.ravel()
    residual = ((A + DT * B) @ moved - A @ u - DT * F).reshape(-1, 2).T
    along = (residual[:, rim] * MESH.xi[:, rim]).sum(axis=0)
    inner = np.setdiff1d(np.arange(a.size), rim)
    assert np.abs(residual[:, inner]).max() < 1e-12
    assert np.abs(along).max() < 1e-12
    assert np.abs(residual[:, rim]).max() > 1e-4  # the constraint carries a force across the rays
    assert np.abs(move.x - x).max() > 1e-3


@pytest.mark.parametrize("reaction", [True, False])
def test_finite_volumes_strike_their_balance_on_the_configurations_it_names(reaction):
    """(1 + k dt) V' a' - V a - k dt V - dt V' s' = dt d (two-point + cross flux on the moved mesh)."""
    model = Model(MODEL.parameters, delta=Delta.RING, reaction=reaction)
    solver = FvDiamond(
        Problem(model, lumpy, np.zeros_like, sheared, source), MESH, PrescribedMotion(MESH.xi, sheared)
    )
    old, _ = solver.step(solver.init(), DT)
    new, _ = solver.step(old, DT)
    before, after = (signed_areas(state.x, MESH.triangles) for state in (old, new))
    faces = solver.faces
    first, second = faces.cells[:, faces.interior]
    flow = over_relaxed(faces, new.x) * (new.a[second] - new.a[first])
    gain = np.bincount(first, flow, new.a.size) - np.bincount(second, flow, new.a.size)
    gain += cross_flux(faces, new.x, vertex_interpolation(faces, new.x)) @ new.a
    points = (quadrature_points(x, MESH.triangles) for x in (new.x, MESH.xi))
    supply = source(*points, new.t).mean(axis=0)
    rate = float(reaction)
    left = (1 + rate * DT) * after * new.a - before * old.a - rate * DT * before - DT * after * supply
    assert np.abs(left - DT * 0.4 * gain).max() < 1e-14
