"""What has been run, kept as it comes: one row of a SQLite file each, by the process that asked for it.

One that is killed loses the runs that had not come in.  Rows are found by what was run and by which code:
those of a checkout with changes, or of none, are not taken up again.
"""

import hashlib
import json
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import database
from actin_xcheck.studies.frontier.answers import Answer, Truth
from actin_xcheck.studies.frontier.planes import Point

FILE_NAME = "points.sqlite"


class Journal:
    """The runs of one report.

    Parameters
    ----------
    path : the file, made where there is none; UserError where it is something else.
    versions : of the code that runs, see `store.provenance`.
    """

    def __init__(self, path: Path, versions: dict[str, str]) -> None:
        self.path, self.versions = Path(path), versions
        with self._open() as rows:
            rows.execute("CREATE TABLE IF NOT EXISTS runs (key TEXT PRIMARY KEY, what TEXT, found TEXT)")

    def keep(self, what: Point | str, found: Answer | Truth) -> None:
        """Write down what a point's run answers, or the truth of a scene (TOML)."""
        row = (self._key(what), json.dumps(_stated(what)), json.dumps(asdict(found)))
        with self._open() as rows:
            rows.execute("INSERT OR REPLACE INTO runs VALUES (?, ?, ?)", row)

    def answer(self, point: Point) -> Answer | None:
        """What the point's run answered; None where this code has not run it."""
        found = self._found(point)
        return None if found is None else _answer(found)

    def truth(self, scene: str) -> Truth | None:
        """The truth of a scene (TOML); None where this code has not run it."""
        found = self._found(scene)
        return None if found is None else Truth(**found | {"answer": _answer(found["answer"])})

    def _found(self, what: Point | str) -> dict | None:
        commit = self.versions["commit"]
        if commit == "unknown" or commit.endswith("-dirty"):  # which code was it?
            return None
        with self._open() as rows:
            row = rows.execute("SELECT found FROM runs WHERE key = ?", (self._key(what),)).fetchone()
        return None if row is None else dict(json.loads(row[0]))

    def _key(self, what: Point | str) -> str:
        text = json.dumps([_stated(what), self.versions], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    @contextmanager
    def _open(self) -> Iterator[sqlite3.Connection]:
        """A connection of this moment: two reports in one folder share the file, and nothing else."""
        try:
            with database(self.path, "rwc") as rows:
                yield rows
        except sqlite3.Error as error:
            raise UserError(f"{self.path}: not a journal of runs that can be written ({error})") from error


def _stated(what: Point | str) -> dict[str, str | int | float]:
    return {"truth of": what} if isinstance(what, str) else asdict(what)


def _answer(found: dict) -> Answer:
    return Answer(**found | {"a": tuple(found["a"]), "x": tuple(found["x"])})
