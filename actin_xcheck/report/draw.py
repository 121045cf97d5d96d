"""Exhibits made ready for HTML: drawings as SVG or PNG, their legends as text, tables as tables.

`templates/exhibits.html` lays them out.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize, to_rgb
from matplotlib.figure import Figure

from actin_xcheck.core.model import Array
from actin_xcheck.report.cells import OUTLINE, Brush, Canvas, ColourBar, Panel, colours, window
from actin_xcheck.report.exhibits import (
    Classes,
    Exhibit,
    Line,
    Outline,
    Outlines,
    Picture,
    Plot,
    Regions,
    Sheet,
    Shots,
)
from actin_xcheck.report.lattice import Divided, divided
from actin_xcheck.report.svg import INK, STYLES, Style, calm, styled, svg, unstyled

_BANDS = (
    *("#30458c", "#b3b1ab", "#4b1c22", "#7b4fa3", "#34874f", "#b48ad6", "#8fcbe6", "#93386b", "#d9c45a"),
    *("#e08bb4", "#f6c08f", "#5a5fc7", "#b7d98a", "#c96f6f", "#56b3a8", "#a8734a", "#f1dca7", "#6d7f3a"),
)
"""Colours of regions by code; neighbours on the maps of theory differ in lightness too."""

TEXT_WIDTH = 0.0125
"""Width of a letter of a map's label in units of the map's."""

_WIDTH, _NARROW = 220.0, 4.6
"""Least width of a plot, and that of a letter above it, in points."""

_ON_LIGHT, _ON_DARK = "#101418", "#ffffff"
_NUMBER = re.compile(r"[-+−]?(\d[\d.,]*|none|decay)?([eE][-+]?\d+)?( ± [\d.]+i)? ?%?")

_T = np.linspace(0, 2 * np.pi, 181)
_CIRCLE = np.array([np.cos(_T), np.sin(_T)])


@dataclass(frozen=True)
class Key:
    """One entry of a legend: a line of some width (`line`, `guide`), a marker (`dot`) or a patch (`band`)."""

    label: str
    colour: str
    width: float = 0.0
    shape: str = "line"


@dataclass(frozen=True)
class Drawing:
    """An exhibit ready for the page.

    Attributes
    ----------
    kind : "plot", "picture", "shots", "outlines", "classes", "regions" or "sheet".
    title, note : text.
    path : where its numbers stand in the file.
    svg : an inline drawing that holds no markup but its own, or empty.
    panels : pictures with their titles.
    outlines : rims, each with its polygons in a drawing of 100 x 100.
    divided : a plane and its classes.
    bars, legend : what the colours and lines mean.
    rows : of a table, header first; `numeric` says which columns hold numbers.
    """

    kind: str
    title: str
    note: str
    path: str
    svg: str = ""
    panels: tuple[tuple[str, Panel], ...] = ()
    outlines: tuple[tuple[Outline, str, str], ...] = ()
    divided: Divided | None = None
    bars: tuple[ColourBar, ...] = ()
    legend: tuple[Key, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    numeric: tuple[bool, ...] = ()


def draw(exhibit: Exhibit, path: str, prefix: str) -> Drawing:
    """Draw an exhibit that is stored at `path`; `prefix` keeps ids apart from those of others on the page."""
    match exhibit:
        case Plot():
            return _plot(exhibit, path, prefix)
        case Picture():
            return _picture(exhibit, path)
        case Shots():
            return _shots(exhibit, path)
        case Outlines():
            outlines = tuple((one, _polygon(one.points), _polygon(one.due)) for one in exhibit.outlines)
            return Drawing("outlines", exhibit.title, exhibit.note, path, outlines=outlines)
        case Classes():
            return Drawing("classes", exhibit.title, exhibit.note, path, divided=divided(exhibit))
        case Regions():
            return _regions(exhibit, path, prefix)
        case Sheet():
            columns = zip(*exhibit.rows[1:], strict=True)
            numeric = tuple(all(map(_NUMBER.fullmatch, column)) for column in columns)
            return Drawing(
                "sheet",
                exhibit.title,
                exhibit.note,
                path,
                rows=exhibit.rows,
                numeric=numeric or (False,) * len(exhibit.rows[0]),
            )


def _plot(plot: Plot, path: str, prefix: str) -> Drawing:
    legend = []
    with styled():
        figure = Figure(figsize=(4.2, 2.5))
        axes = figure.add_subplot(xlabel=plot.xlabel)
        if plot.log:
            axes.set(xscale="log", yscale="log")
        for number, line in enumerate(plot.lines):
            legend.append(_line(axes, line, STYLES[number % len(STYLES)], "o" if plot.log else ""))
        calm(axes)
        _mark(axes, plot.marks)
        return Drawing(
            "plot", plot.title, plot.note, path, svg(figure, plot.title, prefix), legend=tuple(legend)
        )


def _mark(axes: Axes, marks: Sequence[tuple[str, float]]) -> None:
    """Draw uprights with their names above them, in as many rows as keep names apart."""
    for _, x in marks:
        axes.axvline(x, color=INK, linewidth=0.7, linestyle=(0, (1, 2.2)))
    rows: list[float] = []  # where the names in each end
    for name, x in sorted(marks, key=lambda mark: mark[1]):
        place = axes.transAxes.inverted().transform(axes.transData.transform((x, 1)))[0] * _WIDTH
        half = _NARROW * (len(name) + 1) / 2
        row = next((i for i, end in enumerate(rows) if end <= place - half), len(rows))
        rows[row : row + 1] = [place + half]
        axes.annotate(
            name,
            (x, 1),
            (0, 2 + 8 * row),
            ("data", "axes fraction"),
            "offset points",
            ha="center",
            fontsize=7,
        )


def _line(axes: Axes, line: Line, style: Style, marker: str) -> Key:
    """Draw a line with a marker at its points, or none, and return its entry in the legend."""
    if line.points:
        axes.plot(line.x, line.y, "o", color=style.colour, markersize=4, label=line.label)
        return Key(line.label, style.colour, style.width, "dot")
    if line.guide:
        axes.plot(line.x, line.y, color=INK, linewidth=1, linestyle=(0, (1, 2.2)), label=line.label)
        return Key(line.label, "currentColor", 1.5, "guide")
    axes.plot(
        line.x, line.y, color=style.colour, linewidth=style.width, marker=marker, markersize=3.5,
        label=line.label,
    )  # fmt: skip
    return Key(line.label, style.colour, style.width)


@unstyled()
def _picture(picture: Picture, path: str) -> Drawing:
    values, scale = picture.values, colours([picture.values])
    n_r, n_theta = values.shape
    r, theta = np.meshgrid(np.linspace(0, 1, n_r), np.linspace(0, 2 * np.pi, n_theta), indexing="ij")
    canvas = Canvas(window([_CIRCLE]))
    x, y, norm = r * np.cos(theta), r * np.sin(theta), Normalize(scale.low, scale.high)
    canvas.axes.pcolormesh(x, y, values, cmap=scale.name, norm=norm, shading="gouraud")
    canvas.axes.plot(*_CIRCLE, color=OUTLINE, linewidth=0.9)
    panel = canvas.panel(picture.title, scale.extent(values))
    return Drawing(
        "picture", picture.title, "", path, panels=((picture.title, panel),), bars=(scale.bar(""),)
    )


def _shots(shots: Shots, path: str) -> Drawing:
    scale = colours([shot.values for shot in shots.shots])
    shown = window([_CIRCLE, *(shot.x for shot in shots.shots)])
    panels = tuple(
        (shot.title, Brush(shot.triangles, _CIRCLE, shown).panel(shot.title, shot.x, shot.values, scale))
        for shot in shots.shots
    )
    return Drawing("shots", shots.title, shots.note, path, panels=panels, bars=(scale.bar("a"),))


def _polygon(points: Array) -> str:
    """Points (2, n) of a rim in a drawing of 100 x 100 whose unit is 30."""
    x, y = 50 + 30 * points[0], 50 - 30 * points[1]
    return " ".join(f"{a:.2f},{b:.2f}" for a, b in zip(x.tolist(), y.tolist(), strict=True))


def _regions(regions: Regions, path: str, prefix: str) -> Drawing:
    bands = [_BANDS[code % len(_BANDS)] for code in range(len(regions.names))]
    with styled():
        figure = Figure(figsize=(5.2, 4.0))
        axes = figure.add_subplot(xlabel=regions.xlabel, ylabel=regions.ylabel)
        axes.grid(False)
        half_x, half_y = (np.ptp(centres) / (len(centres) - 1) / 2 for centres in (regions.x, regions.y))
        extent = (
            regions.x[0] - half_x, regions.x[-1] + half_x, regions.y[0] - half_y, regions.y[-1] + half_y
        )  # fmt: skip
        # "none" keeps the pixels as they are: the drawing is scaled by the page
        axes.imshow(
            regions.codes,
            ListedColormap(bands),
            Normalize(-0.5, len(bands) - 0.5),
            extent=extent,
            origin="lower",
            aspect="auto",
            interpolation="none",
        )
        for line in regions.borders:
            axes.plot(line.x, line.y, color=_ON_LIGHT, linewidth=0.7)
        axes.set(xlim=extent[:2], ylim=extent[2:])
        for text, x, y in regions.labels:
            _write_into(axes, regions, bands, (text, x, y))
        drawn = svg(figure, regions.title, prefix)
    present = np.unique(regions.codes)
    legend = tuple(Key(regions.names[code], bands[code], shape="band") for code in present)
    return Drawing("regions", regions.title, regions.note, path, drawn, legend=legend)


def _write_into(axes: Axes, regions: Regions, bands: list[str], label: tuple[str, float, float]) -> None:
    """Write a name into its band, upright where the band is too narrow for it."""
    text, x, y = label
    row, column = int(np.argmin(np.abs(regions.y - y))), int(np.argmin(np.abs(regions.x - x)))
    along = regions.codes[row] == regions.codes[row, column]
    left, right = (np.argmin(np.append(side, False)) for side in (along[column::-1], along[column:]))
    fits = 2 * min(left, right) > TEXT_WIDTH * len(text) * len(along)
    red, green, blue = to_rgb(bands[regions.codes[row, column]])
    colour = _ON_LIGHT if 0.3 * red + 0.59 * green + 0.11 * blue > 0.5 else _ON_DARK
    axes.text(x, y, text, color=colour, fontsize=7.5, ha="center", va="center", rotation=0 if fits else 90)
