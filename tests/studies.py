"""Studies carried out in this process, in turn, and comparisons whose runs are made up."""

import os
from math import nan
from pathlib import Path

import h5py

from actin_xcheck.studies.compare import FILE_NAME, RunRow
from actin_xcheck.studies.study import Report, Table, carry_out, counted, write_report
from tests.processes import InTurn


def here(work, task):
    """What is timed runs in this process too."""
    return work(task)


def carry(folder, study, processes=None, name="squares", tell=lambda label, over, whole: None, alone=here):
    command = f"python -m actin_xcheck {name}"
    return carry_out(name, study, folder, command, processes or InTurn(), tell, alone)


def write_comparison(folder, claims, runs, command="python -m actin_xcheck compare"):
    """Write the file of a comparison with links to runs, files by "scene/method", and return its path."""
    rows = [
        RunRow(
            *name.split("/", 1),
            0,
            1,
            0.1,
            nan,
            "completed",
            "",
            1.0,
            f"runs/{name}",
            os.path.relpath(file, folder),
        )
        for name, file in runs.items()
    ]
    tables = {
        "runs": Table("Runs", rows),
        "triangles": Table("Triangles", []),
        "known_to": Table("Known to", []),
    }
    links = {row.place: row.file for row in rows}
    report = Report(counted(claims, "claims hold"), "By hand.", tables, tuple(claims), links=links)
    write_report(folder / FILE_NAME, "compare", report, command)
    return folder / FILE_NAME


def numbers(file: Path) -> dict[str, bytes | str]:
    """All that was computed, to the bit: every dataset of a file but what it took."""
    found = {}

    def keep(name: str, node: h5py.HLObject) -> None:
        if isinstance(node, h5py.Dataset) and not name.endswith("seconds"):
            found[name] = repr(node[()].tolist()) if node.dtype.hasobject else node[()].tobytes()

    with h5py.File(file) as stored:
        stored.visititems(keep)
    return found
