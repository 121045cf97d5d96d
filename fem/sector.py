"""A symmetric problem between two mirror lines, seen as the whole cell."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic

import numpy as np

from actin_xcheck.core import lagrange
from actin_xcheck.core.contract import Frame, Grid, Memento, Probes, S, Solver
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.mesh import ON_A_LINE, Indices, Mesh, shared_nodes, unfold
from actin_xcheck.core.model import Array
from actin_xcheck.core.observables import Measures

ACROSS = np.array([1.0, np.sqrt(0.7)])
"""A direction along which no two cells are level."""


@dataclass(frozen=True, eq=False)
class _Tiling:
    """Where the cells of a disk come from.

    Attributes
    ----------
    image : the image each one is in, (n_cells,).
    cell : the sector's cell it is an image of, (n_cells,).
    corner : the local vertex each of its vertices is an image of, (3, n_cells).
    """

    image: Indices
    cell: Indices
    corner: Indices

    @classmethod
    def of(cls, disk: Mesh, sector: Mesh) -> "_Tiling | None":
        """Find it; None where the disk's cells are not the images of the sector's."""
        assert sector.symmetry is not None
        folded, image = sector.symmetry.fold(disk.centroids)
        level = ACROSS @ sector.centroids
        order = np.argsort(level)
        between = (level[order][1:] + level[order][:-1]) / 2
        cell = order[np.searchsorted(between, ACROSS @ folded)]
        places = disk.xi[:, disk.triangles], sector.xi[:, sector.triangles[:, cell]]
        back = np.einsum("nij,icn->jcn", sector.symmetry.images[image], places[0])
        gaps = np.hypot(*(back[:, :, None] - places[1][:, None]))
        return cls(image, cell, gaps.argmin(axis=1)) if gaps.min(axis=1).max() < ON_A_LINE else None

    def nodes(self, order: int) -> Indices:
        """The local node that each node of each cell of order k is an image of, (n_local, n_cells)."""
        ours = lagrange.nodes(order)
        found = np.empty((ours.shape[1], self.cell.size), dtype=np.int64)
        for kind in np.unique(self.corner, axis=1).T:
            theirs = np.empty_like(ours)
            theirs[kind] = ours
            same = np.abs(theirs[:, :, None] - ours[:, None]).max(axis=0).argmin(axis=1)
            found[:, (self.corner == kind[:, None]).all(axis=0)] = same[:, None]
        return found


class Unfolded(Generic[S]):
    """A solver on a sector, measured as the disk that the sector's images tile.

    States are the inner solver's: x, v and a belong to the sector.

    Parameters
    ----------
    inner : a method bound to a mesh of `geometry.sector` and to data of its symmetry.
    mesh : the disk to be seen, where the sector's images tile it; else the one they do tile is.
    """

    def __init__(self, inner: Solver[S], mesh: Mesh) -> None:
        assert inner.mesh.symmetry is not None
        self.inner, self.symmetry = inner, inner.mesh.symmetry
        self.images = self.symmetry.images
        tiling = _Tiling.of(mesh, inner.mesh)
        self.mesh = mesh if tiling is not None else unfold(inner.mesh)
        found = tiling or _Tiling.of(self.mesh, inner.mesh)
        assert found is not None
        self.tiling = found

    @cached_property
    def grid(self) -> Grid:
        """The images of the sector's cells, in the order of the disk's, whose nodes come first."""
        cells, _ = self._unfolded_nodes
        part = self.inner.grid
        return Grid(self._lifted(part.xi), cells, part.order)

    def frame(self, state: S) -> Frame:
        """The sector's frame and its images."""
        part = self.inner.frame(state)
        node, _ = self._unfolded_nodes[1]
        return Frame(self._lifted(part.x), self._lifted(part.v), part.a[node], part.a_cells[self.tiling.cell])

    def check(self, state: S) -> Outcome:
        """The sector's cells stand for all."""
        return self.inner.check(state)

    def init(self) -> S:
        """The sector at t = 0."""
        return self.inner.init()

    def step(self, state: S, dt: float) -> tuple[S, Outcome]:
        """One step of the sector; mirror images of the gauge's force add up or cancel."""
        new, outcome = self.inner.step(state, dt)
        force_x, force_y = (self.images.sum(axis=0) @ new.net_force).tolist()
        return replace(new, net_force=(force_x, force_y)), outcome

    def corners(self, state: S) -> Array:
        """Corner values (3, n_cells) on the disk."""
        return self.inner.corners(state)[self.tiling.corner, self.tiling.cell]

    def measure(self, state: S) -> Measures:
        """Of the whole cell; its rim counter-clockwise, as the images meet."""
        part, copies = self.inner.measure(state), len(self.images)
        rims = np.einsum("wij,jn->win", self.images, part.rim)
        rims[1::2] = rims[1::2, :, ::-1]
        return replace(
            part,
            area=copies * part.area,
            total_actin=copies * part.total_actin,
            centroid=self.images.mean(axis=0) @ part.centroid,
            rim=np.hstack(list(rims[..., :-1])),
        )

    def probes(self, points: Array) -> Probes[S]:
        """What the sector reads at the points (2, k) that these are images of, put back to where they are."""
        folded, image = self.symmetry.fold(points)
        read, images = self.inner.probes(folded), self.images[image]

        def unfolded(state: S) -> tuple[Array, Array]:
            a, x = read(state)
            return a, np.einsum("nij,nj->ni", images, x)

        return unfolded

    def memento(self, state: S) -> Memento:
        """The sector's."""
        return self.inner.memento(state)

    def restored(self, memento: Memento) -> S:
        """The sector's."""
        return self.inner.restored(memento)

    @cached_property
    def _unfolded_nodes(self) -> tuple[Indices, tuple[Indices, Indices]]:
        """Nodes of the grid's cells (n_local, n_cells); the sector's node and the image each one is, (N,)."""
        part, tiling = self.inner.grid, self.tiling
        shared = shared_nodes(self.symmetry, part.xi)
        cells = shared[tiling.image, part.cells[tiling.nodes(part.order), tiling.cell]]
        number = np.full(shared.max() + 1, -1)
        number[cells[:3]] = self.mesh.triangles
        number[number < 0] = np.arange(self.mesh.xi.shape[1], number.size)
        image, node = np.empty((2, number.size), dtype=np.int64)
        image[number[shared]], node[number[shared]] = np.indices(shared.shape)
        return number[cells], (node, image)

    def _lifted(self, vectors: Array) -> Array:
        """Vectors (2, N) at the grid's nodes of vectors at those of the sector's."""
        node, image = self._unfolded_nodes[1]
        return np.einsum("nij,jn->in", self.images[image], vectors[:, node])
