"""What results show of themselves in a notebook: tables as HTML, films as pictures that move."""

from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from actin_xcheck.core.model import Array
from actin_xcheck.report.pictures import render
from actin_xcheck.runs.store import Run

MOST_FRAMES, MOST_ROWS = 60, 40
"""Of a film and of a table that a notebook keeps."""

_INTEGRALS = ("area", "total_actin", "centroid", "polarity")


def html_of_run(run: Run) -> str:
    """How a run ended, what its cell comes to there, and its film, or its last frame where that is long."""
    last = {name: values[-1] for name, values in run.series.items()}
    rows = [(name.replace("_", " "), _said(last[name])) for name in _INTEGRALS if name in last]
    said, heads = escape(repr(run)[1:-1]), (f"at t = {run.series['time'][-1]:.4g}", "")
    return f"<p><b>{said}</b></p>{table(heads, rows)}{_film(run)}"


def table(heads: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Rows as an HTML table, the first `MOST_ROWS` of them."""
    every = list(rows)
    more = f"<p>… {len(every) - MOST_ROWS} more rows</p>" if len(every) > MOST_ROWS else ""
    cells = ("".join(f"<td>{escape(_said(one))}</td>" for one in row) for row in every[:MOST_ROWS])
    head = "".join(f"<th>{escape(one)}</th>" for one in heads)
    return f"<table><tr>{head}</tr>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>{more}"


def columns_of(series: Mapping[str, Array]) -> dict[str, Array]:
    """Series (n,), (n, 2), (n, k) or (n, k, 2) as columns (n,) by name: `centroid_0`, `probe_x_0_1`."""
    columns: dict[str, Array] = {}
    for name, values in series.items():
        for place in np.ndindex(values.shape[1:]):
            columns["_".join([name, *map(str, place)])] = values[(slice(None), *place)]
    return columns


def _film(run: Run) -> str:
    long = len(run.times) > MOST_FRAMES
    with TemporaryDirectory() as folder:
        path = Path(folder) / ("film.png" if long else "film.gif")
        render(run, path)
        data = b64encode(path.read_bytes()).decode()
    return f'<img alt="The cell" src="data:image/{path.suffix[1:]};base64,{data}">'


def _said(value: Any) -> str:
    if isinstance(value, str):
        return value
    return ", ".join(f"{one:.6g}" for one in np.ravel(value))
