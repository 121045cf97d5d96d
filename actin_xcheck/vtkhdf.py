"""The film of a run: a temporal UnstructuredGrid in VTKHDF 2.0, as vtkHDFReader and ParaView read it.

The triangles, xi and delta never change and are stored once; positions and fields are appended, one block per
output time, and `/VTKHDF/Steps` says where the blocks of each step start.  Vectors have three components, the
last one zero.
"""

from dataclasses import dataclass

import h5py
import numpy as np
from numpy.typing import ArrayLike

from actin_xcheck.geometry import Indices
from actin_xcheck.model import Array

_TRIANGLE = 5
"""VTK's number for a triangle."""


@dataclass(frozen=True)
class Film:
    """What moves and what does not; all quantities are non-dimensional.

    Attributes
    ----------
    times : output times, (n_frames,).
    xi : material positions of the nodes, (2, N).
    triangles : node numbers, (3, n_cells).
    delta : delta(xi) of (2.5) on cells, (n_cells,).
    points, u, v : node positions, displacements and velocities, (n_frames, 2, N).
    a_points, a_cells : concentration at nodes (n_frames, N) and its cell means (n_frames, n_cells).
    """

    times: Array
    xi: Array
    triangles: Indices
    delta: Array
    points: Array
    a_points: Array
    a_cells: Array
    u: Array
    v: Array


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


def create(file: h5py.File, xi: Array, triangles: Indices, delta: Array) -> None:
    """Write `/VTKHDF` without any step: xi (2, N), triangles (3, n_cells), delta (n_cells,)."""
    n_points, n_cells = xi.shape[1], triangles.shape[1]
    grid = file.create_group("VTKHDF")
    grid.attrs["Version"] = np.array([2, 0])
    kind = b"UnstructuredGrid"
    grid.attrs.create("Type", kind, dtype=h5py.string_dtype("ascii", len(kind)))  # VTK wants fixed ASCII
    grid["NumberOfPoints"] = np.array([n_points])
    grid["NumberOfCells"] = np.array([n_cells])
    grid["NumberOfConnectivityIds"] = np.array([3 * n_cells])
    grid["Connectivity"] = triangles.T.ravel().astype(np.int64)
    grid["Offsets"] = 3 * np.arange(n_cells + 1)
    grid["Types"] = np.full(n_cells, _TRIANGLE, dtype=np.uint8)
    growing(grid, "Points", (3,), rows=n_points)
    points, cells, steps = (grid.create_group(name) for name in ("PointData", "CellData", "Steps"))
    points["xi"] = _in_space(xi)
    cells["delta"] = np.asarray(delta, dtype=float)
    growing(points, "a", (), rows=n_points)
    growing(points, "u", (3,), rows=n_points)
    growing(points, "v", (3,), rows=n_points)
    growing(cells, "a", (), rows=n_cells)

    steps.attrs["NSteps"] = 0
    growing(steps, "Values", (), rows=64)
    for name in ("PartOffsets", "NumberOfParts", "PointOffsets"):
        growing(steps, name, (), rows=64, dtype=np.int64)
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        growing(steps, name, (1,), rows=64, dtype=np.int64)
    for kind_of_data, names in (("PointDataOffsets", points), ("CellDataOffsets", cells)):
        offsets = steps.create_group(kind_of_data)
        for name in names:
            growing(offsets, name, (), rows=64, dtype=np.int64)


def append_frame(
    file: h5py.File, t: float, x: Array, a_points: Array, a_cells: Array, u: Array, v: Array
) -> None:
    """Append one output time: x, u, v (2, N), a at nodes (N,) and as cell means (n_cells,)."""
    grid, steps = file["VTKHDF"], file["VTKHDF/Steps"]
    first_point, first_cell = len(grid["Points"]), len(grid["CellData/a"])
    append(grid["Points"], _in_space(x))
    append(grid["PointData/a"], a_points)
    append(grid["PointData/u"], _in_space(u))
    append(grid["PointData/v"], _in_space(v))
    append(grid["CellData/a"], a_cells)

    append(steps["Values"], [t])
    append(steps["NumberOfParts"], [1])
    for name in ("PointOffsets", "PointDataOffsets/a", "PointDataOffsets/u", "PointDataOffsets/v"):
        append(steps[name], [first_point])
    append(steps["CellDataOffsets/a"], [first_cell])
    for name in ("PartOffsets", "PointDataOffsets/xi", "CellDataOffsets/delta"):
        append(steps[name], [0])
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        append(steps[name], [[0]])
    steps.attrs["NSteps"] = len(steps["Values"])


def read(file: h5py.File) -> Film:
    """Return `/VTKHDF`; KeyError or ValueError where it is not what `create` and `append_frame` write."""
    grid = file["VTKHDF"]
    times = grid["Steps/Values"][:]

    def by_frame(name: str) -> Array:
        stored = grid[name][:]
        return stored.reshape(len(times), len(stored) // max(len(times), 1), *stored.shape[1:])

    return Film(
        times=times,
        xi=grid["PointData/xi"][:, :2].T,
        triangles=grid["Connectivity"][:].reshape(-1, 3).T,
        delta=grid["CellData/delta"][:],
        points=_in_plane(by_frame("Points")),
        a_points=by_frame("PointData/a"),
        a_cells=by_frame("CellData/a"),
        u=_in_plane(by_frame("PointData/u")),
        v=_in_plane(by_frame("PointData/v")),
    )


def _in_space(vectors: Array) -> Array:
    """(2, N) as VTK's (N, 3)."""
    return np.pad(vectors.T, ((0, 0), (0, 1)))


def _in_plane(vectors: Array) -> Array:
    """VTK's (n_frames, N, 3) as (n_frames, 2, N)."""
    return vectors[..., :2].swapaxes(1, 2)
