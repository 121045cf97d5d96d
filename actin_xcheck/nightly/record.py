"""A night as it is kept while it goes on: a file of JSON lines, one for every check that is over.

The first line says what was begun, the last one that it was closed; a night without that can be gone on with.
A process that is killed while it writes leaves half a line at the end, which is none.
"""

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from actin_xcheck.core.claim import Claim
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.unnamed import claim_of
from actin_xcheck.nightly.history.record import Kind, Number

FILE_NAME = "night.jsonl"

SCHEMA = 1
"""Version of the lines."""


@dataclass(frozen=True)
class Begun:
    """What a night set out to do.

    Attributes
    ----------
    name : of the night and of its folder.
    date : ISO 8601, UTC, to the microsecond: no other night begins then.
    versions : of the code and its libraries, see `store.provenance`.
    machine : what tells it from others.
    command : what makes it again.
    minutes : wall time it may take; inf without a limit.
    fault : a deliberate fault that is on all night; empty without.
    baseline : the night whose numbers must not be worse; empty without.
    planned : names of the checks, in the order in which they are tried.
    kernel : seconds of the reference kernel when it began.
    """

    name: str
    date: str
    versions: Mapping[str, str]
    machine: str
    command: str
    minutes: float
    fault: str
    baseline: str
    planned: tuple[str, ...]
    kernel: float


@dataclass(frozen=True)
class Done:
    """A check that is over.

    Attributes
    ----------
    name : of the check.
    claims : what came out; where the check broke down there is one, which fails.
    files : of each claim, relative to the night's folder: what holds the number; empty where nothing is kept.
    numbers : what goes to the history beside the claims.
    seconds : wall time.
    trouble : why there is no verdict, a sentence: the check broke down; empty where it did not.
    reached : functions with a known fault that it called.
    folder : where its files are, relative to the night's.
    host : name of the cluster's machine that did it; empty without a cluster.
    """

    name: str
    claims: tuple[Claim, ...]
    files: tuple[str, ...]
    numbers: tuple[Number, ...]
    seconds: float
    trouble: str = ""
    reached: tuple[str, ...] = ()
    folder: str = ""
    host: str = ""

    @property
    def red(self) -> int:
        """How many claims fail."""
        return sum(one.verdict == "FAIL" for one in self.claims)


@dataclass(frozen=True)
class NotRun:
    """A check that was left out, and why.

    Attributes
    ----------
    name, why : of the check; a sentence.
    seconds : after which it was stopped; 0 where it was not, or was not begun.
    """

    name: str
    why: str
    seconds: float = 0.0


@dataclass(frozen=True)
class Kept:
    """What a night's file holds.

    Attributes
    ----------
    folder : of the night.
    begun : its first line.
    done : checks that are over, in the order in which they were.
    left_out : of a closed night.
    seconds : wall time of a closed night; of an interrupted one until its last check.
    closed : whether it came to its end.
    """

    folder: Path
    begun: Begun
    done: tuple[Done, ...] = ()
    left_out: tuple[NotRun, ...] = ()
    seconds: float = 0.0
    closed: bool = False

    @property
    def claims(self) -> tuple[Claim, ...]:
        """Of all checks."""
        return tuple(claim for one in self.done for claim in one.claims)

    @property
    def red(self) -> int:
        """How many claims fail."""
        return sum(one.red for one in self.done)

    @property
    def green(self) -> bool:
        """Whether something was judged, all of it holds, and no check that was planned is missing."""
        kept = {one.name for one in self.done} | {one.name for one in self.left_out}
        return not self.red and any(claim.judged for claim in self.claims) and kept >= {*self.begun.planned}


@dataclass
class Journal:
    """Writes a night's file, a line at a time."""

    path: Path
    _lines: list[dict[str, Any]] = field(default_factory=list)

    def begin(self, begun: Begun) -> None:
        """The first line."""
        self._append({"schema": SCHEMA, "begun": asdict(begun)})

    def keep(self, done: Done, seconds: float) -> None:
        """A check that is over, so many seconds after the beginning."""
        self._append({"done": asdict(done), "seconds": seconds})

    def close(self, left_out: Sequence[NotRun], seconds: float) -> None:
        """The last line."""
        self._append({"closed": [asdict(one) for one in left_out], "seconds": seconds})

    def _append(self, line: dict[str, Any]) -> None:
        text = json.dumps(plain(line), allow_nan=False)  # ASCII: a line is a line
        with self.path.open("ab+") as file:
            if file.tell() and (file.seek(-1, os.SEEK_END), file.read(1))[1] != b"\n":
                file.write(b"\n")  # behind the half of a line that a killed process left
            file.write(text.encode("utf-8") + b"\n")
            file.flush()
            os.fsync(file.fileno())


def read_night(folder: Path) -> Kept:
    """Return what is kept in a night's folder; UserError where its file is missing or none of ours."""
    path = Path(folder) / FILE_NAME
    if not path.is_file():
        raise UserError(f"{path}: no such file; expected a night kept by actin_xcheck")
    lines = []
    for text in path.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            lines.append(json.loads(text))
        except ValueError:  # half a line
            continue
    try:
        if lines[0]["schema"] != SCHEMA:
            raise UserError(f"{path}: schema {lines[0]['schema']}, but this version reads schema {SCHEMA}")
        stated = lines[0]["begun"] | {"planned": tuple(lines[0]["begun"]["planned"])}
        begun = Begun(**stated | {name: _float(stated[name]) for name in ("minutes", "kernel")})
        done = tuple(_done(line["done"]) for line in lines if "done" in line)
        closing = [line for line in lines if "closed" in line]
        left_out = tuple(NotRun(**one) for one in closing[-1]["closed"]) if closing else ()
        seconds = max((_float(line["seconds"]) for line in lines[1:]), default=0.0)
        return Kept(Path(folder), begun, done, left_out, seconds, bool(closing))
    except (KeyError, TypeError, IndexError, ValueError, AttributeError) as error:
        raise UserError(f"{path}: not a night kept by actin_xcheck ({error!r})") from error


def plain(found: Any) -> Any:
    """The same for JSON, which knows no nan (null) and no infinity (a string)."""
    if isinstance(found, Mapping):
        return {name: plain(value) for name, value in found.items()}
    if isinstance(found, list | tuple):
        return [plain(value) for value in found]
    if isinstance(found, float) and not math.isfinite(found):
        return None if math.isnan(found) else str(found)
    return found


def _float(value: float | str | None) -> float:
    return math.nan if value is None else float(value)


def _done(said: dict[str, Any]) -> Done:
    claims = tuple(
        claim_of(one | {"value": _float(one["value"]), "bound": _float(one["bound"])})
        for one in said["claims"]
    )
    numbers = tuple(
        Number(**one | {"kind": Kind(one["kind"]), "value": _float(one["value"])}) for one in said["numbers"]
    )
    lists = {name: tuple(said[name]) for name in ("files", "reached")}
    return Done(**said | lists | {"claims": claims, "numbers": numbers, "seconds": _float(said["seconds"])})
