"""What another code says of a scene: observables in a CSV, meshes with a concentration, or a run of ours.

Meshes of other people are read by VTK, in a process of its own.  The first thing that is wrong is one line.
"""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from actin_xcheck.core import lagrange, observables
from actin_xcheck.core.errors import UserError, brief
from actin_xcheck.core.mesh import Indices, Mesh
from actin_xcheck.core.model import Array
from actin_xcheck.runs.store import Run, read_run
from actin_xcheck.scene.mesh_file import PATIENCE, SAME_PLACE, LostError, aside, checked
from actin_xcheck.scene.resolve import turn_matrix
from actin_xcheck.scene.scene import Scene
from actin_xcheck.scene.shelf import did_you_mean

INTEGRALS = ("area", "total_actin")
"""Of them errors are relative."""

PLAIN = (*INTEGRALS, "centroid_x", "centroid_y", "polarity", "mode_amplitude")
"""Columns beside `time` that every scene may have; of its k-th probe there are `probe_k_a`, `_x` and `_y`."""

MESHES = (".vtu", ".pvd", ".xdmf", ".vtkhdf")

SAME_TIME = 1e-6
"""How near a row must be to an output time, over the end of the scene."""

HALF = 0.5
"""A start that is this much off, relative, is in other units."""

LENGTHS = {"cm": 1.0, "mm": 0.1, "um": 1e-4, "µm": 1e-4, "nm": 1e-7, "m": 100.0}
TIMES = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
"""Centimetres and seconds of a unit."""


@dataclass(frozen=True)
class Theirs:
    """What one file says.

    Attributes
    ----------
    name : of the file, without its suffix.
    times : of its rows, increasing, (n,).
    columns : by name, (n,) each, non-dimensional, in the scene's frame.
    h, dt : of its mesh and steps; nan where that is not said.
    """

    name: str
    times: tuple[float, ...]
    columns: dict[str, tuple[float, ...]]
    h: float = np.nan
    dt: float = np.nan

    @property
    def step(self) -> float:
        """What orders are in: h where it is said, else dt."""
        return self.dt if np.isnan(self.h) else self.h

    def at(self, t: float) -> int:
        """The number of the row at a time."""
        return int(np.argmin(np.abs(np.array(self.times) - t)))


def read_theirs(path: Path, scene: Scene, field: str, units: str) -> Theirs:
    """Return what a file says of a scene; UserError, one line, for the first thing that is wrong.

    Parameters
    ----------
    path : a `.csv`, a mesh of `MESHES`, or a series of them; a `.vtkhdf` may be a run of ours.
    field : name of the concentration in a mesh.
    units : as "um, s"; empty for non-dimensional numbers.
    """
    if not path.is_file():
        raise UserError(f"{path}: no such file; valid: a .csv of observables, or {', '.join(MESHES)}")
    if path.suffix == ".csv":
        times, columns = _of_csv(path, scene)
    elif path.suffix not in MESHES:
        raise UserError(f"{path}: {path.suffix or 'no suffix'}; valid: .csv, {', '.join(MESHES)}")
    elif path.suffix == ".vtkhdf" and (run := _ours(path)):
        times, columns = run.series["time"], columns_of(run, scene)
    else:
        times, columns = _of_meshes(path, scene, field)
    found = _converted(Theirs(path.stem, tuple(times.tolist()), _plain(columns)), scene, units)
    _check(path, found, scene)
    return found


def _plain(columns: Mapping[str, Array]) -> dict[str, tuple[float, ...]]:
    return {name: tuple(values.tolist()) for name, values in columns.items()}


def columns_of(run: Run, scene: Scene) -> dict[str, Array]:
    """Return the series of a run (n,) by the names of columns, in the scene's frame."""
    series, turned = run.series, turn_matrix(scene)
    centroid = series["centroid"] @ turned
    found = {name: series[name] for name in PLAIN if name in series}
    found |= {"centroid_x": centroid[:, 0], "centroid_y": centroid[:, 1]}
    for k, (a, x) in enumerate(zip(series["probe_a"].T, series["probe_x"].swapaxes(0, 1), strict=True), 1):
        x = x @ turned
        found |= {f"probe_{k}_a": a, f"probe_{k}_x": x[:, 0], f"probe_{k}_y": x[:, 1]}
    return {name: values for name, values in found.items() if np.isfinite(values).all()}


def _ours(path: Path) -> Run | None:
    try:
        return read_run(path)
    except UserError:
        return None  # another's may have the same suffix


def names_of(scene: Scene) -> list[str]:
    """The columns that a file may have beside `time`."""
    probes = range(1, len(scene.probes.points) + 1)
    mode = PLAIN if scene.mode else PLAIN[:-1]
    return [*mode, *(f"probe_{k}_{what}" for k in probes for what in "axy")]


def _of_csv(path: Path, scene: Scene) -> tuple[Array, dict[str, Array]]:
    """Times (n,) and columns (n,) of a table with one line of names."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = [row for row in csv.reader(file) if row and not row[0].startswith("#")]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"{path}: cannot be read as CSV ({error})") from None
    names, known = [name.strip() for name in rows[0]] if rows else [], ["time", *names_of(scene)]
    for name in names:
        if name not in known:
            hint, some = did_you_mean(name, known), ", ".join(known[:7])
            raise UserError(
                f"{path}: no column {brief(name)!r} is known{hint}; valid: {some}, probe_1_a, ..."
            )
    if "time" not in names or len(names) < 2 or len(set(names)) < len(names):
        raise UserError(f"{path}: columns {', '.join(names) or 'none'}; valid: time and others, each once")
    numbers = np.empty((len(rows) - 1, len(names)))
    for line, row in enumerate(rows[1:]):
        try:
            numbers[line] = [float(cell) for cell in row]
        except ValueError:
            raise UserError(
                f"{path}: row {line + 1} is {brief(','.join(row))}; valid: {len(names)} numbers"
            ) from None
    columns = dict(zip(names, numbers.T, strict=True))
    return columns.pop("time"), columns


def _of_meshes(path: Path, scene: Scene, field: str) -> tuple[Array, dict[str, Array]]:
    """Times and columns measured on the meshes of a file at the scene's output times."""
    try:
        film = aside(PATIENCE, foreign_film, path, field, scene.output_times[-1])
    except (ValueError, LostError) as error:
        raise UserError(f"{path}: {error!s:.400}") from None
    rows = [_measured(path, *frame) for _, *frame in film]
    return np.array([t for t, *_ in film]), {name: np.array([row[name] for row in rows]) for name in rows[0]}


Frame = tuple[float, Any, Any, Any]
"""Time, points (N, 3), cells (n, n_local), values at points or on cells."""


def foreign_film(path: Path, field: str, end: float) -> list[Frame]:
    """Return what a file holds, time by time; ValueError where it is no plane mesh with a concentration.

    A file without times is taken to be of the end.  To be called by `aside`: readers print, hang or crash.
    """
    import pyvista

    reader = pyvista.get_reader(str(path))
    times = [float(t) for t in getattr(reader, "time_values", None) or []]
    frames = []
    for t in times or [end]:
        if times:
            reader.set_active_time_value(t)
        frames.append((t, *_of_grid(reader.read(), field)))
    return frames


def _of_grid(data: Any, field: str) -> tuple[Any, Any, Any]:
    """Points, cells and concentration of what VTK has read."""
    import pyvista

    if isinstance(data, pyvista.MultiBlock):
        data = data.combine()
    grid = data.cast_to_unstructured_grid()
    plane = {
        int(kind): cells for kind, cells in grid.cells_dict.items() if int(kind) not in (1, 2, 3, 4, 21, 68)
    }
    if len(plane) != 1 or next(iter(plane)) not in (5, 22, 69):
        told = ", ".join(pyvista.CellType(kind).name.lower() for kind in plane) or "none"
        raise ValueError(f"cells of kind {told}; valid: triangles of one kind, straight or Lagrange's")
    ((kind, cells),) = plane.items()
    if field in grid.point_data:
        values = np.asarray(grid.point_data[field])
    elif field in grid.cell_data:
        values = np.asarray(grid.cell_data[field])[np.asarray(grid.celltypes) == kind]
    else:
        known = ", ".join([*grid.point_data.keys(), *grid.cell_data.keys()]) or "none"
        raise ValueError(f"no field {field!r} in it; valid: --field with one of {known}")
    if values.ndim > 1 and values.shape[1] > 1:
        raise ValueError(f"field {field!r} has {values.shape[1]} components; valid: a concentration, of one")
    return np.asarray(grid.points, dtype=float), np.asarray(cells), values.reshape(-1).astype(float)


def _measured(path: Path, points: Array, cells: Indices, values: Array) -> dict[str, float]:
    """Observables of a mesh at one time: integrals by its own elements, polarity of its rim."""
    size = np.abs(points).max(initial=0.0)
    if points.shape[1] > 2 and not np.ptp(points[:, 2]) <= SAME_PLACE * size:
        z = points[:, 2]
        raise UserError(f"{path}: z runs from {z.min():g} to {z.max():g}; valid: a plane mesh")
    x, nodes = points[:, :2].T, cells.T
    order = lagrange.order_of(len(nodes))
    flat = nodes[lagrange.pieces(order)].reshape(3, -1)
    _, first, same = np.unique(
        np.rint(points[:, :2] / (10 * SAME_PLACE * size)), axis=0, return_index=True, return_inverse=True
    )  # some write a node once for each of its cells
    where, triangles = checked(str(path), x[:, first], same.ravel()[flat])
    rule = lagrange.rule(order, 4 * order - 2)
    dx = np.abs(rule.dx(x, nodes))
    a = values if len(values) == nodes.shape[1] != x.shape[1] else rule.blend(values, nodes)
    at, area = rule.blend(x, nodes), dx.sum()
    centroid = (at * dx).sum(axis=(1, 2)) / area
    rim = where[:, Mesh(where, triangles, h=np.nan).rim_nodes]
    return {
        "area": float(area),
        "total_actin": float((a * dx).sum()),
        "centroid_x": float(centroid[0]),
        "centroid_y": float(centroid[1]),
        "polarity": observables.polarity(rim),
    }


def _converted(found: Theirs, scene: Scene, units: str) -> Theirs:
    """The same without dimensions."""
    if not units:
        return found
    words = [word.strip() for word in units.split(",")]
    length, time = (next((w for w in words if w in known), "") for known in (LENGTHS, TIMES))
    if len(words) != 2 or not (length and time):
        valid = f"one of {', '.join(LENGTHS)} and one of {', '.join(TIMES)}, as 'um, s'"
        raise UserError(f"--units: {brief(units)!r}; valid: {valid}")
    if scene.dimensional is None:
        raise UserError(f"--units: {scene.origin} states no [dimensional] scales; valid: without")
    size, rate = scene.dimensional.L / LENGTHS[length], scene.dimensional.k_a * TIMES[time]

    def power(name: str) -> int:
        return 2 if name in INTEGRALS else 1 if re.fullmatch(r"(centroid|probe_\d+)_[xy]", name) else 0

    columns = {
        name: tuple(value / size ** power(name) for value in values) for name, values in found.columns.items()
    }
    return replace(found, times=tuple(t * rate for t in found.times), columns=columns)


def _check(path: Path, found: Theirs, scene: Scene) -> None:
    """UserError for numbers that are none, times that are missing, and other units."""
    named = {"time": found.times, **found.columns}
    for name, values in named.items():
        if not np.isfinite(values).all():
            row = int(np.flatnonzero(~np.isfinite(values))[0])
            raise UserError(f"{path}: {name} of row {row + 1} is {values[row]:g}; valid: finite numbers")
    if any(one >= other for one, other in pairwise(found.times)):
        raise UserError(f"{path}: times do not increase; valid: a row a time, in their order")
    times, end = np.array(found.times), scene.output_times[-1]
    span = f"{times.min():g} to {times.max():g}" if len(times) else "none"
    missing = [t for t in scene.output_times if not (np.abs(times - t) <= SAME_TIME * end).any()]
    if missing == [*scene.output_times] or (path.suffix == ".csv" and missing):
        said = ", ".join(f"{t:g}" for t in missing[:5])
        raise UserError(
            f"{path}: no row at t = {said} of {scene.name} (its times: {span}); valid: all output times, "
            "non-dimensional, or --units"
        )
    if found.times[0] <= SAME_TIME * end and "area" in found.columns:
        area = found.columns["area"][0]
        if not abs(area / np.pi - 1) <= HALF:
            raise UserError(
                f"{path}: area {area:.6g} at t = 0, where the cell is the unit disk; valid: lengths in "
                "units of its radius, or --units"
            )


def sorted_by_step(
    found: Sequence[Theirs], h: Sequence[float] | None, dt: Sequence[float] | None
) -> list[Theirs]:
    """Files with their steps, one each where there are any, the coarsest first: by h, else by dt."""
    steps = [list(one) if one else [np.nan] * len(found) for one in (h, dt)]
    files = [replace(one, h=a, dt=b) for one, a, b in zip(found, *steps, strict=True)]
    return sorted(files, key=lambda one: -one.step) if h or dt else files
