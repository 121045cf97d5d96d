"""One small cell on its way: what the rows on the scheme look at, and the article's force vector by hand."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from actin_xcheck.core.contract import Problem, Solver, State
from actin_xcheck.core.mesh import Mesh, disk
from actin_xcheck.core.model import Array, Closure, Delta, Model, Rheology
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.runs.method import FORCE_BALANCE, METHODS, load
from actin_xcheck.studies.audit.theory.measures import Triangles


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


def relative(residual: Array, scale: Array) -> float:
    """Largest entry of a residual over the largest entry of what it is made of."""
    return float(np.abs(residual).max() / np.abs(scale).max())
