"""The distortion report as a file: every run as a row of columns, what it comes to, and charts.

`/runs/<column>` holds one number or text per run; `/exhibits/<chapter>` what the page draws of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from actin_xcheck.report.exhibit_file import read_chapters, write_chapters
from actin_xcheck.report.exhibits import Chapter
from actin_xcheck.runs.store import provenance, reading, writing

FILE_NAME = "distortion.h5"


@dataclass(frozen=True)
class Row:
    """One run as it came out.

    Attributes
    ----------
    scene, method, family, severity, refine, steps : what was run, see `cases.Case`; the scene by name.
    cells, aspect, angle : of the mesh, and of its worst cells; degrees.
    ending, message : of its Outcome.
    area_error, probes_error, a_error : at the end: relative; largest at the scene's probes; relative in the
        root mean square over a cloud of material points. nan where the run failed.
    uncertainty : of what they are held against: smaller errors mean nothing.
    residual : largest balance residual of a step.
    iterations, solves, factorisations, steps_made : counted work.
    seconds : what it took.
    command : what makes it again, in the report's folder.
    """

    scene: str
    method: str
    family: str
    severity: float
    refine: int
    steps: int
    cells: int
    aspect: float
    angle: float
    ending: str
    message: str
    area_error: float
    probes_error: float
    a_error: float
    uncertainty: float
    residual: float
    iterations: int
    solves: int
    factorisations: int
    steps_made: int
    seconds: float
    command: str

    @property
    def completed(self) -> bool:
        """Whether the run came to its end."""
        return self.ending == "completed"

    @property
    def iterations_a_solve(self) -> float:
        """Iterations of conjugate gradients, over all linear systems."""
        return self.iterations / self.solves if self.solves else float("nan")


@dataclass(frozen=True)
class Distortion:
    """A stored report: its runs, its charts and what was stated about the whole."""

    path: Path
    attributes: dict[str, Any]
    rows: tuple[Row, ...]
    chapters: tuple[Chapter, ...]


def write_distortion(
    path: Path, rows: Sequence[Row], chapters: Sequence[Chapter], attributes: dict[str, Any]
) -> None:
    """Write a report, replacing `path` atomically; UserError where the file cannot be written."""
    with writing(path, {**attributes, **provenance()}) as file:
        runs = file.create_group("runs", track_order=True)
        for field in fields(Row):
            column = [getattr(row, field.name) for row in rows]
            text = h5py.string_dtype() if field.type is str else None
            runs.create_dataset(field.name, data=np.array(column, dtype=object if text else None), dtype=text)
        write_chapters(file.create_group("exhibits", track_order=True), chapters)


def read_distortion(path: Path) -> Distortion:
    """Return the report stored in `path`; UserError where it is missing, not whole or something else."""
    with reading(path, "distortion report") as file:
        stored = file["runs"]
        columns = [
            (stored[field.name].asstr()[()] if field.type is str else stored[field.name][()]).tolist()
            for field in fields(Row)
        ]
        rows = tuple(Row(*values) for values in zip(*columns, strict=True))
        return Distortion(Path(path), dict(file.attrs), rows, read_chapters(file["exhibits"]))
