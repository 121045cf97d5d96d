"""A sweep's table: a row a run, columns of numbers or of text."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.runs.store import reading
from actin_xcheck.runs.vtkhdf import whole

FILE_NAME = "sweep.h5"

Row = Mapping[str, Any]
"""What a sweep's table holds of a run, by column: numbers or text."""


@dataclass(frozen=True, eq=False, repr=False)
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

    def __repr__(self) -> str:
        return f"<SweepTable of {len(self)} runs in {self.folder}>"

    def to_pandas(self) -> Any:
        """The table as a `pandas.DataFrame`, for which pandas must be installed."""
        import pandas

        return pandas.DataFrame(self.columns)


def table_of(folder: Path, rows: Sequence[Row]) -> SweepTable:
    """Return rows as columns; a column is of numbers where all rows that have it have a number there."""
    names = dict.fromkeys(name for row in rows for name in row)
    return SweepTable(folder, {name: _column([row.get(name) for row in rows]) for name in names})


def read_table(folder: str | Path) -> SweepTable:
    """Return the table in a sweep's folder; UserError where there is none."""
    folder = Path(folder)
    with reading(folder / FILE_NAME, "sweep") as file:
        stored = file["tables/runs"]
        columns = {name: whole(stored, name) for name in stored}
        return SweepTable(
            folder,
            {
                name: stored[name].asstr()[()].astype(str) if values.dtype.kind == "O" else values
                for name, values in columns.items()
            },
        )


def is_number(value: Any) -> bool:
    """Whether a value is a number and no truth value."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _column(values: Sequence[Any]) -> NDArray[Any]:
    given = [value for value in values if value is not None]
    if all(map(is_number, given)):
        return np.array([np.nan if value is None else value for value in values], dtype=float)
    return np.array(["" if value is None else _text(value) for value in values], dtype=str)


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)
