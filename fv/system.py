"""The linear system of the force balance at one configuration, and its solution.

The two-point part is symmetric and positive; its factors hardly fill in, and are kept while the mesh moves
little.  The cross part makes the sum unsymmetric: it is applied factor by factor, never formed, and an
iteration preconditioned by the two-point part finds the velocities.

`traction-free` leaves rigid motions to a gauge: of the load, a uniform force and a torque per area that leave
no net load are taken.  They are unknowns beside the velocities; here they are a multiple of the velocities'
own mean motion, which the solution is then freed of.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.errors import COMPLETED, Ending, Outcome
from actin_xcheck.core.linear import bincount
from actin_xcheck.core.mesh import quadrature_points, signed_areas
from actin_xcheck.core.model import Array, Closure
from fv import krylov
from fv.boundary import Ties, free_motions, rigid_motions
from fv.equations import linear_weights
from fv.stress import Assembly, Diamonds, Moduli

GOAL = 1e-11
"""Relative residual at which the iteration stops."""

ACCEPTED = 1e-10
"""Largest relative residual that is not a failure."""

ITERATIONS = 60
"""With a factor of another configuration; a factor of this one is worth some 10."""

ROUNDS, NEARLY = 2, 1e-6
"""Of the iteration with a factor, where the first one leaves no more than that: residuals that rise on the
way part what it believes is left from what is, of which the second round makes an end.
"""


@dataclass(frozen=True, eq=False)
class Gauge:
    """Rigid motions of a free cell, weighted by area.

    Attributes
    ----------
    free : those that mirror lines allow, (3, k).
    motions : of the places, (k, 2 n_places).
    weighted : times the cells' areas, which boundary faces have none of, (k, 2 n_places).
    """

    free: Array
    motions: Array
    weighted: Array

    @classmethod
    def of(cls, ties: Ties, diamonds: Diamonds, volumes: Array) -> "Gauge":
        """On a configuration with cell areas (n_cells,)."""
        centre = diamonds.places[:, : volumes.size] @ volumes / volumes.sum()
        free = free_motions(ties.mesh.symmetry)
        motions = np.einsum("mk,min->kni", free, rigid_motions(diamonds.places, centre))
        weights = np.concatenate([volumes, np.zeros(ties.places - volumes.size)])
        size = 2 * ties.places
        return cls(free, motions.reshape(-1, size), (motions * weights[:, None]).reshape(-1, size))

    def mean(self, v: Array) -> Array:
        """The mean rigid motion (k,) of velocities at the places, (2 n_places,)."""
        return np.asarray(np.linalg.solve(self.weighted @ self.motions.T, self.weighted @ v), np.float64)


class System:
    """For the unknowns of `ties` with nodes at x (2, N).

    Parameters
    ----------
    ties, assembly : of the closure and of the mesh.
    diamonds : the faces of this configuration.
    x : its nodes.
    moduli : of the stress of velocities.
    """

    def __init__(self, ties: Ties, assembly: Assembly, diamonds: Diamonds, x: Array, moduli: Moduli) -> None:
        self.ties, self.x, self.moduli = ties, x, moduli
        star = diamonds.faces.star
        self.interpolation = linear_weights(diamonds.faces, x, diamonds.places)
        """Weights of the star's values, (k,)."""
        shape = x.shape[1], ties.places
        self._to_vertices = sp.csr_matrix((self.interpolation, star.value, star.indptr), shape)
        self._tied, self._directions = ties.of_vertices(x)
        self.weights = ties.weights(x)
        self._cross = assembly.cross(diamonds.cross(moduli))
        self._volumes = signed_areas(x, ties.mesh.triangles)
        self.two_point = assembly.two_point(diamonds.two_point(moduli), self.weights) + self._friction(
            diamonds
        )
        self.gauge = (
            Gauge.of(ties, diamonds, self._volumes) if ties.closure is Closure.TRACTION_FREE else None
        )

    def _friction(self, diamonds: Diamonds) -> sp.csr_matrix:
        """Of the wall of `irrotational-wall`, of unit radius: m1 |S| of the velocity along a rim face."""
        rim = diamonds.faces.rim
        on_wall = self.ties.on_rim & (self.ties.closure is Closure.IRROTATIONAL_WALL)
        slip = np.where(on_wall, self.moduli[0] * np.hypot(*diamonds.area[:, rim]), 0.0)
        place = np.arange(self.ties.places - rim.size, self.ties.places)
        unknown = self.ties.unknown[2 * place]
        return sp.csr_matrix((slip, (unknown, unknown)), (self.ties.size, self.ties.size))

    def projected(self, v: Array) -> Array:
        """Velocities (2, N) at the vertices, those of the boundary as they may move."""
        tied, along = self._tied, self._directions
        v = v.copy()
        v[:, tied] = along * (along * v[:, tied]).sum(axis=0)
        return v

    def at_vertices(self, at_places: Array) -> Array:
        """Velocities (2, N) interpolated from those at the places, (2 n_places,)."""
        return self.projected((self._to_vertices @ at_places.reshape(-1, 2)).T)

    def at_places(self, q: Array) -> Array:
        """Velocities (2 n_places,) of unknowns (n,)."""
        found: Array = self.weights * q[self.ties.unknown]
        return found

    def from_vertices(self, v: Array) -> Array:
        """What velocities of the vertices (2, N) do to the places, (2 n_places,)."""
        done: Array = self._cross @ v.T.ravel()
        return done

    def restricted(self, load: Array) -> Array:
        """Loads (n,) on the unknowns of loads on the places, (2 n_places,)."""
        return bincount(self.ties.unknown, self.weights * load, self.ties.size)

    def __call__(self, q: Array) -> Array:
        """Apply to unknowns (n,)."""
        v = self.at_places(q)
        load = self.from_vertices(self.at_vertices(v))
        if self.gauge is not None:
            load += self._stiffness * self.gauge.mean(v) @ self.gauge.weighted
        applied: Array = self.two_point @ q + self.restricted(load)
        return applied

    @property
    def _stiffness(self) -> float:
        """Load per area and mean rigid motion: any number serves, one near the others fastest."""
        return sum(self.moduli)

    @cached_property
    def _preconditioning(self) -> sp.csr_matrix:
        """The two-point part; of a free cell held by what holds its mean motion."""
        if self.gauge is None:
            return self.two_point
        held = np.zeros(2 * self.ties.places)
        held[: 2 * self._volumes.size] = self._stiffness * np.repeat(self._volumes, 2)
        return self.two_point + sp.diags(np.bincount(self.ties.unknown, held, self.ties.size))

    def factor(self) -> krylov.Inverse | None:
        """The inverse of the two-point part, or None where it has none; it preconditions: six digits do."""
        return krylov.factorise(self._preconditioning, single=True)

    def solve(
        self, load: Array, guess: Array, near: Callable[[], krylov.Inverse | None]
    ) -> tuple[Array, Outcome]:
        """Velocities (2 n_places,) under a load at the places, and how it went.

        Parameters
        ----------
        load : at the places, (2 n_places,).
        guess : velocities (2 n_places,) to begin with.
        near : what was factorised nearby; where it does not serve, this configuration's is.
        """
        rhs = self.restricted(load)
        scale, left = float(np.linalg.norm(rhs)), np.inf
        if not np.isfinite(scale):
            return np.full_like(load, np.nan), Outcome(Ending.NON_FINITE, "the load is not finite")
        if scale == 0.0:
            return np.zeros_like(load), COMPLETED
        start, rhs = self.restricted(guess) / scale, rhs / scale
        for factor, search in ((near, self._in_rounds), (self.factor, self._surely)):
            inverse = factor()
            if inverse is None:
                continue
            # what the iteration takes for a breakdown is not relative to the load
            found = search(rhs, inverse, start)
            left = float(np.linalg.norm(rhs - self(found)))
            if left <= ACCEPTED:
                return self.at_places(scale * found), COMPLETED
        message = (
            f"the force balance of the finite volumes left a relative residual of {left:.1e} "
            f"(tolerance {ACCEPTED:.0e})"
        )
        return np.full_like(load, np.nan), Outcome(Ending.NOT_CONVERGED, message)

    def _in_rounds(self, rhs: Array, inverse: krylov.Inverse, found: Array) -> Array:
        """By BiCGStab, from where it ended once more if not much is left."""
        for _ in range(ROUNDS):
            found = krylov.iterate(self, rhs, inverse, GOAL, ITERATIONS, found)
            left = float(np.linalg.norm(rhs - self(found)))
            if left <= ACCEPTED or not left <= NEARLY:
                break
        return found

    def _surely(self, rhs: Array, inverse: krylov.Inverse, start: Array) -> Array:
        """By what distorted cells do not stall."""
        return krylov.minimise(self, rhs, inverse, GOAL, start)

    def net(self, v: Array) -> tuple[tuple[float, float], float]:
        """The net force and torque, about the centroid, that the gauge balances at velocities of places."""
        if self.gauge is None:
            return (0.0, 0.0), 0.0
        force_x, force_y, torque = (self.gauge.free @ (self.gauge.weighted @ (self._stiffness * v))).tolist()
        return (force_x, force_y), torque

    def without_rigid_motion(self, v: Array) -> Array:
        """Vertex velocities (2, N) without their area-weighted mean translation and rotation."""
        if self.gauge is None:
            return v
        triangles = self.ties.mesh.triangles
        at, values = (quadrature_points(nodal, triangles).reshape(2, -1) for nodal in (self.x, v))
        weights = np.tile(self._volumes / 3, 3)
        centre = at @ weights / weights.sum()
        motions = np.einsum("mk,min->kin", self.gauge.free, rigid_motions(at, centre))
        gram = np.einsum("kin,n,lin->kl", motions, weights, motions)
        mean = np.linalg.solve(gram, np.einsum("kin,n,in->k", motions, weights, values))
        return v - np.einsum("k,mk,min->in", mean, self.gauge.free, rigid_motions(self.x, centre))
