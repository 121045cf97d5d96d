"""What a study shows, as data: curves, fields, maps, tables."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import h5py
import numpy as np

from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array
from actin_xcheck.runs.records import read_record, write_record


@dataclass(frozen=True, eq=False)
class Line:
    """One curve: points x (n,), y (n,) and what it is called; one without a name is in no legend.

    Attributes
    ----------
    points, guide, dashed : markers without a line, a dotted line in the page's ink to compare others with,
        or a dashed one.
    steps : stairs that change at the points, solid.
    style : number of its colour in `figure.STYLES`; lines that state none have one after the other.
    shape : of its markers, as plotly.js calls it: "circle", "diamond-open", ...
    red : whether it has the colour of what fails.
    rail : whether its points stand on a rail above the plot, by their x alone.
    said : what is read at each point, else its numbers.
    links : the page that a click on each point leads to.
    x_spread, y_spread : how far a point may be off to either side, (n,) each: bars, or a band around a line.
    """

    label: str
    x: Array
    y: Array
    points: bool = False
    guide: bool = False
    dashed: bool = False
    steps: bool = False
    style: int = -1
    shape: str = "circle"
    red: bool = False
    rail: bool = False
    said: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    x_spread: Array | None = None
    y_spread: Array | None = None


@dataclass(frozen=True, eq=False)
class Plot:
    """Curves in one pair of axes; `marks` are abscissae with a name, such as the wave numbers of the disk.

    `log` makes both axes logarithmic and shows every point of a line, `logy` the ordinate alone; `levels`
    are ordinates with a name, as `marks`.
    """

    key: str
    title: str
    note: str
    xlabel: str
    lines: tuple[Line, ...]
    marks: tuple[tuple[str, float], ...] = ()
    log: bool = False
    logy: bool = False
    ylabel: str = ""
    levels: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, eq=False)
class Intervals:
    """Numbers (n,) with their uncertainties (n,), one below the other.

    `styles` are the numbers of their colours, -1 the page's ink.
    """

    key: str
    title: str
    note: str
    xlabel: str
    names: tuple[str, ...]
    values: Array
    uncertainties: Array
    styles: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Picture:
    """A field on the unit disk: values (n_r, n_theta) on a polar grid that includes centre and rim.

    Radii are evenly spaced in [0, 1] and angles in [0, 2 pi], the last angle being the first again.
    """

    key: str
    title: str
    values: Array


@dataclass(frozen=True, eq=False)
class Shot:
    """A cell at one time: node positions x (2, N), triangles (3, n_cells), cell means values (n_cells,).

    `link` is the page that a click on it leads to.
    """

    title: str
    x: Array
    triangles: Indices
    values: Array
    link: str = ""


@dataclass(frozen=True, eq=False)
class Shots:
    """Cells side by side in one window and one colour scale, each over the outline of the unit disk."""

    key: str
    title: str
    note: str
    shots: tuple[Shot, ...]


@dataclass(frozen=True, eq=False)
class Outline:
    """A rim: its points (2, n) within two radii, beside those that are due; whether its run failed."""

    title: str
    points: Array
    due: Array
    failed: bool


@dataclass(frozen=True, eq=False)
class Outlines:
    """Rims side by side."""

    key: str
    title: str
    note: str
    outlines: tuple[Outline, ...]


@dataclass(frozen=True, eq=False)
class Regions:
    """A map of a plane: codes (n_y, n_x) number the entries of `names`; `borders` are curves drawn on it.

    x (n_x,) and y (n_y,) are the centres of its pixels; `labels` are names written into the bands at (x, y);
    `links` (n_y rows of n_x) are the pages that clicks lead to.
    """

    key: str
    title: str
    note: str
    xlabel: str
    ylabel: str
    x: Array
    y: Array
    codes: Indices
    names: tuple[str, ...]
    borders: tuple[Line, ...] = ()
    labels: tuple[tuple[str, float, float], ...] = ()
    links: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True, eq=False)
class Places:
    """Places of a lattice along one of its directions: values (n,), by their logarithm where that is said."""

    label: str
    values: Array
    log: bool


@dataclass(frozen=True, eq=False)
class Classes:
    """A plane divided by classes of the points of a lattice.

    nodes (2, n) are columns and rows of the points that are known, `classes` and `sentences` what they are
    and what is said of each; cells (n_cells, 4) are rectangles of the lattice by their first and last column,
    first and last row, which take the classes of their corners.  `lines` are curves drawn over it, in values.
    """

    key: str
    title: str
    note: str
    x: Places
    y: Places
    nodes: Indices
    classes: tuple[str, ...]
    sentences: tuple[str, ...]
    cells: Indices
    lines: tuple[Line, ...]


@dataclass(frozen=True)
class Sheet:
    """A table of text, header first."""

    key: str
    title: str
    note: str
    rows: tuple[tuple[str, ...], ...]


Exhibit = Plot | Intervals | Picture | Shots | Outlines | Regions | Classes | Sheet


@dataclass(frozen=True)
class Chapter:
    """Exhibits that belong together, with a title and a few words above them."""

    key: str
    title: str
    note: str
    exhibits: tuple[Exhibit, ...]


def shares(title: str, note: str, xlabel: str, mark: str, values: Mapping[str, Iterable[float]]) -> Plot:
    """Show which share of numbers, line by line, is below what; `mark` is what 1 is called.

    Zeros and what is not finite have no place on a logarithm, nor has a line without others.
    """
    kept = {name: np.sort([one for one in ours if 0 < one < np.inf]) for name, ours in values.items()}
    lines = [Line(name, x, np.arange(1, x.size + 1) / x.size) for name, x in kept.items() if x.size]
    return Plot("ratios", title, note, xlabel, tuple(lines), ((mark, 1.0),), log=True)


def write_exhibits(group: h5py.Group, exhibits: Iterable[Exhibit]) -> None:
    """Write exhibits into one group each, named by their keys, in this order.

    ValueError where two have the same key.
    """
    for exhibit in exhibits:
        if exhibit.key in group:
            raise ValueError(f"{group.name}: two exhibits have the key {exhibit.key!r}")
        write_record(group.create_group(exhibit.key, track_order=True), exhibit)


def read_exhibits(group: h5py.Group) -> tuple[Exhibit, ...]:
    """Return the exhibits of a group (made with `track_order`) in the order in which they were written."""
    return tuple(read_record(one, Exhibit) for one in group.values())


def write_chapters(group: h5py.Group, chapters: Iterable[Chapter]) -> None:
    """Write chapters into one group each, named by their keys, their exhibits inside."""
    for chapter in chapters:
        within = group.create_group(chapter.key, track_order=True)
        for name in ("title", "note"):
            within.attrs.create(name, getattr(chapter, name), dtype=h5py.string_dtype())
        write_exhibits(within, chapter.exhibits)


def read_chapters(group: h5py.Group) -> tuple[Chapter, ...]:
    """Return the chapters of a group (made with `track_order`) in the order in which they were written."""
    return tuple(
        Chapter(key, str(within.attrs["title"]), str(within.attrs["note"]), read_exhibits(within))
        for key, within in group.items()
    )
