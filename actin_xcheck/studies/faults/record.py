"""A hunt as a file: every fault with the check that caught it, every check as it was without a fault."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from actin_xcheck.core.claim import excess
from actin_xcheck.runs.store import provenance, reading, state, writing
from actin_xcheck.studies.faults.hunt import Caught, Clean, Hunt

FILE_NAME = "faults.h5"


@dataclass(frozen=True)
class Row:
    """A fault as it came out; `check`, `statement` and `note` are empty and numbers nan where none caught it.

    Attributes
    ----------
    name, sentence, code, target : of the fault.
    check, statement, value, bound, note : of the claim that failed by most.
    others : how many more claims of the check failed.
    passed : checks that stayed green.
    seconds : how long it took.
    trouble : why the control proves nothing; empty where it does.
    """

    name: str
    sentence: str
    code: str
    target: str
    check: str
    statement: str
    value: float
    bound: float
    note: str
    others: int
    passed: tuple[str, ...]
    seconds: float
    trouble: str

    @property
    def caught(self) -> bool:
        """Whether a check turned red."""
        return bool(self.check)

    @property
    def excess(self) -> str:
        """Of the claim, see `Claim.excess`."""
        return excess(self.value, self.bound)


@dataclass(frozen=True)
class CleanRow:
    """A check without a fault: its name, how many claims it makes, those that failed, and its seconds."""

    name: str
    judged: int
    red: tuple[str, ...]
    seconds: float


@dataclass(frozen=True)
class Stored:
    """A stored hunt and what was stated about it."""

    path: Path
    attributes: dict[str, Any]
    faults: tuple[Row, ...]
    checks: tuple[CleanRow, ...]


def write_hunt(path: Path, found: Hunt, command: str) -> None:
    """Write a hunt, replacing `path` atomically: groups `/faults/<name>` and `/checks/<number>`.

    UserError where the file cannot be written.
    """
    with writing(path, {"command": command, **provenance()}) as file:
        faults = file.create_group("faults", track_order=True)
        for caught in found.found:
            state(faults.create_group(caught.fault.name), vars(_row(caught)))
        checks = file.create_group("checks", track_order=True)
        for number, clean in enumerate(found.clean):
            state(checks.create_group(str(number)), vars(_clean_row(clean)))


def read_hunt(path: Path) -> Stored:
    """Return the hunt stored in `path`; UserError where it is missing, not whole or something else."""
    with reading(path, "hunt for faults") as file:
        faults = tuple(Row(**_stated(group, Row)) for group in file["faults"].values())
        checks = tuple(CleanRow(**_stated(group, CleanRow)) for group in file["checks"].values())
        return Stored(Path(path), dict(file.attrs), faults, checks)


def _row(caught: Caught) -> Row:
    fault, claim = caught.fault, caught.claim
    return Row(
        fault.name,
        fault.sentence,
        fault.code,
        fault.target,
        caught.check,
        claim.statement if claim else "",
        claim.value if claim else np.nan,
        claim.bound if claim else np.nan,
        claim.note if claim else "",
        caught.others,
        caught.passed,
        caught.seconds,
        caught.trouble,
    )


def _clean_row(clean: Clean) -> CleanRow:
    said = [f"{claim.statement}: {claim.excess}" for claim in clean.red]
    return CleanRow(clean.check.name, clean.judged, tuple(said), clean.seconds)


def _stated(group: h5py.Group, kind: type[Row] | type[CleanRow]) -> dict[str, Any]:
    """A row's fields from a group's attributes; KeyError where one is missing."""
    values = {field.name: group.attrs[field.name] for field in fields(kind)}
    return {name: tuple(value) if isinstance(value, np.ndarray) else value for name, value in values.items()}
