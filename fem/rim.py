r"""A free rim's deformation gradient, known to the order of positions: why the load sees phi without loss.

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
from numpy.polynomial.legendre import Legendre, legvander

from actin_xcheck.core.lagrange import lobatto
from actin_xcheck.core.model import Array, Closure, Model
from fem.boundary import rim_directions
from fem.space import Space

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
