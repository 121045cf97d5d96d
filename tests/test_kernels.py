"""The kernels against the weak forms: plain scikit-fem on fresh curved meshes, for k = 1 to 4."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
import scipy.sparse as sp
from skfem import (
    Basis,
    ElementTriP1,
    ElementTriP2,
    ElementTriP3,
    ElementTriP4,
    ElementVector,
    FacetBasis,
    MeshTri,
    MeshTri2,
)
from skfem.element.element_h1 import ElementH1
from skfem.helpers import div
from skfem.mapping import MappingIsoparametric
from skfem.quadrature import get_quadrature
from skfem.refdom import RefLine

from actin_xcheck.core.lagrange import HIGHEST, TABLED, lagrange, quadrature
from actin_xcheck.core.linear import solve
from actin_xcheck.core.mesh import Symmetry, disk, sector
from actin_xcheck.core.model import Closure, Delta, Model, Rheology
from actin_xcheck.core.parameters import Parameters
from fem import forms
from fem.fields import locate
from fem.force_balance import CellNetwork, ForceBalance
from fem.solver import TransportMatrices
from fem.space import Space
from tests.lab import local_orders

ORDERS = (1, 2, 3, 4)
EVERY_ORDER = range(1, HIGHEST + 1)
L0 = 0.8
MESH = disk(2, L0, rotation=0.3)
DT = 0.03


@dataclass(repr=False)
class MeshTri3(MeshTri2):
    elem: type = ElementTriP3


@dataclass(repr=False)
class MeshTri4(MeshTri2):
    elem: type = ElementTriP4


UNIFORM = {1: ElementTriP1(), 2: ElementTriP2(), 3: ElementTriP3(), 4: ElementTriP4()}
MESHES = {1: MeshTri, 2: MeshTri2, 3: MeshTri3, 4: MeshTri4}


class Line(ElementH1):
    """Lagrange elements on an edge, which scikit-fem lacks for k > 2: maps points of curved edges."""

    refdom = RefLine

    def __init__(self, k):
        self.nodes = np.concatenate([[0, 1], np.arange(1, k) / k])

    def lbasis(self, X, i):
        others = np.delete(self.nodes, i)
        factors = (X[0] - others[:, None]) / (self.nodes[i] - others)[:, None]
        slopes = [
            np.delete(factors, j, axis=0).prod(axis=0) / (self.nodes[i] - others[j])
            for j in range(others.size)
        ]
        return factors.prod(axis=0), sum(slopes)[None]


class Mapping(MappingIsoparametric):
    """scikit-fem finds points on curved edges by Newton's method, to 1e-12; here to the last digit."""

    def invF(self, x, tind=None):
        found = super().invF(x, tind)
        points = get_quadrature(RefLine, 2 * self.elem.maxdeg + 1)[0][0]
        known = np.concatenate([points, 1 - points, [0, 1]])
        nearest = known[np.abs(found[..., None] - known).argmin(axis=-1)]
        assert np.abs(found - nearest).max() < 1e-11
        return nearest


def moved(xi):
    """A smooth deformation: stretch, shear, bend."""
    return np.array([1.1 * xi[0] + 0.1 * xi[1] + 0.05 * xi[1] ** 2, 0.95 * xi[1] + 0.08 * np.sin(2 * xi[0])])


def lumpy(xi):
    return 1 + 0.3 * xi[0] * xi[1] + 0.1 * np.cos(3 * xi[0])


class Plain:
    """Fresh mesh and bases of plain scikit-fem on a configuration x of a space.

    `change` (N, N) takes our nodal values to scikit-fem's, at uniform nodes; `vectors` does so for vectors.
    """

    def __init__(self, space, x):
        k = space.order
        local, _ = lagrange(k).tabulate(UNIFORM[k].doflocs.T)
        dense = np.zeros((space.xi.shape[1],) * 2)
        dense[space.cells, space.cells[:, None]] = local[..., None]
        self.change = sp.csr_matrix(dense)
        mesh = MESHES[k](x @ dense.T, space.cells[:3].astype(np.int32), sort_t=False)
        mapping = None if k == 1 else Mapping(mesh, UNIFORM[k], Line(k))
        scalar, vector = UNIFORM[k], ElementVector(UNIFORM[k])
        self.gradients = Basis(mesh, vector, mapping, intorder=2 * k - 2)
        self.inside = Basis(mesh, vector, mapping, intorder=2 * k)
        self.rim = FacetBasis(mesh, vector, mapping, intorder=2 * k + 1)
        self.scalar_gradients = self.gradients.with_element(scalar)
        self.scalar = self.inside.with_element(scalar)
        self.scalar_rim = self.rim.with_element(scalar)
        assert np.array_equal(self.scalar.element_dofs, space.cells)
        # scikit-fem numbers vector unknowns otherwise for k > 1: component i at node n is theirs[n, i]
        theirs = np.empty((space.xi.shape[1], 2), dtype=int)
        for i in range(2):
            theirs[self.scalar.element_dofs, i] = self.gradients.element_dofs[i::2]
        self.vectors = sp.kron(self.change, sp.identity(2), format="csr")[np.argsort(theirs.ravel())]

    def system(self, model, delta, u, a, dt):
        """A + dt B and F - B u of (B.23a), form by form, and the size of the loads that cancel in it."""
        matrix = forms.network(model, dt).assemble(self.gradients)
        u, a = self.vectors @ u.T.ravel(), self.change @ a
        u_inside, u_rim = self.inside.interpolate(u), self.rim.interpolate(u)
        a_inside, a_rim = (np.asarray(basis.interpolate(a)) for basis in (self.scalar, self.scalar_rim))
        f = model.active_stress(a_inside, div(u_inside), delta[:, None])
        f_rim = model.active_stress(a_rim, div(u_rim), model.delta_on_rim())
        rim_load = forms.rim_load.assemble(self.rim, f=f_rim)
        load = forms.active_load(model).assemble(self.inside, f=f, u=u_inside) + rim_load
        if model.closure is Closure.IRROTATIONAL_WALL:
            mu1, one = model.viscous_moduli()[0], model.elastic_moduli()[0]
            matrix = matrix + forms.slip_friction(mu1 + dt * one).assemble(self.rim)
            load = load - forms.slip_friction(one).assemble(self.rim) @ u
        T = self.vectors
        return T.T @ matrix @ T, T.T @ load, abs(rim_load).max()


def same(ours, theirs, scale=None, bound=1e-13):
    """Agreement to `bound` of the largest entry, or of the numbers that cancelled."""
    return abs(ours - theirs).max() <= bound * (scale or abs(theirs).max())


def rim_bound(k):
    """The P4 slopes of scikit-fem carry 3e-14 of round-off; it measures edges without them, we do not."""
    return 1e-13 if k < 4 else 5e-13


@pytest.mark.parametrize("k", ORDERS)
def test_transport_matrices_and_sources_are_those_of_the_forms(k):
    space = Space.on(MESH, k, L0)
    x = moved(space.xi)
    plain = Plain(space, x)
    T = plain.change
    assert same(space.scalars.matrix(space.inside.at(x).mass()), T.T @ forms.mass.assemble(plain.scalar) @ T)
    stiffness = space.scalars.matrix(space.gradients.at(x).stiffness())
    assert same(stiffness, T.T @ forms.stiffness.assemble(plain.scalar_gradients) @ T)
    if k == 1:  # gradients are the same at all points: one rule serves both matrices
        assert same(space.scalars.matrix(space.inside.at(x).stiffness()), stiffness)
    place = np.asarray(plain.scalar.global_coordinates())
    ours = space.inside.blend(x[:, space.cells])
    assert same(ours, place.swapaxes(1, 2))
    source = space.scalars.vector(space.inside.at(x).load(lumpy(ours)))
    assert same(source, T.T @ forms.source.assemble(plain.scalar, s=lumpy(place)))


@pytest.mark.parametrize("k", ORDERS)
@pytest.mark.parametrize("closure", list(Closure))
@pytest.mark.parametrize("rheology", list(Rheology))
def test_the_force_balance_is_that_of_the_forms(k, closure, rheology):
    model = Model(Parameters(150.0, 0.4, l0=L0), rheology, closure, Delta.RING)
    balance = ForceBalance(model, MESH, k)
    space, x, a = balance.space, moved(balance.space.xi), lumpy(balance.space.xi)
    plain = Plain(space, x)
    ours = balance.system(
        x, space.inside.blend(a[space.cells]), space.on_rim.blend(a[space.on_rim.cells]), DT
    )
    matrix, load, scale = plain.system(model, balance.delta, balance.displacement(x), a, DT)
    assert same(ours.matrix, matrix)
    assert same(ours.load, load, scale, rim_bound(k))
    assert abs(matrix - matrix.T).max() < 1e-13 * abs(matrix).max()
    constraint = balance.constraint
    P, weights = constraint.prolongation(x), constraint.weights(x)
    assert same(constraint.reduce(weights, ours.matrix), P.T @ matrix @ P)
    assert same(constraint.restrict(weights, ours.load), P.T @ load, scale, rim_bound(k))


@pytest.mark.parametrize("k", ORDERS)
def test_current_normals_are_the_integrals_of_phi_n(k):
    balance = ForceBalance(Model(Parameters(0.0, 0.0), closure=Closure.CURRENT_NORMAL), MESH, k)
    space, x = balance.space, moved(balance.space.xi)
    plain = Plain(space, x)
    ones = np.ones(plain.rim.dx.shape)
    normal = (plain.vectors.T @ forms.rim_load.assemble(plain.rim, f=ones)).reshape(-1, 2)[space.rim_nodes]
    weights = balance.constraint.weights(x).reshape(-1, 2)
    along = weights[space.rim_nodes]
    assert same(along * (along * normal).sum(axis=1, keepdims=True), normal, bound=rim_bound(k))
    assert np.allclose((along**2).sum(axis=1), 1, atol=1e-15)
    inner = np.setdiff1d(np.arange(x.shape[1]), space.rim_nodes)
    assert np.array_equal(weights[inner], np.ones((inner.size, 2)))


@pytest.mark.parametrize("k", [5, HIGHEST])
@pytest.mark.parametrize("closure", list(Closure))
def test_matrices_that_are_applied_cell_by_cell_are_those_of_their_entries(k, closure):
    balance = ForceBalance(Model(Parameters(150.0, 0.4, l0=L0), closure=closure), MESH, k)
    space, x = balance.space, moved(balance.space.xi)
    random = np.random.default_rng(5)
    matrices, a = TransportMatrices(space, x), random.random(x.shape[1])
    for mass, diffusion in ((1.0, 0.0), (0.0, 1.0), (1.3, 0.02)):
        operator, entries = matrices.combined(mass, diffusion), matrices.assembled(mass, diffusion)
        assert same(operator @ a, entries @ a)
    assert same(matrices.diagonal(), matrices.assembled(1.0, 0.0).diagonal())
    kept, content = matrices.kept(a, 3.0)
    assert content.sum() == pytest.approx(3, rel=1e-14)
    assert same(matrices.mass @ kept, content)
    corners, weights = lumpy(space.xi)[space.cells], balance.constraint.weights(x)
    network = CellNetwork(balance.assemble(x, corners, DT), weights)
    q = random.random(balance.constraint.pattern.size)
    assert same(network @ q, network.assembled() @ q)


@pytest.mark.parametrize("k", EVERY_ORDER)
def test_polynomials_of_the_elements_degree_are_its_own(k):
    """Values and slopes at any point, and integrals by the space's own rule: exact but for round-off."""
    points = np.random.default_rng(k).dirichlet([1, 1, 1], 20).T
    values, slopes = lagrange(k).tabulate(points[1:])
    (x, y), (r, s) = points[1:], lagrange(k).nodes[1:]
    assert same(((1 + r - 2 * s) ** k) @ values, (1 + x - 2 * y) ** k, 2.0**k)
    along = np.einsum("n,niq->iq", (1 + r - 2 * s) ** k, slopes)
    assert same(along, k * (1 + x - 2 * y) ** (k - 1) * np.array([[1], [-2]]), 2.0**k * k, 1e-12)
    assert np.abs(values).sum(axis=0).max() < 6  # equispaced nodes have 24 at k = 8
    for degree in (k, 2 * k, 4 * k - 2):
        (x, y), weights = quadrature(degree)
        if degree <= TABLED:
            points, theirs = get_quadrature(ElementTriP1(), degree)
            assert np.array_equal([x, y], points)
            assert np.array_equal(weights, theirs)
        exact = math.factorial(degree) / math.factorial(degree + 2)
        assert weights @ x**degree == pytest.approx(exact, rel=1e-12)
        assert weights @ (x + y) ** degree == pytest.approx(1 / (degree + 2), rel=1e-12)


def test_a_cell_bent_beyond_its_corners_is_on_its_own_side_of_the_ring():
    """On the coarsest mesh the corners of a cell outside of the ring have their mean inside of it."""
    mesh = disk(1, L0)
    balance = ForceBalance(Model(Parameters(150.0, 0.4, l0=L0)), mesh, 5)
    outside = (np.hypot(*balance.space.xi[:, balance.space.cells]) > L0 + 1e-6).any(axis=0)
    assert np.array_equal(balance.delta, outside)
    assert not np.array_equal(balance.delta, np.hypot(*mesh.centroids) > L0)


RING = 0.75
"""A ring that every mesh from refinement 2 on has at the same layer, so that meshes refine evenly."""
LEVELS = {1: (4, 5), 2: (3, 4), 3: (3, 4), 4: (3, 4), 5: (2, 3), 6: (2, 3), 7: (2, 3), 8: (2, 3)}
"""Refinements at which errors are asymptotic and above round-off."""


def scatter_of(k):
    """How far an observed order may be from k + 1: above P4 round-off leaves two meshes of few cells."""
    return 0.12 if k < 5 else 0.7


def order(k, error, levels=None):
    """Observed order of error(space) between two refinements."""
    errors = [error(Space.on(disk(refine, RING), k, RING)) for refine in levels or LEVELS[k]]
    return local_orders(errors)[0]


def l2_error(space, nodal, exact):
    """L2 norm of a P_k field minus exact(x), sampled finer than the kernels do."""
    rule = space.rule(2 * space.order + 4)
    points, field = (rule.blend(values[..., space.cells]) for values in (space.xi, nodal))
    return np.sqrt(((field - exact(points)) ** 2 * rule.at(space.xi).dx).sum())


@pytest.mark.parametrize("k", EVERY_ORDER)
@pytest.mark.parametrize("l0", [0.3, L0])
def test_the_curved_cells_are_sound_and_share_their_nodes(k, l0):
    for refine in (1, 2, 3, 4):
        mesh = disk(refine, l0, rotation=0.2)
        space = Space.on(mesh, k, l0)
        assert np.array_equal(space.xi[:, : mesh.xi.shape[1]], mesh.xi)
        assert space.xi.shape[1] == 2 * (k * 2**refine) ** 2 + 2 * k * 2**refine + 1
        assert space.rule(2 * k + 4).at(space.xi).dx.min() > 0
        radii = np.hypot(*space.xi[:, space.rim_nodes])
        assert np.abs(radii - 1).max() < 1e-15
        angles = np.unwrap(np.arctan2(*space.xi[::-1, space.rim_nodes]))
        assert (np.diff(angles) > 0).all()
        assert angles[-1] - angles[0] < 2 * np.pi


@pytest.mark.parametrize("k", EVERY_ORDER)
@pytest.mark.parametrize("mirrors", [1, 2])
def test_a_sectors_curved_cells_are_those_of_the_disk(k, mirrors):
    symmetry, refine = Symmetry(mirrors, 0.2), 2
    part, whole = (
        Space.on(mesh, k, L0) for mesh in (sector(refine, L0, symmetry, 0.2), disk(refine, L0, 0.2))
    )
    gaps = np.hypot(*(part.xi[:, :, None] - whole.xi[:, None]))
    same_node = gaps.argmin(axis=1)
    assert gaps.min(axis=1).max() < 2e-15
    on_sides = symmetry.on_sides(part.xi)
    assert on_sides.sum(axis=1).tolist() == [k * 2**refine + 1] * 2
    assert whole.xi.shape[1] == 2 * mirrors * part.xi.shape[1] - mirrors * on_sides.sum() + 1
    assert set(same_node[part.rim_nodes]) <= set(whole.rim_nodes)
    angles = np.unwrap(np.arctan2(*part.xi[::-1, part.rim_nodes])) - symmetry.start
    assert angles.size == k * part.rim.shape[1] + 1
    assert (np.diff(angles) > 0).all()
    assert angles[[0, -1]] == pytest.approx([0, symmetry.angle], abs=1e-14)
    for rule in ("inside", "on_rim"):
        portions = [getattr(space, rule).at(space.xi).dx.sum() for space in (part, whole)]
        assert 2 * mirrors * portions[0] == pytest.approx(portions[1], rel=1e-14)


@pytest.mark.parametrize("k", ORDERS)
def test_the_area_of_the_disk_converges_at_twice_the_order(k):
    def error(space):
        return abs(space.inside.at(space.xi).dx.sum() - np.pi)

    assert order(k, error, levels=(1, 2)) == pytest.approx(2 * k, abs=0.1)


def polished(x):
    """A field with n.grad a = 0 on the unit circle, and its negative Laplacian."""
    s = x[0] ** 2 + x[1] ** 2
    quadrupole = x[0] ** 2 - x[1] ** 2
    a = np.cos(np.pi * s) + quadrupole * (2 - s)
    return a, 4 * np.pi * (np.sin(np.pi * s) + np.pi * s * np.cos(np.pi * s)) + 12 * quadrupole


@pytest.mark.parametrize("k", EVERY_ORDER)
def test_a_diffusion_problem_converges_at_order_k_plus_one(k):
    """a - Laplace a = s with n.grad a = 0, as (B.22) assembles it."""

    def error(space):
        inside = space.inside.at(space.xi)
        matrix = space.scalars.matrix(inside.mass() + space.gradients.at(space.xi).stiffness())
        source = sum(polished(space.inside.blend(space.xi[:, space.cells])))
        a, outcome = solve(matrix, space.scalars.vector(inside.load(source)))
        assert outcome.ok
        return l2_error(space, a, lambda x: polished(x)[0])

    assert order(k, error) == pytest.approx(k + 1, abs=scatter_of(k))


def contraction(x):
    """A velocity v = grad chi, along the rays on the unit circle, and Laplace chi; there n.sigma_v n = 0.

    chi = (x^2 - y^2)(-175 + 278 s - 103 s^2)/200, s = |x|^2: chi = mu chi'' + mu2 chi' = 0 at r = 1.
    """
    s, quadrupole = x[0] ** 2 + x[1] ** 2, x[0] ** 2 - x[1] ** 2
    factor, slope = (-175 + 278 * s - 103 * s**2) / 200, (278 - 206 * s) / 200
    v = 2 * factor * np.array([x[0], -x[1]]) + 2 * quadrupole * slope * x
    return v, quadrupole * (12 * 278 - 32 * 103 * s) / 200


@pytest.mark.parametrize("k", EVERY_ORDER)
def test_the_force_balance_converges_at_order_k_plus_one(k):
    """-div sigma_v = grad f with f = -mu Laplace chi, a being the concentration whose pressure is f."""
    p = 500.0
    model = Model(Parameters(0.0, p, l0=RING), Rheology.VISCOUS, delta=Delta.FULL)
    mu = model.parameters.mu1 + model.parameters.mu2

    def concentration(x):
        return np.tan(np.pi / 2 * (-mu * contraction(x)[1] / p))

    def error(refine):
        balance = ForceBalance(model, disk(refine, RING), k)
        space = balance.space
        a, a_rim = (
            concentration(rule.blend(space.xi[:, rule.cells])) for rule in (space.inside, space.on_rim)
        )
        v, _, outcome = balance._rates(space.xi, balance.system(space.xi, a, a_rim, 0.0))
        assert outcome.ok
        return l2_error(space, v, lambda x: contraction(x)[0])

    errors = [error(refine) for refine in LEVELS[k]]
    if k == HIGHEST:  # a few digits of the rules, which have 13 or 14, times p are all that is left
        assert errors[1] < 2e-11
        assert errors[0] < 2e-9
    else:
        assert local_orders(errors)[0] == pytest.approx(k + 1, abs=scatter_of(k))


@pytest.mark.parametrize("order", EVERY_ORDER)
def test_points_are_found_where_they_are(order):
    """Also on the coarsest mesh, whose cells are so curved that Newton's method can go astray."""
    space = Space.on(disk(1, 0.8), order, 0.8)
    radii, angles = np.meshgrid([0.1, 0.37, 0.55, 0.7], np.linspace(0.1, 6.2, 23))
    points = (radii * np.array([np.cos(angles), np.sin(angles)])).reshape(2, -1)
    cells, values = locate(space, points)
    found = np.einsum("ak,iak->ik", values, space.xi[:, space.cells[:, cells]])
    assert np.abs(found - points).max() < 1e-12
