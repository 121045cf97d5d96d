"""Meshes as other people's readers hand them out; for a process of its own, which loads little else."""

from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout, suppress
from functools import partialmethod
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np


def foreign_mesh(path: Path) -> tuple[Any, list[tuple[str, Any]]]:
    """Return the points and the cells of each type in a file; ValueError where nobody can read it.

    By meshio; what that cannot read (packed by LZ4, a surface) VTK may.  To be called by `aside`:
    readers print, hang or crash, and what is changed here of meshio stays so.
    """
    import meshio

    # data are not wanted, and gmsh's are refused where some cells are in no physical group
    meshio.Mesh.__init__ = partialmethod(_bare, meshio.Mesh.__init__)
    said = StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):
            found = meshio.read(path)
        return np.asarray(found.points), [(one.type, np.asarray(one.data)) for one in found.cells]
    except (Exception, SystemExit) as error:  # its readers raise whatever they stumble over, or exit
        reason = " ".join(said.getvalue().split()) if isinstance(error, SystemExit) else repr(error)
    with suppress(Exception, SystemExit):
        import pyvista

        grid = pyvista.read(path).cast_to_unstructured_grid()
        cells = [(pyvista.CellType(kind).name.lower(), nodes) for kind, nodes in grid.cells_dict.items()]
        if cells:
            return np.asarray(grid.points), cells
    raise ValueError(reason)


def _bare(mesh: Any, make: Callable[..., None], points: Any, cells: Any, *_: Any, **__: Any) -> None:
    """Make a mesh without data."""
    make(mesh, points, cells)
