"""A night and its numbers: what it set out to do, what became of its checks, and the file that says so.

`night.jsonl` holds a line for what was begun, one for every check that is over, and one that closes it; while
a night goes on its answers are in the journal beside it, like those of a study.  JUnit XML says the same to
those who read that.
"""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from io import BytesIO
from pathlib import Path
from typing import Any

from actin_xcheck.core.claim import Claim, claim_of
from actin_xcheck.core.errors import LONGEST, UserError, brief
from actin_xcheck.core.files import replace_file
from actin_xcheck.studies import journal

FILE_NAME, STUDY = "night.jsonl", "nightly"

SCHEMA = 1
"""Version of the lines."""


class NumberKind(StrEnum):
    """What a number is, which says how it is read."""

    ERROR = "error"
    ORDER = "order"
    RATE = "rate"
    TIME = "time"
    MEMORY = "memory"
    COUNT = "count"
    CLAIM = "claim"

    @property
    def worse(self) -> int:
        """1 where larger is worse, -1 where smaller is, 0 where either is news."""
        return {NumberKind.ORDER: -1, NumberKind.RATE: 0}.get(self, 1)

    @property
    def logarithmic(self) -> bool:
        """Whether numbers are compared by their ratio."""
        return self not in (NumberKind.ORDER, NumberKind.RATE)

    @property
    def of_machine(self) -> bool:
        """Whether numbers of different machines say nothing about each other."""
        return self in (NumberKind.TIME, NumberKind.MEMORY)


@dataclass(frozen=True)
class Number:
    """One number of a night.

    Attributes
    ----------
    key : its name, the same every night, such as "error/area/fig14-four-fronts/fem-p1-paper".
    kind, value, unit : what it is; the value is nan where it was asked for and could not be had.
    source : where it comes from, the run's file or the command that makes it again.
    """

    key: str
    kind: NumberKind
    value: float
    unit: str = ""
    source: str = ""


@dataclass(frozen=True)
class Night:
    """Where, when and of what the numbers of a night were made.

    Attributes
    ----------
    name : by which it is asked for, such as "2026-03-04".
    date : its beginning, ISO 8601, UTC; nights are in the order of their dates.
    commit : of the code.
    versions : by package.
    machine : what tells it from others whose times and memory are not comparable.
    command : what makes it again.
    budget, seconds : wall time it was given and took; inf without a limit, nan where unknown.
    """

    name: str
    date: str
    commit: str
    versions: Mapping[str, str]
    machine: str
    command: str = ""
    budget: float = math.inf
    seconds: float = math.nan

    def differences(self, before: "Night") -> tuple[str, ...]:
        """What of the code, its libraries and the machine is not as it was in another night, in words."""
        packages = sorted({*before.versions, *self.versions})
        pairs = [("commit", short(before.commit), short(self.commit))]
        pairs += ((name, before.versions.get(name, ""), self.versions.get(name, "")) for name in packages)
        pairs.append(("machine", before.machine, self.machine))
        return tuple(f"{name} {old or 'none'} -> {new or 'none'}" for name, old, new in pairs if old != new)


def short(commit: str) -> str:
    """A commit as it is read; one with changes that were not committed stays told from the others."""
    revision, dash, state = commit.partition("-")
    return revision[:12] + dash + state


@dataclass(frozen=True)
class Begun:
    """What a night set out to do.

    Attributes
    ----------
    name : of the night and of its folder.
    date : ISO 8601, UTC, to the microsecond: no other night begins then.
    versions : of the code and its libraries, see `provenance.provenance`.
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
    numbers: tuple[Number, ...] = ()
    seconds: float = 0.0
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
    """A check that was left out, and why; `seconds` after which it was stopped, 0 where it was not."""

    name: str
    why: str
    seconds: float = 0.0

    @property
    def stopped(self) -> bool:
        """Whether it was begun, or a machine was missing; else there was no time, or nothing to judge."""
        return self.seconds > 0 or self.why.startswith("the machine")


@dataclass(frozen=True)
class Kept:
    """What a night's file holds.

    Attributes
    ----------
    folder : of the night.
    begun : its first line.
    done : checks that are over.
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


def write_night(kept: Kept) -> None:
    """Write the file of a night, whole or not at all."""
    lines: list[dict[str, Any]] = [{"schema": SCHEMA, "begun": asdict(kept.begun)}]
    lines += ({"done": asdict(one)} for one in kept.done)
    if kept.closed:
        lines.append({"closed": [asdict(one) for one in kept.left_out]})
    lines[-1]["seconds"] = kept.seconds
    text = "".join(
        json.dumps(plain(line), allow_nan=False) + "\n" for line in lines
    )  # ASCII: a line is a line
    replace_file(kept.folder / FILE_NAME, text.encode("utf-8"))


def read_night(folder: Path) -> Kept:
    """Return what is kept in a night's folder; UserError where its file is missing or none of ours."""
    path = Path(folder) / FILE_NAME
    if not path.is_file():
        raise UserError(f"{path}: no such file; expected a night kept by actin_xcheck")
    lines = []
    for text in path.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            lines.append(json.loads(text))
        except ValueError:  # half a line, of a night that was killed while it wrote
            continue
    try:
        if lines[0]["schema"] != SCHEMA:
            raise UserError(f"{path}: schema {lines[0]['schema']}, but this version reads schema {SCHEMA}")
        stated = lines[0]["begun"] | {"planned": tuple(lines[0]["begun"]["planned"])}
        begun = Begun(**stated | {name: number(stated[name]) for name in ("minutes", "kernel")})
        done = tuple(_done(line["done"]) for line in lines if "done" in line)
        seconds = max((number(line["seconds"]) for line in lines if "seconds" in line), default=0.0)
        kept = Kept(Path(folder), begun, done, (), seconds)
        if closing := [line["closed"] for line in lines if "closed" in line]:
            return replace(kept, left_out=tuple(NotRun(**one) for one in closing[-1]), closed=True)
        return _so_far(kept)
    except (KeyError, TypeError, IndexError, ValueError, AttributeError) as error:
        raise UserError(f"{path}: not a night kept by actin_xcheck ({error!r})") from error


def _so_far(kept: Kept) -> Kept:
    """A night that was interrupted, with what its journal holds: as long as that was written to."""
    answers = kept.folder / journal.FILE_NAME
    if not answers.exists():
        return kept
    done = (*kept.done, *journal.Journal(kept.folder, STUDY).kept(Done))
    more = answers.stat().st_mtime - (kept.folder / FILE_NAME).stat().st_mtime
    last = {one.name: one for one in done}  # other code may have answered too
    return replace(kept, done=tuple(last.values()), seconds=kept.seconds + max(more, 0.0))


def nights_in(reports: Path) -> Iterator[Kept]:
    """The nights whose folders lie here, in the order in which they were begun."""
    found = []
    for path in reports.glob(f"*/{FILE_NAME}"):
        try:
            found.append(read_night(path.parent))
        except UserError:
            continue
    yield from sorted(found, key=lambda one: (one.begun.date, one.begun.name))


def plain(found: Any) -> Any:
    """The same for JSON, which knows no nan (null) and no infinity (a string)."""
    if isinstance(found, Mapping):
        return {name: plain(value) for name, value in found.items()}
    if isinstance(found, list | tuple):
        return [plain(value) for value in found]
    if isinstance(found, float) and not math.isfinite(found):
        return None if math.isnan(found) else str(found)
    return found


def number(value: float | str | None) -> float:
    """The number that stands for `value` in JSON, or in a table, where nan is nothing."""
    return math.nan if value is None else float(value)


def _done(said: dict[str, Any]) -> Done:
    claims = (
        claim_of(one | {name: number(one[name]) for name in ("value", "bound")}) for one in said["claims"]
    )
    numbers = (
        Number(**one | {"kind": NumberKind(one["kind"]), "value": number(one["value"])})
        for one in said["numbers"]
    )
    lists = {"claims": claims, "numbers": numbers, **{name: said[name] for name in ("files", "reached")}}
    return Done(
        **said
        | {name: tuple(values) for name, values in lists.items()}
        | {"seconds": number(said["seconds"])}
    )


def junit(night: Kept) -> bytes:
    """Return a night as JUnit XML for continuous integration: a suite per check, a case per claim.

    Claims that nobody judges and checks that were not run are skipped.
    """
    from junitparser import JUnitXml, TestSuite

    whole, document = JUnitXml(f"actin_xcheck {night.begun.name}"), BytesIO()
    checks: tuple[Done | NotRun, ...] = (*night.done, *night.left_out)
    for one in checks:
        suite = TestSuite(one.name)
        suite.timestamp, suite.hostname = (
            night.begun.date[:19],
            getattr(one, "host", "") or night.begun.machine,
        )
        suite.add_testcases(list(_cases(one)))
        if isinstance(one, Done) and math.isfinite(one.seconds):  # of a lost process nobody knows
            suite.time = round(one.seconds, 3)
        whole.append(suite)
    for what in ("tests", "failures", "errors", "skipped"):
        setattr(whole, what, sum(getattr(suite, what) for suite in whole))
    whole.time = round(night.seconds, 3)
    whole.write(document, pretty=True)
    return document.getvalue()


def _cases(one: Done | NotRun) -> Iterator[Any]:
    from junitparser import Error, Failure, Skipped, TestCase

    if isinstance(one, NotRun):
        case = TestCase("is run", classname=one.name)
        case.result = Skipped(brief(one.why, LONGEST))
        yield case
        return
    for claim, file in zip(one.claims, one.files, strict=True):
        case = TestCase(claim.key, classname=one.name)
        if one.trouble:
            case.result = Error(one.trouble, "trouble")
        elif claim.verdict == "FAIL":
            case.result = failure = Failure(claim.excess, "claim")
            said = claim.statement, claim.note, claim.command, f"{file}{claim.path}"
            failure.text = "\n".join(brief(part, LONGEST) for part in said)  # what is no letter is no XML
        elif claim.verdict == "NOT JUDGED":
            case.result = Skipped(f"{claim.value:.3g}, no bound")
        yield case
