"""Folders of reports: one of their own for each, made when it is needed, had by one process at a time."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import locked, new_folder


def report_folder(out_dir: Path | None, kind: str) -> Path:
    """Return the folder a user named, else make a new one for this kind of report and this moment."""
    return out_dir or new_folder(Path("reports") / f"{kind}-{datetime.now():%Y%m%d-%H%M%S}")


def make_folder(folder: Path) -> Path:
    """Make a folder where there is none and return it; UserError where that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--out: cannot make the folder {folder}: {error.strerror}") from error
    return folder


@contextmanager
def report_in(folder: Path, file_name: str, what: str, force: bool) -> Iterator[None]:
    """Make the folder of a report that is kept in `file_name`, and have it to oneself.

    A page must never stand beside files that it is not made of: what `force` overwrites is gone first.
    UserError where `what` is there already, or another process is at work there.
    """
    file = make_folder(folder) / file_name
    with locked(file):
        if (folder / "journal.sqlite").exists():
            raise UserError(f"--out: {folder} is the folder of a study; valid: another one")
        if file.exists() and not force:
            raise UserError(f"--out: {folder} holds {what} already; valid: another folder, or --force")
        for stale in (file_name, "index.html"):
            (folder / stale).unlink(missing_ok=True)
        yield
