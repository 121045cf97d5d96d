r"""The closures: which way each rim node may move, and what keeps the system solvable.

A tied node moves along one direction only: both of its components are one free unknown, weighted.  The
prolongation P from free unknowns q to nodal vectors thus has one entry a row, and P^T L P q = P^T F leaves no
force along the directions left free.

The straight sides of a sector are mirror lines: v.n = 0 and no shear traction; nodes slide along them.

A free rim's deformation gradient, known to the order of positions: why the load sees phi without loss.

The load of (B.21) on a free rim is the integral of f(a, phi) w.n, and phi = 2 - tr F^-1, F = dx/dxi, needs a
trace of grad u, whose error in P_k is O(h^k).  Its tangential part does no harm: x_s is a derivative along
the rim, and against smooth w its error is integrated by parts, O(h^(k+1)).  The part across does.  It is
carried instead, as a state of its own at the rim's points: with N the normal of the reference rim,

    d(F N)/dt = (grad v) F N,    grad v = v_s/|x_s| (x) tau + q (x) n,

v_s again along the rim.  Across, q follows from the traction t = (sigma_v + sigma_e) n of (2.3) and (2.4):

    (mu1 + mu2) q.n + mu2 tau.v_s/|x_s| + n.sigma_e n = t.n,
    mu1/2 (q.tau + n.v_s/|x_s|) + tau.sigma_e n = t.tau.

The traction is what f jumps by from inside to the rim's load, n times; that is none but for `membrane`.
Along a tied direction comes the reaction: the residual of the discrete balance in the functions that the
closure rules out.  Its moments with smooth functions are those of the exact reaction up to O(h^(2k)).  So all
errors of F N are derivatives along the rim of O(h^(k+1)), or as small against smooth functions, and positions
keep order k + 1: docs/methods.md.

Arrays at the rim's points: components i, points q, edges e.
"""

from collections.abc import Callable
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.polynomial.legendre import Legendre, legvander

from actin_xcheck.core.lagrange import lobatto
from actin_xcheck.core.linear import Pattern, bincount
from actin_xcheck.core.mesh import Indices, Symmetry
from actin_xcheck.core.model import Array, Closure, Model
from fem.space import Space


def rim_directions(closure: Closure, space: Space, x: Array) -> Array:
    """Unit directions (2, n_rim) in which rim nodes may move; see `Closure` for each reading.

    Parameters
    ----------
    closure : the reading; a `traction-free` rim moves freely, its three tied nodes take their rays.
    space : on the reference cell, or on a sector, where the rim's ends keep to their sides instead.
    x : current node positions (2, N).
    """
    rim = space.rim_nodes
    match closure:
        case Closure.REFERENCE_NORMAL:
            # the normal of the non-deformed outline (B.7): on a circle a rim point keeps to its ray
            direction = space.rim_normals
        case Closure.TRACTION_FREE:
            direction = space.xi[:, rim]
        case Closure.CURRENT_NORMAL:
            # n_i proportional to the integral of phi_i n ds; for P1 the chord between the neighbours, turned
            direction = space.rim_vectors.vector(space.on_rim.at(x).normal_load(1.0)).reshape(-1, 2)[rim].T
        case Closure.IRROTATIONAL_WALL:
            direction = np.array([-x[1, rim], x[0, rim]])
    return direction / np.hypot(*direction)


def along_sides(closure: Closure, space: Space) -> tuple[Indices, Array]:
    """The nodes (n,) on a sector's sides and how they may move: a unit direction each, or zero, (2, n).

    A node on two mirror lines stays where it is.  So does a rim node on the wall of `irrotational-wall`, and
    one of a free half disk, which could slide along its mirror line: the balance puts that motion back.
    """
    if space.symmetry is None:
        return np.zeros(0, dtype=np.int64), np.zeros((2, 0))
    first, second = space.symmetry.on_sides(space.xi)
    still = first & second & (space.symmetry.mirrors > 1)
    if closure is Closure.IRROTATIONAL_WALL:
        still[space.rim_nodes[[0, -1]]] = True
    elif closure is Closure.TRACTION_FREE and space.symmetry.mirrors == 1:
        still[space.rim_nodes[0]] = True
    nodes = np.flatnonzero(first | second)
    along = space.symmetry.sides[:, np.where(first, 0, 1)]
    return nodes, np.where(still, 0.0, along)[:, nodes]


class Constraint:
    """The free unknowns of a closure and the reduced system in them; the pattern is fixed, weights move.

    Parameters
    ----------
    closure : which nodes are tied, and how.
    space : on the reference cell or a sector.
    """

    def __init__(self, closure: Closure, space: Space) -> None:
        self.closure = closure
        self.space = space
        self._which = np.arange(space.rim_nodes.size)
        if closure is Closure.TRACTION_FREE:
            # three rim points on their rays take the rigid motions out; the balance puts the right ones back
            self._which = _a_third_apart(space)
        self.tied = space.rim_nodes[self._which]
        self.on_sides, self._along = along_sides(closure, space)
        components = np.full(space.xi.shape[1], 2)
        components[self.tied] = 1
        components[self.on_sides] = self._along.any(axis=0)
        first = np.cumsum(components) - components
        size = int(components.sum())
        # a node that stays has no unknown; it names one, with weight zero
        unknowns = np.stack([first, first + np.maximum(components, 1) - 1], axis=1)
        self.unknown: Indices = np.minimum(unknowns, size - 1).ravel()
        """The free unknown behind each component of a nodal vector, (2 N,)."""
        self.of_cells = self.unknown[space.vectors.of_cells]
        """The same of each cell, (2, n_local, n_cells)."""
        self.parts = np.repeat(space.parts, components)
        """The space's dissection of nodes, by free unknown, (n_free,)."""
        full, moves = space.vectors.pattern, np.repeat(components > 0, 2)
        self._kept = np.flatnonzero(moves[full.rows] & moves[full.columns])
        self._rows, self._columns = full.rows[self._kept], full.columns[self._kept]
        self.pattern = Pattern(self.unknown[self._rows], self.unknown[self._columns], size)

    def weights(self, x: Array) -> Array:
        """What each component takes of its free unknown, (2 N,)."""
        weights = np.ones((x.shape[1], 2))
        weights[self.tied] = rim_directions(self.closure, self.space, x)[:, self._which].T
        weights[self.on_sides] = self._along.T
        return weights.ravel()

    def reduce(self, weights: Array, matrix: sp.csr_matrix) -> sp.csr_matrix:
        """P^T L P (n_free, n_free) of a matrix L (2 N, 2 N) summed by the space's own pattern."""
        return self.pattern.sum(matrix.data[self._kept] * weights[self._rows] * weights[self._columns])

    def restrict(self, weights: Array, load: Array) -> Array:
        """P^T F (n_free,) of a load F (2 N,)."""
        return bincount(self.unknown, weights * load, self.pattern.size)

    def prolongation(self, x: Array) -> sp.csr_matrix:
        """Sparse map P (2 N, n_free) from free unknowns to interleaved nodal vectors."""
        return sp.csr_matrix((self.weights(x), self.unknown, np.arange(self.unknown.size + 1)))


def _a_third_apart(space: Space) -> Indices:
    """Three of the rim nodes by their places in `rim_nodes`, about 120 degrees apart; none of a sector's."""
    if space.symmetry is not None:
        return np.zeros(0, dtype=np.int64)
    if space.normals is None:
        return np.arange(3) * space.rim_nodes.size // 3
    x, y = space.xi[:, space.rim_nodes]
    angle = np.remainder(np.arctan2(y, x) - np.arctan2(y[0], x[0]), 2 * np.pi)
    thirds = np.arange(3)[:, None] * 2 * np.pi / 3
    return np.where(angle <= thirds, angle, -1.0).argmax(axis=1)


def settle(closure: Closure, space: Space, x: Array) -> Array:
    """Put rim nodes that slid along the wall back onto it; other closures leave positions alone.

    Valid to first order in the amplitude, which is all `irrotational-wall` is for.
    """
    if closure is not Closure.IRROTATIONAL_WALL:
        return x
    rim = space.rim_nodes
    settled = x.copy()
    settled[:, rim] *= np.hypot(*space.xi[:, rim]) / np.hypot(*x[:, rim])
    return settled


def free_motions(symmetry: Symmetry | None) -> Array:
    """The rigid motions that mirror lines allow, by columns of translations and rotation (3, 3, 1 or 0)."""
    if symmetry is None:
        return np.eye(3)
    along = symmetry.sides[:, :1] if symmetry.mirrors == 1 else np.zeros((2, 0))
    return np.vstack([along, np.zeros(along.shape[1])])


def rigid_motions(x: Array, centre: Array) -> Array:
    """Two translations and the rotation about `centre` (2,), as interleaved vectors (2 N, 3)."""
    motions = np.zeros((2 * x.shape[1], 3))
    motions[0::2, 0] = 1
    motions[1::2, 1] = 1
    motions[0::2, 2] = -(x[1] - centre[1])
    motions[1::2, 2] = x[0] - centre[0]
    return motions


DEPTH, DEGREE = 0.1, 8
"""Most that an initial displacement is followed inwards, as far as an edge is long, and by what degree."""


class FreeRim:
    """F = dx/dxi at the points of a rim, from positions along it and F N across, (2, q, e).

    Parameters
    ----------
    model : moduli and closure.
    space : its elements.
    """

    def __init__(self, model: Model, space: Space) -> None:
        self.model, self.space = model, space
        at_rest = self.along(space.xi)
        points = space.on_rim.blend(space.xi[:, space.on_rim.cells])
        outwards = points if space.normals is None else np.array([at_rest[1], -at_rest[0]])
        self.along_at_rest, self.points = at_rest, points
        self.normals = outwards / np.hypot(*outwards)

    def along(self, nodal: Array) -> Array:
        """Derivative of a field (2, N) along the rim, by its edges' own coordinate, (2, q, e)."""
        rule = self.space.on_rim
        derivative = np.einsum("ijqe,je->iqe", rule.tangent_map(nodal), rule.direction)
        return np.broadcast_to(derivative, (2, len(rule.weights), derivative.shape[2]))

    def start(self, u0: Callable[[Array], Array]) -> Array:
        """F N (2, q, e) of an initial displacement of material points (2, n) -> (2, n), seen from inside."""
        inwards = lobatto(DEGREE)
        slope = np.linalg.solve(
            legvander(2 * inwards - 1, DEGREE).T,
            [2 * Legendre.basis(n).deriv()(-1.0) for n in range(DEGREE + 1)],
        )
        depth = np.minimum(np.hypot(*self.along_at_rest), min(DEPTH, 1 - self.model.parameters.l0))
        places = self.points[..., None] - depth[..., None] * inwards * self.normals[..., None]
        u = u0(places.reshape(2, -1)).reshape(places.shape)
        start: Array = self.normals - u @ slope / depth
        return start

    def inverse(self, x: Array, across: Array) -> Array:
        """F^-1 (i, j, q, e) where nodes are at x (2, N) and F N is known."""
        along = self.along(x)
        determinant = along[0] * across[1] - along[1] * across[0]
        rows = np.array([[across[1], -across[0]], [-along[1], along[0]]]) / determinant
        return np.einsum("aiqe,ajqe->ijqe", np.array([self.along_at_rest, self.normals]), rows)

    def dilation(self, x: Array, across: Array) -> Array:
        """phi = 2 - tr F^-1, (q, e)."""
        return np.asarray(2 - np.trace(self.inverse(x, across)), np.float64)

    def rate(self, x: Array, v: Array, across: Array, jump: Array, residual: Array) -> Array:
        """(grad v) F N (2, q, e) of velocities v (2, N).

        Parameters
        ----------
        x : node positions (2, N).
        across : F N.
        jump : of f from inside to what the rim's load takes, (q, e).
        residual : of the force balance without its closure, at the nodes, (2, N).
        """
        (mu1, mu2), (one, nu_prime) = self.model.viscous_moduli(), self.model.elastic_moduli()
        x_s = self.along(x)
        length = np.hypot(*x_s)
        tau, v_tau = x_s / length, self.along(v) / length
        n = np.array([tau[1], -tau[0]])
        grad_u = np.eye(2)[..., None, None] - self.inverse(x, across)
        strain = (grad_u + grad_u.swapaxes(0, 1)) / 2
        elastic = one * np.einsum("ijqe,jqe->iqe", strain, n) + nu_prime * np.trace(grad_u) * n
        traction = self._reaction(x, residual) / length + jump * n - elastic
        normal = (_dot(traction, n) - mu2 * _dot(v_tau, tau)) / (mu1 + mu2)
        shear = 2 / mu1 * _dot(traction, tau) - _dot(v_tau, n)
        rate: Array = v_tau * _dot(tau, across) + (normal * n + shear * tau) * _dot(n, across)
        return rate

    def read(self, other: "FreeRim", across: Array) -> Array:
        """F N (2, q, e) from that of another mesh of the disk, a polynomial of the angle on each edge."""
        ends = other.space.xi[:, other.space.rim]
        first, last, known, here = (
            _angle(place) for place in (*ends.swapaxes(0, 1), other.points, self.points)
        )
        turn = np.argsort(first)
        edge = turn[np.searchsorted(first[turn], here) - 1]

        def polynomials(angle: Array) -> Array:
            """Those of Legendre where angles (..., q, e) are on their edges, (..., q, e, n)."""
            share = np.remainder(angle - first[edge] + np.pi, 2 * np.pi) - np.pi
            place = 2 * share / np.remainder(last - first, 2 * np.pi)[edge] - 1
            return np.asarray(legvander(place, len(known) - 1), np.float64)

        nodes = np.moveaxis(polynomials(known[:, edge]), 0, -1)
        weights = np.linalg.solve(nodes, polynomials(here)[..., None])[..., 0]
        return np.einsum("qek,ckqe->cqe", weights, across[:, :, edge])

    def _reaction(self, x: Array, residual: Array) -> Array:
        """The closure's reaction per length at rest, times that of the edges' coordinate there, (2, q, e).

        Mirror lines have a reaction of their own, and by symmetry the rim has none where it meets them.
        """
        if self.model.closure is Closure.TRACTION_FREE:
            return np.zeros_like(self.points)
        nodes, tied = self.space.rim_nodes[self._inner], self._tied(x)
        moments = _dot(residual[:, nodes], tied)
        steady = self.model.closure is Closure.REFERENCE_NORMAL
        reaction = np.zeros_like(residual)
        reaction[:, nodes] = tied * (
            self._inverse @ moments if steady else np.linalg.solve(self._products(tied), moments)
        )
        density = self.space.on_rim.blend(reaction[:, self.space.on_rim.cells])
        return np.asarray(density * np.hypot(*self.along_at_rest), np.float64)

    def _tied(self, x: Array) -> Array:
        """The directions (2, n) that are not free."""
        outwards = rim_directions(self.model.closure, self.space, x)[:, self._inner]
        return np.array([-outwards[1], outwards[0]])

    def _products(self, tied: Array) -> Array:
        """Of the rim's basis functions along directions (2, n), over its length at rest, (n, n)."""
        return self._mass * (tied.T @ tied)

    @cached_property
    def _inverse(self) -> Array:
        """That of the products where directions do not change, (n, n)."""
        return np.asarray(np.linalg.inv(self._products(self._tied(self.space.xi))), np.float64)

    @cached_property
    def _inner(self) -> slice:
        """The rim's nodes but for those on mirror lines."""
        return slice(None) if self.space.symmetry is None else slice(1, -1)

    @cached_property
    def _mass(self) -> Array:
        """Products of the rim's basis functions at rest, (n, n)."""
        rule, nodes = self.space.on_rim, self.space.rim_nodes
        number = np.full(self.space.xi.shape[1], nodes.size)
        number[nodes] = np.arange(nodes.size)
        rows = number[rule.cells]
        products = np.einsum(
            "aqe,bqe,qe->abe", rule.values, rule.values, rule.weights * np.hypot(*self.along_at_rest)
        )
        mass = np.zeros((nodes.size + 1,) * 2)
        np.add.at(mass, (rows[:, None], rows[None]), products)
        return mass[:-1, :-1][self._inner, self._inner]


def _dot(one: Array, other: Array) -> Array:
    return (one * other).sum(axis=0)


def _angle(place: Array) -> Array:
    return np.arctan2(place[1], place[0])
