"""The history as a file of SQLite: nights, their versions, numbers and claims, a table each.

A night is one transaction, begun with the lock of a writer: of an interrupted one nothing is left, and two
at once get in one after the other.  The journal is SQLite's default, a rollback journal, and not a
write-ahead log: nights are short and rare, and the history stays a single file that can be copied.
"""

import math
import sqlite3
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import TypeVar

import numpy as np

from actin_xcheck.core.claim import Claim
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import database
from actin_xcheck.nightly.history.record import Judged, Kind, Night, Number, Series

SCHEMA = 1
"""Version of the tables."""

_APPLICATION = 0x61637869
"""What SQLite files of ours have in their header ("acxi")."""

_STATED = ("date", "commit", "machine", "command", "budget", "seconds")
"""What the table of nights holds beside the name."""

_COLUMNS = ", ".join(f'"{name}"' for name in _STATED)

_Row = TypeVar("_Row", Number, Judged)

_TABLES = """
CREATE TABLE nights (night INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, date TEXT NOT NULL,
    "commit" TEXT NOT NULL, machine TEXT NOT NULL, command TEXT NOT NULL, budget REAL, seconds REAL);
CREATE TABLE versions (night INTEGER NOT NULL REFERENCES nights, package TEXT NOT NULL,
    version TEXT NOT NULL, PRIMARY KEY (night, package)) WITHOUT ROWID;
CREATE TABLE numbers (night INTEGER NOT NULL REFERENCES nights, key TEXT NOT NULL, kind TEXT NOT NULL,
    value REAL, unit TEXT NOT NULL, source TEXT NOT NULL, PRIMARY KEY (night, key)) WITHOUT ROWID;
CREATE TABLE claims (night INTEGER NOT NULL REFERENCES nights, key TEXT NOT NULL, scene TEXT NOT NULL,
    methods TEXT NOT NULL, statement TEXT NOT NULL, value REAL, bound REAL, verdict TEXT NOT NULL,
    seconds REAL, command TEXT NOT NULL, path TEXT NOT NULL, note TEXT NOT NULL, source TEXT NOT NULL,
    PRIMARY KEY (night, key)) WITHOUT ROWID
"""


@dataclass(frozen=True)
class Counted:
    """A night with how many numbers it has, and how many of its claims have each verdict."""

    night: Night
    numbers: int
    verdicts: Counter[str]


def append(path: Path, night: Night, numbers: Iterable[Number], claims: Iterable[Judged] = ()) -> Night:
    """Add a night to the history, whole or not at all, and return it as it is called there.

    A name that is taken gets a number behind it, as does a key that comes twice in one night.  The file is
    made where there is none; UserError where it is something else or cannot be written.
    """
    numbers, claims = tuple(numbers), tuple(claims)
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    with _open(path, "rwc") as rows:
        rows.execute("BEGIN IMMEDIATE")
        _prepare(rows, path)
        taken = {name for (name,) in rows.execute("SELECT name FROM nights")}
        called = replace(night, name=_free(night.name, taken))
        place = rows.execute(
            f"INSERT INTO nights (name, {_COLUMNS}) VALUES (?{', ?' * len(_STATED)})",
            (
                called.name,
                night.date,
                night.commit,
                night.machine,
                night.command,
                night.budget,
                night.seconds,
            ),
        ).lastrowid
        for table, width, written in (
            ("versions", 3, ((place, *version) for version in night.versions.items())),
            ("numbers", 6, ((place, key, *_number(one)) for key, one in _keyed(numbers))),
            ("claims", 13, ((place, key, *_claim(one)) for key, one in _keyed(claims))),
        ):
            rows.executemany(f"INSERT INTO {table} VALUES ({', '.join('?' * width)})", written)
        rows.execute("COMMIT")
    return called


def read_nights(path: Path) -> list[Counted]:
    """Return the nights in the order of their dates; UserError where the file is none of ours."""
    with _reading(path) as rows:
        numbers = Counter(dict(rows.execute("SELECT night, count(*) FROM numbers GROUP BY night")))
        counted = "SELECT night, verdict, count(*) FROM claims GROUP BY night, verdict ORDER BY night"
        verdicts = {
            place: Counter({verdict: count for _, verdict, count in group})
            for place, group in groupby(rows.execute(counted), lambda row: row[0])
        }
        return [
            Counted(night, numbers[place], verdicts.get(place, Counter()))
            for place, night in _nights(rows).items()
        ]


def read_numbers(path: Path, name: str) -> list[Number]:
    """Return the numbers of a night, by key."""
    chosen = "SELECT key, kind, value, unit, source FROM numbers JOIN nights USING (night) WHERE name = ?"
    with _reading(path) as rows:
        return [
            Number(key, Kind(kind), _float(value), unit, source)
            for key, kind, value, unit, source in rows.execute(f"{chosen} ORDER BY key", (name,))
        ]


def read_claims(path: Path, name: str) -> dict[str, Judged]:
    """Return the claims of a night by their keys."""
    chosen = (
        "SELECT key, scene, methods, statement, value, bound, claims.command, path, note, claims.seconds,"
        " source FROM claims JOIN nights USING (night) WHERE name = ? ORDER BY key"
    )
    with _reading(path) as rows:
        return {
            key: Judged(
                Claim(scene, tuple(methods.split()), statement, _float(value), _float(bound), *rest),
                _float(seconds),
                source,
            )
            for key, scene, methods, statement, value, bound, *rest, seconds, source in rows.execute(
                chosen, (name,)
            )
        }


def read_series(path: Path, pattern: str = "*") -> list[Series]:
    """Return every number and the value of every claim (key "claim/...") through the nights.

    Parameters
    ----------
    path : of the history; UserError where it is none.
    pattern : which keys, as a shell's pattern (SQLite's GLOB).
    """
    chosen = """
        SELECT * FROM (SELECT key, kind, unit, night, value FROM numbers
            UNION ALL SELECT 'claim/' || key, 'claim', '', night, value FROM claims)
        JOIN nights USING (night) WHERE key GLOB ? ORDER BY kind, key, unit, date, night
    """
    with _reading(path) as rows:
        nights = _nights(rows)
        found = []
        for (key, kind, unit), group in groupby(rows.execute(chosen, (pattern,)), lambda row: row[:3]):
            places, values = zip(*((row[3], _float(row[4])) for row in group), strict=True)
            found.append(
                Series(key, Kind(kind), unit, tuple(nights[place] for place in places), np.array(values))
            )
        return found


def find_night(nights: Sequence[Counted], text: str) -> Counted:
    """Return the night whose name begins like this; UserError where none or several do."""
    found = [one for one in nights if one.night.name.startswith(text)]
    exact = [one for one in found if one.night.name == text]
    if len(exact or found) != 1:
        known = ", ".join(one.night.name for one in (found or nights)[-5:]) or "none"
        raise UserError(
            f"{text}: {'several nights begin' if found else 'no night begins'} so; such as {known}"
        )
    return (exact or found)[0]


def _number(one: Number) -> tuple[str | float, ...]:
    return str(one.kind), one.value, one.unit, one.source


def _claim(one: Judged) -> tuple[str | float, ...]:
    claim = one.claim
    return (
        claim.scene, " ".join(claim.methods), claim.statement, claim.value, claim.bound, claim.verdict,
        one.seconds, claim.command, claim.path, claim.note, one.source,
    )  # fmt: skip


def _keyed(given: Iterable[_Row]) -> Iterator[tuple[str, _Row]]:
    """Each with its key, and a number behind where that has been given."""
    taken: set[str] = set()
    for one in given:
        taken.add(key := _free(one.key, taken))
        yield key, one


def _free(name: str, taken: set[str]) -> str:
    """The name, with the first number behind that makes it free."""
    count, free = 1, name
    while free in taken:
        free = f"{name}-{(count := count + 1)}"
    return free


def _nights(rows: sqlite3.Connection) -> dict[int, Night]:
    versions = {
        place: {package: version for _, package, version in group}
        for place, group in groupby(rows.execute("SELECT * FROM versions ORDER BY night"), lambda row: row[0])
    }
    chosen = f"SELECT night, name, {_COLUMNS} FROM nights ORDER BY date, night"
    return {
        place: Night(
            name, date, commit, versions.get(place, {}), machine, command, _float(budget), _float(seconds)
        )
        for place, name, date, commit, machine, command, budget, seconds in rows.execute(chosen)
    }


def _float(value: float | None) -> float:
    """A number of the file; nan is NULL there."""
    return math.nan if value is None else float(value)


def _prepare(rows: sqlite3.Connection, path: Path) -> None:
    """Make the tables where the file is new."""
    if rows.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,):
        for table in _TABLES.split(";"):
            rows.execute(table)
        rows.execute(f"PRAGMA application_id = {_APPLICATION}")
        rows.execute(f"PRAGMA user_version = {SCHEMA}")
    _check(rows, path)


def _check(rows: sqlite3.Connection, path: Path) -> None:
    (application,), (schema,) = (
        rows.execute(f"PRAGMA {name}").fetchone() for name in ("application_id", "user_version")
    )
    if application != _APPLICATION:
        raise UserError(f"{path}: a database of something else; expected a history written by actin_xcheck")
    if schema != SCHEMA:
        raise UserError(f"{path}: schema {schema}, but this version reads schema {SCHEMA}")


@contextmanager
def _open(path: Path, mode: str) -> Iterator[sqlite3.Connection]:
    """A connection of this moment; whatever SQLite says against the file becomes one line."""
    try:
        with database(path, mode) as rows:
            yield rows
    except sqlite3.Error as error:
        raise UserError(f"{path}: not a whole history, or it cannot be written ({error})") from error


@contextmanager
def _reading(path: Path) -> Iterator[sqlite3.Connection]:
    """A connection that sees one state of the history.

    It may write, for of a night that was killed the next to open the file takes back what it had begun.
    """
    if not Path(path).is_file():
        raise UserError(f"{path}: no such file; expected a history written by actin_xcheck")
    with _open(path, "rw") as rows:
        _check(rows, path)
        rows.execute("BEGIN")
        try:
            yield rows
        except (KeyError, TypeError, ValueError) as error:
            raise UserError(f"{path}: not a whole history ({error})") from error
