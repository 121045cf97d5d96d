"""What the site takes from the code: tables, the command reference, and formulas as MathML.

Formulas need neither scripts nor fonts, so that the built site is complete without a network.
"""

import html
import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import grimp
from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

from actin_xcheck.cli.output import schemas
from actin_xcheck.runs.method import METHODS
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.scene.shelf import listed
from actin_xcheck.theory.errata import errata

PICTURE = Path(__file__).parents[1] / "reports" / "example.png"

PROGRAM = "python -m actin_xcheck"


def on_files(files: Any, config: Any) -> Any:
    """Add the command reference, as Typer writes it, and a picture that lies elsewhere."""
    command = [sys.executable, "-m", "typer", "actin_xcheck.cli.app", "utils", "docs", "--name", PROGRAM]
    environment = os.environ | {"PYTHONUTF8": "1"}
    done = subprocess.run(
        [*command, "--title", "Commands"], capture_output=True, encoding="utf-8", env=environment, check=False
    )
    if done.returncode:
        raise PluginError(f"no command reference: {done.stderr}")
    files.append(File.generated(config, "commands.md", content=done.stdout))
    files.append(File.generated(config, "example.png", abs_src_path=str(PICTURE)))
    files.append(File.generated(config, "floors.svg", content=_picture_of_floors()))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Put tables where a page asks for them: <!-- table: NAME -->."""
    return re.sub(r"<!-- table: (\w+) -->", lambda asked: _table(asked[1]), markdown)


def on_page_content(content: str, page: Any, config: Any, files: Any) -> str:
    """Turn the formulas that arithmatex has marked into MathML."""
    marked = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)
    return marked.sub(lambda found: _formula(found[2], found[1] == "div"), content)


def _formula(latex: str, display: bool) -> str:
    written = convert(html.unescape(latex).strip(), display="block" if display else "inline")
    if "\\" in html.unescape(written):
        raise PluginError(f"a formula with a command that is not known: {latex}")
    return f"<p>{written}</p>" if display else written


def _errata() -> str:
    rows = ((str(one.number), one.where, one.printed, one.corrected, one.reason) for one in errata())
    return _rows(("no.", "where", "printed", "holds", "because"), rows)


def _methods() -> str:
    rows = (
        (
            f"`{one.name}`",
            one.description,
            f"{one.order_h:g}",
            f"{one.order_dt:g}",
            "by error" if one.adaptive else "equal",
        )
        for one in METHODS.values()
    )
    return _rows(("method", "what it is", "order in h", "in dt", "steps"), rows)


def _answers() -> str:
    parts = []
    for schema in schemas().values():
        parts.append(f"## {schema['description']}\n\n{_keys(schema)}")
        for part in schema.get("$defs", {}).values():
            holds = _keys(part) if "properties" in part else _type(part)
            parts.append(f"`{part['title']}`: {part['description']}\n\n{holds}")
    return "\n\n".join(parts)


def _keys(schema: dict[str, Any]) -> str:
    needed = schema.get("required", ())
    rows = (
        (f"`{key}`", _type(one), "" if key in needed else "may be left out", one.get("description", ""))
        for key, one in schema["properties"].items()
    )
    return _rows(("key", "type", "", "holds"), rows)


def _type(one: dict[str, Any]) -> str:
    """A type of JSON Schema in words."""
    if "$ref" in one:
        return f"`{one['$ref'].rpartition('/')[2]}`"
    if "const" in one or "enum" in one:
        return ", ".join(f"`{value}`" for value in one.get("enum", (one.get("const"),)))
    if "anyOf" in one:
        return " or ".join(_type(either) for either in one["anyOf"])
    if one["type"] == "array":
        return f"list of {_type(one['items'])}" if "items" in one else "list"
    if isinstance(one.get("additionalProperties"), dict):
        return f"object of {_type(one['additionalProperties'])}"
    return str(one["type"])


PROBLEMS = (
    *("static-decay", "growing-disk", "fig12-mixed-31-02-21", "fig14-four-fronts"),
    *("fig16-uniform-expansion", "fig17-uniform-contraction", "tense-cell", "lopsided-cell"),
)
"""Those of the open benchmark, in its order."""

COLUMNS = ("time", "area", "total_actin", "centroid_x", "centroid_y")


def _templates() -> str:
    """A file to be filled in for each problem, with a row for every time at which numbers are compared."""
    parts = []
    for name in PROBLEMS:
        rows = (f"{time:.10g}{',' * (len(COLUMNS) - 1)}" for time in load_scene(name).output_times)
        parts.append("\n".join((f'```csv title="{name}.csv"', ",".join(COLUMNS), *rows, "```")))
    return "\n\n".join(parts)


def _gallery() -> str:
    """The shipped scenes as `benchmarks.gallery` has hung them, those of the article first."""
    hung = json.loads((Path(__file__).parent / "gallery" / "scenes.json").read_text(encoding="utf-8"))
    cards: dict[bool, list[str]] = {True: [], False: []}
    for name, one in hung.items():
        citation, model = listed(name)[1:]
        said = (
            f"<strong>{name}</strong>",
            html.escape(f"a: {one['extent']}"),
            f"<strong>{html.escape(one['verdict'])}</strong>",
            html.escape(one["comes_to"]),
            html.escape(f"{one['seconds']:.1f} s, {one['made_by']}"),
            f"<em>{html.escape(citation)}</em>",
            html.escape(model),
        )
        picture = f'<img src="gallery/{name}.webp" alt="{name} at its end" style="width: 100%">'
        cards[not citation.startswith("Verification")].append(f"<div>{picture}{'<br>'.join(said)}</div>")
    style = "display: grid; grid-template-columns: repeat(auto-fill, minmax(10rem, 1fr)); gap: 1.5rem; "
    style += "font-size: .7rem; overflow-wrap: anywhere"
    return "\n\n".join(
        f'## {title}\n\n<div style="{style}">{"".join(cards[of_it])}</div>'
        for title, of_it in (("Of the article", True), ("For verification", False))
    )


FLOORS = {
    "actin_xcheck.__main__": "starts the command, with nothing from its surroundings",
    "actin_xcheck.cli": "the commands: options, what is said, exit codes",
    "actin_xcheck.api": "the same for notebooks and scripts",
    "actin_xcheck.nightly": "every night: checks within a budget, their history, the dashboard",
    "actin_xcheck.studies": "each asks for runs and says what the answers mean",
    "actin_xcheck.verdicts": "what stored runs prove: claims, uncertainties, orders",
    "actin_xcheck.report": "what pages are made of: exhibits, drawings, films, tables",
    "actin_xcheck.runs": "from a scene and a method to a stored run, and processes for many",
    "actin_xcheck.scene": "the physics of a run as data, and how it becomes a problem",
    "actin_xcheck.theory": "linear theory, exact modes, the article's errata",
    "fem": "finite elements, on scikit-fem",
    "fv": "finite volumes, on FiPy",
    "actin_xcheck.core": "equations, meshes, contracts; nothing here knows a method",
}
"""What each package is, the highest floor first."""

ROWS = (
    ("actin_xcheck.__main__",), ("actin_xcheck.cli",), ("actin_xcheck.api",), ("actin_xcheck.nightly",),
    ("actin_xcheck.studies",), ("actin_xcheck.verdicts", "actin_xcheck.report"), ("actin_xcheck.runs",),
    ("actin_xcheck.scene",), ("actin_xcheck.theory", "fem", "fv"), ("actin_xcheck.core",),
)  # fmt: skip
"""Floors as `pyproject.toml` lists them."""


def _floors() -> str:
    graph = grimp.build_graph("actin_xcheck", "fem", "fv")
    counted = {name: len(graph.find_descendants(name)) or 1 for name in FLOORS}
    rows = ((f"`{name}`", what, str(counted[name])) for name, what in FLOORS.items())
    return _rows(("package", "what it is", "modules"), rows)


def _picture_of_floors() -> str:
    """The floors as boxes, and the imports between them as lines."""
    graph = grimp.build_graph("actin_xcheck", "fem", "fv")
    places = {
        name: (360 * (2 * i + 1) / len(row), 30 + 62 * j)
        for j, row in enumerate(ROWS)
        for i, name in enumerate(row)
    }
    parts = []
    for upper, lower in product(FLOORS, FLOORS):
        count = sum(
            len(graph.get_import_details(importer=one, imported=other))
            for one in {upper, *graph.find_descendants(upper)}
            for other in graph.find_modules_directly_imported_by(one)
            if other == lower or other.startswith(f"{lower}.")
        )
        if count and upper != lower:
            (x, y), (x2, y2) = places[upper], places[lower]
            middle = (x + x2) / 2 + (140 if abs(y2 - y) > 70 and x == x2 else 0)
            path = f"M{x} {y + 16} Q{middle} {(y + y2) / 2} {x2} {y2 - 16}"
            width = 0.6 + math.log10(count)
            title = f"<title>{upper} imports {lower} {count} times</title>"
            parts.append(
                f'<path d="{path}" fill="none" stroke="#7a8899" stroke-width="{width:.2f}">{title}</path>'
            )
    for name, (x, y) in places.items():
        parts.append(f'<rect x="{x - 95}" y="{y - 16}" width="190" height="32" rx="6" class="floor"/>')
        parts.append(f'<text x="{x}" y="{y + 5}" text-anchor="middle">{name}</text>')
    style = "text{font:14px system-ui,sans-serif;fill:#1d2126}.floor{fill:#f4f1ea;stroke:#30458c}"
    size = f'viewBox="0 0 720 {62 * len(ROWS)}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}><style>{style}</style>{"".join(parts)}</svg>'


TABLES: dict[str, Callable[[], str]] = {
    "errata": _errata,
    "methods": _methods,
    "answers": _answers,
    "floors": _floors,
    "templates": _templates,
    "gallery": _gallery,
}


def _table(name: str) -> str:
    if name not in TABLES:
        raise PluginError(f"{name} is not a table; valid: {', '.join(TABLES)}")
    return TABLES[name]()


def _rows(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines)
