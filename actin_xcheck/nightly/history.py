"""The history as a file of SQLite: nights, their versions, numbers and claims, a table each.

Claims were kept by their sentences once; a file of that time gets their keys when it is opened first.

A night is one transaction, begun with the lock of a writer: of an interrupted one nothing is left, and two
at once get in one after the other.  The journal is SQLite's default, a rollback journal, and not a
write-ahead log: nights are short and rare, and the history stays a single file that can be copied.
"""

import math
import sqlite3
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from actin_xcheck.core.claim import Claim, claim_of, free_name
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import database
from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array
from actin_xcheck.nightly.record import Done, Kept, Night, Number, NumberKind, number

FILE_NAME = "history.sqlite"

SCHEMA, BEFORE = 2, 1
"""Version of the tables, and the one whose claims had no keys of their own."""

STOPPED = "stopped"
"""Numbers of the history: seconds after which a check was stopped, so that it takes longer."""

ROUND_OFF = 1e-9
"""Numbers that differ by less, relatively or (orders and rates) of their size, are equal."""

_APPLICATION = 0x61637869
"""What SQLite files of ours have in their header ("acxi")."""

_STATED = ("name", "date", "commit", "machine", "command", "budget", "seconds")
"""What the table of nights holds."""

_COLUMNS = ", ".join(f'"{name}"' for name in _STATED)

_Row = TypeVar("_Row", Number, "JudgedNumber")

_TABLES = """
CREATE TABLE nights (night INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, date TEXT NOT NULL,
    "commit" TEXT NOT NULL, machine TEXT NOT NULL, command TEXT NOT NULL, budget REAL, seconds REAL);
CREATE TABLE versions (night INTEGER NOT NULL REFERENCES nights, package TEXT NOT NULL,
    version TEXT NOT NULL, PRIMARY KEY (night, package)) WITHOUT ROWID;
CREATE TABLE numbers (night INTEGER NOT NULL REFERENCES nights, key TEXT NOT NULL, kind TEXT NOT NULL,
    value REAL, unit TEXT NOT NULL, source TEXT NOT NULL, PRIMARY KEY (night, key)) WITHOUT ROWID;
"""

_CLAIMS = """
CREATE TABLE claims (night INTEGER NOT NULL REFERENCES nights, key TEXT NOT NULL, kind TEXT NOT NULL,
    quantity TEXT NOT NULL, scene TEXT NOT NULL, methods TEXT NOT NULL, statement TEXT NOT NULL, value REAL,
    bound REAL, verdict TEXT NOT NULL, command TEXT NOT NULL, path TEXT NOT NULL, note TEXT NOT NULL,
    "check" TEXT NOT NULL, seconds REAL, source TEXT NOT NULL, PRIMARY KEY (night, key)) WITHOUT ROWID
"""

_LEAST = {NumberKind.ERROR: 1e-16, NumberKind.CLAIM: 1e-16, NumberKind.TIME: 1e-6}
_LEAST |= {NumberKind.MEMORY: 1.0, NumberKind.COUNT: 0.5}
"""Below this, numbers on a logarithm are one: smaller errors are round-off, and 0 has no logarithm."""

_INTEREST = {
    NumberKind.ERROR: math.log(2.0),
    NumberKind.CLAIM: math.log(2.0),
    NumberKind.ORDER: 0.1,
    NumberKind.RATE: 0.05,
}
"""The smallest change of interest, on the number's scale, but of work; of a rate, in parts of its median."""


@dataclass(frozen=True)
class JudgedNumber:
    """A claim as it came out in a night: in which check, how long its runs took, the file that holds them."""

    claim: Claim
    check: str
    seconds: float = math.nan
    source: str = ""

    @property
    def key(self) -> str:
        """Its name, the same every night."""
        return f"{self.claim.key} · {self.check}"


@dataclass(frozen=True, eq=False)
class Series:
    """A number through the nights that asked for it.

    Attributes
    ----------
    key, kind, unit : of the number.
    nights : in order.
    values : (n,), nan where a night could not have it.
    """

    key: str
    kind: NumberKind
    unit: str
    nights: tuple[Night, ...]
    values: Array

    @property
    def scaled(self) -> Array:
        """The values on the scale on which they are compared, (n,)."""
        if not self.kind.logarithmic:
            return self.values
        return np.log(np.maximum(np.abs(self.values), _LEAST[self.kind]))

    @property
    def round_off(self) -> float:
        """Differences up to this, on that scale, are none."""
        return ROUND_OFF if self.kind.logarithmic else ROUND_OFF * max(1.0, np.nanmax(np.abs(self.values)))

    @property
    def interest(self) -> float:
        """The smallest change of interest, on that scale."""
        size = float(np.nanmedian(np.abs(self.values))) if self.kind is NumberKind.RATE else 1.0
        return max(_INTEREST.get(self.kind, math.log(1.15)) * size, self.round_off)

    @property
    def by_machine(self) -> list["Series"]:
        """The series, or that of each machine where machines are not comparable."""
        if not self.kind.of_machine:
            return [self]
        machines = np.array([night.machine for night in self.nights])
        return [self.only(np.flatnonzero(machines == machine)) for machine in dict.fromkeys(machines)]

    def only(self, places: Indices) -> "Series":
        """The same of the nights at these places."""
        return replace(self, nights=tuple(self.nights[i] for i in places), values=self.values[places])


@dataclass(frozen=True)
class Counted:
    """A night with how many numbers it has, and how many of its claims have each verdict."""

    night: Night
    numbers: int
    verdicts: Counter[str]


def append(path: Path, night: Night, numbers: Iterable[Number], claims: Iterable[JudgedNumber] = ()) -> Night:
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
        called = replace(night, name=free_name(night.name, taken))
        place = _insert(rows, "nights", {name: getattr(called, name) for name in _STATED})
        for package, version in night.versions.items():
            _insert(rows, "versions", {"night": place, "package": package, "version": version})
        for key, number_ in _keyed(numbers):
            _insert(rows, "numbers", {"night": place, **vars(number_), "key": key})
        for key, judged in _keyed(claims):
            _insert(rows, "claims", _claim(judged) | {"night": place, "key": key})
        rows.execute("COMMIT")
    return called


def remember(history: Path, kept: Kept) -> Night:
    """Add a night to the history, once however often this is asked for, as it is called there."""
    begun = kept.begun
    versions = {name: version for name, version in begun.versions.items() if name != "commit"}
    night = Night(
        begun.name, begun.date, begun.versions["commit"], versions, begun.machine, begun.command,
        60 * begun.minutes, kept.seconds,
    )  # fmt: skip
    for one in read_nights(history) if history.exists() else ():
        if one.night.date == night.date and one.night.machine == night.machine:
            return one.night
    return append(history, night, numbers_of(kept), judged_in(kept.done))


def numbers_of(kept: Kept) -> Iterator[Number]:
    """The numbers of a night beside the values of its claims."""
    yield Number("kernel", NumberKind.TIME, kept.begun.kernel, "s")
    for one in kept.done:
        yield from one.numbers
        yield Number(f"red/{one.name}", NumberKind.COUNT, float(one.red))
    for left in kept.left_out:
        if left.seconds:
            yield Number(f"{STOPPED}/{left.name}", NumberKind.TIME, left.seconds, "s")


def judged_in(done: Iterable[Done]) -> Iterator[JudgedNumber]:
    """The claims of checks as the history keeps them."""
    for one in done:
        for claim, file in zip(one.claims, one.files, strict=True):
            yield JudgedNumber(claim, one.name, one.seconds, file)


def read_nights(path: Path) -> list[Counted]:
    """Return the nights in the order of their dates; UserError where the file is none of ours."""
    with _reading(path) as rows:
        numbers = Counter(dict(rows.execute("SELECT night, count(*) FROM numbers GROUP BY night")))
        verdicts: dict[int, Counter[str]] = {}
        for place, verdict in rows.execute("SELECT night, verdict FROM claims"):
            verdicts.setdefault(place, Counter())[verdict] += 1
        return [
            Counted(night, numbers[place], verdicts.get(place, Counter()))
            for place, night in _nights(rows).items()
        ]


def read_numbers(path: Path, name: str) -> list[Number]:
    """Return the numbers of a night, by key."""
    chosen = "SELECT key, kind, value, unit, source FROM numbers JOIN nights USING (night) WHERE name = ?"
    with _reading(path) as rows:
        found = rows.execute(f"{chosen} ORDER BY key", (name,))
        return [Number(key, NumberKind(kind), number(value), *rest) for key, kind, value, *rest in found]


def read_claims(path: Path, name: str) -> dict[str, JudgedNumber]:
    """Return the claims of a night by their keys."""
    chosen = "SELECT claims.* FROM claims JOIN nights USING (night) WHERE name = ? ORDER BY key"
    with _reading(path) as rows:
        return {said["key"]: _judged(said) for said in _columns(rows.execute(chosen, (name,)))}


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
        nights, found = _nights(rows), []
        for (key, kind, unit), group in groupby(rows.execute(chosen, (pattern,)), lambda row: row[:3]):
            places, values = zip(*((nights[row[3]], number(row[4])) for row in group), strict=True)
            found.append(Series(key, NumberKind(kind), unit, places, np.array(values)))
        return found


def find_night(nights: Sequence[Counted], text: str) -> Counted:
    """Return the night whose name begins like this; UserError where none or several do."""
    found = [one for one in nights if one.night.name.startswith(text)]
    exact = [one for one in found if one.night.name == text]
    if len(exact or found) != 1:
        known = ", ".join(one.night.name for one in (found or nights)[-5:]) or "none"
        how = "several nights begin" if found else "no night begins"
        raise UserError(f"{text}: {how} so; such as {known}")
    return (exact or found)[0]


def _claim(one: JudgedNumber) -> dict[str, Any]:
    """What columns hold of a claim."""
    stated = vars(one.claim) | {"methods": " ".join(one.claim.methods), "verdict": one.claim.verdict}
    return stated | {"check": one.check, "seconds": one.seconds, "source": one.source}


def _judged(said: Mapping[str, Any]) -> JudgedNumber:
    """The claim that columns hold, and how it was judged."""
    claim = {name: number(said[name]) for name in ("value", "bound")} | {"methods": said["methods"].split()}
    return JudgedNumber(claim_of({**said, **claim}), said["check"], number(said["seconds"]), said["source"])


def _columns(found: sqlite3.Cursor) -> Iterator[dict[str, Any]]:
    """Each row that was found, by the names of its columns."""
    names = [name for name, *_ in found.description]
    return (dict(zip(names, row, strict=True)) for row in found)


def _insert(rows: sqlite3.Connection, table: str, said: Mapping[str, Any]) -> int | None:
    """Add a row to a table by the names of its columns, and return its place."""
    names, marks = ", ".join(f'"{name}"' for name in said), ", ".join(f":{name}" for name in said)
    return rows.execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", said).lastrowid


def _keyed(given: Iterable[_Row]) -> Iterator[tuple[str, _Row]]:
    """Each with its key, and a number behind where that has been given."""
    taken: set[str] = set()
    for one in given:
        taken.add(key := free_name(one.key, taken))
        yield key, one


def _nights(rows: sqlite3.Connection) -> dict[int, Night]:
    """The nights by their places, in the order of their dates."""
    versions: dict[int, dict[str, str]] = {}
    for place, package, version in rows.execute("SELECT * FROM versions"):
        versions.setdefault(place, {})[package] = version
    found = _columns(rows.execute(f"SELECT night, {_COLUMNS} FROM nights ORDER BY date, night"))
    return {
        (place := said.pop("night")): Night(
            **said | {name: number(said[name]) for name in ("budget", "seconds")},
            versions=versions.get(place, {}),
        )
        for said in found
    }


def _prepare(rows: sqlite3.Connection, path: Path) -> None:
    """Make the tables where the file is new."""
    if rows.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,):
        for table in (*_TABLES.split(";"), _CLAIMS):
            rows.execute(table)
        rows.execute(f"PRAGMA application_id = {_APPLICATION}")
        rows.execute(f"PRAGMA user_version = {SCHEMA}")
    _check(rows, path)


def _header(rows: sqlite3.Connection) -> tuple[int, ...]:
    """Whose file it is, and the version of its tables."""
    return tuple(rows.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version"))


def _bring_forward(rows: sqlite3.Connection, path: Path) -> None:
    """Give the claims of the version before their keys, all at once; its table stays, as `claims_1`.

    Each goes on under the one key that all its sentences have; of two at once the second finds nothing to do.
    """
    if _header(rows) != (_APPLICATION, BEFORE):
        return
    rows.execute("BEGIN IMMEDIATE")
    if _header(rows)[1] == BEFORE:
        rows.execute(f"ALTER TABLE claims RENAME TO claims_{BEFORE}")
        rows.execute(_CLAIMS)
        old = _columns(rows.execute(f"SELECT * FROM claims_{BEFORE} ORDER BY night, key"))
        try:
            for place, night in groupby(old, lambda said: said["night"]):
                for key, one in _keyed(map(_told, night)):
                    _insert(rows, "claims", _claim(one) | {"night": place, "key": key})
        except (AttributeError, TypeError, ValueError) as error:
            raise UserError(f"{path}: not a whole history ({error})") from error
        rows.execute(f"PRAGMA user_version = {SCHEMA}")
    rows.execute("COMMIT")


def _told(said: dict[str, Any]) -> JudgedNumber:
    """A claim of the version before, whose statement ended in its check."""
    statement, _, check = said["statement"].rpartition(" · ")
    return _judged(said | {"statement": statement, "check": check})


def _check(rows: sqlite3.Connection, path: Path) -> None:
    application, schema = _header(rows)
    if application != _APPLICATION:
        raise UserError(f"{path}: a database of something else; expected a history written by actin_xcheck")
    if schema != SCHEMA:
        raise UserError(f"{path}: schema {schema}, but this version reads schema {SCHEMA}")


@contextmanager
def _open(path: Path, mode: str) -> Iterator[sqlite3.Connection]:
    """A connection of this moment, to tables of this version; what SQLite says against it is one line."""
    try:
        with database(path, mode) as rows:
            _bring_forward(rows, path)
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
