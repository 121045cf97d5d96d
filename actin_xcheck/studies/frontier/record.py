"""The frontier report as a file: every map with its points, its cells and the lines of theory.

`/maps/<plane>--<method>` holds a map: its points in `points`, a dataset a column, its cells as rows of first
and last column and row of the lattice, whose coordinates are `x` and `y`.  `/exhibits` holds what stands
beside the maps, in the words of `exhibits.py`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from actin_xcheck.core.mesh import Indices
from actin_xcheck.report.exhibit_file import read_chapters, write_chapters
from actin_xcheck.report.exhibits import Chapter, Line
from actin_xcheck.runs.store import Attributes, provenance, reading, state, writing
from actin_xcheck.studies.frontier.planes import Axis, Plane

FILE_NAME = "frontier.h5"


@dataclass(frozen=True)
class Row:
    """A point of a map as it came out.

    Attributes
    ----------
    column, row : its place in the lattice.
    psi, p, end, dt, refine, steps, command : the run, and what makes it again.
    kind, label, sentence : its class, the same with the Outcome of a failure, and what happened.
    area_error, total_actin_error, a_error, x_error : see `answers.ERRORS`; nan where they mean nothing.
    outcome, message, t : how the run ended and when.
    area, total_actin : its answer.
    true_outcome, true_t, true_area, true_total_actin, uncertainty : the converged run's.
    seconds : wall time.
    """

    column: int
    row: int
    psi: float
    p: float
    end: float
    dt: float
    refine: int
    steps: int
    command: str
    kind: str
    label: str
    sentence: str
    area_error: float
    total_actin_error: float
    a_error: float
    x_error: float
    outcome: str = ""
    message: str = ""
    t: float = math.nan
    area: float = math.nan
    total_actin: float = math.nan
    true_outcome: str = ""
    true_t: float = math.nan
    true_area: float = math.nan
    true_total_actin: float = math.nan
    uncertainty: float = math.nan
    seconds: float = math.nan


@dataclass(frozen=True, eq=False)
class Map:
    """One plane for one method.

    Attributes
    ----------
    method : its name.
    plane : the axes.
    points : by column and row.
    cells : first and last column, first and last row of each, (n, 4); they tile the lattice.
    lines : limits by theory.
    words : what it says.
    """

    method: str
    plane: Plane
    points: tuple[Row, ...]
    cells: Indices
    lines: tuple[Line, ...]
    words: str

    @property
    def key(self) -> str:
        """Its name in the file."""
        return f"{self.plane.name}--{self.method}"


@dataclass(frozen=True)
class Frontier:
    """A stored report: its maps, what stands beside them and what was stated about the whole."""

    path: Path
    attributes: dict[str, Any]
    maps: tuple[Map, ...]
    chapters: tuple[Chapter, ...]


def write_frontier(
    path: Path, maps: Sequence[Map], chapters: Sequence[Chapter], attributes: Attributes
) -> None:
    """Write a report, replacing `path` atomically; UserError where the file cannot be written."""
    with writing(path, {**attributes, **provenance()}) as file:
        stored = file.create_group("maps", track_order=True)
        for one in maps:
            _write_map(stored.create_group(one.key), one)
        write_chapters(file.create_group("exhibits", track_order=True), chapters)


def read_frontier(path: Path) -> Frontier:
    """Return the report stored in `path`; UserError where it is missing, not whole or something else."""
    with reading(path, "frontier report") as file:
        maps = tuple(_read_map(group) for group in file["maps"].values())
        return Frontier(Path(path), dict(file.attrs), maps, read_chapters(file["exhibits"]))


def _write_map(group: h5py.Group, one: Map) -> None:
    state(group, {"method": one.method, "words": one.words})
    for name, axis in ("x", one.plane.x), ("y", one.plane.y):
        group[name] = axis.values
        state(group[name], {"name": axis.name, "stride": axis.stride, "log": axis.log})
    group["cells"] = one.cells
    points = group.create_group("points", track_order=True)
    for field in fields(Row):
        column = [getattr(point, field.name) for point in one.points]
        text = h5py.string_dtype() if field.type is str else None
        points.create_dataset(field.name, data=np.array(column, dtype=object) if text else column, dtype=text)
    lines = group.create_group("lines", track_order=True)
    for number, line in enumerate(one.lines):
        drawn = lines.create_group(str(number))
        state(drawn, {"label": line.label})
        drawn["x"], drawn["y"] = line.x, line.y


def _read_map(group: h5py.Group) -> Map:
    axes = (
        Axis(str(values.attrs["name"]), tuple(values[()].tolist()), int(values.attrs["stride"]),
             bool(values.attrs["log"]))
        for values in (group["x"], group["y"])
    )  # fmt: skip
    stored = group["points"]
    columns = [
        (stored[field.name].asstr()[()] if field.type is str else stored[field.name][()]).tolist()
        for field in fields(Row)
    ]
    points = tuple(Row(*values) for values in zip(*columns, strict=True))
    lines = tuple(
        Line(str(line.attrs["label"]), line["x"][()], line["y"][()]) for line in group["lines"].values()
    )
    said = group.attrs
    return Map(str(said["method"]), Plane(*axes), points, group["cells"][()], lines, str(said["words"]))
