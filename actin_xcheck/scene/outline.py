"""Meshes that are not the disk's own: a user's cell outline, and the disk's mesh made worse on purpose.

An outline is the reference configuration: the nodes of its triangulation are the material points, its
boundary loop is the rim, and `reference-normal` keeps rim points to the normals of this outline.  Lengths
are in units of the cell's radius and the origin lies inside, for scenes and the ring |xi| = l0 are stated
about it.

What is made worse (perturbed, stretched, flattened, off the ring) is the triangulation: the disk, its rim
nodes on the unit circle and the physics stay.  Its sides are straight, as a user's are, but for the rim and
the ring.
"""

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.mesh import ON_A_CIRCLE, Indices, Mesh, arcs, disk, nearest_in_polygon, signed_areas
from actin_xcheck.core.model import Array, Closure, Delta
from actin_xcheck.scene.mesh_file import MOST_CELLS, read_triangulation
from actin_xcheck.scene.scene import Scene

SHARP = 30.0
"""Degrees by which an outline turns at a corner; those of a smooth one fall with h."""


def read_mesh(path: Path) -> Mesh:
    """Return the mesh in a file; cells are counter-clockwise, nodes that no cell uses are left out.

    UserError, one line, where the file is not a conforming triangulation of one simply connected cell about
    the origin.
    """
    xi, triangles = read_triangulation(path)
    width = 2 * np.sqrt(
        signed_areas(xi, triangles).sum() / (np.pi * triangles.shape[1])
    )  # of `disk`'s layers
    digest = hashlib.sha256(xi.tobytes() + triangles.tobytes()).hexdigest()  # a file may refer to others
    mesh = Mesh(xi, triangles, float(width), layered=False, origin=f"{path.name} sha256:{digest}")
    if not nearest_in_polygon(mesh, np.zeros(2))[0]:
        raise UserError(
            f"--mesh: {path}: the origin is outside of its outline; valid: a cell about the origin, where "
            "scenes and the ring are stated"
        )
    return mesh


def write_mesh(path: Path, mesh: Mesh) -> None:
    """Write a mesh for `read_mesh`, in the format that the suffix names."""
    import meshio

    xi = np.vstack([mesh.xi, np.zeros(mesh.xi.shape[1])])
    meshio.Mesh(xi.T, [("triangle", mesh.triangles.T)]).write(path)


def refined(mesh: Mesh, ring: float, times: int) -> Mesh:
    """Return a mesh with its cells divided into four, so many times; new nodes of `arcs` lie on them.

    UserError where that gives more cells than are affordable.
    """
    if (cells := mesh.triangles.shape[1] * 4**times) > MOST_CELLS:
        raise UserError(f"--refine: {times} divides the mesh into {cells} cells; valid: up to {MOST_CELLS}")
    for _ in range(times):
        mesh = _refined(mesh, ring)
    return mesh


@dataclass(frozen=True)
class Fit:
    """What a mesh is to a scene.

    Attributes
    ----------
    crossed : cells that lie on both sides of the ring.
    circular : whether the rim's nodes are on the unit circle.
    doubled : whether a cell has two sides on the rim.
    turn : largest angle between neighbouring sides of the rim, degrees.
    """

    crossed: int
    circular: bool
    doubled: bool
    turn: float

    @classmethod
    def of(cls, mesh: Mesh, ring: float) -> "Fit":
        """Measure a mesh against the ring |xi| = `ring`."""
        beyond = np.hypot(*mesh.xi[:, mesh.triangles]) - ring
        crossed = (beyond > ON_A_CIRCLE).any(axis=0) & (beyond < -ON_A_CIRCLE).any(axis=0)
        circular = np.abs(np.hypot(*mesh.xi[:, mesh.rim_nodes]) - 1).max() < ON_A_CIRCLE
        start, end = mesh.triangles, np.roll(mesh.triangles, -1, axis=0)
        keys = np.minimum(start, end) * mesh.xi.shape[1] + np.maximum(start, end)
        _, number, cells = np.unique(keys, return_inverse=True, return_counts=True)
        on_rim = (cells == 1)[number.reshape(keys.shape)]
        side = mesh.xi[:, mesh.rim[1]] - mesh.xi[:, mesh.rim[0]]
        after = np.roll(side, -1, axis=1)
        turn = np.arctan2(side[0] * after[1] - side[1] * after[0], (side * after).sum(axis=0))
        doubled = bool(on_rim.sum(axis=0).max() > 1)
        return cls(int(crossed.sum()), bool(circular), doubled, float(np.rad2deg(np.abs(turn).max())))


def caveats(scene: Scene, mesh: Mesh) -> list[str]:
    """Return what a user must know before believing a scene's run on a mesh, a sentence each.

    Raises
    ------
    UserError : the scene is stated on the unit circle and the mesh is not, or its probes are outside.
    """
    fit, name = Fit.of(mesh, scene.parameters.l0), mesh.origin.partition(" ")[0]
    if scene.physics.closure is Closure.IRROTATIONAL_WALL and (not fit.circular or fit.doubled):
        others = ", ".join(one for one in Closure if one is not Closure.IRROTATIONAL_WALL)
        raise UserError(
            f"--mesh: {name} with {scene.origin}: irrotational-wall is slip friction on the unit circle, no "
            f"two sides of it in one cell; valid closures: {others}"
        )
    if not fit.circular and (scene.mode is not None or scene.initial.eigenmode is not None):
        raise UserError(
            f"--mesh: {name} with {scene.origin}: its modes are those of the unit disk; valid: an outline on "
            "the unit circle, or a scene without eigenmode and growth rate"
        )
    _require_inside(scene, mesh, name)
    said = []
    if scene.physics.delta is Delta.RING and fit.crossed:
        said.append(
            f"{name}: {fit.crossed} cells lie on both sides of the ring |xi| = {scene.parameters.l0:g}, "
            "where delta jumps: errors are of order h, whatever the method, until sides follow the ring"
        )
    if fit.turn > SHARP and scene.physics.closure is Closure.REFERENCE_NORMAL:
        said.append(
            f"{name}: its outline turns by {fit.turn:.0f} degrees at a node: a corner has no normal to keep "
            "to and is taken as rounded over the sides next to it"
        )
    return said


def _require_inside(scene: Scene, mesh: Mesh, name: str) -> None:
    """UserError where a probe is farther from the mesh than an arc is from its chord."""
    angle = np.deg2rad(scene.domain.rotation)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    within = np.hypot(*(mesh.xi[:, mesh.rim[1]] - mesh.xi[:, mesh.rim[0]])).max() / 4
    for x, y in scene.probes.points:
        point = turn @ np.array([x, y])
        if (distance := np.hypot(*(nearest_in_polygon(mesh, point)[1] - point))) > within:
            raise UserError(
                f"--mesh: {name} with {scene.origin}: probes.points: ({x:g}, {y:g}) is {distance:.2g} "
                "outside of the outline; valid: material points of the mesh"
            )


def _refined(mesh: Mesh, ring: float) -> Mesh:
    start, end = mesh.triangles, np.roll(mesh.triangles, -1, axis=0)
    count = mesh.xi.shape[1]
    keys, first, number = np.unique(
        np.minimum(start, end) * count + np.maximum(start, end), return_index=True, return_inverse=True
    )
    ends = mesh.xi[:, np.array(np.divmod(keys, count))]  # (2, 2, n)
    middle = ends.mean(axis=1)
    on_arc = arcs(mesh.xi, mesh.triangles, ring).ravel()[first]
    radius = np.hypot(*ends).mean(axis=0)
    middle = np.where(on_arc, radius * middle / np.where(on_arc, np.hypot(*middle), 1.0), middle)
    a, b, c = mesh.triangles
    ab, bc, ca = count + number.reshape(mesh.triangles.shape)
    triangles = np.hstack([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]])
    xi = np.hstack([mesh.xi, middle])
    normals = mesh.normals / np.where(mesh.normals.any(axis=0), np.hypot(*mesh.normals), 1.0)
    on_rim = np.bincount(number.ravel()) == 1
    between = normals[:, np.array(np.divmod(keys, count))].sum(axis=1) * on_rim
    given = np.hstack([normals, between])
    return replace(mesh, xi=xi, triangles=triangles, h=mesh.h / 2, given_normals=given)


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
