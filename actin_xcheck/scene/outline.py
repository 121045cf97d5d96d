"""A user's cell outline as the reference configuration.

The nodes of its triangulation are the material points, its boundary loop is the rim, and `reference-normal`
keeps rim points to the normals of this outline.  Lengths are in units of the cell's radius and the origin
lies inside, for scenes and the ring |xi| = l0 are stated about it.
"""

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.mesh import ON_A_CIRCLE, Mesh, arcs, nearest_in_polygon, signed_areas
from actin_xcheck.core.model import Closure, Delta
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
