"""The force balance term by term: patch tests against stresses worked out by hand."""

import numpy as np
import pytest

from actin_xcheck.core.mesh import disk, signed_areas
from actin_xcheck.core.model import Closure, Delta, Model, Rheology
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.scene import load_scene
from fem.force_balance import ForceBalance
from tests.lab import FEM, FV

MESH = disk(4, 0.8)
F = np.array([[1.2, 0.15], [-0.1, 0.9]])
"""An affine deformation x = F xi: stress is constant, so only rim nodes feel a force, sigma n ds."""
X = F @ MESH.xi
GRADIENT = np.eye(2) - np.linalg.inv(F)
"""grad u with respect to the current x, u = x - xi."""
PHI = np.trace(GRADIENT)


def model_of(psi=0.0, p=0.0, delta=Delta.NONE, rheology=Rheology.VISCOELASTIC):
    return Model(Parameters(psi, p), rheology, Closure.REFERENCE_NORMAL, delta)


def interleave(x):
    """Node vectors (2, N) as the unknowns (2 N,) of a system."""
    return x.T.ravel()


def separate(unknowns):
    """Inverse of `interleave`."""
    return unknowns.reshape(-1, 2).T


def rim_force(stress, chain, scale=1.0):
    """Nodal forces (2, N) of a constant stress on a closed chain of nodes, counter-clockwise."""
    force = np.zeros_like(X)
    for i, j in zip(chain, np.roll(chain, -1), strict=True):
        edge = X[:, j] - X[:, i]
        traction = scale * stress @ np.array([edge[1], -edge[0]]) / 2
        force[:, i] += traction
        force[:, j] += traction
    return force


def uniform(a):
    return np.full((3, MESH.triangles.shape[1]), a)


def test_contractility_and_pressure_are_those_of_the_article():
    model = Model(Parameters(2.0, 0.5, a_sat=1.4))
    assert model.contractility(np.array(0.7)) == pytest.approx(2 * 0.49 * np.exp(-0.5), rel=1e-15)
    half_atan = 0.5 / 1.25 * (1 + 2 / np.pi * np.pi / 4)
    assert model.pressure(np.array(1.0), np.array(0.25), 1.0) == pytest.approx(half_atan, rel=1e-15)
    assert model.pressure(np.array(1.0), np.array(0.25), 0.0) == pytest.approx(0.4, rel=1e-15)


def test_viscous_stress_has_its_two_moduli():
    """A v = nodal forces of sigma_v = mu1 eps(v) + mu2 (div v) I for a linear v on the deformed cell."""
    slope = np.array([[0.3, -0.2], [0.7, 0.1]])
    v = slope @ X
    p = model_of().parameters
    stress = p.mu1 * (slope + slope.T) / 2 + p.mu2 * np.trace(slope) * np.eye(2)
    system = ForceBalance(model_of(), MESH).assemble(X, uniform(1.0), 0.0).matrix
    expected = rim_force(stress, MESH.rim_nodes)
    assert np.abs(separate(system @ interleave(v)) - expected).max() < 1e-12


def test_elastic_stress_has_its_two_moduli_and_current_gradients():
    """Load = -(nodal forces of sigma_e = eps(u) + nu' phi I), gradients with respect to the current x."""
    stress = (GRADIENT + GRADIENT.T) / 2 + 0.75 * PHI * np.eye(2)
    load = ForceBalance(model_of(), MESH).assemble(X, uniform(1.0), 0.0).load
    assert np.abs(separate(load) + rim_force(stress, MESH.rim_nodes)).max() < 1e-12
    viscous = ForceBalance(model_of(rheology=Rheology.VISCOUS), MESH)
    assert np.abs(viscous.assemble(X, uniform(1.0), 0.0).load).max() < 1e-12


def test_the_step_adds_dt_times_the_elastic_matrix():
    """(A + dt B) - A applied to an affine u is minus dt times the load that u exerts."""
    balance = ForceBalance(model_of(), MESH)
    before, after = (balance.assemble(X, uniform(1.0), dt) for dt in (0.0, 0.25))
    elastic = (after.matrix - before.matrix) @ interleave(X - MESH.xi)
    assert np.abs(elastic + 0.25 * before.load).max() < 1e-11
    assert np.abs(elastic).max() > 1e-3


@pytest.mark.parametrize("rheology", list(Rheology))
@pytest.mark.parametrize("a", [0.6, 1.7])
def test_the_membrane_pushes_with_the_active_pressure_of_the_rim(rheology, a):
    """delta = membrane: a surplus p/(1+phi) (2/pi) arctan a on the boundary integral only."""
    model = model_of(p=0.3, delta=Delta.MEMBRANE, rheology=rheology)
    phi = PHI if rheology is Rheology.VISCOELASTIC else 0.0
    surplus = 0.3 / (1 + phi) * 2 / np.pi * np.arctan(a)
    elastic = ForceBalance(model_of(rheology=rheology), MESH).assemble(X, uniform(a), 0.0).load
    load = ForceBalance(model, MESH).assemble(X, uniform(a), 0.0).load - elastic
    assert np.abs(separate(load) - rim_force(np.eye(2), MESH.rim_nodes, surplus)).max() < 1e-12


def test_the_ring_pulls_where_its_pressure_ends():
    """delta = ring: f jumps by p/(1+phi) (2/pi) arctan a across |xi| = l0; no other node feels a force."""
    model = model_of(psi=7.0, p=0.3, delta=Delta.RING)
    surplus = 0.3 / (1 + PHI) * 2 / np.pi * np.arctan(1.3)
    elastic = ForceBalance(model_of(), MESH).assemble(X, uniform(1.3), 0.0).load
    load = ForceBalance(model, MESH).assemble(X, uniform(1.3), 0.0).load - elastic
    on_ring = np.flatnonzero(np.isclose(np.hypot(*MESH.xi), 0.8, atol=1e-12))
    chain = on_ring[np.argsort(np.arctan2(*MESH.xi[::-1, on_ring]))]
    assert np.abs(separate(load) - rim_force(np.eye(2), chain, surplus)).max() < 1e-12


def test_a_gradient_of_actin_pulls_with_the_slope_of_the_contractility():
    """Away from the rim the load is the integral of grad f against w."""
    model = model_of(psi=3.0)
    a = 1 + 0.1 * MESH.xi[0]
    load = ForceBalance(model, MESH).assemble(MESH.xi, a[MESH.triangles], 0.0).load
    inner = np.setdiff1d(np.arange(MESH.xi.shape[1]), MESH.rim_nodes)
    share = np.bincount(MESH.triangles.ravel(), np.tile(signed_areas(MESH.xi, MESH.triangles) / 3, 3))
    slope = 3 * (2 * a - a**2 / 1.4) * np.exp(-a / 1.4) * 0.1
    force = separate(load)
    assert np.abs(force[0, inner] - (share * slope)[inner]).max() < 0.03 * np.abs(share * slope).max()
    assert np.abs(force[1, inner]).max() < 0.03 * np.abs(share * slope).max()


def test_elasticity_is_implicit():
    """psi = p = 0: a step far longer than the elastic time brings a displacement back to almost nothing."""
    x = MESH.xi * (1 + 0.1 * np.hypot(*MESH.xi))
    x[0] += 0.02 * (1 - (MESH.xi**2).sum(axis=0)) * MESH.xi[1]
    move = ForceBalance(model_of(), MESH).advance(0.0, 1e4, x, uniform(1.0))
    assert np.abs(move.x - MESH.xi).max() < 1e-2 * np.abs(x - MESH.xi).max()


@pytest.mark.parametrize("method", [FEM, FV, "fv-driven"])
def test_velocities_are_those_the_nodes_moved_with(method):
    solver = bind(load_scene("fig14-four-fronts"), Numerics(METHODS[method], 3, 0.05))
    old = solver.init()
    new, _ = solver.step(old, 0.05)
    assert np.allclose(new.v, (new.x - old.x) / 0.05, atol=1e-12)
    assert np.abs(new.v).max() > 0.1
    assert np.abs(old.v - new.v).max() < 0.5 * np.abs(new.v).max()  # at t = 0: the instantaneous balance


def test_the_wall_starts_and_stays_on_its_circle():
    model = Model(Parameters(62.4, 0.0), closure=Closure.IRROTATIONAL_WALL, delta=Delta.NONE)
    balance = ForceBalance(model, MESH)
    slid = MESH.xi + 0.05 * np.array([-MESH.xi[1], MESH.xi[0]])
    start = balance.start(slid)
    assert np.allclose(np.hypot(*start[:, MESH.rim_nodes]), 1, atol=1e-15)
    a = 1 + 0.3 * MESH.xi[0]
    move = balance.advance(0.0, 0.5, start, a[MESH.triangles])
    assert np.abs(move.x - start).max() > 0.01
    assert np.allclose(np.hypot(*move.x[:, MESH.rim_nodes]), 1, atol=1e-15)
