"""The film of a run: a temporal UnstructuredGrid in VTKHDF 2.0, as vtkHDFReader and ParaView read it.

The cells, xi and delta never change and are stored once; positions and fields are appended, one block per
output time, and `/VTKHDF/Steps` says where the blocks of each step start.  Vectors have three components, the
last one zero.  Cells of order k > 1 are VTK's Lagrange triangles (`lagrange.py`): fields and sides are P_k.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike

from actin_xcheck.core import lagrange
from actin_xcheck.core.contract import Frame
from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array

_TRIANGLE, _LAGRANGE_TRIANGLE = 5, 69
"""VTK's numbers for a straight triangle and for one of any order."""


@dataclass(frozen=True)
class Film:
    """What moves and what does not; all quantities are non-dimensional.

    Attributes
    ----------
    times : output times, (n_frames,).
    xi : material positions of the nodes, (2, N).
    cells : nodes of each cell in the order of `lagrange.nodes`, (n_local, n_cells).
    delta : delta(xi) of (2.5) on cells, (n_cells,).
    points, u, v : node positions, displacements and velocities, (n_frames, 2, N).
    a_points, a_cells : concentration at nodes (n_frames, N) and its cell means (n_frames, n_cells).
    """

    times: Array
    xi: Array
    cells: Indices
    delta: Array
    points: Array
    a_points: Array
    a_cells: Array
    u: Array
    v: Array

    @property
    def order(self) -> int:
        """k of the cells and of the fields on them."""
        return lagrange.order_of(len(self.cells))

    @property
    def corners(self) -> Indices:
        """Nodes at the corners of the cells, counter-clockwise, (3, n_cells)."""
        return self.cells[:3]

    @property
    def triangles(self) -> Indices:
        """The k^2 straight triangles between the nodes of each cell, cell by cell, (3, k^2 n_cells)."""
        return np.swapaxes(self.cells[lagrange.pieces(self.order)], 1, 2).reshape(3, -1)


def growing(group: h5py.Group, name: str, shape: tuple[int, ...], rows: int, dtype: type = float) -> None:
    """Create an empty dataset of items of a shape that `append` lengthens, `rows` of them a chunk."""
    # An item may be empty (no probes), a chunk may not: its extent is 1 where it could grow and never does.
    chunks, largest = (max(n, 1) for n in shape), (n or None for n in shape)
    group.create_dataset(name, (0, *shape), dtype, maxshape=(None, *largest), chunks=(rows, *chunks))


def append(dataset: h5py.Dataset, items: ArrayLike) -> None:
    """Lengthen a dataset by the given items."""
    items = np.asarray(items)
    dataset.resize(len(dataset) + len(items), axis=0)
    dataset[len(dataset) - len(items) :] = items


def create(file: h5py.File, xi: Array, cells: Indices, delta: Array) -> None:
    """Write `/VTKHDF` without any step: xi (2, N), cells (n_local, n_cells), delta (n_cells,)."""
    n_points, (n_local, n_cells) = xi.shape[1], cells.shape
    grid = file.create_group("VTKHDF")
    grid.attrs["Version"] = np.array([2, 0])
    kind = b"UnstructuredGrid"
    grid.attrs.create("Type", kind, dtype=h5py.string_dtype("ascii", len(kind)))  # VTK wants fixed ASCII
    grid["NumberOfPoints"] = np.array([n_points])
    grid["NumberOfCells"] = np.array([n_cells])
    grid["NumberOfConnectivityIds"] = np.array([n_local * n_cells])
    grid["Connectivity"] = cells.T.ravel().astype(np.int64)
    grid["Offsets"] = n_local * np.arange(n_cells + 1)
    grid["Types"] = np.full(n_cells, _TRIANGLE if n_local == 3 else _LAGRANGE_TRIANGLE, dtype=np.uint8)
    growing(grid, "Points", (3,), rows=n_points)
    points, in_cells, steps = (grid.create_group(name) for name in ("PointData", "CellData", "Steps"))
    points["xi"] = _in_space(xi)
    in_cells["delta"] = np.asarray(delta, dtype=float)
    growing(points, "a", (), rows=n_points)
    growing(points, "u", (3,), rows=n_points)
    growing(points, "v", (3,), rows=n_points)
    growing(in_cells, "a", (), rows=n_cells)

    steps.attrs["NSteps"] = 0
    growing(steps, "Values", (), rows=64)
    for name in ("PartOffsets", "NumberOfParts", "PointOffsets"):
        growing(steps, name, (), rows=64, dtype=np.int64)
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        growing(steps, name, (1,), rows=64, dtype=np.int64)
    for kind_of_data, names in (("PointDataOffsets", points), ("CellDataOffsets", in_cells)):
        offsets = steps.create_group(kind_of_data)
        for name in names:
            growing(offsets, name, (), rows=64, dtype=np.int64)


def append_frames(file: h5py.File, times: Sequence[float], frames: Sequence[Frame]) -> None:
    """Append output times: all at once, for each access to a file takes what a small picture takes."""
    grid, steps, count = file["VTKHDF"], file["VTKHDF/Steps"], np.arange(len(frames))
    xi = grid["PointData/xi"][:]
    points, cells = len(grid["Points"]) + len(xi) * count, len(grid["CellData/a"])
    x = [_in_space(frame.x) for frame in frames]
    append(grid["Points"], np.concatenate(x))
    append(grid["PointData/a"], np.concatenate([frame.a for frame in frames]))
    append(grid["PointData/u"], np.concatenate([one - xi for one in x]))
    append(grid["PointData/v"], np.concatenate([_in_space(frame.v) for frame in frames]))
    append(grid["CellData/a"], np.concatenate([frame.a_cells for frame in frames]))

    append(steps["Values"], times)
    append(steps["NumberOfParts"], np.ones_like(count))
    for name in ("PointOffsets", "PointDataOffsets/a", "PointDataOffsets/u", "PointDataOffsets/v"):
        append(steps[name], points)
    append(steps["CellDataOffsets/a"], cells + frames[0].a_cells.size * count)
    for name in ("PartOffsets", "PointDataOffsets/xi", "CellDataOffsets/delta"):
        append(steps[name], 0 * count)
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        append(steps[name], 0 * count[:, None])
    steps.attrs["NSteps"] = len(steps["Values"])


def read(file: h5py.File) -> Film:
    """Return `/VTKHDF`; KeyError or ValueError where it is not what `create` and `append_frames` write."""
    grid = file["VTKHDF"]
    times, xi = numbers(grid, "Steps/Values", 1), numbers(grid, "PointData/xi", 2)[:, :2].T
    nodes, delta = whole(grid, "Connectivity"), numbers(grid, "CellData/delta", 1)
    frames, n_points, n_cells = len(times), xi.shape[1], len(delta)
    if nodes.dtype.kind != "i" or nodes.size % max(n_cells, 1) or not n_cells:
        raise ValueError("/VTKHDF/Connectivity is not that of the cells")
    cells = nodes.reshape(n_cells, -1).T
    if cells.min() < 0 or cells.max() >= n_points or lagrange.order_of(len(cells)) < 1:
        raise ValueError("/VTKHDF/Connectivity is not that of the points")

    def vectors(name: str) -> Array:
        return _in_plane(numbers(grid, name, 2).reshape(frames, n_points, 3))

    return Film(
        times=times,
        xi=xi,
        cells=cells,
        delta=delta,
        points=vectors("Points"),
        a_points=numbers(grid, "PointData/a", 1).reshape(frames, n_points),
        a_cells=numbers(grid, "CellData/a", 1).reshape(frames, n_cells),
        u=vectors("PointData/u"),
        v=vectors("PointData/v"),
    )


def whole(group: h5py.Group, name: str) -> Any:
    """Return what a dataset holds; ValueError where it is no dataset of this file, or mostly not there.

    Shapes are declared: what was never written, or is packed more than a hundredfold, would fill the memory.
    """
    dataset = group[name]
    if (
        not isinstance(dataset, h5py.Dataset)
        or dataset.external
        or dataset.file.filename != group.file.filename
    ):
        raise ValueError(f"{group.name}/{name} is no dataset of this file")
    if dataset.nbytes > 2**24 and dataset.nbytes > 100 * dataset.id.get_storage_size():
        raise ValueError(f"{group.name}/{name} declares {dataset.nbytes} bytes that it does not hold")
    return dataset[()]


def numbers(group: h5py.Group, name: str, dimensions: int) -> Array:
    """Return real numbers of so many dimensions; ValueError where the dataset has others."""
    found = whole(group, name)
    if found.dtype.kind not in "fiu" or found.ndim != dimensions:
        raise ValueError(f"{group.name}/{name} holds no numbers of {dimensions} dimensions")
    return np.asarray(found)


def _in_space(vectors: Array) -> Array:
    """(2, N) as VTK's (N, 3)."""
    return np.pad(vectors.T, ((0, 0), (0, 1)))


def _in_plane(vectors: Array) -> Array:
    """VTK's (n_frames, N, 3) as (n_frames, 2, N)."""
    return vectors[..., :2].swapaxes(1, 2)
