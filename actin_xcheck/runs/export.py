"""A run's film in other people's formats, written by meshio: XDMF for any tool, VTU with curved cells."""

import os
import xml.etree.ElementTree as ET
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import quote

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import replace_file
from actin_xcheck.runs.pictures import frame_at, in_space
from actin_xcheck.runs.store import Run


def files_of(run: Run, path: Path) -> tuple[Path, ...]:
    """Return the files of an export, the one to open first.

    `path` has the name it was given; in those that it names, special characters are %XX, for readers take a
    ':' for a drive and do not find what is not ASCII.

    Raises
    ------
    UserError : no frame, another suffix, or a path that readers do not open.
    """
    frame_at(run, None)  # a film of none is a file that readers refuse
    stem = quote(os.fsencode(path.stem), safe="")
    others = {".xdmf": [f"{stem}.h5"], ".pvd": [f"{stem}-{frame:04d}.vtu" for frame in range(len(run.times))]}
    if path.suffix not in others:
        raise UserError(
            f"--to: {path} is of no format that is known; valid: a file that ends in {', '.join(others)}"
        )
    if "\\" in path.absolute().as_posix():
        raise UserError(f"--to: {path}: VTK takes a backslash for the end of a folder; valid: a path without")
    return (path, *(path.with_name(name) for name in others[path.suffix]))


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
    UserError : as `files_of`, or a file that cannot be written.
    """
    first, *others = files_of(run, Path(path))
    with TemporaryDirectory() as folder:
        written = _WRITERS[first.suffix](run, Path(folder), [other.name for other in others])
        for other in others:  # before what lists them
            replace_file(other, (Path(folder) / other.name).read_bytes())
        replace_file(first, written)
    return first, *others


def _xdmf(run: Run, folder: Path, others: list[str]) -> bytes:
    """A temporal collection: meshio's writer takes one mesh for all times, so each grid is given its own."""
    from meshio.xdmf import TimeSeriesWriter  # most commands write no meshes

    listing = folder / f"{Path(others[0]).stem}.xdmf"  # the writer takes its numbers' name from this
    with chdir(folder), TimeSeriesWriter(listing) as writer:  # and puts them where it is
        for frame, t in enumerate(run.times):
            at = ET.SubElement(writer.collection, "Grid", Name=f"frame {frame}", GridType="Uniform")
            ET.SubElement(at, "Time", Value=repr(float(t)))
            writer.points(at, in_space(run.points[frame]))
            writer.cells([("triangle", run.triangles.T)], at)
            writer.point_data(_at_nodes(run, frame), at)
            pieces = run.triangles.shape[1] // len(run.delta)
            on_cells = {"a_cells": run.a_cells[frame], "delta": run.delta}
            writer.cell_data({name: [np.repeat(values, pieces)] for name, values in on_cells.items()}, at)
    return listing.read_bytes()


def _vtu(run: Run, folder: Path, others: list[str]) -> bytes:
    """A file a frame, and a list of them as ParaView reads it."""
    import meshio

    kind = "triangle" if run.order == 1 else "VTK_LAGRANGE_TRIANGLE"
    root = ET.Element("VTKFile", type="Collection", version="0.1")
    collection = ET.SubElement(root, "Collection")
    for frame, name in enumerate(others):
        on_cells = {"a_cells": [run.a_cells[frame]], "delta": [run.delta]}
        cells = [(kind, run.cells.T)]
        mesh = meshio.Mesh(in_space(run.points[frame]), cells, _at_nodes(run, frame), on_cells)
        mesh.write(folder / name, file_format="vtu")
        ET.SubElement(collection, "DataSet", timestep=repr(float(run.times[frame])), part="0", file=name)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True)


def _at_nodes(run: Run, frame: int) -> dict[str, np.ndarray]:
    vectors = {"u": run.u[frame], "v": run.v[frame], "xi": run.xi}
    return {"a": run.a_points[frame], **{name: in_space(one) for name, one in vectors.items()}}


_WRITERS: dict[str, Callable[[Run, Path, list[str]], bytes]] = {".xdmf": _xdmf, ".pvd": _vtu}
