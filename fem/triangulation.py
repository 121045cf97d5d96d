"""Curved elements on a new triangulation: their spaces, and what is carried over to them.

A mesh's sides are straight in the current configuration.  Pulled back to the reference disk they are curved
as the deformation has curved them: straight sides there would cut across thin cells, which is what well
shaped ones in a sheared cell have started as.  How far cells are from losing their shape is told before one
turns over.  Fields are carried over by projection, their sums kept.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.errors import COMPLETED, Ending, Outcome
from actin_xcheck.core.lagrange import lagrange
from actin_xcheck.core.linear import solve
from actin_xcheck.core.mesh import ON_A_CIRCLE, Indices, Mesh
from actin_xcheck.core.model import Array, Model
from actin_xcheck.core.remesh import SLIVER, NoMesh, PresentCell, circle
from fem.fields import locate
from fem.force_balance import ForceBalance
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
