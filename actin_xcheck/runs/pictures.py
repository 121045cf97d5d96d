"""A run for other eyes: pictures and films that PyVista draws, and its film in formats that other tools read.

Nothing needs a display: VTK draws into memory, in a process of its own, for it crashes where it finds nothing
to draw with.  Curved cells are drawn curved: each is cut into small flat pieces, on which the fields are the
element's own.  Files for other tools are written by meshio: XDMF for any, VTU with curved cells.
"""

import io
import math
import os
import shutil
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Sequence
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from actin_xcheck.core.aside import LostError, aside
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import replace_file
from actin_xcheck.core.model import Array
from actin_xcheck.core.parameters import FIELDS
from actin_xcheck.runs.store import Run

SUFFIXES = (".png", ".gif", ".mp4")

_SIDE = 800
"""Pixels; even, as video codecs want it."""

_PIECES = 100_000
"""About as many flat pieces as a cell is cut into for a picture: no side is longer than a few pixels."""

_SECONDS, _FASTEST = 6.0, 25.0
"""A film lasts so long, unless it would have more frames a second than this."""

_SLOWEST = 4.0
"""Frames a second of a film of few."""

_BAR: dict[str, Any] = {
    "vertical": False,
    "color": "black",
    "n_labels": 2,
    "title_font_size": 18,
    "label_font_size": 16,
    "position_x": 0.25,
    "position_y": 0.02,
    "width": 0.5,
    "height": 0.08,
}

Picture = NDArray[np.uint8]
"""(_SIDE, _SIDE, 3)."""


def render(run: Run, path: Path, time: float | None = None, field: str = "a") -> tuple[float, ...]:
    """Draw a run, and return the times that were drawn.

    Parameters
    ----------
    run : as stored; a failed one too.
    path : a `.png` of one frame; a `.gif`, or where ffmpeg is found an `.mp4`, of all.  Replaced where it
        exists.
    time : the output time to draw; the last one where nothing is said.
    field : one of `FIELDS`.

    Raises
    ------
    UserError : no such field, time or kind of file; nothing here to draw or to make films with.
    """
    path = Path(path)
    if field not in FIELDS:
        raise UserError(f"--field: {field!r} is no field of a run; valid: {', '.join(FIELDS)}")
    if path.suffix not in SUFFIXES:
        raise UserError(f"--out: {path} is no picture; valid: a file that ends in {', '.join(SUFFIXES)}")
    if path.suffix != ".png" and time is not None:
        raise UserError(f"--time: {path} shows all output times; valid: with a .png")
    ffmpeg = _ffmpeg() if path.suffix == ".mp4" else ""
    frames = [frame_at(run, time)] if path.suffix == ".png" else list(range(len(run.times)))
    try:
        aside(math.inf, _write, run, path, frames, field, ffmpeg)
    except LostError as error:
        raise UserError(
            f"render: the process that draws ended without a picture ({error}); valid: something for VTK to "
            "draw with: libEGL (Debian: libegl1), OSMesa or a DISPLAY that answers"
        ) from None
    return tuple(float(run.times[frame]) for frame in frames)


def _write(run: Run, path: Path, frames: Sequence[int], field: str, ffmpeg: str) -> None:
    """Draw frames into a file."""
    pictures = _drawn(run, frames, field)
    rate = min(_FASTEST, max(_SLOWEST, len(frames) / _SECONDS))
    if ffmpeg:
        replace_file(path, _video(pictures, rate, ffmpeg))
    else:
        first, *others = (Image.fromarray(picture) for picture in pictures)
        content = io.BytesIO()
        looped: dict[str, Any] = dict(
            save_all=True, append_images=others, duration=round(1000 / rate), loop=0
        )
        first.save(content, path.suffix.removeprefix("."), **(looped if path.suffix == ".gif" else {}))
        replace_file(path, content.getvalue())


def frame_at(run: Run, time: float | None) -> int:
    """The number of the frame at an output time, or of the last one; UserError where there is none."""
    if not len(run.times):
        raise UserError(f"{run.path}: holds no frame; the run ended before ({run.attributes['message']})")
    if time is None:
        return len(run.times) - 1
    frame = int(np.argmin(np.abs(run.times - time)))
    if abs(run.times[frame] - time) > 1e-9:
        known = ", ".join(f"{t:g}" for t in run.times)
        raise UserError(f"--time: {time:g} is no output time of {run.path}; valid: {known}")
    return frame


def grid(run: Run, frame: int) -> Any:
    """A frame as a `pyvista.UnstructuredGrid`, curved: a, u, v, xi at nodes, a_cells, delta on cells."""
    import pyvista

    n_local, n_cells = run.cells.shape
    kind = pyvista.CellType.TRIANGLE if run.order == 1 else pyvista.CellType.LAGRANGE_TRIANGLE
    cells = np.insert(run.cells, 0, n_local, axis=0).T.ravel()
    found = pyvista.UnstructuredGrid(cells, np.full(n_cells, kind, np.uint8), in_space(run.points[frame]))
    for name, vectors in {"u": run.u[frame], "v": run.v[frame], "xi": run.xi}.items():
        found.point_data[name] = in_space(vectors)
    found.point_data["a"] = run.a_points[frame]
    found.cell_data["a_cells"], found.cell_data["delta"] = run.a_cells[frame], run.delta
    return found


def in_space(vectors: Array) -> Array:
    """(2, N) as VTK's (N, 3)."""
    return np.pad(vectors.T, ((0, 0), (0, 1)))


def _drawn(run: Run, frames: Sequence[int], field: str) -> Iterator[Picture]:
    """Pictures of frames, in a window that holds the whole film and with one range of colours."""
    import pyvista

    cuts = 1 + int(np.clip(np.log(_PIECES / run.triangles.shape[1]) / np.log(4), 0, 3))
    low, high = _range(run, frames, field)
    x = np.concatenate([run.xi[None], run.points])
    x = x[np.isfinite(x).all(axis=(1, 2))]
    centre, half = (x.max((0, 2)) + x.min((0, 2))) / 2, 0.5 * np.ptp(x, axis=(0, 2)).max()
    start = grid(run, frames[0]).warp_by_vector("u", factor=-1.0)
    outline = _surface(start, cuts).extract_feature_edges(
        boundary_edges=True, feature_edges=False, manifold_edges=False, non_manifold_edges=False
    )
    title = f"{run.attributes['scene_name']}, {run.attributes['method_name']}"
    plotter = pyvista.Plotter(off_screen=True, window_size=(_SIDE, _SIDE))
    plotter.enable_parallel_projection()
    plotter.camera_position = [(*centre, 10.0), (*centre, 0.0), (0.0, 1.0, 0.0)]
    plotter.camera.parallel_scale = 1.3 * half
    try:
        for frame in frames:
            plotter.clear_actors()
            plotter.add_mesh(
                _surface(grid(run, frame), cuts),
                scalars=field,
                clim=(low, high),
                cmap="viridis",
                lighting=False,
                reset_camera=False,
                scalar_bar_args={**_BAR, "title": FIELDS[field]},
            )
            plotter.add_mesh(outline, color="grey", line_width=1.5, lighting=False, reset_camera=False)
            plotter.add_text(f"{title}, t = {run.times[frame]:.6g}", font_size=10, color="black")
            yield np.asarray(plotter.screenshot(return_img=True))
    finally:
        plotter.close()


def _surface(cells: Any, cuts: int) -> Any:
    """Flat pieces of a grid's curved cells."""
    return cells.extract_surface(nonlinear_subdivision=cuts, algorithm="dataset_surface")


def _range(run: Run, frames: Sequence[int], field: str) -> tuple[float, float]:
    """Smallest and largest finite value of a field in frames."""
    stored = {"a": run.a_points, "a_cells": run.a_cells, "u": run.u, "v": run.v}
    if field == "delta":
        return 0.0, 1.0
    values = stored[field][frames]
    values = np.hypot(*np.moveaxis(values, 1, 0)) if field in "uv" else values
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)


def _ffmpeg() -> str:
    """The path of ffmpeg: the system's, else the one that imageio-ffmpeg brings."""
    if found := shutil.which("ffmpeg"):
        return found
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise UserError(
            "--out: an .mp4 needs ffmpeg; valid: a .gif, or pip install 'actin-xcheck[film]' first"
        ) from None


def _video(pictures: Iterator[Picture], rate: float, ffmpeg: str) -> bytes:
    """H.264, as every browser plays it."""
    given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{_SIDE}x{_SIDE}", "-r", f"{rate:g}", "-i", "-"]
    made = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    with TemporaryDirectory() as folder:  # the index at its head wants a file, no pipe
        file = Path(folder) / "film.mp4"
        raw = b"".join(picture.tobytes() for picture in pictures)
        done = subprocess.run(
            [ffmpeg, "-v", "error", *given, *made, str(file)], input=raw, capture_output=True, check=False
        )
        if done.returncode:
            raise UserError(f"--out: {ffmpeg} makes no film: {done.stderr.decode(errors='replace')}")
        return file.read_bytes()


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
