"""The audit: what the rows need is run, then every row is examined; its page, to be seen by judgement."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from actin_xcheck.report.exhibits import Chapter, Exhibit
from actin_xcheck.runs.numerics import command
from actin_xcheck.runs.records import read_table
from actin_xcheck.runs.store import reading
from actin_xcheck.studies.audit import figures, linear, model, scheme, stability, weak  # noqa: F401
from actin_xcheck.studies.audit.checks import row_of
from actin_xcheck.studies.audit.row import Judgement, Row, article
from actin_xcheck.studies.audit.runs import Evidence
from actin_xcheck.studies.study import Batch, Report, Study, Table, Task

ROWS: dict[str, Row] = {key: row_of(key) for key in article()}
"""By key, in the order of the article."""

SIMULATED, DERIVED = 5.0, 1.0
"""Seconds in which a row with and one without simulations is examined, about."""

_PARTS = {"eq": "Equations", "table": "Tables", "fig": "Figures", "": "Sentences"}
"""Beginnings of keys, and what a reader calls what they name; the last takes the rest."""

SHOWN = ("key", "place", "judgement", "statement", "computed", "reason", "command")


@dataclass(frozen=True)
class Entry:
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

    entry: Entry
    exhibits: tuple[Exhibit, ...]


def paper(keys: Sequence[str], said: bool = False) -> Study:
    """Examine the rows of these keys, in their order; `said` makes a finding of what each comes to."""
    rows = [ROWS[key] for key in keys]
    families = dict.fromkeys(family for one in rows for family in one.families)
    runs = {job.file: job for family in families for job in family.jobs().values()}
    seconds = [SIMULATED if one.families else DERIVED for one in rows]
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
    row = ROWS[key]
    evidence = [Evidence.of(family, folder) for family in row.families]
    finding = row.examine(*evidence)
    entry = Entry(
        key=key,
        place=row.place,
        statement=row.statement,
        judgement=finding.judgement,
        computed=finding.computed,
        reason=finding.reason,
        command=command("paper", only=key),
        numbers=tuple((name, float(number)) for name, number in finding.numbers.items()),
        runs=tuple(file.relative_to(folder).as_posix() for one in evidence for file in one.files.values()),
    )
    return Examined(entry, finding.exhibits)


def _told(entry: Entry) -> str:
    return f"{entry.key} ({entry.place}): {entry.judgement}\n  {entry.computed}\n  {entry.reason}"


def write_audit_page(path: Path) -> Path:
    """Write `index.html` beside the file of an audit and return its path.

    UserError where the file is missing or not whole.
    """
    from actin_xcheck.report.draw import Drawing
    from actin_xcheck.report.exhibits import read_chapters
    from actin_xcheck.report.page import drawn, environment, put_page

    with reading(path, "audit") as file:
        attributes = {
            name: file.attrs[name] for name in file.attrs if name not in ("findings", "lead", "title")
        }
        entries = read_table(file["tables/rows"], Entry)
        drawings = {chapter.key: shown for chapter, shown in drawn(read_chapters(file["exhibits"]))}
    parts: dict[str, list[tuple[Entry, list[Drawing]]]] = {title: [] for title in _PARTS.values()}
    for entry in entries:
        part = next(title for start, title in _PARTS.items() if entry.key.startswith(start))
        parts[part].append((entry, drawings.get(entry.key, [])))
    found = Counter(entry.judgement for entry in entries)
    html = environment(path.parent).get_template("audit.html")
    text = html.render(
        attributes=attributes,
        parts={title: rows for title, rows in parts.items() if rows},
        counts=[(judgement, found[judgement]) for judgement in Judgement if found[judgement]],
        total=len(entries),
        file=path,
    )
    return put_page(path.parent, text)
