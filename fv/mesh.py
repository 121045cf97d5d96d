"""FiPy's view of a mesh, and FiPy itself behind a guarded import."""

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import cached_property
from importlib.machinery import ModuleSpec, SourceFileLoader
from types import ModuleType
from typing import Any

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.mesh import Indices, Mesh
from actin_xcheck.core.model import Array


def _import_fipy() -> Any:
    """Import FiPy with SciPy's solvers, whatever surrounds it.

    It would take our command line for its own (`--petsc`, ...), and so it would variables that others set for
    a FiPy of theirs; it adds to a docstring, of which there is none under `python -OO`.  UserError where it
    was imported before with other solvers: its matrices are others then.
    """
    for name in [name for name in os.environ if name.startswith("FIPY_")]:
        del os.environ[name]
    os.environ["FIPY_SOLVERS"] = "scipy"
    arguments, sys.argv = sys.argv, sys.argv[:1]
    try:
        with warnings.catch_warnings(), _with_docstrings() if sys.flags.optimize > 1 else nullcontext():
            warnings.simplefilter("ignore")
            import fipy
    finally:
        sys.argv = arguments
    if (suite := fipy.solvers.solver_suite) != "scipy":
        raise UserError(
            f"FiPy is in this process with its {suite} solvers already; "
            "valid: FIPY_SOLVERS=scipy before it is imported, or another process"
        )
    return fipy


@contextmanager
def _with_docstrings() -> Iterator[None]:
    """Give modules of FiPy's that are imported within it an empty docstring in place of none."""

    def create_module(loader: SourceFileLoader, spec: ModuleSpec) -> ModuleType | None:
        return ModuleType(spec.name, "") if spec.name.startswith("fipy.") else None

    SourceFileLoader.create_module = create_module  # type: ignore
    try:
        yield
    finally:
        del SourceFileLoader.create_module  # what it inherits


fipy = _import_fipy()


@dataclass(frozen=True, eq=False)
class Star:
    """The values around each vertex, vertex by vertex: its cells, and the mirror images of those on the rim.

    Attributes
    ----------
    vertex, cell : the vertex each value belongs to, and the cell it is the value of, (k,).
    value : its number among all values, cells first, then the images across the rim faces, (k,).
    indptr : where each vertex begins, (N + 1,).
    """

    vertex: Indices
    cell: Indices
    value: Indices
    indptr: Indices


@dataclass(frozen=True, eq=False)
class Faces:
    """The faces of a triangulation; cell i is triangle i.

    Attributes
    ----------
    mesh : the reference mesh.
    nodes : the two nodes of each face, counter-clockwise seen from its first cell, (2, n_faces).
    of_cell : the three faces of each cell, (3, n_cells).
    cells : first and second cell of each face, (2, n_faces); -1 for the second one on the rim.
    """

    mesh: Mesh
    nodes: Indices
    of_cell: Indices
    cells: Indices

    @classmethod
    def of(cls, mesh: Mesh) -> "Faces":
        """Number the faces of a mesh; the first cell of a face is the one that is met first."""
        triangles = mesh.triangles
        directed = np.stack([triangles[[i, (i + 1) % 3]] for i in range(3)], axis=-1)  # (2, n_cells, 3)
        directed = directed.reshape(2, -1)  # cell by cell
        _, first, number = np.unique(
            np.sort(directed, axis=0), axis=1, return_index=True, return_inverse=True
        )
        number = number.ravel()
        owner = np.arange(directed.shape[1]) // 3
        cells = np.full((2, first.size), -1)
        cells[0] = owner[first]
        second = np.setdiff1d(np.arange(directed.shape[1]), first)
        cells[1, number[second]] = owner[second]
        return cls(mesh, directed[:, first], number.reshape(-1, 3).T, cells)

    @cached_property
    def interior(self) -> Indices:
        """Numbers of the faces between two cells."""
        return np.flatnonzero(self.cells[1] >= 0)

    @cached_property
    def rim(self) -> Indices:
        """Numbers of the faces on the rim."""
        return np.flatnonzero(self.cells[1] < 0)

    @cached_property
    def places(self) -> Indices:
        """The place beyond each face, (n_faces,): the second cell, on the rim the face itself.

        Places are the cells, then the faces on the rim.
        """
        places = self.cells[1].copy()
        places[self.rim] = self.mesh.triangles.shape[1] + np.arange(self.rim.size)
        return places

    @cached_property
    def star(self) -> Star:
        """The values that each vertex is interpolated from."""
        triangles, (start, end) = self.mesh.triangles, self.nodes[:, self.rim]
        every, image = np.arange(triangles.shape[1]), triangles.shape[1] + np.arange(self.rim.size)
        vertex = np.concatenate([*triangles, start, end])
        value = np.concatenate([every, every, every, image, image])
        order = np.argsort(vertex, kind="stable")
        cell = np.concatenate([every, self.cells[0, self.rim]])[value]
        indptr = np.searchsorted(vertex[order], np.arange(self.mesh.xi.shape[1] + 1))
        return Star(vertex[order], cell[order], value[order], indptr)

    @cached_property
    def ends(self) -> Indices:
        """Numbers 3 i + c of corner c of cell i at both ends of every face, (2 cells, 2 ends, n_faces).

        The second cell of a face on the rim is its first one.
        """
        cells = np.where(self.cells < 0, self.cells[0], self.cells)
        at = self.mesh.triangles[:, cells][:, :, None] == self.nodes  # (3, 2 cells, 2 ends, n_faces)
        return 3 * cells[:, None] + at.argmax(axis=0)

    @cached_property
    def corners(self) -> Indices:
        """Those of the interior faces, (4 n_interior,).

        In the first cell the ends, then the starts; the same in the second.
        """
        return self.ends[:, ::-1, self.interior].ravel()

    def geometry(self, x: Array) -> tuple[Array, Array]:
        """Of the interior faces with nodes at x: outward area vector of the first cell and centroid distance.

        Both (2, n_interior); the area vector's length is the face's.
        """
        edge = x[:, self.nodes[1, self.interior]] - x[:, self.nodes[0, self.interior]]
        centroids = x[:, self.mesh.triangles].mean(axis=1)
        first, second = self.cells[:, self.interior]
        return np.array([edge[1], -edge[0]]), centroids[:, second] - centroids[:, first]

    def fipy_mesh(self) -> Any:
        """FiPy's `Mesh2D` of the reference configuration."""
        from fipy.meshes.mesh2D import Mesh2D

        return Mesh2D(self.mesh.xi, self.nodes, self.of_cell)
