"""Files that appear whole or not at all, folders of reports, and one process at a time on each output."""

import itertools
import os
import re
import sqlite3
from collections.abc import Container, Iterator
from contextlib import closing, contextmanager, nullcontext, suppress
from datetime import datetime
from errno import EINVAL, ENOLCK, ENOSYS, EOPNOTSUPP
from pathlib import Path
from warnings import catch_warnings

from filelock import BaseFileLock, FileLock, SoftFileLock, Timeout

from actin_xcheck.core.errors import UserError

if os.name == "posix":
    from fcntl import LOCK_NB, LOCK_SH, flock

_NO_LOCKS = (ENOLCK, ENOSYS, EOPNOTSUPP)
"""What file systems without locks say: NFS where its lock daemon is not running, some of clusters."""

_NO_FOLDERS = (EINVAL, ENOSYS, EOPNOTSUPP)
"""What file systems say that have a folder's names on the disk by themselves, or never."""

_PATIENCE = 60.0
"""Seconds to wait for another process that is at work in a database."""


def replace_file(path: Path, content: bytes) -> None:
    """Write a file beside its destination and rename it into place.

    At any moment `path` holds what it held before or all of `content`, whoever kills the process and whenever
    the power fails; when this returns it holds `content` for good.  UserError where it cannot be written.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        try:
            write_through(beside, content)
            publish(beside, path)
        finally:
            with suppress(OSError):  # what it would say is less than what has gone wrong
                os.unlink(beside)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror or error})") from error


def write_through(path: Path, content: bytes) -> None:
    """Write a file that a loss of power leaves as it is, but for its name; OSError where that cannot be."""
    number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | getattr(os, "O_BINARY", 0), 0o666)
    try:
        left = memoryview(content)
        while left:
            left = left[os.write(number, left) :]
        os.fsync(number)
    finally:
        os.close(number)


def publish(beside: Path, path: Path) -> None:
    """Rename a file that is written through, and have the name on the disk; OSError where that cannot be."""
    os.replace(beside, path)
    if os.name != "posix":
        return
    number = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(number)
    except OSError as error:
        if error.errno not in _NO_FOLDERS:
            raise
    finally:
        os.close(number)


def new_folder(wanted: Path, taken: Container[str] = ()) -> Path:
    """Make a folder that nobody else has made and return it: `wanted`, or with a number behind its name.

    Names that are `taken` are left out too.  UserError where it cannot be made.
    """
    for count in itertools.count(1):
        folder = wanted if count == 1 else wanted.with_name(f"{wanted.name}-{count}")
        if folder.name not in taken:
            try:
                folder.mkdir(parents=True)
            except FileExistsError:
                continue
            except OSError as error:
                raise UserError(f"--out: cannot make the folder {folder}: {error.strerror}") from error
            return folder
    raise AssertionError("numbers do not end")


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


def unfinished(path: Path) -> Path:
    """Where an output stands while it is not finished: `run.partial.vtkhdf` for `run.vtkhdf`."""
    return path.with_suffix(f".partial{path.suffix}")


@contextmanager
def locked(path: Path, wait: float = 0.0) -> Iterator[None]:
    """Hold the one lock on an output; UserError where another process has it, or where there can be none.

    The lock is the operating system's and ends with the process, whatever ends that.  On a file system
    without locks it is a file that names the process, which another on the same machine sees to have ended.
    """
    file = path.with_name(f".{path.name}.lock")
    try:
        lock = _acquired(file, wait)
    except Timeout as error:
        where = "" if error.lock_file == str(file) else f", or to remove {error.lock_file} where none is"
        raise UserError(
            f"{path}: another process is writing it; valid: another name, or to wait{where}"
        ) from error
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror or error})") from error
    try:
        names = "|".join(re.escape(one.name) for one in (path, unfinished(path)))
        for left in path.parent.iterdir():  # by a process that was killed while it wrote
            if re.fullmatch(rf"\.({names})\.\d+\.new", left.name):
                left.unlink()
        yield
    finally:
        with suppress(OSError):  # where an open file cannot be removed it stays
            file.unlink()
        lock.release()


def _acquired(file: Path, wait: float) -> BaseFileLock:
    """A lock that is held; Timeout where another process holds it, OSError where it cannot be made."""
    lock: BaseFileLock = FileLock(file, timeout=wait)
    try:
        with catch_warnings(action="ignore"):  # of no locks at all, where it takes the other kind itself
            lock.acquire()
    except Timeout:
        with suppress(FileExistsError):  # for it takes what can never be made for what is not there yet
            file.touch(exist_ok=False)
            file.unlink()
        raise
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
        lock = SoftFileLock(f"{file}.owner", timeout=wait)
        lock.acquire()
    return lock


@contextmanager
def database(path: Path, mode: str) -> Iterator[sqlite3.Connection]:
    """Open a file of SQLite for a moment; with mode "rwc" it is made where there is none, with "rw" not.

    Statements commit by themselves outside of a transaction.  On a file system without locks, on which SQLite
    waits for ever, ours is held for that moment.
    """
    file = Path(path).absolute()
    lockless = _lockless(file, os.O_RDWR | os.O_CREAT if mode == "rwc" else os.O_RDONLY)
    address = f"{file.as_uri()}?mode={mode}{'&nolock=1' * lockless}"
    with (
        locked(file, _PATIENCE) if lockless else nullcontext(),
        closing(sqlite3.connect(address, _PATIENCE, isolation_level=None, uri=True)) as rows,
    ):
        rows.execute("PRAGMA synchronous = EXTRA")  # what is committed outlasts a loss of power at once
        yield rows


def _lockless(file: Path, flags: int) -> bool:
    """Whether a file is where there are no locks; not, where it cannot be opened."""
    if os.name != "posix":
        return False
    try:
        number = os.open(file, flags, 0o666)
    except OSError:
        return False
    try:
        flock(number, LOCK_SH | LOCK_NB)
    except OSError as error:
        return error.errno in _NO_LOCKS
    finally:
        os.close(number)
    return False
