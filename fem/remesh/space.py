"""Spaces and the force balance on a triangulation whose sides are straight in the current configuration.

Pulled back to the reference disk, sides are curved as the deformation has curved them: straight sides there
would cut across thin cells, which is what well shaped ones in a sheared cell have started as.  How far cells
are from losing their shape is told before one turns over.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.errors import COMPLETED, Ending, Outcome
from actin_xcheck.core.mesh import ON_A_CIRCLE, Indices, Mesh
from actin_xcheck.core.model import Array, Model
from fem.element import lagrange
from fem.force_balance import ForceBalance
from fem.remesh.transfer import Reading
from fem.space import Space

SLIVER = 0.2
"""Shape of a cell below which the mesh is about to break.

An equilateral triangle has it when it is sheared by 2.8; on the article's meshes no cell starts below
0.5.
"""

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


def new_mesh(xi: Array, triangles: Indices) -> Mesh:
    """A mesh without layers; its h is that of the disk with as many cells."""
    return Mesh(xi, triangles, 2 / np.sqrt(triangles.shape[1]), layered=False)


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
        # a thin cell's corners may have their mean on the other side of the ring
        nodes = space.xi[:, space.cells]
        farthest = np.abs(np.hypot(*nodes) - model.parameters.l0).argmax(axis=0)
        self.delta = model.delta_on_cells(np.take_along_axis(nodes, farthest[None, None], axis=1)[:, 0])
