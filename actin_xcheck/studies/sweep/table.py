"""A sweep's table: a row for every run, with what was varied and how it came out."""

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.files import replace_file
from actin_xcheck.runs.store import reading, writing
from actin_xcheck.runs.vtkhdf import whole
from actin_xcheck.studies.sweep.task import Row

FILE_NAME = "sweep.h5"
CSV_NAME = "sweep.csv"


@dataclass(frozen=True, eq=False)
class SweepTable:
    """The runs of a sweep in the order in which its file asks for them.

    Attributes
    ----------
    folder : where the sweep lies; the column `file` is relative to it, and empty where a run has no file.
    columns : one array (n_runs,) each, of numbers (nan where a run has none) or of text.  What was varied
        stands under its dotted key (`scene.time` where it is all of `[time]`), then numerics, `outcome` and
        `message`, then the last row of each run's series.
    """

    folder: Path
    columns: dict[str, NDArray[Any]]

    def __getitem__(self, column: str) -> NDArray[Any]:
        return self.columns[column]

    def __len__(self) -> int:
        return len(self.columns["outcome"])


def table_of(folder: Path, rows: Sequence[Row]) -> SweepTable:
    """Return rows as columns; a column is of numbers where all rows that have it have a number there."""
    names = dict.fromkeys(name for row in rows for name in row)
    return SweepTable(folder, {name: _column([row.get(name) for row in rows]) for name in names})


def write_table(table: SweepTable, command: str) -> None:
    """Write `sweep.h5` and `sweep.csv` into the sweep's folder, each whole or not at all."""
    with writing(table.folder / FILE_NAME, {"command": command}) as file:
        columns = file.create_group("columns", track_order=True)
        for name, values in table.columns.items():
            columns[name] = values.astype("T") if values.dtype.kind == "U" else values
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(table.columns)
    lines.writerows(zip(*(values.tolist() for values in table.columns.values()), strict=True))
    replace_file(table.folder / CSV_NAME, text.getvalue().encode())


def read_table(folder: str | Path) -> SweepTable:
    """Return the table in a sweep's folder; UserError where there is none."""
    folder = Path(folder)
    with reading(folder / FILE_NAME, "sweep") as file:
        stored = file["columns"]
        columns = {name: whole(stored, name) for name in stored}
        return SweepTable(
            folder,
            {
                name: stored[name].asstr()[()].astype(str) if values.dtype.kind == "O" else values
                for name, values in columns.items()
            },
        )


def _column(values: Sequence[Any]) -> NDArray[Any]:
    given = [value for value in values if value is not None]
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in given):
        return np.array([np.nan if value is None else value for value in values], dtype=float)
    return np.array(["" if value is None else _text(value) for value in values], dtype=str)


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)
