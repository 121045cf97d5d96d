"""The force balance (B.21) as a Mechanics: it takes a concentration and moves the nodes."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from skfem.helpers import div

from actin_xcheck.geometry import Mesh
from actin_xcheck.linear import solve
from actin_xcheck.model import Array, Closure, Model, Rheology
from actin_xcheck.observables import centroid
from actin_xcheck.result import COMPLETED, Ending, Outcome
from actin_xcheck.solver import Move
from fem import forms
from fem.boundary import prolongation, rigid_motions, settle
from fem.mesh import Bases, interleave, separate


@dataclass(frozen=True)
class _System:
    """A + dt B (2N, 2N), F - B u (2N,) and the smallest dilation of each cell (n_cells,)."""

    matrix: sp.csr_matrix
    load: Array
    dilation: Array


@dataclass(frozen=True)
class _Gauge:
    """The loads that balance a traction-free cell: total force (2,) and torque, and the balanced load."""

    load: Array
    force: tuple[float, float] = (0.0, 0.0)
    torque: float = 0.0


class ForceBalance:
    """(A + dt B) dU = dt (F - B U): (B.23a) for the increment, on the current configuration.

    Parameters
    ----------
    model : constitutive laws, rheology, closure and delta.
    mesh : the reference mesh; displacements are u = x - xi.
    """

    def __init__(self, model: Model, mesh: Mesh) -> None:
        self.model = model
        self.mesh = mesh
        self.bases = Bases.on(mesh)
        self.delta = model.delta_on_cells(mesh.centroids)

    def start(self, x: Array) -> Array:
        """Initial positions (2, N), with the rim where the closure wants it."""
        return settle(self.model.closure, self.mesh, x)

    def advance(self, t: float, dt: float, x: Array, corners: Array) -> Move:
        """Move the nodes from x (2, N) at t by one step of (B.23a) under corner values (3, n_cells)."""
        system = self.assemble(x, corners, dt)
        outcome = self._dilation_outcome(t, system.dilation)
        if not outcome.ok:
            return Move(x, np.zeros_like(x), outcome)
        v, gauge, outcome = self._rates(x, system)
        settled = settle(self.model.closure, self.mesh, x + dt * v)
        return Move(settled, v, outcome, gauge.force, gauge.torque)

    def velocity(self, t: float, x: Array, corners: Array) -> Array:
        """Return the instantaneous velocities of A v = F - B u (B.21), (2, N)."""
        return self._rates(x, self.assemble(x, corners, 0.0))[0]

    def displacement(self, x: Array) -> Array:
        """The displacement the elastic stress and the dilation see (Remark 2.1), (2, N)."""
        return x - self.mesh.xi if self.model.rheology is Rheology.VISCOELASTIC else np.zeros_like(x)

    def _rates(self, x: Array, system: _System) -> tuple[Array, _Gauge, Outcome]:
        gauge = self._balanced(x, system.load)
        free = prolongation(self.model.closure, self.mesh, x)
        q, outcome = solve(free.T @ system.matrix @ free, free.T @ gauge.load)
        v = free @ q
        if self.model.closure is Closure.TRACTION_FREE:
            v = self._without_rigid_motion(x, v)
        return separate(v), gauge, outcome

    def assemble(self, x: Array, corners: Array, dt: float) -> _System:
        """Return A + dt B, F - B u and the dilation on the configuration x, unconstrained."""
        model, u = self.model, interleave(self.displacement(x))
        matrix = forms.network(model, dt).assemble(self.bases.vector.at(x))
        inside, rim = self.bases.vector_load.at(x), self.bases.rim.at(x)
        a_inside, a_rim = (
            np.asarray(basis.interpolate(corners.T.ravel()))
            for basis in (self.bases.corners_load, self.bases.corners_rim)
        )
        u_inside, u_rim = inside.interpolate(u), rim.interpolate(u)
        f_inside = model.active_stress(a_inside, div(u_inside), self.delta[:, None])
        f_rim = model.active_stress(a_rim, div(u_rim), model.delta_on_rim())
        load = forms.active_load(model).assemble(inside, f=f_inside, u=u_inside)
        load += forms.rim_load.assemble(rim, f=f_rim)
        if model.closure is Closure.IRROTATIONAL_WALL:
            (mu1, _), (one, _) = model.viscous_moduli(), model.elastic_moduli()
            matrix = matrix + forms.slip_friction(mu1 + dt * one).assemble(rim)
            load -= forms.slip_friction(one).assemble(rim) @ u
        return _System(matrix, load, div(u_inside).min(axis=1))

    def _balanced(self, x: Array, load: Array) -> _Gauge:
        """Subtract the uniform force and the torque per area that leave no net load on a free cell."""
        if self.model.closure is not Closure.TRACTION_FREE:
            return _Gauge(load)
        rigid, weighted = self.rigid(x)
        net = rigid.T @ load
        multipliers = np.linalg.solve(rigid.T @ weighted, net)
        return _Gauge(load - weighted @ multipliers, (float(net[0]), float(net[1])), float(net[2]))

    def _without_rigid_motion(self, x: Array, v: Array) -> Array:
        """Remove the area-weighted mean translation and rotation of v (2N,)."""
        rigid, weighted = self.rigid(x)
        return v - rigid @ np.linalg.solve(rigid.T @ weighted, weighted.T @ v)

    def rigid(self, x: Array) -> tuple[Array, Array]:
        """Rigid motions and their area-weighted images M r, both (2N, 3)."""
        rigid = rigid_motions(x, centroid(x, self.mesh.triangles))
        mass = forms.mass.assemble(self.bases.scalar.at(x))
        return rigid, sp.kron(mass, sp.identity(2), format="csr") @ rigid

    def _dilation_outcome(self, t: float, dilation: Array) -> Outcome:
        """1 + phi <= 0 is where the pressure (2.5) ends; phi = 2 - tr F^-1 with F = dx/dxi."""
        worst = int(np.argmin(dilation))
        if self.model.parameters.p == 0 or 1 + dilation[worst] > 0:
            return COMPLETED
        where = self.mesh.centroids[:, worst]
        message = (
            f"1 + phi = {1 + dilation[worst]:.3g} at t = {t:.6g} in the triangle that started at "
            f"({where[0]:.3f}, {where[1]:.3f}): the pressure (2.5) is singular there"
        )
        return Outcome(Ending.SINGULAR_DILATION, message)
