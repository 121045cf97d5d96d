"""Curved elements that go on where their mesh would fold, on a new triangulation of the reference disk.

A mesh's sides are straight in the current configuration.  Pulled back to the reference disk they are curved
as the deformation has curved them: straight sides there would cut across thin cells, which is what well
shaped ones in a sheared cell have started as.  How far cells are from losing their shape is told before one
turns over.  Fields are carried over by projection, their sums kept.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.contract import Frame, Grid, Memento
from actin_xcheck.core.errors import COMPLETED, Ending, Outcome
from actin_xcheck.core.lagrange import lagrange
from actin_xcheck.core.linear import solve
from actin_xcheck.core.mesh import ON_A_CIRCLE, Indices, Mesh
from actin_xcheck.core.model import Array, Model
from actin_xcheck.core.motion import Anchor
from actin_xcheck.core.remeshing import SLIVER, NoMesh, PresentCell, Remeshed, RemeshedState, circle, new_mesh
from fem.fields import Lattice, cell_means, locate, measure
from fem.force_balance import ForceBalance
from fem.imex import FemImex, ImexState
from fem.solver import TransportMatrices
from fem.space import Space

CHUNK = 4_000_000
"""Pairs of points and cells that are looked at together."""

NEAR = 1e-8
"""Distance at which a point is hit."""


@dataclass(frozen=True, eq=False)
class Reading:
    """Points in the cells of a space: what reads any of its fields there.

    Attributes
    ----------
    nodes : of the cell at each point, (n_local, q).
    values : the cell's basis functions there, (n_local, q).
    hit : whether the point is in a cell, or as near to one as `NEAR`, (q,).
    """

    nodes: Indices
    values: Array
    hit: NDArray[np.bool_]

    @classmethod
    def at(cls, space: Space, points: Array) -> Self:
        """Read at material points (2, q); one beyond the rim by the width of a chord's arc is read too."""
        size = max(CHUNK // space.cells.shape[1], 1)
        parts = [locate(space, points[:, i : i + size]) for i in range(0, points.shape[1], size)]
        nodes = np.hstack([space.cells[:, cells] for cells, _ in parts])
        values = np.hstack([found for _, found in parts])
        reached = np.einsum("aq,iaq->iq", values, space.xi[:, nodes])
        return cls(nodes, values, np.hypot(*(reached - points)) < NEAR)

    @classmethod
    def at_places(cls, space: Space, x: Array, places: Array) -> Self:
        """Read at places (2, q) where the nodes of the space are at x (2, N)."""
        return cls.at(replace(space, xi=x), places)

    def of(self, field: Array) -> Array:
        """Values (..., q) of a field (..., N)."""
        return np.einsum("aq,...aq->...q", self.values, field[..., self.nodes])


def projected(old: Space, new: Space, x: Array, a: Array, total: float) -> tuple[Array, Outcome]:
    """The concentration a of `old` on `new`, (N,): its L2 projection, in sum `total` to round-off.

    The integrals are those over the cells of `new`, as they lie now; a factor 1 + O(h^(k+1)) puts right what
    they lose of the sum.

    Parameters
    ----------
    old, new : spaces on the same disk.
    x : current node positions of `new`, (2, N).
    a : nodal values on `old`.
    total : of actin, to be kept.
    """
    rule = new.rule(2 * new.order + 1)
    sample = rule.at(x)
    points = rule.blend(new.xi[:, new.cells])
    density = Reading.at(old, points.reshape(2, -1)).of(a).reshape(points.shape[1:])
    mass = new.scalars.matrix(new.inside.at(x).mass())
    found, outcome = solve(mass, new.scalars.vector(sample.load(density)))
    return found * (total / (mass @ found).sum()), outcome


_TO_EQUILATERAL = np.array([[1, -1 / np.sqrt(3)], [0, 2 / np.sqrt(3)]])
"""Inverse of the map of the reference triangle to the equilateral one with sides of length 1."""


def shapes(space: Space, x: Array) -> Array:
    """Shape of each cell with nodes x (2, N), the worst of its quadrature points, (n_cells,).

    The mean ratio 2 det A / |A|^2 of the map A from an equilateral triangle: 1 where it is one, 0 where an
    angle, the area or one point of a curved cell has none left, negative where it has turned over (Knupp,
    SIAM J. Sci. Comput. 23, 2001).
    """
    tangent_map = space.inside.tangent_map(x)
    (a, b), (c, d) = np.einsum("ijqe,jk->ikqe", tangent_map, _TO_EQUILATERAL)
    ratio = 2 * (a * d - b * c) / (a**2 + b**2 + c**2 + d**2)
    worst: Array = (ratio * space.orientation).min(axis=0)
    return worst


def soundness(space: Space, t: float, x: Array) -> Outcome:
    """`tangled`, with the worst cell, where a mesh is about to fold; the cells are still valid then."""
    of_cells = shapes(space, x)
    worst = int(np.argmin(of_cells))
    if of_cells[worst] > SLIVER:
        return COMPLETED
    started, now = (nodes[:, space.cells[:3, worst]].mean(axis=1) for nodes in (space.xi, x))
    message = (
        f"the mesh is about to fold at t = {t:.6g}: the shape of the cell that started at "
        f"({started[0]:.3f}, {started[1]:.3f}), now at ({now[0]:.3f}, {now[1]:.3f}), has fallen to "
        f"{of_cells[worst]:.2g} of an equilateral triangle's; a run with --remesh would go on"
    )
    return Outcome(Ending.TANGLED, message)


def pulled_back(old: Space, x: Array, mesh: Mesh, ring: float) -> Space | None:
    """The space of `old`'s order on a new mesh; None where a node lies in none of the old cells.

    Sides on the ring and on the rim stay arcs of their circles, and their cells are curved towards them
    degree by degree (Lenoir, SIAM J. Numer. Anal. 23, 1986); all others are straight where `old` is at x.
    """
    space = Space.on(mesh, old.order, ring)
    if old.order == 1:
        return placed_space(mesh, 1, ring, space.xi)
    shares, cells = lagrange(old.order).nodes, space.cells
    now = Reading.at(old, space.xi).of(x)
    local = np.einsum("cn,ice->ine", shares, now[:, cells[:3]])
    kept = np.arange(space.xi.shape[1]) < mesh.xi.shape[1]
    arcs = _neighbours(mesh.xi, cells[:3], ring) | _neighbours(mesh.xi, cells[:3], 1.0)
    for i, curved in enumerate(arcs):
        j, across = (i + 1) % 3, (i + 2) % 3
        side = np.flatnonzero(np.isclose(shares[across], 0) & (shares[i] * shares[j] > 0))
        width = shares[i] + shares[j]
        s = shares[j] / np.where(width > 0, width, 1.0)
        bumps = np.array([s * (1 - s) * (2 * s - 1) ** (m - 2) for m in range(2, old.order + 1)])
        departure = (now[:, cells] - local)[:, side][..., curved]
        fading = bumps * width ** np.arange(2, old.order + 1)[:, None]
        fitted = np.einsum("sm,ise->ime", np.linalg.inv(bumps[:, side]), departure)
        local[..., curved] += np.einsum("mn,ime->ine", fading, fitted)
        kept[cells[np.ix_(side, curved)]] = True
    places = np.empty_like(space.xi)
    places[:, cells] = local
    found = Reading.at_places(old, x, places[:, ~kept])
    if not found.hit.all():
        return None
    xi = space.xi.copy()
    xi[:, ~kept] = found.of(old.xi)
    return placed_space(mesh, old.order, ring, xi)


def placed_space(mesh: Mesh, order: int, ring: float, xi: Array) -> Space:
    """The space of order k on a mesh, its nodes at xi (2, N)."""
    # which way a thin curved cell runs is not told by its corners at rest, but by their order
    smallest, next_one = mesh.triangles.argmin(axis=0), np.sort(mesh.triangles, axis=0)[1]
    successor = np.take_along_axis(mesh.triangles, (smallest[None] + 1) % 3, axis=0)[0]
    orientation = np.where((successor == next_one) | (order < 3), 1.0, -1.0)
    return replace(Space.on(mesh, order, ring), xi=xi, orientation=orientation)


def _neighbours(xi: Array, triangles: Indices, radius: float) -> NDArray[np.bool_]:
    """Which sides join neighbours on a circle, (3, n_cells): side i runs from corner i to corner i + 1."""
    nodes = np.flatnonzero(np.abs(np.hypot(*xi) - radius) < ON_A_CIRCLE)
    place = np.full(xi.shape[1], -1)
    place[nodes[np.argsort(np.arctan2(xi[1, nodes], xi[0, nodes]))]] = np.arange(nodes.size)
    start, end = place[triangles], np.roll(place[triangles], -1, axis=0)
    apart = np.remainder(end - start, nodes.size)
    found: NDArray[np.bool_] = (start >= 0) & (end >= 0) & ((apart == 1) | (apart == nodes.size - 1))
    return found


class Rebalanced(ForceBalance):
    """The force balance on a given space."""

    def __init__(self, model: Model, mesh: Mesh, space: Space) -> None:
        super().__init__(model, mesh, space.order, space)
        self.delta = model.delta_on_cells(space.farthest(model.parameters.l0))

    def carried_from(self, other: object, carried: Array) -> Array:
        """What another mesh's force balance carries, on this one."""
        if not isinstance(other, ForceBalance) or self.free_rim is None or other.free_rim is None:
            return carried
        return self.free_rim.read(other.free_rim, carried)


def remeshed(space: Space, x: Array, ring: float, edge: float) -> tuple[Mesh, Space]:
    """Return a mesh of the reference disk and a space whose cells are well shaped where `space` is at x.

    Parameters
    ----------
    space : of a disk.
    x : node positions, (2, N).
    ring, edge : see `Cell`.

    Raises NoMesh where no such mesh is found.
    """

    def pulled_back_points(places: Array) -> tuple[Array, NDArray[np.bool_]]:
        found = Reading.at_places(space, x, places)
        return found.of(space.xi), found.hit

    cell = PresentCell(
        ring,
        lambda radius, angles: Reading.at(space, circle(radius, angles)).of(x),
        pulled_back_points,
        lambda mesh, _: (mesh, _sound(space, x, mesh, ring)),
    )
    return cell.remeshed(edge, space.rim_nodes.size)


def _sound(old: Space, x: Array, mesh: Mesh, ring: float) -> Space:
    """Return the space on a mesh; raises NoMesh where its cells are not sound, at rest or now."""
    new = pulled_back(old, x, mesh, ring)
    if new is None:
        raise NoMesh("a side leaves the cell")
    if (at_rest := shapes(new, new.xi).min()) <= 0:
        raise NoMesh(f"a cell of the reference disk is turned over (shape {at_rest:.2g})")
    if (moved := shapes(new, Reading.at(old, new.xi).of(x)).min()) <= 1.5 * SLIVER:
        raise NoMesh(f"a cell has the shape {moved:.2g}")
    return new


@dataclass(frozen=True, eq=False)
class FemPart:
    """A solver on one mesh, and what reads its fields at the nodes that are stored.

    Attributes
    ----------
    solver : on the mesh.
    shown : the space whose nodes are stored.
    """

    solver: FemImex
    shown: Space

    @cached_property
    def reading(self) -> Reading:
        """At the nodes of the space that is shown, (N,)."""
        return Reading.at(self.solver.space, self.shown.xi)

    @property
    def placed(self) -> Memento:
        """The mesh and the space's nodes."""
        mesh, space = self.solver.mesh, self.solver.space
        return {"mesh_xi": mesh.xi, "triangles": mesh.triangles, "xi": space.xi}

    def worst(self, x: Array) -> float:
        """The worst shape of a cell with nodes at x (2, N)."""
        return float(shapes(self.solver.space, x).min())


class Remeshing(Remeshed[FemPart]):
    """A `FemImex` whose mesh is replaced; x and v are interpolated, a is projected."""

    def __init__(self, first: FemImex, build: Callable[[Mesh, ForceBalance], FemImex]) -> None:
        super().__init__(first, build)
        self._shown = first.space
        self._lattice = Lattice(self._shown, first.mesh.triangles)

    @property
    def grid(self) -> Grid:
        """That of the first mesh."""
        return self._lattice.grid

    @cached_property
    def area_at_rest(self) -> float:
        """That of the first mesh's curved cells."""
        shown = self._shown
        return measure(shown, shown.xi, np.ones(shown.xi.shape[1])).area

    def started(self) -> FemPart:
        """The part on the first mesh."""
        return FemPart(self.first, self._shown)

    def again(self, memento: Memento) -> FemPart:
        """The part on the mesh that a memento has."""
        mesh = new_mesh(memento["mesh_xi"], memento["triangles"])
        model, order = self.first.problem.model, self._shown.order
        space = placed_space(mesh, order, model.parameters.l0, memento["xi"])
        return FemPart(self.build(mesh, Rebalanced(model, mesh, space)), self._shown)

    def corners(self, state: RemeshedState) -> Array:
        """Values (3, n_cells) at the corners of the first mesh's cells."""
        part, inner = self.parts(state)
        return part.reading.of(inner.a)[self.mesh.triangles]

    def frame(self, state: RemeshedState) -> Frame:
        """The polynomials of the moment at the nodes of the grid."""
        part, inner = self.parts(state)
        read = [part.reading.of(nodal) for nodal in (inner.x, inner.v, inner.a)]
        means = cell_means(self._shown, read[0], read[2])
        x, v, a = (self._lattice.moved(nodal) for nodal in read)
        return Frame(x, v, a, means)

    def carried_over(
        self, part: FemPart, inner: ImexState, edge: float
    ) -> tuple[FemPart, ImexState, Outcome]:
        """A new part and the same moment on it; NoMesh where there is none."""
        model, old = self.first.problem.model, part.solver.space
        mesh, space = remeshed(old, inner.x, model.parameters.l0, edge)
        balance = Rebalanced(model, mesh, space)
        solver = self.build(mesh, balance)
        reading = Reading.at(old, space.xi)
        x, v = solver.mechanics.settle(reading.of(inner.x)), reading.of(inner.v)
        a, outcome = projected(old, space, x, inner.a, part.solver.measure(inner).total_actin)
        content = TransportMatrices(space, x).mass @ a
        carried = balance.carried_from(part.solver.mechanics, inner.carried)
        new = replace(inner, x=x, a=a, v=v, carried=carried, content=content, anchor=Anchor(x))
        return FemPart(solver, self._shown), new, outcome
