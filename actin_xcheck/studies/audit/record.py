"""The audit as a file: every row with what was found, how it was found and the runs it rests on."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py

from actin_xcheck.report.exhibit_file import read_exhibits, write_exhibits
from actin_xcheck.runs.store import provenance, reading, state, writing
from actin_xcheck.studies.audit.row import Finding, Judgement

FILE_NAME = "audit.h5"


@dataclass(frozen=True)
class Entry:
    """A row as it was found.

    Attributes
    ----------
    key, place, statement : of the row.
    finding : what was found.
    command : what examines the row again.
    runs : files of the runs it rests on, relative to the audit's folder.
    """

    key: str
    place: str
    statement: str
    finding: Finding
    command: str
    runs: tuple[str, ...]


@dataclass(frozen=True)
class Audit:
    """A stored audit: its entries in order and what was stated about the whole."""

    path: Path
    attributes: dict[str, Any]
    entries: tuple[Entry, ...]


def write_audit(path: Path, entries: Iterable[Entry], command: str) -> None:
    """Write an audit, replacing `path` atomically: group `/rows/<key>` each, external links `/runs/<file>`.

    UserError where the file cannot be written.
    """
    with writing(path, {"command": command, **provenance()}) as file:
        rows = file.create_group("rows", track_order=True)
        linked = file.create_group("runs")
        for entry in entries:
            group, found = rows.create_group(entry.key), entry.finding
            words = {name: getattr(entry, name) for name in ("place", "statement", "command", "runs")}
            verdict = {name: str(getattr(found, name)) for name in ("judgement", "computed", "reason")}
            state(group, words | verdict)
            state(group.create_group("numbers", track_order=True), found.numbers)
            write_exhibits(group.create_group("exhibits", track_order=True), found.exhibits)
            for run in entry.runs:
                if os.path.basename(run) not in linked:
                    linked[os.path.basename(run)] = h5py.ExternalLink(run, "/")


def read_audit(path: Path) -> Audit:
    """Return the audit stored in `path`; UserError where it is missing, not whole or something else."""
    with reading(path, "audit") as file:
        entries = tuple(_entry(key, group) for key, group in file["rows"].items())
        return Audit(Path(path), dict(file.attrs), entries)


def _entry(key: str, group: h5py.Group) -> Entry:
    said = group.attrs
    finding = Finding(
        Judgement(said["judgement"]),
        said["computed"],
        said["reason"],
        read_exhibits(group["exhibits"]),
        dict(group["numbers"].attrs),
    )
    return Entry(key, said["place"], said["statement"], finding, said["command"], tuple(said["runs"]))
