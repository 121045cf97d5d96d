"""The force balance (B.21) as a Mechanics: it takes a concentration and moves the nodes."""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.contract import NOTHING, Move
from actin_xcheck.core.errors import COMPLETED, Outcome
from actin_xcheck.core.linear import Operator, SymmetricSolver, bincount
from actin_xcheck.core.mesh import Indices, Mesh
from actin_xcheck.core.model import Array, Closure, Model, Rheology
from actin_xcheck.core.motion import Anchor
from actin_xcheck.core.preconditioner import Preconditioner
from fem.boundary import Constraint, FreeRim, free_motions, rigid_motions, settle
from fem.kernels import CellSample
from fem.space import CELLWISE, Space

PAIRS = ((0, 1), (1, 2), (2, 0))
"""Local nodes of a cell's edges."""


@dataclass(frozen=True, eq=False)
class _System:
    """A + dt B (2N, 2N), F - B u (2N,) and the smallest dilation of each cell (n_cells,).

    `moduli` are those of A + dt B, whose entries are summed when they are asked for.
    """

    balance: "ForceBalance"
    x: Array
    moduli: tuple[float, float]
    load: Array
    dilation: Array

    @cached_property
    def matrix(self) -> sp.csr_matrix:
        """A + dt B."""
        return self.balance.matrix(self.x, self.moduli)

    def forces(self, v: Array) -> Array:
        """A + dt B times a velocity, both (2, N), without what the closure and the gauge make of it."""
        space = self.balance.space
        if space.order < CELLWISE:
            return _nodal(self.matrix @ v.T.ravel())
        sample = space.gradients.at(self.x)
        strain, dilation = sample.strain(v)
        return _nodal(
            space.vectors.vector(sample.stress_load(self.moduli[1] * dilation, self.moduli[0] * strain))
        )


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
    order : k of the elements P_k.
    space : of that order, where nodes are not where `Space.on` puts them.
    """

    def __init__(self, model: Model, mesh: Mesh, order: int = 1, space: Space | None = None) -> None:
        self.model = model
        self.mesh = mesh
        self.space = space or Space.on(mesh, order, model.parameters.l0)
        ring = model.parameters.l0
        self.delta = model.delta_on_cells(self.space.farthest(ring) if mesh.layered else mesh.centroids)
        self.constraint = Constraint(model.closure, self.space)
        # friction on a wall couples rim nodes beyond what the cells' gradients do
        by_edges = order == 1 and model.closure is not Closure.IRROTATIONAL_WALL
        self._network = Network(self.space) if by_edges else None
        free = self.constraint.pattern
        self._solver = SymmetricSolver(free.rows, free.columns, self.constraint.parts)
        self._anchor = Anchor(self.space.xi)
        self.free_rim = FreeRim(model, self.space) if model.rim_sees_dilation else None

    def start(self, x: Array) -> Array:
        """Initial positions (2, N), with the rim where the closure wants it."""
        return self.settle(x)

    def near(self, anchor: Anchor) -> Self:
        """Return the same, its systems preconditioned at an anchor instead of on the reference disk."""
        other = copy(self)
        other._anchor = anchor
        return other

    def advance(self, t: float, dt: float, x: Array, corners: Array, about: Array | None = None) -> Move:
        """Move the nodes from x (2, N) at t by one step of (B.23a) under corner values (3, n_cells)."""
        system = self.assemble(x, corners, dt)
        outcome = self.model.dilated(t, system.dilation, self._place)
        if not outcome.ok:
            return Move(x, np.zeros_like(x), outcome)
        v, gauge, outcome = self._rates(x, system, about)
        return Move(self.settle(x + dt * v), v, outcome, gauge.force, gauge.torque)

    def velocity(self, t: float, x: Array, corners: Array) -> Array:
        """Return the instantaneous velocities of A v = F - B u (B.21), (2, N)."""
        return self.flow(t, x, corners).v

    def carried(self, u0: Callable[[Array], Array]) -> Array:
        """F N on a free rim whose load sees the dilation, (2, q, e); see `rim.py`."""
        return NOTHING if self.free_rim is None else self.free_rim.start(u0)

    def flow(
        self, t: float, x: Array, corners: Array, carried: Array = NOTHING, about: Array | None = None
    ) -> Move:
        """Return the same as a Move that leaves the nodes at x, with its Outcome and the gauge's loads.

        Without what is carried the rim's load takes the trace of the dilation.  Velocities that are about
        those, (2, N), make it fast.
        """
        rim = self.free_rim if carried.size else None
        dilation = None if rim is None else rim.dilation(x, carried)
        system = self.assemble(x, corners, 0.0, dilation)
        outcome = self.model.dilated(t, system.dilation, self._place)
        if not outcome.ok:
            return Move(x, np.zeros_like(x), outcome)
        v, gauge, outcome = self._rates(x, system, about)
        rate = NOTHING
        if rim is not None and dilation is not None:
            a = self.space.on_rim.blend(corners[:, self.space.rim_cells])
            forces = system.forces(v) - _nodal(gauge.load)
            rate = rim.rate(x, v, carried, self._jump(a, dilation), forces)
        return Move(x, v, outcome, gauge.force, gauge.torque, rate)

    def _jump(self, a: Array, dilation: Array) -> Array:
        """What f jumps by on the rim, from inside to what its load takes, (q, e)."""
        inside, model = self.delta[self.space.rim_cells], self.model
        beyond = model.active_stress(a, dilation, model.delta_on_rim())
        return beyond - model.active_stress(a, dilation, inside)

    def settle(self, x: Array) -> Array:
        """Put rim nodes back onto the wall of `irrotational-wall`."""
        return settle(self.model.closure, self.space, x)

    def displacement(self, x: Array) -> Array:
        """The displacement the elastic stress and the dilation see (Remark 2.1), (2, N)."""
        return x - self.space.xi if self.model.rheology is Rheology.VISCOELASTIC else np.zeros_like(x)

    def intact(self, t: float, x: Array, carried: Array = NOTHING) -> Outcome:
        """Whether the pressure exists where a step has led, at x (2, N) with what is carried."""
        if not self.model.breaks_down:
            return COMPLETED
        u, rim = self.displacement(x), self.free_rim if carried.size else None
        _, dilation = self.space.inside.at(x).strain(u)
        on_rim = self.space.on_rim.at(x).strain(u)[1] if rim is None else rim.dilation(x, carried)
        return self.model.dilated(t, self._least(dilation, on_rim), self._place)

    def _least(self, inside: Array, on_rim: Array) -> Array:
        """The smallest value in each cell (n_cells,) of those at its points (q, e) and at the rim's."""
        least: Array = inside.min(axis=0)
        cells = self.space.rim_cells
        least[cells] = np.minimum(least[cells], on_rim.min(axis=0))
        return least

    def _rates(self, x: Array, system: _System, about: Array | None = None) -> tuple[Array, _Gauge, Outcome]:
        gauge = self._balanced(x, system.load)
        constraint, weights = self.constraint, self.constraint.weights(x)
        reduced: sp.csr_matrix | Operator
        if self.space.order >= CELLWISE:
            reduced = CellNetwork(system, weights)
        else:
            reduced = constraint.reduce(weights, system.matrix)
        near = self._anchor.factor("force balance", lambda: self._factor(self._anchor.x))
        start = None
        if about is not None and self.model.closure is not Closure.TRACTION_FREE:  # whose v is not P q
            start = constraint.restrict(weights, about.T.ravel())
        q, outcome = self._solver.solve(reduced, constraint.restrict(weights, gauge.load), near, start)
        v = weights * q[constraint.unknown]
        if self.model.closure is Closure.TRACTION_FREE:
            v = self._without_rigid_motion(x, v)
        return _nodal(v), gauge, outcome

    def _factor(self, x: Array) -> Preconditioner | None:
        """Of A at x (2, N); dt B is small beside it."""
        matrix = self.matrix(x, self.model.viscous_moduli())
        return self._solver.preconditioner(self.constraint.reduce(self.constraint.weights(x), matrix))

    def assemble(self, x: Array, corners: Array, dt: float, rim_dilation: Array | None = None) -> _System:
        """Return A + dt B, F - B u and the dilation on the configuration x, unconstrained.

        The dilation at the rim's points (q, e) is the trace of the one inside where it is not known better.
        """
        inside, rim = self.space.inside, self.space.on_rim
        on_rim = rim.blend(corners[:, self.space.rim_cells])
        return self.system(x, inside.blend(corners), on_rim, dt, rim_dilation)

    def system(
        self, x: Array, a: Array, a_rim: Array, dt: float, rim_dilation: Array | None = None
    ) -> _System:
        """Return the same for concentrations at the points of the cells (q, e) and of the rim."""
        model, space, u = self.model, self.space, self.displacement(x)
        (mu1, mu2), (one, nu_prime) = model.viscous_moduli(), model.elastic_moduli()
        moduli = (mu1 + dt * one, mu2 + dt * nu_prime)
        inside, rim = space.inside.at(x), space.on_rim.at(x)
        strain, dilation = inside.strain(u)
        f = model.active_stress(a, dilation, self.delta)
        load = space.vectors.vector(-inside.stress_load(f + nu_prime * dilation, one * strain))
        if rim_dilation is None:
            _, rim_dilation = rim.strain(u)
        rim_load = rim.normal_load(model.active_stress(a_rim, rim_dilation, model.delta_on_rim()))
        if model.closure is Closure.IRROTATIONAL_WALL:
            rim_load -= one * np.einsum("aibje,jbe->aie", rim.friction(), u[:, space.on_rim.cells])
        load += space.rim_vectors.vector(rim_load)
        return _System(self, x, moduli, load, self._least(dilation, rim_dilation))

    def matrix(self, x: Array, moduli: tuple[float, float]) -> sp.csr_matrix:
        """The matrix (2 N, 2 N) of first eps(v) : eps(w) + second (div v)(div w), and the wall's friction."""
        if self._network is not None:
            return self._network.matrix(self.space.inside.at(x), moduli)
        entries = self.space.gradients.at(x).isotropic(moduli)
        if self.model.closure is Closure.IRROTATIONAL_WALL:
            # no cell has two rim edges
            entries[..., self.space.rim_cells] += moduli[0] * self.space.on_rim.at(x).friction()
        return self.space.vectors.matrix(entries)

    def _balanced(self, x: Array, load: Array) -> _Gauge:
        """Subtract the uniform force and the torque per area that leave no net load on a free cell."""
        if self.model.closure is not Closure.TRACTION_FREE:
            return _Gauge(load)
        rigid, weighted = self.rigid(x)
        net = rigid.T @ load
        multipliers = np.linalg.solve(rigid.T @ weighted, net)
        force_x, force_y, torque = (free_motions(self.space.symmetry) @ net).tolist()
        return _Gauge(load - weighted @ multipliers, (force_x, force_y), torque)

    def _without_rigid_motion(self, x: Array, v: Array) -> Array:
        """Remove the area-weighted mean translation and rotation of v (2N,)."""
        rigid, weighted = self.rigid(x)
        return v - rigid @ np.linalg.solve(rigid.T @ weighted, weighted.T @ v)

    def rigid(self, x: Array) -> tuple[Array, Array]:
        """Rigid motions and their area-weighted images M r, both (2N, 3); fewer on a sector."""
        space, inside = self.space, self.space.inside.at(x)
        weights = space.scalars.vector(inside.load(np.ones_like(inside.dx)))
        rigid = rigid_motions(x, x @ weights / weights.sum()) @ free_motions(space.symmetry)
        weighted = np.empty_like(rigid)
        for i, motion in enumerate(rigid.T):
            at_points = inside.rule.blend(motion.reshape(-1, 2).T[:, space.cells])
            weighted[:, i] = space.vectors.vector(inside.load(at_points).swapaxes(0, 1))
        return rigid, weighted

    def _place(self, cell: int) -> str:
        where = self.mesh.centroids[:, cell]
        return f"in the triangle that started at ({where[0]:.3f}, {where[1]:.3f})"


def _nodal(interleaved: Array) -> Array:
    """Vectors at the nodes (2, N) from unknowns (2 N,)."""
    return interleaved.reshape(-1, 2).T


class CellNetwork:
    """A + dt B in the free unknowns, applied cell by cell: forces of the stress that a velocity makes.

    Parameters
    ----------
    system : of a force balance.
    weights : what each component of a nodal vector takes of its free unknown, (2 N,).
    """

    def __init__(self, system: _System, weights: Array) -> None:
        self._system, self._weights = system, weights
        balance = system.balance
        space = balance.space
        self._unknown = balance.constraint.of_cells
        self._takes = weights[space.vectors.of_cells]
        self._tensor = space.gradients.at(system.x).elasticity(system.moduli)
        self._slopes = space.gradients.tables[1]
        slides = balance.model.closure is Closure.IRROTATIONAL_WALL
        self._friction = space.on_rim.at(system.x).friction() if slides else None

    def __matmul__(self, q: Array) -> Array:
        """Apply it to free unknowns (n_free,)."""
        local = q[self._unknown] * self._takes
        flux = np.einsum("mnp,np->mp", self._tensor, (self._slopes @ local).reshape(4, -1))
        forces = self._slopes.T @ flux.reshape(2, -1, local.shape[2])
        if self._friction is not None:
            at = self._system.balance.space.rim_cells
            on_rim = np.einsum("aibje,jbe->iae", self._friction, local[..., at])
            forces[..., at] += self._system.moduli[0] * on_rim
        return bincount(self._unknown.ravel(), (forces * self._takes).ravel(), q.size)

    def assembled(self) -> sp.csr_matrix:
        """The matrix."""
        return self._system.balance.constraint.reduce(self._weights, self._system.matrix)


class Network:
    """`CellSample.isotropic` of a P1 space, with a third of the arithmetic.

    The gradients of a cell's basis functions sum to zero, and so do the rows of a matrix made of products of
    them: what couples the two ends of an edge is summed over its cells, and diagonal blocks follow.

    Parameters
    ----------
    space : of order 1.
    """

    def __init__(self, space: Space) -> None:
        self._pattern = space.vectors.pattern
        self._count = space.xi.shape[1]
        first, second = space.cells[np.array(PAIRS).T]
        keys = np.minimum(first, second) * self._count + np.maximum(first, second)
        found, edge = np.unique(keys, return_inverse=True)
        self._ends = np.array(np.divmod(found, self._count))
        # an edge couples (i at its lower end, j at its upper one); a pair that runs down is transposed
        i, j = np.arange(2)[:, None, None, None], np.arange(2)[:, None, None]
        component = np.where(first > second, 2 * j + i, 2 * i + j)
        self._edges: Indices = (component * found.size + edge.reshape(first.shape)).ravel()
        self._places = self._sources()

    def matrix(self, sample: CellSample, moduli: tuple[float, float]) -> sp.csr_matrix:
        """Return the matrix (2 N, 2 N) of first eps(v) : eps(w) + second (div v)(div w)."""
        shear, bulk = moduli[0] / 2, moduli[1]
        stretch = bulk + 2 * shear
        gradients = sample.gradients[:, :, 0]
        weighted = gradients * sample.dx.sum(axis=0)
        local = np.empty((2, 2, len(PAIRS), gradients.shape[-1]))
        for n, (a, b) in enumerate(PAIRS):
            (p, q), (r, s) = weighted[a], gradients[b]
            pr, ps, qr, qs = p * r, p * s, q * r, q * s
            local[0, 0, n] = stretch * pr + shear * qs
            local[1, 1, n] = stretch * qs + shear * pr
            local[0, 1, n] = bulk * ps + shear * qr
            local[1, 0, n] = bulk * qr + shear * ps
        coupled = bincount(self._edges, local.ravel(), 4 * self._ends.shape[1]).reshape(2, 2, -1)
        own = np.empty((2, 2, self._count))
        for i, j in ((0, 0), (0, 1), (1, 1)):
            own[i, j] = own[j, i] = -self._at_ends(coupled[i, j], coupled[j, i])
        return self._pattern.matrix(np.concatenate([coupled.ravel(), own.ravel()])[self._places])

    def _at_ends(self, lower: Array, upper: Array) -> Array:
        """Sum what edges give to their lower and to their upper ends, (N,)."""
        first, second = self._ends
        return bincount(first, lower, self._count) + bincount(second, upper, self._count)

    def _sources(self) -> Indices:
        """Where each entry of the pattern is among those of edges (i, j, edge), then of nodes (i, j, N)."""
        i, j = np.arange(2)[:, None, None], np.arange(2)[:, None]
        nodes = np.arange(self._count)
        rows = [2 * self._ends[0] + i + 0 * j, 2 * nodes + i + 0 * j]
        columns = [2 * self._ends[1] + j + 0 * i, 2 * nodes + j + 0 * i]
        row, column = (np.concatenate([part.ravel() for part in parts]) for parts in (rows, columns))
        mirrored = slice(4 * self._ends.shape[1])
        keys = np.concatenate([row * 2 * self._count + column, (column * 2 * self._count + row)[mirrored]])
        sources = np.arange(row.size)
        return np.concatenate([sources, sources[mirrored]])[np.argsort(keys)]
