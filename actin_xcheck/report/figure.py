"""Exhibits as figures of plotly.js, which `static/charts.js` draws: traces and a layout, values for JSON.

Two colours stand for the page's own, which follow the reader's theme: `INK`, and `RED` of what fails.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from actin_xcheck.core.model import Array
from actin_xcheck.report.exhibits import Classes, Intervals, Line, Plot, Regions
from actin_xcheck.report.lattice import READ, TITLE, WIDE, classes, painted, patch, text

Figure = dict[str, Any]

INK, RED = "#0d0e0f", "#c22f2e"


@dataclass(frozen=True)
class Style:
    """How a line is drawn."""

    colour: str
    width: float


STYLES = (
    *(Style("#527ed4", 3.6), Style("#cd3122", 1.5), Style("#20814d", 1.2), Style("#9c4fa3", 1.0)),
    *(Style("#bd8b0b", 1.0), Style("#06a5ac", 1.0), Style("#e85e9f", 1.0), Style("#6f707a", 1.0)),
)
"""Lines mostly coincide, so each is drawn thinner than the one before, on top of it; apart for every eye."""

BANDS = (
    *("#30458c", "#b3b1ab", "#4b1c22", "#7b4fa3", "#34874f", "#b48ad6", "#8fcbe6", "#93386b", "#d9c45a"),
    *("#e08bb4", "#f6c08f", "#5a5fc7", "#b7d98a", "#c96f6f", "#56b3a8", "#a8734a", "#f1dca7", "#6d7f3a"),
)
"""Colours of regions by code; neighbours on the maps of theory differ in lightness too."""

TEXT_WIDTH = 0.0125
"""Width of a letter of a map's label in units of the map's."""

_MOST = 1000
"""Points of a curve that are drawn; of more, the least and the largest of every few."""

_WIDTH, _LETTER, _ROW = 220.0, 5.2, 11
"""Least width of a plot, that of a letter above it, and the height of a row of them, in pixels."""

_LABEL = 20
"""Letters of a name in a band."""

_SMALL = {"size": 9}
_ON_LIGHT, _ON_DARK = "#101418", "#ffffff"


def figure(exhibit: Plot | Intervals | Regions | Classes) -> Figure:
    """Return an exhibit as `data` and `layout`; `layout["height"]` is that of its axes and what is around."""
    match exhibit:
        case Plot():
            return _plot(exhibit)
        case Intervals():
            return _intervals(exhibit)
        case Regions():
            return _regions(exhibit)
        case Classes():
            return classes(exhibit)


def _axis(name: str, log: bool = False, **more: Any) -> Figure:
    return {"title": {"text": text(name, TITLE)}, "type": "log" if log else "linear", **more}


def _numbers(values: Array) -> list[float | None]:
    """Values with twelve digits, None where there is none."""
    finite = np.isfinite(values)
    return [float(f"{one:.12g}") if ok else None for one, ok in zip(values.tolist(), finite, strict=True)]


def _thinned(line: Line) -> np.ndarray:
    """Numbers of the points that are drawn, all of them where they are not many."""
    n = len(line.y)
    if n <= _MOST or line.points or line.said:
        return np.arange(n)
    pieces = np.array_split(np.nan_to_num(line.y), _MOST // 2)
    starts = np.cumsum([0, *map(len, pieces[:-1])])
    extremes = [
        start + one(piece)
        for start, piece in zip(starts, pieces, strict=True)
        for one in (np.argmin, np.argmax)
    ]
    return np.unique([0, *extremes, n - 1])


def _plot(plot: Plot) -> Figure:
    logx, logy = plot.log, plot.log or plot.logy
    data = [trace for number, line in enumerate(plot.lines) for trace in _line(line, number, plot)]
    layout: Figure = {
        "height": 230,
        "xaxis": _axis(plot.xlabel, logx),
        "yaxis": _axis(plot.ylabel, logy),
        "hovermode": "closest" if plot.log or any(line.said for line in plot.lines) else "x unified",
        "shapes": [],
        "annotations": [],
    }
    shown = [*(line.y for line in plot.lines if not line.rail), np.array([y for _, y in plot.levels])]
    if ends := _calm(shown, logy):
        layout["yaxis"]["range"] = ends
    if any(line.rail for line in plot.lines):
        layout["yaxis"]["domain"] = [0, 0.9]
        layout["yaxis2"] = {"domain": [0.92, 1], "range": [0, 2], "visible": False, "fixedrange": True}
        layout["shapes"].append(_level(0.91, "paper", {"width": 0.5}))
        layout["annotations"].append(
            _text("failed", 0, 1, xref="paper", yref="paper", xanchor="left", yanchor="top")
        )
    for name, y in plot.levels:
        label = {"text": text(name), "textposition": "end", "font": _SMALL | {"color": INK}}
        layout["shapes"].append(_level(y, "y", {"width": 1, "dash": "dash"}) | {"label": label})
        data.append(_seen(plot, y))
    rows = _mark(plot, layout)
    return {"data": data, "layout": layout | {"margin": {"t": 8 + _ROW * rows}}}


def _level(y: float, ref: str, line: Figure) -> Figure:
    return {
        "type": "line",
        "xref": "paper",
        "x0": 0,
        "x1": 1,
        "yref": ref,
        "y0": y,
        "y1": y,
        "line": {"color": INK, **line},
    }


def _seen(plot: Plot, y: float) -> Figure:
    """A point that nobody sees and axes make room for."""
    x = next((one for line in plot.lines for one in _numbers(line.x) if one is not None), 1.0)
    return {"type": "scatter", "x": [x], "y": [y], "opacity": 0, "showlegend": False, "hoverinfo": "skip"}


def _text(said: str, x: float, y: float, **more: Any) -> Figure:
    said = said if len(said) <= WIDE else f"{said[: WIDE - 1]}…"
    return {"text": text(said), "x": x, "y": y, "showarrow": False, "font": _SMALL | {"color": INK}, **more}


def _line(line: Line, number: int, plot: Plot) -> list[Figure]:
    """The traces of a line: itself, and a band where it has one."""
    style = STYLES[(number if line.style < 0 else line.style) % len(STYLES)]
    colour = INK if line.guide else RED if line.red else style.colour
    shown = _thinned(line)
    x, y = np.asarray(line.x)[shown], np.asarray(line.y)[shown]
    trace: Figure = {"type": "scatter", "x": _numbers(x), "y": _numbers(y), "name": text(line.label, WIDE)}
    trace |= {
        "mode": "markers" if line.points else "lines+markers" if plot.log and not line.guide else "lines"
    }
    trace |= {"line": {"color": colour, "width": 1.2 if line.guide else style.width}}
    trace |= {
        "marker": {"color": colour, "size": 7, "symbol": line.shape, "line": {"width": 1.5, "color": colour}}
    }
    if line.steps:
        trace["line"]["shape"] = "hv"
        trace["mode"] = "lines"
    elif line.guide or line.dashed:
        trace["line"]["dash"] = "dot" if line.guide else "dash"
    if line.rail:
        trace |= {"yaxis": "y2", "y": [1] * len(shown), "cliponaxis": False}
    if not line.label:
        trace["showlegend"] = False
    if line.said:
        said = [text(one).replace("\n", "<br>") for one in line.said]
        trace |= {"text": said, "hovertemplate": READ}
    elif not line.label:
        trace["hoverinfo"] = "skip"
    if line.links:
        trace["customdata"] = [line.links[i] for i in np.arange(len(line.x))[shown]]
    for name, spread in (("error_x", line.x_spread), ("error_y", line.y_spread)):
        if spread is not None and (line.points or name == "error_x"):
            trace[name] = {
                "type": "data",
                "array": _numbers(np.asarray(spread)[shown]),
                "width": 3,
                "thickness": 1,
            }
    if line.y_spread is None or line.points:
        return [trace]
    spread = np.asarray(line.y_spread)[shown]
    edge = {"type": "scatter", "x": trace["x"], "mode": "lines", "line": {"width": 0}, "showlegend": False}
    edge |= {"hoverinfo": "skip"}
    wash = {
        "fill": "tonexty",
        "fillcolor": f"rgba({int(colour[1:3], 16)},{int(colour[3:5], 16)},{int(colour[5:], 16)},.2)",
    }
    return [edge | {"y": _numbers(y - spread)}, edge | {"y": _numbers(y + spread)} | wash, trace]


def _calm(curves: Sequence[Array], log: bool) -> list[float] | None:
    """Ends that keep the value axis from magnifying round-off, 1e-9 of what it shows; None without need."""
    values = np.concatenate([np.ravel(one) for one in curves] or [np.empty(0)])
    values = values[np.isfinite(values) & ((values > 0) | (not log))]
    if not len(values):
        return None
    low, high = float(values.min()), float(values.max())
    least = 1e-9 * max(0.0 if log else 1.0, abs(low), abs(high))
    if high - low >= least:
        return None
    ends = np.array([(low + high - least) / 2, (low + high + least) / 2])
    return [float(one) for one in (np.log10(ends) if log else ends)]


def _mark(plot: Plot, layout: Figure) -> int:
    """Draw uprights with their names above them, and return in how many rows they are kept apart."""
    if not plot.marks:
        return 0
    x = np.concatenate([np.ravel(line.x) for line in plot.lines] + [np.array([at for _, at in plot.marks])])
    measure = np.log10 if plot.log else np.asarray
    low, high = np.nanmin(measure(x)), np.nanmax(measure(x))
    rows: list[float] = []  # where the names in each end
    for name, at in sorted(plot.marks, key=lambda mark: mark[1]):
        place = float(measure(at))
        width = _LETTER * (min(len(name), WIDE) + 1)
        middle = (place - low) / ((high - low) or 1.0) * _WIDTH
        start = max(min(middle - width / 2, _WIDTH - width), 0.0)
        anchor = "center" if start == middle - width / 2 else "right" if start else "left"
        row = next((i for i, end in enumerate(rows) if end <= start), len(rows))
        rows[row : row + 1] = [start + width]
        line = {"color": INK, "width": 0.7, "dash": "dot"}
        layout["shapes"].append(
            {"type": "line", "yref": "paper", "y0": 0, "y1": 1, "x0": at, "x1": at, "line": line}
        )
        layout["annotations"].append(
            _text(name, place, 1, yref="paper", yanchor="bottom", yshift=_ROW * row, xanchor=anchor)
        )
    return len(rows)


def _intervals(one: Intervals) -> Figure:
    names = [text(name) for name in one.names]
    data = []
    for name, value, uncertainty, style in zip(names, one.values, one.uncertainties, one.styles, strict=True):
        colour = STYLES[style % len(STYLES)].colour if style >= 0 else INK
        trace: Figure = {"type": "scatter", "mode": "markers", "x": _numbers(np.array([value])), "y": [name]}
        trace |= {"name": name, "marker": {"color": colour, "size": 7}}
        if np.isfinite(uncertainty):
            trace["error_x"] = {
                "type": "data",
                "array": [float(uncertainty)],
                "color": colour,
                "thickness": 1.5,
            }
        data.append(trace)
    layout = {
        "xaxis": _axis(one.xlabel),
        "yaxis": {"type": "category", "range": [len(names) - 0.4, -0.6], "showgrid": False},
    }
    height = 66 + 24 * len(names) + 15 * layout["xaxis"]["title"]["text"].count("<br>")
    return {"data": data, "layout": layout | {"height": height, "hovermode": "closest", "showlegend": False}}


def _regions(regions: Regions) -> Figure:
    bands = [BANDS[code % len(BANDS)] for code in range(len(regions.names))]
    data = [
        painted(_numbers(regions.x), _numbers(regions.y), regions.codes.tolist(), list(regions.names), bands)
    ]
    if regions.links:
        data[0]["customdata"] = [list(row) for row in regions.links]
    for line in regions.borders:
        trace: Figure = {"type": "scatter", "x": _numbers(line.x), "y": _numbers(line.y), "mode": "lines"}
        data.append(
            trace
            | {"name": text(line.label, WIDE), "showlegend": False, "line": {"color": _ON_LIGHT, "width": 1}}
        )
    data += [patch(regions.names[code], bands[code]) for code in np.unique(regions.codes)]
    half_x, half_y = (np.ptp(centres) / (len(centres) - 1) / 2 for centres in (regions.x, regions.y))
    layout = {
        "height": 400,
        "xaxis": _axis(regions.xlabel, range=[float(regions.x[0] - half_x), float(regions.x[-1] + half_x)]),
        "yaxis": _axis(regions.ylabel, range=[float(regions.y[0] - half_y), float(regions.y[-1] + half_y)]),
        "annotations": [_written(regions, bands, label) for label in regions.labels],
        "hovermode": "closest",
        "legend": {"itemclick": False, "itemdoubleclick": False},
    }
    return {"data": data, "layout": layout}


def _written(regions: Regions, bands: list[str], label: tuple[str, float, float]) -> Figure:
    """A name in its band, upright where the band is too narrow for it."""
    said, x, y = label
    row, column = int(np.argmin(np.abs(regions.y - y))), int(np.argmin(np.abs(regions.x - x)))
    along = regions.codes[row] == regions.codes[row, column]
    left, right = (np.argmin(np.append(side, False)) for side in (along[column::-1], along[column:]))
    fits = 2 * min(left, right) > TEXT_WIDTH * len(said) * len(along)
    band = bands[regions.codes[row, column]]
    red, green, blue = (int(band[i : i + 2], 16) / 255 for i in (1, 3, 5))
    colour = _ON_LIGHT if 0.3 * red + 0.59 * green + 0.11 * blue > 0.5 else _ON_DARK
    said = said if len(said) <= _LABEL else f"{said[: _LABEL - 1]}…"
    return _text(said, x, y, textangle=0 if fits else -90, font={"size": 10, "color": colour})
