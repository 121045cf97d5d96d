"""The report on extremes as a file: every run with how it ended, and the breakdown times."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from actin_xcheck.runs.store import provenance, reading, state, writing
from actin_xcheck.studies.extremes.attempt import Attempt
from actin_xcheck.studies.extremes.breakdown import Breakdown

FILE_NAME = "extremes.h5"


@dataclass(frozen=True)
class Extremes:
    """A stored report and what was stated about it."""

    path: Path
    attributes: dict[str, Any]
    attempts: tuple[Attempt, ...]
    breakdowns: tuple[Breakdown, ...]


def write_extremes(
    path: Path, attempts: Sequence[Attempt], breakdowns: Sequence[Breakdown], command: str
) -> None:
    """Write a report, replacing `path` atomically: groups `/runs/<key>` and `/breakdowns/<scene>--<method>`.

    UserError where the file cannot be written.
    """
    with writing(path, {"command": command, **provenance()}) as file:
        for name, rows in ("runs", attempts), ("breakdowns", breakdowns):
            group = file.create_group(name, track_order=True)
            for row in rows:
                _write(group.create_group(row.key), row)


def read_extremes(path: Path) -> Extremes:
    """Return the report stored in `path`; UserError where it is missing, not whole or something else."""
    with reading(path, "report on extremes") as file:
        attempts = tuple(Attempt(**_read(group, Attempt)) for group in file["runs"].values())
        breakdowns = tuple(Breakdown(**_read(group, Breakdown)) for group in file["breakdowns"].values())
        return Extremes(Path(path), dict(file.attrs), attempts, breakdowns)


def _write(group: h5py.Group, row: Attempt | Breakdown) -> None:
    """Numbers and text as attributes, arrays as datasets."""
    values = {field.name: getattr(row, field.name) for field in fields(row)}
    state(group, {name: value for name, value in values.items() if not isinstance(value, np.ndarray)})
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            group[name] = value


def _read(group: h5py.Group, kind: type[Attempt] | type[Breakdown]) -> dict[str, Any]:
    """A row's fields; KeyError where one is missing."""
    found = {
        field.name: group[field.name][()] if field.name in group else group.attrs[field.name]
        for field in fields(kind)
    }
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in found.items()}
