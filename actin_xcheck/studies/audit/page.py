"""The page of the audit, from `audit.h5` alone."""

from collections import Counter
from pathlib import Path

from actin_xcheck.report.draw import draw
from actin_xcheck.report.environment import environment, put_page
from actin_xcheck.studies.audit.record import FILE_NAME, read_audit
from actin_xcheck.studies.audit.row import Judgement

_PARTS = {
    "eq": "Equations",
    "table": "Tables",
    "fig": "Figures",
    "": "Sentences",
}
"""Beginnings of keys, and what a reader calls what they name; the last takes the rest."""


def write_audit_page(folder: Path) -> Path:
    """Write `folder/index.html` from `folder/audit.h5` and return its path.

    UserError where the file is missing or not whole.
    """
    folder = Path(folder)
    audit = read_audit(folder / FILE_NAME)
    parts: dict[str, list[tuple[object, list[object]]]] = {title: [] for title in _PARTS.values()}
    for i, entry in enumerate(audit.entries):
        part = next(title for start, title in _PARTS.items() if entry.key.startswith(start))
        drawings: list[object] = [
            draw(exhibit, f"/rows/{entry.key}/exhibits/{exhibit.key}", f"r{i}-{j}")
            for j, exhibit in enumerate(entry.finding.exhibits)
        ]
        parts[part].append((entry, drawings))
    found = Counter(entry.finding.judgement for entry in audit.entries)
    html = environment(folder).get_template("audit.html")
    text = html.render(
        attributes=audit.attributes,
        parts={title: rows for title, rows in parts.items() if rows},
        counts=[(judgement, found[judgement]) for judgement in Judgement if found[judgement]],
        total=len(audit.entries),
        file=audit.path,
    )
    return put_page(folder, text)
