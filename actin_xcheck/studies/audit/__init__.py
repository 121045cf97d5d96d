"""The audit: a row per statement of the article, examined when what it needs is run; its page, by judgement.

`article.toml` has a row's place and statement, and the words of its finding, in which values stand as
{name}.  What computes them is a function marked `@examines("eq3.6")`: it returns an `answer`.
"""

import tomllib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cache, cached_property
from importlib.resources import files
from pathlib import Path
from string import Formatter
from typing import TYPE_CHECKING, Any

import numpy as np

from actin_xcheck.report.exhibits import Chapter, Exhibit
from actin_xcheck.runs.numerics import command
from actin_xcheck.runs.records import gathered, read_table
from actin_xcheck.runs.store import reading
from actin_xcheck.studies.study import Batch, Report, Study, Table, Task

if TYPE_CHECKING:
    from actin_xcheck.studies.audit.runs import RunFamily


class Judgement(StrEnum):
    """How a statement of the article stands."""

    REPRODUCED = "reproduced"
    """Computed to the digits printed, or as stated, with an uncertainty smaller than what is judged."""
    IN_KIND = "reproduced in kind"
    """The picture or the words agree; there is no number to hold against."""
    NOT_REPRODUCED = "not reproduced"
    """Something else comes out, by more than the numerical uncertainty."""
    MISPRINT = "misprint"
    """Contradicts the article's own equations or data; the corrected statement is given."""
    UNDECIDABLE = "cannot be decided"
    """Photographs, results not shown, or conditions not stated."""


@dataclass(frozen=True)
class Finding:
    """What this project has to say to one row.

    Attributes
    ----------
    judgement : the verdict.
    computed : what was computed, numbers included, in a sentence or two.
    reason : why that gives the verdict.
    exhibits : curves, fields, maps and tables to be shown below.
    numbers : computed values by name, stored beside the words.
    """

    judgement: Judgement
    computed: str
    reason: str
    exhibits: tuple[Exhibit, ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class RowAnswer:
    """What computing comes to: see `answer`."""

    holds: bool
    corrected: bool
    exhibits: tuple[Exhibit, ...]
    values: Mapping[str, Any]


def answer(
    holds: bool | np.bool,
    *,
    corrected: bool | np.bool = False,
    exhibits: tuple[Exhibit, ...] = (),
    **values: Any,
) -> RowAnswer:
    """Return what computing says to a row.

    Parameters
    ----------
    holds : the article's statement agrees with what was computed.
    corrected : a corrected statement does, which makes a statement that does not hold a misprint.
    exhibits : as in `Finding`.
    values : what the words of the row name.
    """
    return RowAnswer(bool(holds), bool(corrected), exhibits, values)


@dataclass(frozen=True)
class AuditRow:
    """One statement of the article.

    Attributes
    ----------
    key : what `--only` takes: "eq3.6", "table4", "fig21"; sentences by their section, "s5.4-failure".
    examine : computes the finding in a few seconds, from the `Evidence` of each family, in their order.
    needs : gives the simulations it needs, none where theory alone decides; to state them scenes are read.
    """

    key: str
    examine: Callable[..., Finding]
    needs: "Callable[[], tuple[RunFamily, ...]]" = tuple

    @cached_property
    def families(self) -> "tuple[RunFamily, ...]":
        """The simulations it needs."""
        return self.needs()

    @property
    def place(self) -> str:
        """Where it stands, for the reader: "(3.6)", "Table 4", "Section 5.4"."""
        return str(article()[self.key]["place"])

    @property
    def statement(self) -> str:
        """What the article says."""
        return str(article()[self.key]["statement"])


@cache
def article() -> dict[str, dict[str, Any]]:
    """Return what `article.toml` says, by key; a row has what it does not say from the one it is `like`."""
    said = table("article.toml")
    return {key: {**said.get(entry.get("like", ""), {}), **entry} for key, entry in said.items()}


@cache
def table(name: str) -> dict[str, dict[str, Any]]:
    """Return a TOML file of this package."""
    return tomllib.loads((files(__package__) / name).read_text(encoding="utf-8"))


_EXAMINERS: dict[str, Callable[..., RowAnswer]] = {}


def examines(*keys: str) -> Callable[[Callable[..., RowAnswer]], Callable[..., RowAnswer]]:
    """Mark what computes the answer to rows, of `Evidence` where they need runs, and of what they give."""

    def mark(function: Callable[..., RowAnswer]) -> Callable[..., RowAnswer]:
        _EXAMINERS.update(dict.fromkeys(keys, function))
        return function

    return mark


def answered(key: str, *evidence: Any) -> RowAnswer:
    """Return the answer to a row; one for which nothing is computed stands as it is written."""
    if key not in _EXAMINERS:
        return answer(False, corrected=True)
    given = article()[key].get("given", {})
    got = _EXAMINERS[key](*evidence, **given)
    return replace(got, values={**given, **got.values})


def examined(key: str, *evidence: Any) -> Finding:
    """Return what is found about a row: its words with what was computed, and the verdict that follows.

    Where that is not the verdict for which the reason was written, the reason says so.
    """
    entry, got = article()[key], answered(key, *evidence)
    written = Judgement(entry["verdict"])
    judgement = written
    if key in _EXAMINERS:
        judgement = _verdict(written, got)
    each = {
        name: ", ".join(form.format(*pair) for pair in got.values[name].items())
        for name, form in entry.get("each", {}).items()
    }
    computed, reason = (
        _WORDS.vformat(entry[part], (), {**got.values, **each}) for part in ("computed", "reason")
    )
    if judgement is not written:
        reason = f"The numbers no longer give '{written}', for which this was the reason: {reason}"
    return Finding(judgement, computed, reason, got.exhibits, numbers(entry.get("numbers", {}), got.values))


def _verdict(written: Judgement, got: RowAnswer) -> Judgement:
    if got.holds:
        mild = Judgement.IN_KIND, Judgement.UNDECIDABLE
        return written if written in mild else Judgement.REPRODUCED
    return Judgement.MISPRINT if got.corrected else Judgement.NOT_REPRODUCED


def numbers(names: Mapping[str, str], values: Mapping[str, Any]) -> dict[str, float]:
    """Return values by the names they are stored under; {} in a name stands for the keys of a dictionary."""
    found = {}
    for name, path in names.items():
        value, _ = _WORDS.get_field(path, (), values)
        many = value if isinstance(value, Mapping) else {"": value}
        found.update({name.format(key): float(one) for key, one in many.items()})
    return found


class _Words(Formatter):
    """Lists are said one by one."""

    def format_field(self, value: Any, spec: str) -> str:
        many = isinstance(value, list) or (isinstance(value, np.ndarray) and value.ndim)
        return ", ".join(format(one, spec) for one in value) if many else format(value, spec)


_WORDS = _Words()


@cache
def rows() -> dict[str, AuditRow]:
    """Every row by its key, in the order of the article; what computes them is loaded."""
    from actin_xcheck.studies.audit import figures, linear, model, scheme, stability, weak  # noqa: F401
    from actin_xcheck.studies.audit.checks import row_of

    return {key: row_of(key) for key in article()}


SIMULATED, DERIVED = 5.0, 1.0
"""Seconds in which a row with and one without simulations is examined, about."""

_PARTS = {"eq": "Equations", "table": "Tables", "fig": "Figures", "": "Sentences"}
"""Beginnings of keys, and what a reader calls what they name; the last takes the rest."""

SHOWN = ("key", "place", "judgement", "statement", "computed", "reason", "command")


@dataclass(frozen=True)
class AuditEntry:
    """A row as it was found.

    Attributes
    ----------
    key, place, statement : of the row.
    judgement, computed, reason, numbers : see `Finding`.
    command : what examines the row again.
    runs : files of the runs it rests on, relative to the audit's folder.
    """

    key: str
    place: str
    statement: str
    judgement: Judgement
    computed: str
    reason: str
    command: str
    numbers: tuple[tuple[str, float], ...]
    runs: tuple[str, ...]


@dataclass(frozen=True)
class Examined:
    """An entry and what is shown below it."""

    entry: AuditEntry
    exhibits: tuple[Exhibit, ...]


def paper(keys: Sequence[str], said: bool = False) -> Study:
    """Examine the rows of these keys, in their order; `said` makes a finding of what each comes to."""
    asked = [rows()[key] for key in keys]
    families = dict.fromkeys(family for one in asked for family in one.families)
    runs = {job.file: job for family in families for job in family.jobs().values()}
    seconds = [SIMULATED if one.families else DERIVED for one in asked]
    yield Batch((job.task for job in runs.values()), later=sum(seconds))
    found: list[Examined] = yield [Task(examine, *one) for one in zip(keys, seconds, strict=True)]
    entries = [one.entry for one in found]
    counts = Counter(entry.judgement for entry in entries)
    verdicts = {str(judgement): counts[judgement] for judgement in Judgement if counts[judgement]}
    return Report(
        ", ".join(f"{count} {judgement}" for judgement, count in verdicts.items()),
        "Every equation, table, figure and number of the article, held against what is computed here.",
        {"rows": Table("Rows", entries, shown=SHOWN)},
        findings=tuple(map(_told, entries)) if said else (),
        chapters=tuple(
            Chapter(one.entry.key, one.entry.place, one.entry.statement, one.exhibits)
            for one in found
            if one.exhibits
        ),
        links={f"runs/{file.rpartition('/')[2]}": file for file in runs},
        verdicts=verdicts,
    )


def examine(key: str, folder: Path) -> Examined:
    """Examine one row, whose runs lie in the folder."""
    from actin_xcheck.studies.audit.runs import Evidence

    row = rows()[key]
    evidence = [Evidence.of(family, folder) for family in row.families]
    finding = row.examine(*evidence)
    entry = gathered(
        AuditEntry,
        row,
        finding,
        command=command("paper", only=key),
        numbers=tuple((name, float(number)) for name, number in finding.numbers.items()),
        runs=tuple(file.relative_to(folder).as_posix() for one in evidence for file in one.files.values()),
    )
    return Examined(entry, finding.exhibits)


def _told(entry: AuditEntry) -> str:
    return f"{entry.key} ({entry.place}): {entry.judgement}\n  {entry.computed}\n  {entry.reason}"


def write_audit_page(path: Path) -> Path:
    """Write `index.html` beside the file of an audit and return its path.

    UserError where the file is missing or not whole.
    """
    from actin_xcheck.report.draw import Drawing
    from actin_xcheck.report.exhibits import read_chapters
    from actin_xcheck.report.page import PROVENANCE, drawn, environment, put_page

    with reading(path, "audit") as file:
        attributes = {
            name: file.attrs[name] for name in file.attrs if name not in ("findings", "lead", "title")
        }
        entries = read_table(file["tables/rows"], AuditEntry)
        drawings = {chapter.key: shown for chapter, shown in drawn(read_chapters(file["exhibits"]))}
    kinds: dict[str, list[tuple[AuditEntry, list[Drawing]]]] = {title: [] for title in _PARTS.values()}
    for entry in entries:
        kind = next(title for start, title in _PARTS.items() if entry.key.startswith(start))
        kinds[kind].append((entry, drawings.get(entry.key, [])))
    kinds = {title: rows for title, rows in kinds.items() if rows}
    found = Counter(entry.judgement for entry in entries)
    html = environment(path.parent).get_template("audit.html")
    text = html.render(
        attributes=attributes,
        kinds=kinds,
        parts=[*((title.lower(), title) for title in kinds), PROVENANCE],
        counts=[(judgement, found[judgement]) for judgement in Judgement if found[judgement]],
        total=len(entries),
        file=path,
    )
    return put_page(path.parent, text)
