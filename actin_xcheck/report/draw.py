"""Exhibits made ready for HTML, which `templates/parts.html` lays out: figures, pictures, tables."""

import re
from dataclasses import dataclass

import numpy as np
from matplotlib.colors import Normalize

from actin_xcheck.core.model import Array
from actin_xcheck.report.cells import (
    OUTLINE,
    Brush,
    Canvas,
    ColourBar,
    Panel,
    colours,
    unstyled,
    window,
)
from actin_xcheck.report.exhibits import Exhibit, Outline, Outlines, Picture, Sheet, Shots
from actin_xcheck.report.figure import Figure, figure

_NUMBER = re.compile(r"[-+−]?(\d[\d.,]*|none|decay)?([eE][-+]?\d+)?( ± [\d.]+i)? ?%?")

_T = np.linspace(0, 2 * np.pi, 181)
_CIRCLE = np.array([np.cos(_T), np.sin(_T)])


@dataclass(frozen=True)
class Drawing:
    """An exhibit ready for the page.

    Attributes
    ----------
    kind : name of its class in small letters.
    title, note : text.
    path : where its numbers stand in the file.
    figure : of plotly.js.
    panels : pictures with their titles.
    outlines : rims, each with its polygons in a drawing of 100 x 100.
    bars : what the colours of pictures mean.
    rows : of a table, header first; `numeric` says which columns hold numbers.
    """

    kind: str
    title: str
    note: str
    path: str
    figure: Figure | None = None
    panels: tuple[tuple[str, Panel], ...] = ()
    outlines: tuple[tuple[Outline, str, str], ...] = ()
    bars: tuple[ColourBar, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    numeric: tuple[bool, ...] = ()


def draw(exhibit: Exhibit, path: str) -> Drawing:
    """Draw an exhibit that is stored at `path`."""
    match exhibit:
        case Picture():
            return _picture(exhibit, path)
        case Shots():
            return _shots(exhibit, path)
        case Outlines():
            outlines = tuple((one, _polygon(one.points), _polygon(one.due)) for one in exhibit.outlines)
            return Drawing("outlines", exhibit.title, exhibit.note, path, outlines=outlines)
        case Sheet():
            columns = zip(*exhibit.rows[1:], strict=True)
            numeric = tuple(all(map(_NUMBER.fullmatch, column)) for column in columns)
            numeric = numeric or (False,) * len(exhibit.rows[0])
            return Drawing("sheet", exhibit.title, exhibit.note, path, rows=exhibit.rows, numeric=numeric)
        case _:
            kind = type(exhibit).__name__.lower()
            return Drawing(kind, exhibit.title, exhibit.note, path, figure(exhibit))


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
