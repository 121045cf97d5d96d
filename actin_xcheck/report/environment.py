"""What all pages have in common: the templates' environment and their place."""

import gzip
import json
import math
import os
from base64 import b64encode
from functools import cache
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from actin_xcheck.core.files import replace_file


def environment(folder: Path) -> Environment:
    """Return the environment of a page that will stand in `folder`: escapes everything, defaults nothing.

    Filters: `number` (three digits), `link` (a path relative to the page), `from_json`.
    Functions: `static` (the text of a script or style sheet of ours, for it is part of the page), `packed` (a
    library's, by gzip and in base64, for it would be most of the page).
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
    made.globals |= {"static": _static, "packed": _packed}
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
