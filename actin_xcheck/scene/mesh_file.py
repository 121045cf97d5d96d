"""A triangulation in a file, in any format meshio reads, and the proof that it is one.

What a mesh must be: straight triangles in a plane, conforming, joined by sides into one piece without holes
or folds.  The first thing that is wrong becomes one line; numbers in it count from 0, in the file's order.

Other people's readers may hang, crash or end the process: they are called in one of their own.  It is started
afresh and not by multiprocessing, which would run the caller's script once more.
"""

import faulthandler
import math
import os
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout, suppress
from functools import partialmethod
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ParamSpec, TypeVar

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.mesh import Indices, signed_areas
from actin_xcheck.core.model import Array

MOST_CELLS = 200_000
"""More would not be affordable, and neither would be checking them."""

MOST_BYTES = 500_000_000
"""Of a file."""

PATIENCE = 60.0
"""Seconds that reading may take; the largest mesh takes a few."""

SIZES = 0.1, 10.0
"""Distance of the farthest node from the origin: outside of these a mesh is in other units."""

SAME_PLACE = 1e-9
"""How near two nodes, or a node and a side, may not be, as a part of the mesh's size or the side's length."""

IGNORED = ("vertex", "line")
"""Cells that may stand beside triangles; writers add them to name boundaries."""


def read_triangulation(path: Path) -> tuple[Array, Indices]:
    """Return the nodes (2, N) and the cells (3, n) in a file, counter-clockwise; UserError where it has none.

    Nodes that no cell uses are left out.
    """
    return checked(f"--mesh: {path}", *_read(path))


def checked(place: str, points: Array, triangles: Indices) -> tuple[Array, Indices]:
    """Return the nodes (2, N) that are used and the cells (3, n), counter-clockwise.

    UserError, which begins with `place`, for the first thing that is wrong.
    """
    triangles = _Check(place, points, triangles).oriented()
    used, numbers = np.unique(triangles, return_inverse=True)
    return points[:, used], numbers.reshape(triangles.shape)


def _read(path: Path) -> tuple[Array, Indices]:
    """Points (2, N) and triangles (3, n) of a file as they stand there."""
    if not path.is_file():
        raise UserError(f"--mesh: {path}: no such file; valid: a triangulation that meshio reads")
    if path.stat().st_size > MOST_BYTES:
        raise UserError(f"--mesh: {path}: {path.stat().st_size:.2g} bytes; valid: {MOST_BYTES:.0e}")
    try:
        points, blocks = aside(PATIENCE, foreign_mesh, path)
    except (ValueError, LostError) as error:  # on rubbish some of its readers go round for ever
        raise UserError(
            f"--mesh: {path}: meshio cannot read it ({error!s:.120}); valid: .msh, .vtu, .xdmf or another "
            "of its formats, by the suffix"
        ) from None
    return _planar(path, points), _triangles(path, blocks, points.shape[0])


def _planar(path: Path, points: Any) -> Array:
    """The coordinates in the plane, (2, N)."""
    if points.ndim != 2 or points.shape[1] not in (2, 3) or points.dtype.kind not in "fiu":
        raise UserError(f"--mesh: {path}: points of shape {points.shape}; valid: (N, 2) or (N, 3) numbers")
    xyz = points.T.astype(float)
    size = np.abs(xyz[np.isfinite(xyz)]).max(initial=0.0)
    if len(xyz) == 3 and xyz[2].size and not np.ptp(xyz[2]) <= SAME_PLACE * size:
        raise UserError(
            f"--mesh: {path}: z runs from {xyz[2].min():g} to {xyz[2].max():g}; valid: a plane mesh"
        )
    return xyz[:2]


def _triangles(path: Path, blocks: list[tuple[str, Any]], count: int) -> Indices:
    """The cells (3, n), all of them triangles."""
    others = {kind: len(data) for kind, data in blocks if kind not in ("triangle", *IGNORED) and len(data)}
    if others:
        told = ", ".join(f"{number} of type {kind}" for kind, number in others.items())
        raise UserError(
            f"--mesh: {path}: cells of another kind ({told}); valid: triangles with straight sides "
            "(beside them lines and vertices, which are ignored)"
        )
    found = [data for kind, data in blocks if kind == "triangle" and len(data)]
    if not found:
        raise UserError(f"--mesh: {path}: it holds no triangle; valid: a triangulation of the cell")
    if odd := [data for data in found if data.ndim != 2 or data.shape[1] != 3 or not _whole(data)]:
        raise UserError(
            f"--mesh: {path}: triangles of shape {odd[0].shape}, {odd[0].dtype}; valid: (n, 3) node numbers"
        )
    triangles = np.concatenate(found).T
    if triangles.shape[1] > MOST_CELLS:
        raise UserError(f"--mesh: {path}: {triangles.shape[1]} cells; valid: {MOST_CELLS}")
    if triangles.min() < 0 or triangles.max() >= count:
        cell = int(np.flatnonzero(((triangles < 0) | (triangles >= count)).any(axis=0))[0])
        nodes = ", ".join(f"{node:.0f}" for node in triangles[:, cell])
        raise UserError(f"--mesh: {path}: cell {cell} names the nodes {nodes}; valid: 0 to {count - 1}")
    return triangles.astype(np.int64)


def _whole(data: Any) -> bool:
    """Whether all are whole numbers, of whatever type: unsigned ones leave meshio as floats."""
    return data.dtype.kind in "iu" or (data.dtype.kind == "f" and bool((data == np.rint(data)).all()))


class _Check:
    """A mesh under examination: points (2, N) and triangles (3, n) as they stand in its place."""

    def __init__(self, place: str, points: Array, triangles: Indices) -> None:
        self.place, self.points, self.triangles = place, points, triangles

    def oriented(self) -> Indices:
        """The triangles, counter-clockwise; UserError for the first thing that is wrong."""
        self._nodes()
        self._cells()
        # a mesher's surfaces have sides, a cell has none: one that is inverted lies upon its neighbours
        clockwise = signed_areas(self.points, self.triangles) < 0
        self.triangles = np.where(clockwise, self.triangles[[0, 2, 1]], self.triangles)
        self._sides()
        self._outline()
        return self.triangles

    def _refuse(self, what: str) -> None:
        raise UserError(
            f"{self.place}: {what}; valid: a conforming triangulation of one simply connected cell"
        )

    def _at(self, node: int) -> str:
        x, y = self.points[:, node]
        return f"node {node} at ({x:.4g}, {y:.4g})"

    def _cell(self, cell: int) -> str:
        x, y = self.points[:, self.triangles[:, cell]].mean(axis=1)
        return f"cell {cell} at ({x:.4g}, {y:.4g})"

    def _nodes(self) -> None:
        """Finite, in units of the cell's radius, and no two at one place."""
        used = np.unique(self.triangles)
        places = self.points[:, used]
        if not np.isfinite(places).all():
            self._refuse(f"node {used[~np.isfinite(places).all(axis=0)][0]} is not finite")
        size, (low, high) = np.hypot(*places).max(), SIZES
        if not low <= size <= high:
            self._refuse(
                f"its farthest node is {size:.4g} from the origin, where {low:g} to {high:g} of the cell's "
                "radius, the unit of length, are allowed"
            )
        pairs = cKDTree(places.T).query_pairs(SAME_PLACE * size, output_type="ndarray")
        if len(pairs):
            one, other = used[pairs[0]].tolist()
            self._refuse(f"{self._at(one)} and node {other} are one place{_more(len(pairs))}")

    def _cells(self) -> None:
        """Three corners each, an area, and no two the same."""
        corners = np.sort(self.triangles, axis=0)
        twice = np.flatnonzero((corners[:-1] == corners[1:]).any(axis=0))
        if twice.size:
            self._refuse(f"cell {twice[0]}{_more(twice.size)} names one node twice")
        _, first, number = np.unique(corners, axis=1, return_index=True, return_inverse=True)
        again = np.setdiff1d(np.arange(corners.shape[1]), first)
        if again.size:
            original = first[number.ravel()[again[0]]]
            self._refuse(f"cells {original} and {again[0]}{_more(again.size)} are the same")
        sides = self.points[:, self.triangles] - self.points[:, np.roll(self.triangles, 1, axis=0)]
        areas, longest = signed_areas(self.points, self.triangles), np.hypot(*sides).max(axis=0)
        flat = np.flatnonzero(np.abs(areas) <= SAME_PLACE * longest**2)
        if flat.size:
            self._refuse(f"{self._cell(flat[0])}{_more(flat.size)} has no area")

    def _sides(self) -> None:
        """At most two cells at a side, one on either hand; no node within a side; all cells joined."""
        count, cells = self.points.shape[1], self.triangles.shape[1]
        start, end = self.triangles.ravel(), np.roll(self.triangles, -1, axis=0).ravel()
        owner = np.tile(np.arange(cells), 3)
        keys = np.minimum(start, end) * count + np.maximum(start, end)
        _, side, meeting = np.unique(keys, return_inverse=True, return_counts=True)
        if (crowded := np.flatnonzero(meeting[side] > 2)).size:
            at = crowded[0]
            number = meeting[side[at]]
            self._refuse(f"{number} cells meet at the side from {self._at(start[at])} to node {end[at]}")
        _, first, times = np.unique(start * count + end, return_index=True, return_counts=True)
        if (folded := first[times > 1]).size:
            at = folded[0]
            both = owner[side == side[at]]
            self._refuse(
                f"cells {both[0]} and {both[1]} lie on one hand of the side they share{_more(folded.size)}"
            )
        self.outer = np.flatnonzero(meeting[side] == 1)
        self.rim = np.array([start[self.outer], end[self.outer]])
        self._hanging(owner[self.outer])
        pair = np.argsort(side, kind="stable")
        pair = pair[(meeting[side] == 2)[pair]].reshape(-1, 2).T
        joined = sp.coo_matrix((np.ones(pair.shape[1]), owner[pair]), (cells, cells))
        pieces, label = connected_components(joined, directed=False)
        if pieces > 1:
            other = int(np.flatnonzero(label != label[0])[0])
            self._refuse(f"it is in {pieces} pieces: no sides join {self._cell(other)} to cell 0")

    def _hanging(self, owner: Indices) -> None:
        """No node of the boundary within a side of it."""
        nodes = np.unique(self.rim)
        tree = cKDTree(self.points[:, nodes].T)
        start, end = self.points[:, self.rim].swapaxes(0, 1)
        length = np.hypot(*(end - start))
        for number, near in enumerate(tree.query_ball_point((start + end).T / 2, length / 2)):
            for node in nodes[near].tolist():
                side, offset = end[:, number] - start[:, number], self.points[:, node] - start[:, number]
                across = abs(side[0] * offset[1] - side[1] * offset[0]) / length[number] ** 2
                if node not in self.rim[:, number] and across <= SAME_PLACE:
                    one, other = self.rim[:, number].tolist()
                    self._refuse(
                        f"{self._at(node)} lies within the side of cell {owner[number]} from node {one} to "
                        f"node {other}: a hanging node"
                    )

    def _outline(self) -> None:
        """One loop that passes every node once and does not cross itself."""
        leaving = np.bincount(self.rim[0])
        if (pinched := np.flatnonzero(leaving > 1)).size:
            self._refuse(f"its outline touches itself in {self._at(pinched[0])}{_more(pinched.size)}")
        count = self.points.shape[1]
        ones = np.ones(self.rim.shape[1])
        _, label = connected_components(sp.coo_matrix((ones, self.rim), (count, count)), directed=False)
        loops = np.unique(label[self.rim[0]])
        if loops.size > 1:
            start, end = self.points[:, self.rim].swapaxes(0, 1)
            turned = start[0] * end[1] - start[1] * end[0]
            areas = np.array([turned[label[self.rim[0]] == one].sum() / 2 for one in loops])
            hole = self.rim[0][label[self.rim[0]] == loops[areas.argmin()]]
            x, y = self.points[:, hole].mean(axis=1)
            self._refuse(
                f"its boundary is {loops.size} loops, one of them about a hole at ({x:.4g}, {y:.4g})"
            )
        self._crossings()

    def _crossings(self) -> None:
        """No two sides of the outline cross: cells would cover a place twice."""
        start, end = self.points[:, self.rim].swapaxes(0, 1)
        for number in range(start.shape[1]):
            one = _left(start[:, number], end[:, number], start) * _left(
                start[:, number], end[:, number], end
            )
            other = _left(start, end, start[:, number]) * _left(start, end, end[:, number])
            if (crossed := np.flatnonzero((one < 0) & (other < 0))).size:
                nodes = [*self.rim[:, number].tolist(), *self.rim[:, crossed[0]].tolist()]
                self._refuse("its outline crosses itself: nodes {} to {} and {} to {}".format(*nodes))


def _left(start: Array, end: Array, point: Array) -> Array:
    """Positive where a point is left of the line from start to end; each (2,) or (2, n)."""
    (ax, ay), (bx, by), (px, py) = start, end, point
    found: Array = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
    return found


def _more(number: int) -> str:
    """How many others are like the one that is named."""
    return f" (and {number - 1} more)" if number > 1 else ""


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
        told = said.getvalue() if isinstance(error, SystemExit) else f"{type(error).__name__}: {error}"
        reason = " ".join(told.split())
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


Given = ParamSpec("Given")
Result = TypeVar("Result")

_TASK, _ANSWER = "task.pickle", "answer.pickle"


class LostError(Exception):
    """The process ended, or was ended, without an answer; says how."""


def aside(seconds: float, work: Callable[Given, Result], *given: Given.args, **named: Given.kwargs) -> Result:
    """Return what a module's function returns, called in a process that ends after so many seconds.

    Whatever it prints is lost.  Raises whatever `work` raises; LostError where no answer comes.
    """
    with TemporaryDirectory() as folder:
        (Path(folder) / _TASK).write_bytes(pickle.dumps((work, given, named)))
        code = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import _answer; _answer()"
        began, quiet = time.monotonic(), subprocess.DEVNULL
        words = [sys.executable, "-c", code, folder, str(seconds)]
        child = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet)
        try:
            ended = child.wait()
        finally:
            child.kill()  # an interrupt: nobody waits for it any more
            child.communicate()
        if ended:
            late = time.monotonic() - began > seconds
            raise LostError(f"no end within {seconds:g} s" if late else f"a crash, exit code {ended}")
        raised, answer = pickle.loads((Path(folder) / _ANSWER).read_bytes())
    if raised:
        raise answer
    result: Result = answer
    return result


def _answer() -> None:
    """In the process: call what is asked for and leave what comes of it in the folder."""
    folder, seconds = sys.argv[1], float(sys.argv[2])
    if seconds < math.inf:
        faulthandler.dump_traceback_later(seconds, exit=True)  # whatever the interpreter is busy with
    threading.Thread(target=_end_with_parent, daemon=True).start()
    work, given, named = pickle.loads((Path(folder) / _TASK).read_bytes())
    try:
        answer = False, work(*given, **named)
    except Exception as error:
        answer = True, error
    (Path(folder) / _ANSWER).write_bytes(pickle.dumps(answer))


def _end_with_parent() -> None:
    """The pipe is closed when the parent ends, however it does."""
    os.read(sys.stdin.fileno(), 1)
    os._exit(1)
