"""The audit at work: run what the rows need, examine every row, write what was found."""

from collections.abc import Sequence
from pathlib import Path

from actin_xcheck.runs.commands import command as command_of
from actin_xcheck.runs.store import provenance
from actin_xcheck.runs.workers import Report, work_off
from actin_xcheck.studies.audit.record import FILE_NAME, Entry, write_audit
from actin_xcheck.studies.audit.rows import ROWS
from actin_xcheck.studies.audit.simulations.studies import plan
from actin_xcheck.studies.compare import is_done, run_all


def examine(keys: Sequence[str], folder: Path, command: str, report: Report) -> tuple[Entry, ...]:
    """Run all that the rows called `keys` need, examine them and write `folder/audit.h5`.

    Runs that an interrupted audit left in the folder are kept, where the same code made them.

    Returns
    -------
    The entries, in the order of the keys.
    """
    rows = [ROWS[key] for key in keys]
    jobs, _ = plan(dict.fromkeys(study for row in rows for study in row.studies), folder)
    (folder / "runs").mkdir(parents=True, exist_ok=True)
    versions = provenance()
    run_all([job for job in jobs if not is_done(job, versions)], report)
    first_long_ones = sorted(keys, key=lambda key: not ROWS[key].studies)
    found = work_off(_examine, [(key, folder) for key in first_long_ones], report, lambda task: task[0])
    by_key = {entry.key: entry for entry in found}
    entries = tuple(by_key[key] for key in keys)
    write_audit(folder / FILE_NAME, entries, command)
    return entries


def _examine(task: tuple[str, Path], report: Report) -> Entry:
    """One row, in a worker."""
    key, folder = task
    row = ROWS[key]
    report(key, 0, 1)
    _, evidence = plan(row.studies, folder)
    finding = row.examine(*(evidence[study] for study in row.studies))
    report(key, 1, 1)
    files = (file for study in row.studies for file in evidence[study].files.values())
    runs = tuple(file.relative_to(folder).as_posix() for file in files)
    return Entry(key, row.place, row.statement, finding, command_of("paper", only=key), runs)
