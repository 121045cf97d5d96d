"""What the audit measures with: quadrature and fields on the disk, P1 matrices by hand, one small cell.

The matrices are built here from the article's own entries, in plain numpy, so that they share nothing with
the finite elements they are held against.
"""

from dataclasses import dataclass
from decimal import Decimal
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial.legendre import leggauss

from actin_xcheck.core.contract import Problem, Solver, State
from actin_xcheck.core.mesh import INTERIOR_POINTS, Indices, Mesh, disk, signed_areas
from actin_xcheck.core.model import Array, Closure, Delta, Model, Rheology
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.runs.method import FORCE_BALANCE, METHODS, load

ROUND_OFF = 1e-11
"""Relative difference below which two evaluations of one formula are the same."""


def rounds_to(value: float, printed: str) -> bool:
    """Whether a value, rounded to the digits of a printed number ("3.83170", "3.1e2"), is that number."""
    decimal = Decimal(printed)
    exponent = decimal.as_tuple().exponent
    assert isinstance(exponent, int)
    # a value half-way between two numbers may be printed as either
    return abs(value - float(decimal)) <= 0.5 * 10.0**exponent * (1 + 1e-9)


def disk_quadrature(inner: float = 0.0, outer: float = 1.0) -> tuple[Array, Array]:
    """Points (2, n) and weights (n,) on an annulus: Gauss in r and, quadrant by quadrant, in theta.

    The quadrants let |sin x sin y| be integrated to round-off: its kinks lie on the axes.
    """
    s, ws = leggauss(32)
    r, wr = inner + (outer - inner) * (s + 1) / 2, (outer - inner) * ws / 2
    theta = np.concatenate([np.pi / 4 * (s + 1) + quadrant * np.pi / 2 for quadrant in range(4)])
    wt = np.tile(np.pi / 4 * ws, 4)
    R, T = np.meshgrid(r, theta, indexing="ij")
    return np.array([(R * np.cos(T)).ravel(), (R * np.sin(T)).ravel()]), np.outer(wr * r, wt).ravel()


def circle(radius: float = 1.0, count: int = 128) -> tuple[Array, Array, float]:
    """Points (2, count) on a circle, its outward normals (2, count) and the length each point stands for."""
    theta = 2 * np.pi * np.arange(count) / count
    n = np.array([np.cos(theta), np.sin(theta)])
    return radius * n, n, 2 * np.pi * radius / count


def relative(residual: Array, scale: Array) -> float:
    """Largest entry of a residual over the largest entry of what it is made of."""
    return float(np.abs(residual).max() / np.abs(scale).max())


@dataclass(frozen=True, eq=False)
class Triangles:
    """P1 elements on node positions x (2, N): the article's matrix entries as dense arrays."""

    x: Array
    triangles: Indices

    @cached_property
    def areas(self) -> Array:
        """Areas (n_cells,)."""
        return signed_areas(self.x, self.triangles)

    @cached_property
    def gradients(self) -> Array:
        """Gradients of the three basis functions of each cell, (2, 3, n_cells)."""
        p = self.x[:, self.triangles]
        opposite = np.roll(p, -2, axis=1) - np.roll(p, -1, axis=1)
        return np.array([-opposite[1], opposite[0]]) / (2 * self.areas)

    def summed(self, local: Array) -> Array:
        """Sum cell entries (3, n_cells) or (3, 3, n_cells) into nodal ones, (N,) or (N, N)."""
        count, nodes = self.x.shape[1], self.triangles
        whole = np.zeros((count,) * (local.ndim - 1))
        np.add.at(whole, (nodes,) if local.ndim == 2 else (nodes[:, None], nodes[None, :]), local)
        return whole

    def pairs(self, k: int, m: int) -> Array:
        """Integrals of d_k phi_i d_m phi_j, (N, N)."""
        g = self.gradients
        return self.summed(self.areas * g[k][:, None] * g[m][None, :])

    def mass(self) -> Array:
        """M of (B.22)."""
        return self.summed(self.areas * (np.ones((3, 3)) + np.eye(3))[:, :, None] / 12)

    def stiffness(self) -> Array:
        """K of (B.22)."""
        return self.pairs(0, 0) + self.pairs(1, 1)

    def load(self) -> Array:
        """H of (B.22)."""
        return self.summed(np.broadcast_to(self.areas / 3, self.triangles.shape))

    def blocks(self, normal: float, coupling: float, shear: float) -> tuple[Array, Array, Array]:
        """Return A11, A12 and A22 of (B.20) for D11 = D22, D12 and D33, or B's for the C."""
        xx, yy, xy = self.pairs(0, 0), self.pairs(1, 1), self.pairs(0, 1)
        return normal * xx + shear * yy, coupling * xy + shear * xy.T, shear * xx + normal * yy

    def network(self, normal: float, coupling: float, shear: float) -> Array:
        """The block matrix of (B.20), all u before all v."""
        first, mixed, second = self.blocks(normal, coupling, shear)
        return np.block([[first, mixed], [mixed.T, second]])

    def at_points(self, nodal: Array) -> Array:
        """Values (3, n_cells) of a P1 field at the interior points of each cell."""
        return np.asarray(INTERIOR_POINTS @ nodal[self.triangles])

    def divergence(self, u: Array) -> Array:
        """Div of the P1 field with nodal values u (2, N), (n_cells,)."""
        return np.einsum("kan,kan->n", self.gradients, u[:, self.triangles])


def lumpy(xi: Array) -> Array:
    """Return a concentration without any symmetry."""
    return np.asarray(1 + 0.3 * xi[0] * xi[1] + 0.1 * xi[0])


@dataclass(frozen=True, eq=False)
class Step:
    """A second step of the implementation, from a state that is already deformed.

    Attributes
    ----------
    model, mesh, dt : what is solved.
    solver, balance : the implementation, loaded by name.
    old, new : the states at the step's two ends.
    """

    model: Model
    mesh: Mesh
    dt: float
    solver: Solver
    balance: Any
    old: State
    new: State

    @property
    def before(self) -> Triangles:
        """P1 elements on the old configuration."""
        return Triangles(self.old.x, self.mesh.triangles)

    @property
    def after(self) -> Triangles:
        """P1 elements on the new configuration."""
        return Triangles(self.new.x, self.mesh.triangles)

    def displacements(self) -> tuple[Array, Array]:
        """U of (B.23a) at the step's two ends, (2 N,) each."""
        return (self.old.x - self.mesh.xi).ravel(), (self.new.x - self.mesh.xi).ravel()

    def velocity(self) -> Array:
        """The implementation's solution of (B.21) on the old configuration, (2 N,)."""
        v = self.balance.velocity(self.old.t, self.old.x, self.old.a[self.mesh.triangles])
        return np.asarray(v).ravel()

    def viscosity(self) -> Array:
        """A of (B.20) on the old configuration, from D11, D12, D33 of (B.2)."""
        p = self.model.parameters
        return self.before.network(p.mu1 + p.mu2, p.mu2, p.mu1 / 2)

    def elasticity(self) -> Array:
        """B of (B.20) on the old configuration, from C11, C12, C33 of (B.2) in units of (3.1)."""
        p = self.model.parameters
        return self.before.network(1 + p.nu_prime, p.nu_prime, 0.5)

    def force(self) -> Array:
        """F of (B.20) on the old configuration, (2 N,)."""
        grid, model, a, u = self.before, self.model, self.old.a, self.balance.displacement(self.old.x)
        phi = grid.divergence(u)
        f = model.active_stress(grid.at_points(a), phi, model.delta_on_cells(self.mesh.centroids)).mean(
            axis=0
        )
        inside = np.array([-grid.summed(f * grid.areas * g) for g in grid.gradients])
        return np.asarray(inside + self._rim_force(phi)).ravel()

    def _rim_force(self, phi: Array) -> Array:
        """The integral of n f phi_j over the boundary, two Gauss points an edge, (2, N)."""
        x, a, (start, end) = self.old.x, self.old.a, self.mesh.rim
        owner = {
            (int(i), int(j)): cell
            for k in range(3)
            for cell, (i, j) in enumerate(self.mesh.triangles[[k, (k + 1) % 3]].T)
        }
        cells = [owner[int(i), int(j)] for i, j in zip(start, end, strict=True)]
        edge = x[:, end] - x[:, start]
        normal = np.array([edge[1], -edge[0]])  # of the edge's length
        force = np.zeros_like(x)
        for s in (0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12)):
            f = self.model.active_stress(
                (1 - s) * a[start] + s * a[end], phi[cells], self.model.delta_on_rim()
            )
            np.add.at(force.T, start, ((1 - s) * f * normal / 2).T)
            np.add.at(force.T, end, (s * f * normal / 2).T)
        return force

    def free(self, nodal: Array) -> Array:
        """Components of a nodal force (2 N,) along which the closure leaves nodes free."""
        both, rim = nodal.reshape(2, -1), self.mesh.rim_nodes
        inner = np.setdiff1d(np.arange(both.shape[1]), rim)
        along = (both[:, rim] * self.mesh.xi[:, rim]).sum(axis=0)
        return np.concatenate([both[:, inner].ravel(), along])

    def held(self, nodal: Array) -> Array:
        """Components of a nodal force (2 N,) across the rays, which the closure holds: (n_rim,)."""
        both, rim = nodal.reshape(2, -1), self.mesh.rim_nodes
        return np.asarray(both[1, rim] * self.mesh.xi[0, rim] - both[0, rim] * self.mesh.xi[1, rim])


def second_step(rheology: Rheology = Rheology.VISCOELASTIC, dt: float = 0.02) -> Step:
    """Return the second step of (B.23) at psi = 150, p = 0.4 on 145 nodes from a lumpy concentration."""
    model = Model(Parameters(150.0, 0.4), rheology, Closure.REFERENCE_NORMAL, Delta.RING)
    mesh = disk(3, model.parameters.l0)
    balance = load(FORCE_BALANCE)(model, mesh)
    problem = Problem(model, lumpy, np.zeros_like)
    solver: Solver = load(METHODS["fem-p1-paper"].solver)(problem, mesh, balance)
    old, _ = solver.step(solver.init(), dt)
    new, _ = solver.step(old, dt)
    return Step(model, mesh, dt, solver, balance, old, new)
