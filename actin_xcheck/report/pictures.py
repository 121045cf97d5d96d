"""A run for other eyes: pictures and films, a page that plays one, and formats that other tools read.

Curved cells are drawn curved: each is cut into small flat pieces, on which the fields are the element's own.
Files for other tools are written by meshio: XDMF for any, VTU with curved cells.
"""

import io
import os
import shutil
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Sequence
from contextlib import chdir
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self
from urllib.parse import quote

import numpy as np
from matplotlib.colors import Normalize
from numpy.typing import NDArray
from PIL import Image

from actin_xcheck.core import lagrange
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import replace_file
from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array
from actin_xcheck.core.parameters import FIELDS
from actin_xcheck.report.draw import SEQUENTIAL, Canvas, closed_rim, unstyled
from actin_xcheck.runs.store import Run

SUFFIXES = (".png", ".gif", ".mp4", ".html")

_SIDE = 800
"""Pixels; even, as video codecs want it."""

_INCHES = 8.0
"""The same, by which letters and lines are measured."""

_PIECES, _FINEST = 50_000, 24
"""About as many flat pieces as are drawn, and as a side has at most: none is longer than a few pixels."""

_SECONDS, _FASTEST = 6.0, 25.0
"""A film lasts so long, unless it would have more frames a second than this."""

_SLOWEST = 4.0
"""Frames a second of a film of few."""

Picture = NDArray[np.uint8]
"""(_SIDE, _SIDE, 3)."""


def render(run: Run, path: Path, time: float | None = None, field: str = "a") -> tuple[float, ...]:
    """Draw a run, and return the times that were drawn.

    Parameters
    ----------
    run : as stored; a failed one too.
    path : a `.png` of one frame; a `.gif`, or where ffmpeg is found an `.mp4`, of all; a `.html` that plays
        them.  Replaced where it exists.
    time : the output time to draw; the last one where nothing is said.
    field : one of `FIELDS`.

    Raises
    ------
    UserError : no such field, time or kind of file; nothing here to make films with.
    """
    path = Path(path)
    if field not in FIELDS:
        raise UserError(f"--field: {field!r} is no field of a run; valid: {', '.join(FIELDS)}")
    if path.suffix not in SUFFIXES:
        raise UserError(f"--out: {path} is no picture; valid: a file that ends in {', '.join(SUFFIXES)}")
    if path.suffix != ".png" and time is not None:
        raise UserError(f"--time: {path} shows all output times; valid: with a .png")
    if path.suffix == ".html":
        return _play(run, path, field)
    ffmpeg = _ffmpeg() if path.suffix == ".mp4" else ""
    frames = [frame_at(run, time)] if path.suffix == ".png" else list(range(len(run.times)))
    with unstyled():
        _write(run, path, frames, field, ffmpeg)
    return tuple(float(run.times[frame]) for frame in frames)


_ON_PAGE = ("scene", "command", "outcome", "message")
"""What the page of a run says elsewhere."""


def _play(run: Run, path: Path, field: str) -> tuple[float, ...]:
    """Write the page of a run with its film, and return its times."""
    from actin_xcheck.report.film import film_data, film_strip
    from actin_xcheck.report.page import environment

    if field != "a":
        raise UserError(f"--field: {path} plays a, not {field}; valid: a, or a .gif")
    frame_at(run, None)
    strip, last = film_strip([run], most=1), {name: run.series[name][-1] for name in _SAID}
    name = str(run.attributes["scene_name"])
    shown = {"name": name, "number": 1, "right": 0, "runs": [(run, None)], "strip": strip}
    html = environment(path.parent).get_template("film.html").render(
        run=run,
        section=shown | {"film": film_data([run], strip)},
        values=[(f"{key.replace('_', ' ')} at the end", f"{value:.6g}") for key, value in last.items()],
        said=[(key, value) for key, value in run.attributes.items() if key not in _ON_PAGE],
    )  # fmt: skip
    replace_file(path, html.encode("utf-8"))
    return tuple(run.times.tolist())


_SAID = ("time", "area", "total_actin", "polarity")
"""Of a run's last row, on its page."""


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


def in_space(vectors: Array) -> Array:
    """(2, N) as VTK's (N, 3)."""
    return np.pad(vectors.T, ((0, 0), (0, 1)))


@dataclass(frozen=True)
class _Pieces:
    """Small flat pieces of the curved cells of a run, on which its fields are the element's own.

    Attributes
    ----------
    cells : nodes of each cell, (n_local, n_cells).
    basis : of a cell, at the corners of its pieces, (n_local, m).
    triangles : the pieces, cell by cell, by numbers of their corners, (3, n^2 n_cells).
    """

    cells: Indices
    basis: Array
    triangles: Indices

    @classmethod
    def of(cls, run: Run) -> Self:
        """As many as a picture shows; straight cells are pieces themselves."""
        n_cells, order = run.cells.shape[1], run.order
        n = 1 if order == 1 else max(order, min(round(np.sqrt(_PIECES / n_cells)), _FINEST))
        corners = lagrange.nodes(n)
        numbers = np.arange(corners.shape[1] * n_cells).reshape(-1, n_cells)
        triangles = np.swapaxes(numbers[lagrange.pieces(n)], 1, 2).reshape(3, -1)
        return cls(run.cells, lagrange.Basis(lagrange.nodes(order))(corners[1:])[0], triangles)

    def at_corners(self, nodal: Array) -> Array:
        """A field (..., N) at the corners of all pieces, (..., m n_cells)."""
        values = np.einsum("am,...ae->...me", self.basis, nodal[..., self.cells])
        return values.reshape(*nodal.shape[:-1], -1)


def _drawn(run: Run, frames: Sequence[int], field: str) -> Iterator[Picture]:
    """Pictures of frames, in a window that holds the whole film and with one range of colours."""
    pieces, ends = _Pieces.of(run), _range(run, frames, field)
    x = np.concatenate([run.xi[None], run.points])
    x = x[np.isfinite(x).all(axis=(1, 2))]
    centre, half = (x.max((0, 2)) + x.min((0, 2))) / 2, 0.5 * np.ptp(x, axis=(0, 2)).max()
    outline = run.xi[:, closed_rim(run.triangles)]
    title = f"{run.attributes['scene_name']}, {run.attributes['method_name']}"
    for frame in frames:
        canvas = Canvas((centre - 1.3 * half, centre + 1.3 * half), _SIDE / _INCHES, _INCHES, "white")
        corners = pieces.at_corners(run.points[frame])
        shade = partial(
            canvas.axes.tripcolor, *corners, pieces.triangles.T, cmap=SEQUENTIAL, norm=Normalize(*ends)
        )
        if field in ("a_cells", "delta"):
            values = run.delta if field == "delta" else run.a_cells[frame]
            shade(facecolors=np.repeat(values, pieces.triangles.shape[1] // len(values)), antialiased=False)
        else:
            nodal = pieces.at_corners({"a": run.a_points, "u": run.u, "v": run.v}[field][frame])
            shade(np.hypot(*nodal) if field in "uv" else nodal, shading="gouraud")
        canvas.axes.plot(*outline, color="grey", linewidth=0.8)
        canvas.axes.set_title(f"{title}, t = {run.times[frame]:.6g}", y=0.96, x=0.01, loc="left", fontsize=11)
        bar = canvas.axes.inset_axes((0.25, 0.045, 0.5, 0.02), yticks=())
        bar.imshow([np.linspace(0, 1, 256)], cmap=SEQUENTIAL, aspect="auto", extent=(0, 1, 0, 1))
        bar.set_xticks((0, 1), [f"{end:.4g}" for end in ends])
        bar.set_title(FIELDS[field], fontsize=11, pad=3)
        yield canvas.pixels()[..., :3].copy()


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
