"""What the site takes from the code: tables, the command reference, and formulas as MathML.

Formulas need neither scripts nor fonts, so that the built site is complete without a network.
"""

import html
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

from actin_xcheck.cli.output import schemas
from actin_xcheck.runs.method import METHODS
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
            parts.append(f"`{part['title']}`: {part['description']}\n\n{_keys(part)}")
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


TABLES: dict[str, Callable[[], str]] = {"errata": _errata, "methods": _methods, "answers": _answers}


def _table(name: str) -> str:
    if name not in TABLES:
        raise PluginError(f"{name} is not a table; valid: {', '.join(TABLES)}")
    return TABLES[name]()


def _rows(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines)
