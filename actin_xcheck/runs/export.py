"""A run's film in other people's formats, written by meshio: XDMF for any tool, VTU with curved cells."""

import xml.etree.ElementTree as ET
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import replace_file
from actin_xcheck.runs.pictures import in_space
from actin_xcheck.runs.store import Run


def export(run: Run, path: Path) -> tuple[Path, ...]:
    """Write every frame of a run, and return the files, the one to open first.

    Parameters
    ----------
    run : as stored; a failed one too.
    path : `film.xdmf`, beside which `film.h5` holds the numbers: straight triangles, k^2 for each cell of
        order k, for XDMF has no curved ones of any order.  `film.pvd`, the list of `film-0000.vtu` and so on
        with their times: cells as they are, Lagrange triangles where k > 1.  Replaced where they exist.

    Raises
    ------
    UserError : another suffix, or a file that cannot be written.
    """
    path = Path(path)
    write = _WRITERS.get(path.suffix)
    if write is None:
        raise UserError(
            f"--to: {path} is of no format that is known; valid: a file that ends in {', '.join(_WRITERS)}"
        )
    with TemporaryDirectory() as folder:
        names = write(run, Path(folder), path.stem)
        for name in reversed(names):  # the one to open last: it must not list what is not there yet
            replace_file(path.with_name(name), (Path(folder) / name).read_bytes())
    return tuple(path.with_name(name) for name in names)


def _xdmf(run: Run, folder: Path, stem: str) -> list[str]:
    """A temporal collection: meshio's writer takes one mesh for all times, so each grid is given its own."""
    from meshio.xdmf import TimeSeriesWriter  # most commands write no meshes

    with chdir(folder), TimeSeriesWriter(f"{stem}.xdmf") as writer:  # it puts its numbers where it is
        for frame, t in enumerate(run.times):
            at = ET.SubElement(writer.collection, "Grid", Name=f"frame {frame}", GridType="Uniform")
            ET.SubElement(at, "Time", Value=repr(float(t)))
            writer.points(at, in_space(run.points[frame]))
            writer.cells([("triangle", run.triangles.T)], at)
            writer.point_data(_at_nodes(run, frame), at)
            pieces = run.triangles.shape[1] // len(run.delta)
            on_cells = {"a_cells": run.a_cells[frame], "delta": run.delta}
            writer.cell_data({name: [np.repeat(values, pieces)] for name, values in on_cells.items()}, at)
    return [f"{stem}.xdmf", f"{stem}.h5"]


def _vtu(run: Run, folder: Path, stem: str) -> list[str]:
    """A file a frame, and a list of them as ParaView reads it."""
    import meshio

    kind = "triangle" if run.order == 1 else "VTK_LAGRANGE_TRIANGLE"
    names = [f"{stem}-{frame:04d}.vtu" for frame in range(len(run.times))]
    root = ET.Element("VTKFile", type="Collection", version="0.1")
    collection = ET.SubElement(root, "Collection")
    for frame, name in enumerate(names):
        on_cells = {"a_cells": [run.a_cells[frame]], "delta": [run.delta]}
        cells = [(kind, run.cells.T)]
        mesh = meshio.Mesh(in_space(run.points[frame]), cells, _at_nodes(run, frame), on_cells)
        mesh.write(folder / name, file_format="vtu")
        ET.SubElement(collection, "DataSet", timestep=repr(float(run.times[frame])), part="0", file=name)
    ET.ElementTree(root).write(folder / f"{stem}.pvd", encoding="utf-8", xml_declaration=True)
    return [f"{stem}.pvd", *names]


def _at_nodes(run: Run, frame: int) -> dict[str, np.ndarray]:
    vectors = {"u": run.u[frame], "v": run.v[frame], "xi": run.xi}
    return {"a": run.a_points[frame], **{name: in_space(one) for name, one in vectors.items()}}


_WRITERS: dict[str, Callable[[Run, Path, str], list[str]]] = {".xdmf": _xdmf, ".pvd": _vtu}
