"""What a study has been answered, kept as it comes: a file of SQLite, each answer a small HDF5 image.

Answers are found by what was asked and by a digest of the code that answers (`provenance.code`), so that a
checkout with changes takes up its own answers and nobody else's.  A process that is killed loses what had not
come in.
"""

import hashlib
import json
import sqlite3
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

import h5py

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import database
from actin_xcheck.runs.provenance import SOURCES, code
from actin_xcheck.runs.records import read_record, write_record
from actin_xcheck.scene.scene import Scene

FILE_NAME = "journal.sqlite"


class Journal:
    """The answers in one folder.

    Parameters
    ----------
    folder : it exists.
    study : whose answers these are; UserError where the folder has those of another one, a report without
        answers, or a file that is none.
    """

    def __init__(self, folder: Path, study: str) -> None:
        self.path = folder / FILE_NAME
        if not self.path.exists():
            if others := reports_in(folder):
                said = f"--out: {folder} holds {others[0].name} already"
                raise UserError(f"{said}; valid: another folder, or --force")
            if (folder / f"{study}.h5").exists():
                raise UserError(f"--out: {folder}/{study}.h5 is no report; valid: another folder")
        with self._open() as rows:
            rows.execute("BEGIN IMMEDIATE")
            rows.execute("CREATE TABLE IF NOT EXISTS study (name TEXT)")
            rows.execute("CREATE TABLE IF NOT EXISTS answers (key TEXT PRIMARY KEY, asked TEXT, image BLOB)")
            rows.execute(
                "CREATE TABLE IF NOT EXISTS files (key TEXT, file TEXT, digest TEXT, PRIMARY KEY (key, file))"
            )
            found = rows.execute("SELECT name FROM study").fetchone()
            if found is None:
                rows.execute("INSERT INTO study VALUES (?)", (study,))
            rows.execute("COMMIT")
            if found is not None and found[0] != study:
                raise UserError(
                    f"--out: {folder} is the folder of `{found[0]}`; valid: another one, or --force"
                )

    def keep(self, key: str, asked: str, answer: Any, files: Sequence[str] = ()) -> None:
        """Write an answer down, and what the files are that belong to it."""
        image = BytesIO()
        with h5py.File(image, "w") as file:
            write_record(file, answer)
        left = [(key, file, digest) for file in files if (digest := self._digest(file))]
        with self._open() as rows:
            rows.execute("BEGIN IMMEDIATE")
            rows.execute("INSERT OR REPLACE INTO answers VALUES (?, ?, ?)", (key, asked, image.getvalue()))
            rows.executemany("INSERT OR REPLACE INTO files VALUES (?, ?, ?)", left)
            rows.execute("COMMIT")

    def answers(self, wanted: Mapping[str, tuple[type, Sequence[str]]]) -> dict[str, Any]:
        """Return the answers that are there, by key: of each its class and the files that belong to it.

        One whose files are not as it left them is none: another question may have the same names.
        """
        found = {}
        with self._open() as rows:
            for key, (kind, files) in wanted.items():
                row = rows.execute("SELECT image FROM answers WHERE key = ?", (key,)).fetchone()
                left = dict(rows.execute("SELECT file, digest FROM files WHERE key = ?", (key,)))
                if row and all(file in left and left[file] == self._digest(file) for file in files):
                    with h5py.File(BytesIO(row[0])) as file:
                        found[key] = read_record(file, kind)
        return found

    def kept(self, kind: type) -> list[Any]:
        """Return all that was answered, in the order in which it came, where all of it is of class `kind`."""
        with self._open() as rows:
            images = rows.execute("SELECT image FROM answers ORDER BY rowid").fetchall()
        found = []
        for (image,) in images:
            with h5py.File(BytesIO(image)) as file:
                found.append(read_record(file, kind))
        return found

    def _digest(self, file: str) -> str | None:
        try:
            with open(self.path.parent / file, "rb") as stream:
                return hashlib.file_digest(stream, "sha256").hexdigest()
        except FileNotFoundError:
            return None

    @contextmanager
    def _open(self) -> Iterator[sqlite3.Connection]:
        """The file for a moment: nothing of it is held while a study computes."""
        try:
            with database(self.path, "rwc") as rows:
                yield rows
        except sqlite3.Error as error:
            raise UserError(f"{self.path}: not a journal that can be written ({error})") from error


def files_in(folder: Path) -> list[tuple[Path, set[str] | None]]:
    """Files that may be reports, with the names of what each states; None where it cannot be opened."""
    found: list[tuple[Path, set[str] | None]] = []
    for path in sorted(path for path in Path(folder).glob("*.h5") if path.is_file()):
        try:
            with h5py.File(path) as file:
                found.append((path, set(file.attrs)))
        except Exception:  # the library has its own for every way in which a file can be damaged
            found.append((path, None))
    return found


def reports_in(folder: Path) -> list[Path]:
    """The reports in a folder, and what cannot be opened and may be one; other files of HDF5 are not."""
    return [
        path for path, stated_there in files_in(folder) if stated_there is None or "schema" in stated_there
    ]


def key_of(work: Callable[..., Any], asked: str) -> str:
    """The key of an answer: what is asked of which function of which code."""
    text = json.dumps([work.__module__, work.__qualname__, asked, code(), _module_code(work.__module__)])
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def _module_code(module: str) -> str:
    """A digest of a module that `code` does not know: a user's study."""
    file = getattr(sys.modules.get(module), "__file__", None)
    known = file is None or module.split(".")[0] in SOURCES
    return "" if known else hashlib.sha256(Path(str(file)).read_bytes()).hexdigest()


def stated(ask: Any) -> str:
    """A question in JSON: plain values, dataclasses by class and fields by which they are compared, scenes by
    their text, functions by their place.
    """
    return json.dumps(ask, default=_plain, sort_keys=True)


def _plain(value: Any) -> Any:
    if isinstance(value, Scene):
        return value.text
    if is_dataclass(value) and not isinstance(value, type):
        return [
            type(value).__qualname__,
            {one.name: getattr(value, one.name) for one in fields(value) if one.compare},
        ]
    return f"{value.__module__}:{value.__qualname__}"
