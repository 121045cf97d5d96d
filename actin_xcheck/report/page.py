"""Pages: what all have in common, and that of a study, made from its file alone."""

import gzip
import json
import math
import os
import re
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from importlib.resources import files
from itertools import groupby
from pathlib import Path
from typing import Any

import h5py
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from actin_xcheck.core.claim import Claim, Unnamed, free_name
from actin_xcheck.core.files import replace_file
from actin_xcheck.report.draw import Drawing, draw
from actin_xcheck.report.exhibits import Chapter, read_chapters
from actin_xcheck.runs.records import read_table
from actin_xcheck.runs.store import reading


def environment(folder: Path) -> Environment:
    """Return the environment of a page that will stand in `folder`: escapes everything, defaults nothing.

    Filters: `number` (three digits), `link` (a path relative to the page), `from_json`, `state` (of a
    verdict in the style sheet), `anchor` (of a claim by its key, which lasts when its sentence is improved).
    Functions: `static` (the text of a script or style sheet of ours, for it is part of the page), `packed` (a
    library's, by gzip and in base64, for it would be most of the page), `free` (an anchor that is not taken).
    """
    made = Environment(
        loader=PackageLoader("actin_xcheck.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters["number"] = lambda value: f"{value:.3g}" if math.isfinite(value) else "no number"
    made.filters["link"] = lambda path: Path(os.path.relpath(path, folder)).as_posix()
    made.filters["from_json"] = json.loads
    made.filters["state"] = lambda verdict: verdict.lower().replace(" ", "-")
    made.filters["anchor"] = lambda key: f"claim-{re.sub(r'[^a-zA-Z0-9_-]+', '-', key)}"
    taken: set[str] = set()

    def free(anchor: str) -> str:
        taken.add(name := free_name(anchor, taken))
        return name

    made.globals |= {"static": _static, "packed": _packed, "free": free}
    return made


def _static(name: str) -> Markup:
    """A file of `static/` as it is."""
    return Markup((files("actin_xcheck.report") / "static" / name).read_text(encoding="utf-8"))


@cache
def _packed(name: str) -> Markup:
    """A file of `static/` for a script to unpack."""
    text = (files("actin_xcheck.report") / "static" / name).read_bytes()
    return Markup(b64encode(gzip.compress(text, mtime=0)).decode())


def put_page(folder: Path, text: str) -> Path:
    """Write `folder/index.html`, whole or not at all, and return its path; UserError where that cannot be."""
    page = folder / "index.html"
    replace_file(page, text.encode("utf-8"))
    return page


PROVENANCE = ("provenance", "Provenance")
"""The last part of most pages: its anchor and its title."""

_SCORE = re.compile(r"\d+ of \d+")
"""What a title may begin with, and the page is coloured by."""

AGAIN = 5
"""Seconds after which the page of what is under way is written, and reads itself, again."""

ENDED = "typed again, with the same --out, it goes on."

_LONG = 40
"""Letters from which a column is one of sentences."""


@dataclass(frozen=True)
class Column:
    """A column of a table: numbers stand to the right, commands are code, files links, sentences get room."""

    title: str
    numeric: bool
    code: bool
    file: bool
    long: bool


@dataclass(frozen=True)
class Shown:
    """A table as a page shows it: every cell is text."""

    name: str
    title: str
    note: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]

    @property
    def heads(self) -> list[str]:
        """The titles of its columns, as the template's `board` takes them."""
        return ["#" * one.numeric + one.title for one in self.columns]


def write_page(path: Path) -> Path:
    """Write `index.html` beside the file of a study and return its path.

    UserError where the file is missing, not whole or something else.
    """
    path = Path(path)
    with reading(path, "report of a study") as file:
        said: dict[str, Any] = dict(file.attrs)
        claims = read_claims(file)
        chapters = read_chapters(file["exhibits"])
        tables = [_stored(name, group) for name, group in file["tables"].items()]
    title = said.pop("title")
    parts = [("claims", "Claims")] if claims else []
    parts += ((one.key, one.title) for one in chapters)
    parts += ((one.name, one.title) for one in tables)
    score = match.group() if (match := _SCORE.match(title)) else ""
    html = environment(path.parent).get_template("study.html")
    text = html.render(
        name=said["study"],
        parts=[*parts, PROVENANCE],
        score=score,
        title=title[len(score) :],
        lead=said.pop("lead"),
        findings=list(said.pop("findings")),
        attributes=said,
        claims=claims,
        groups=_by_scene(claims),
        chapters=drawn(chapters),
        tables=tables,
        file=path,
    )
    return put_page(path.parent, text)


def drawn(chapters: Iterable[Chapter]) -> list[tuple[Chapter, list[Drawing]]]:
    """Chapters with their drawings, which say where in the file their numbers are."""
    return [
        (
            one,
            [draw(each, f"/exhibits/{one.key}/{each.key}") for each in one.exhibits],
        )
        for one in chapters
    ]


def write_underway(
    folder: Path,
    name: str,
    part: float,
    left: float,
    claims: Sequence[Claim],
    tables: Mapping[str, Mapping[str, Sequence[Any]]],
) -> None:
    """Write the page of a study that is under way, which the finished one will replace.

    Parameters
    ----------
    name : of the study.
    part : of its work that is over, in 0..1.
    left : seconds until all of it is; not finite where nothing tells.
    claims : judged so far.
    tables : answers so far, columns by name.
    """
    known = f", about {max(left, 1):.0f} s left" if left < 100 else f", about {left / 60:.0f} min left"
    lead = "What is answered so far; the finished page will stand here. This was written at "
    lead += f"{datetime.now():%H:%M:%S}. Where that is long ago, the command has ended: {ENDED}"
    text = environment(folder).get_template("underway.html").render(
        name=name,
        parts=[*[("claims", "Claims")][: len(claims)], *((key, key) for key in tables)],
        score="",
        title=f"{part:.0%} done{known if math.isfinite(left) else ''}",
        lead=lead,
        findings=[],
        claims=claims,
        groups=_by_scene(claims),
        chapters=[],
        tables=[_shown(key, key, "", columns) for key, columns in tables.items()],
        file=None,
        seconds=AGAIN,
    )  # fmt: skip
    put_page(folder, text)


def _by_scene(claims: Iterable[Claim]) -> dict[str, list[Claim]]:
    return {scene: list(group) for scene, group in groupby(claims, lambda claim: claim.scene)}


def _stored(name: str, group: h5py.Group) -> Shown:
    """A table with the columns that its study wants to be seen, all without a choice."""
    plain = [one for one in group if isinstance(group[one], h5py.Dataset)]
    chosen = [one for one in group.attrs["shown"] if one in plain] or plain  # none of a table without rows
    text = {one: h5py.check_string_dtype(group[one].dtype) is not None for one in chosen}
    columns = {one: group[one].asstr()[()] if text[one] else group[one][()].tolist() for one in chosen}
    return _shown(name, str(group.attrs["title"]), str(group.attrs["note"]), columns)


def _shown(name: str, title: str, note: str, by_field: Mapping[str, Sequence[Any]]) -> Shown:
    """A table of values by field."""
    columns, cells = [], []
    for field, values in by_field.items():
        text = any(isinstance(one, str) for one in values)
        cells.append([_cell(value) for value in values])
        code, file = field == "command", field in ("file", "finer_file", "film")
        long = text and not (code or file) and max(map(len, cells[-1]), default=0) > _LONG
        columns.append(Column(field.replace("_", " "), not text, code, file, long))
    return Shown(name, title, note, tuple(columns), tuple(zip(*cells, strict=True)))


def _cell(value: Any) -> str:
    """A value as text: five digits of a number, a dash where there is none."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "–" if value != value else f"{value:.5g}"
    return str(value)


def read_claims(file: h5py.File) -> list[Claim]:
    """The claims of a report, whether or not it was written before they had kinds."""
    group = file["claims"]
    if "kind" in group or not len(group):
        return read_table(group, Claim)
    return [one.named for one in read_table(group, Unnamed)]
