"""What a sweep's page shows of its table: columns over what was varied, outcomes, cells at their ends."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.errors import Ending, UserError
from actin_xcheck.report.exhibits import Chapter, Exhibit, Line, Plot, Regions, Shot, Shots
from actin_xcheck.runs.store import read_run

Columns = Mapping[str, NDArray[Any]]

FIRST = ("area", "total_actin", "polarity", "steps")
"""Columns that are drawn before the others."""

MOST_LINES, MOST_RUNS, CELLS = 12, 2000, 24
"""Of a chart, of a page that has charts, and of cells that are shown."""

_CLICK = "Click a point, or press Enter where it is read, for its film."

_LABELS = ("refine", "dt", "rtol", "accuracy", "key")


def chapters_of(folder: Path, columns: Columns, varied: Sequence[str]) -> tuple[Chapter, ...]:
    """Charts, a map of outcomes over two ranges, and cells; none of what the sweep does not have.

    Parameters
    ----------
    folder : where the sweep's runs lie.
    columns : of its table, (n_runs,) each.
    varied : which of them were varied.
    """
    ranges = [name for name in varied if columns[name].dtype.kind == "f" and len(set(columns[name])) > 1]
    if not 1 < len(columns["outcome"]) <= MOST_RUNS:
        return ()
    cells = tuple(_cells(folder, columns, varied))
    chapters = [Chapter("cells", "The cells", "Where each run ended.", cells)] if cells else []
    if ranges:
        drawn: list[Exhibit] = [*_maps(columns, ranges), *_charts(columns, varied, ranges[0])]
        note = f"Over {ranges[0]}; red: not completed. Numbers are those of the last row of a run. {_CLICK}"
        chapters.insert(0, Chapter("columns", "What was varied", note, tuple(drawn)))
    return tuple(chapters)


def _charts(columns: Columns, varied: Sequence[str], along: str) -> Iterator[Plot]:
    """Every column of numbers over a range, a line for what else was varied, failures by themselves."""
    others = [name for name in ("scene", "method", *varied) if name != along and len(set(columns[name])) > 1]
    said = np.array(
        [" ".join(_short(columns, name, i) for name in others) for i in range(len(columns[along]))]
    )
    numbers = [
        name for name, of in columns.items() if of.dtype.kind == "f" and name not in (*varied, *_LABELS)
    ]
    completed = columns["outcome"] == str(Ending.COMPLETED)
    for name in sorted(numbers, key=lambda one: FIRST.index(one) if one in FIRST else len(FIRST)):
        y, x = columns[name], columns[along]
        if not np.isfinite(y).any() or np.ptp(y[np.isfinite(y)]) == 0:
            continue
        lines = []
        for label in dict.fromkeys(said[completed]) if completed.any() else ():
            of = np.flatnonzero(completed & (said == label))
            of = of[np.argsort(x[of])]
            lines.append(Line(str(label), x[of], y[of], shape="circle", links=_films(columns, of)))
        failed = ~completed & np.isfinite(y)
        if failed.any():
            words = tuple(columns["outcome"][failed].tolist())
            gone = _films(columns, np.flatnonzero(failed))
            drawn = Line("not completed", x[failed], y[failed], points=True, red=True, said=words, links=gone)
            lines.append(drawn)
        log = bool(np.all(x > 0) and x.max() > 50 * x.min() and np.all(y[np.isfinite(y)] > 0))
        yield Plot(name, name.replace("_", " "), "", along, tuple(lines[-MOST_LINES:]), log=log)


def _films(columns: Columns, rows: NDArray[Any]) -> tuple[str, ...]:
    """The pages of runs by their rows; none where no run has one."""
    pages = tuple(columns["film"][rows].tolist()) if "film" in columns else ()
    return pages if any(pages) else ()


def film_of(folder: Path, file: str) -> str:
    """Write the page that plays a run beside it and return its place; empty without a run, or a frame."""
    from actin_xcheck.report.pictures import render  # matplotlib is loaded where it draws

    page = Path(file).with_suffix(".html")
    try:
        render(read_run(folder / file), folder / page)
    except UserError:
        return ""
    return page.as_posix()


def _short(columns: Columns, name: str, row: int) -> str:
    value = columns[name][row]
    return f"{name.rpartition('.')[2]} = {value:.4g}" if columns[name].dtype.kind == "f" else str(value)


def _maps(columns: Columns, ranges: Sequence[str]) -> Iterator[Regions]:
    """Outcomes over the first two ranges, where the runs fill their rectangle."""
    if len(ranges) != 2:
        return
    (x, across), (y, up) = (np.unique(columns[name], return_inverse=True) for name in ranges)
    names = tuple(dict.fromkeys(columns["outcome"].tolist()))
    if x.size * y.size != len(columns["outcome"]):
        return
    codes = np.zeros((y.size, x.size), dtype=np.int64)
    codes[up, across] = [names.index(one) for one in columns["outcome"]]
    row_at = np.zeros_like(codes)
    row_at[up, across] = np.arange(codes.size)
    links = tuple(_films(columns, row) for row in row_at)
    links = links if all(links) else ()
    yield Regions("outcomes", "outcomes", "", ranges[0], ranges[1], x, y, codes, names, links=links)


def _cells(folder: Path, columns: Columns, varied: Sequence[str]) -> Iterator[Exhibit]:
    """Some of the cells where they ended, in the order of the table, evenly through it."""
    there = np.flatnonzero(columns["file"] != "")
    chosen = there[np.unique(np.linspace(0, len(there) - 1, CELLS).round().astype(int))] if len(there) else []
    shots = []
    for row in chosen:
        try:
            run = read_run(folder / str(columns["file"][row]))
        except UserError:  # the table says so
            continue
        words = " ".join(_short(columns, name, row) for name in varied) or str(columns["scene"][row])
        outcome = "" if columns["outcome"][row] == Ending.COMPLETED else f", {columns['outcome'][row]}"
        values = run.a_points[-1][run.triangles].mean(axis=0)
        link = "".join(_films(columns, np.array([row])))
        shots.append(Shot(f"{words}{outcome}", run.points[-1], run.triangles, values, link))
    if shots:
        yield Shots("cells", "a", "", tuple(shots))
