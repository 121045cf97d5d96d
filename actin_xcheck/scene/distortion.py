"""The disk's mesh made worse on purpose: perturbed, stretched, flattened, and off the ring.

All of it is the triangulation's: the disk, its rim nodes on the unit circle and the physics stay as they are.
The meshes returned are without layers, as a user's are: their sides are straight but for the rim and the
ring.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.mesh import Indices, Mesh, disk, signed_areas
from actin_xcheck.core.model import Array

LEAST_AREA = 0.05
"""Of its area, the part that a random perturbation leaves every cell."""

SLIVERS = 0.1
"""Part of the inner nodes that `flattened` moves, as far as they have room."""


def without_layers(mesh: Mesh) -> Mesh:
    """Return the same nodes and cells as a mesh of unknown origin."""
    return replace(mesh, layered=False)


def perturbed(mesh: Mesh, amount: float, ring: float, seed: int = 0) -> Mesh:
    """Return a disk's mesh with its inner nodes moved at random, by `amount` of the shortest side at each.

    Where a cell would lose more than its due (`LEAST_AREA`), the moves of its corners are halved until it
    does not.

    Parameters
    ----------
    mesh : of a disk.
    amount : 0 to 1.
    ring : nodes on this radius stay, and so do those on the rim.
    seed : of the directions.
    """
    rng = np.random.default_rng(seed)
    count, shortest = mesh.xi.shape[1], np.full(mesh.xi.shape[1], np.inf)
    corners = mesh.xi[:, mesh.triangles]
    sides = np.hypot(*(corners - np.roll(corners, 1, axis=1)))  # side c ends at corner c
    for at in (mesh.triangles, np.roll(mesh.triangles, 1, axis=0)):
        np.minimum.at(shortest, at.ravel(), sides.ravel())
    angle = rng.uniform(0, 2 * np.pi, count)
    moves = amount * shortest * np.array([np.cos(angle), np.sin(angle)])
    moves[:, _fixed(mesh, ring)] = 0.0
    before = signed_areas(mesh.xi, mesh.triangles)
    while (bad := signed_areas(mesh.xi + moves, mesh.triangles) < LEAST_AREA * before).any():
        moves[:, np.unique(mesh.triangles[:, bad])] /= 2
    return replace(mesh, xi=mesh.xi + moves, layered=False)


def stretched(mesh: Mesh, closer: float) -> Mesh:
    """Return a disk's mesh with half of its rays drawn together about the y axis: cells there are needles.

    Angles from the axis up to 45 degrees are divided by `closer`, which gives aspects of 0.55 of it; what
    room that leaves the other rays share.  Layers stay the circles they were.
    """
    x, y = mesh.xi
    sign = np.where(y >= 0, 1.0, -1.0)
    phi = np.arctan2(x, sign * y)  # from the nearer half of the axis, in [-pi/2, pi/2]
    knots = np.pi / 4 * np.array([-2, -1, 0, 1, 2])
    phi = np.interp(phi, knots, knots * np.array([1, 1 / closer, 0, 1 / closer, 1]))
    return replace(mesh, xi=np.hypot(x, y) * np.array([np.sin(phi), sign * np.cos(phi)]), layered=False)


def flattened(mesh: Mesh, height: float, ring: float, seed: int = 0) -> Mesh:
    """Return a disk's mesh with slivers: nodes moved towards the middle of an opposite side.

    About a tenth of the inner nodes, no two of one cell, are moved until one of the cells at each has the
    part `height` of its height left, so that the angle there nears 180 degrees.  A node at which another cell
    would lose more than that stays.  No sliver has a side on the rim or the ring, whose arc might cross it.

    Parameters
    ----------
    mesh : of a disk.
    height : in (0, 1].
    ring : nodes on this radius stay, and so do those on the rim.
    seed : of the choice.
    """
    rng, fixed = np.random.default_rng(seed), _fixed(mesh, ring)
    xi, inner = mesh.xi.copy(), np.flatnonzero(~fixed)
    around: list[list[int]] = [[] for _ in range(mesh.xi.shape[1])]
    for cell, nodes in enumerate(mesh.triangles.T.tolist()):
        for node in nodes:
            around[node].append(cell)
    areas, taken, moved = signed_areas(xi, mesh.triangles), np.zeros(xi.shape[1], dtype=bool), 0
    for node in rng.permutation(inner).tolist():
        star = mesh.triangles[:, around[node]]
        target = star[:, rng.integers(star.shape[1])]
        if taken[star].any() or fixed[target].sum() > 1:
            continue
        trial = xi.copy()
        trial[:, node] = height * xi[:, node] + (1 - height) * xi[:, target[target != node]].mean(axis=1)
        left = signed_areas(trial, star) / areas[around[node]]
        if left.min() >= height * (1 - 1e-9):
            xi, moved = trial, moved + 1
            taken[star] = True
        if moved >= SLIVERS * inner.size:
            break
    return replace(mesh, xi=xi, layered=False)


def off_ring(refine: int, l0: float, offset: float) -> Mesh:
    """Return a disk's mesh whose layer nearest to the ring lies `offset` widths of a layer outside of it."""
    return without_layers(disk(refine, l0 + offset * 2.0**-refine))


def aspects(xi: Array, triangles: Indices) -> Array:
    """Of each cell the longest side over its height above it, 1 where it is equilateral, (n_cells,)."""
    corners = xi[:, triangles]
    longest = np.hypot(*(corners - np.roll(corners, 1, axis=1))).max(axis=0)
    ratio: Array = np.sqrt(3) / 4 * longest**2 / signed_areas(xi, triangles)
    return ratio


def largest_angle(xi: Array, triangles: Indices) -> float:
    """Largest angle of all cells, degrees."""
    corners = xi[:, triangles]
    one, other = np.roll(corners, 1, axis=1) - corners, np.roll(corners, -1, axis=1) - corners
    cross = np.abs(one[0] * other[1] - one[1] * other[0])
    return float(np.rad2deg(np.arctan2(cross, (one * other).sum(axis=0))).max())


def _fixed(mesh: Mesh, ring: float) -> NDArray[np.bool_]:
    """Which nodes stay where they are, (N,): those of the rim and those on the ring."""
    fixed: NDArray[np.bool_] = np.abs(np.hypot(*mesh.xi) - ring) < 1e-9
    fixed[mesh.rim_nodes] = True
    return fixed
