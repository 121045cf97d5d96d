"""Files that appear whole or not at all, and one process at a time on each output."""

import itertools
import os
import re
from collections.abc import Container, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from actin_xcheck.core.errors import UserError


def replace_file(path: Path, content: bytes) -> None:
    """Write a file beside its destination and rename it into place.

    At any moment `path` holds what it held before or all of `content`, whoever kills the process.  UserError
    where it cannot be written.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        try:
            beside.write_bytes(content)
            os.replace(beside, path)
        finally:
            beside.unlink(missing_ok=True)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror or error})") from error


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


def unfinished(path: Path) -> Path:
    """Where an output stands while it is not finished: `run.partial.vtkhdf` for `run.vtkhdf`."""
    return path.with_suffix(f".partial{path.suffix}")


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the one lock on an output; UserError where another process has it, or where there can be none.

    The lock is the operating system's and ends with the process, whatever ends that.
    """
    file = path.with_name(f".{path.name}.lock")
    lock = FileLock(file, timeout=0)
    try:
        lock.acquire()
    except Timeout as error:
        raise UserError(f"{path}: another process is writing it; valid: another name, or to wait") from error
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
