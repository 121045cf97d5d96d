"""The page of the audit, from its file alone: row by row, to be seen by judgement."""

from collections import Counter
from pathlib import Path

from actin_xcheck.report.draw import Drawing
from actin_xcheck.report.environment import environment, put_page
from actin_xcheck.report.exhibit_file import read_chapters
from actin_xcheck.runs.records import read_table
from actin_xcheck.runs.store import reading
from actin_xcheck.studies.audit.row import Judgement
from actin_xcheck.studies.audit.study import Entry
from actin_xcheck.studies.page import drawn

_PARTS = {
    "eq": "Equations",
    "table": "Tables",
    "fig": "Figures",
    "": "Sentences",
}
"""Beginnings of keys, and what a reader calls what they name; the last takes the rest."""


def write_audit_page(path: Path) -> Path:
    """Write `index.html` beside the file of an audit and return its path.

    UserError where the file is missing or not whole.
    """
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
