"""The page of a work-precision chart, from `chart.h5` alone."""

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from actin_xcheck.core.choices import CAVEATS
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.model import Array
from actin_xcheck.core.outcome import Ending
from actin_xcheck.report.draw import Drawing
from actin_xcheck.report.environment import environment, put_page
from actin_xcheck.report.svg import INK, STYLES, Style, styled, svg
from actin_xcheck.scene.scene import parse_scene
from actin_xcheck.studies.chart.advice import advice_of, in_words, short
from actin_xcheck.studies.chart.front import front
from actin_xcheck.studies.chart.measure import Sample
from actin_xcheck.studies.chart.record import FILE_NAME, Chart, Charted, read_chart
from actin_xcheck.studies.chart.truth import WRONG, Quantity, Standing
from actin_xcheck.studies.ledger_table import ledger_table

_RED = "#c22f2e"
"""Stand-in for the page's colour of what fails."""

_MARKERS = {"fem": "o", "fv": "D"}
"""By the code a method belongs to."""

ENDINGS = {
    Ending.TANGLED: ("x", "✕"),
    Ending.SINGULAR_DILATION: ("v", "▼"),
    Ending.NEGATIVE_CONCENTRATION: ("_", "−"),
    Ending.STEP_TOO_SMALL: ("^", "▲"),
    Ending.NOT_CONVERGED: ("P", "✚"),
    Ending.NON_FINITE: ("*", "★"),
    Ending.INTERRUPTED: ("s", "■"),
}
"""How a failed run is marked: in matplotlib's words and in the legend."""

_RAIL = 0.95
"""Where failed runs stand, as a part of the height."""

_BUSY = 0.1
"""Part of the time that runs may wait for a processor before the page warns of it."""


@dataclass(frozen=True)
class _Work:
    """An abscissa: its name, and one number a repetition of a run."""

    key: str
    title: str
    xlabel: str
    values: Callable[[Sample], Array]

    def of(self, sample: Sample) -> float:
        """The median."""
        return float(np.median(self.values(sample)))


WORKS = (
    _Work("kernels", "Wall time", "wall time / reference kernel", lambda sample: sample.kernels),
    _Work("cpu", "CPU time", "CPU time / reference kernel", lambda sample: sample.cpu_kernels),
    _Work("cells-steps", "Cells × steps", "cells × steps", lambda sample: np.array([sample.cells_steps])),
    _Work("memory", "Peak memory", "MB beyond what the process had", lambda sample: _megabytes(sample)),
)


def _megabytes(sample: Sample) -> Array:
    """Peak memory; at least a page, for a logarithm has no place for nothing."""
    return np.array([max(sample.memory, 4096) / 1e6])


def write_chart_page(folder: Path) -> Path:
    """Write `folder/index.html` from `folder/chart.h5` and return its path.

    UserError where the file is missing or not whole, or holds no run yet.
    """
    folder = Path(folder)
    chart = read_chart(folder / FILE_NAME)
    if not chart.points:
        raise UserError(f"{chart.path}: no run was measured before the chart was interrupted")
    methods = list(dict.fromkeys(point.sample.point.method for point in chart.points))
    styles = {method.name: STYLES[i % len(STYLES)] for i, method in enumerate(methods)}
    kernel = np.array([sample.kernel for sample in (*chart.reference, *(p.sample for p in chart.points))])
    made = environment(folder)
    made.filters |= {"short": short, "median": lambda values: f"{np.median(values):.3g}"}
    html = made.get_template("chart.html")
    text = html.render(
        attributes={name: value for name, value in chart.attributes.items() if name not in _LONG},
        scene=chart.attributes["scene_name"],
        citation=chart.attributes["citation"],
        caveat=_caveat(chart),
        left_out=list(chart.attributes["left_out"]),
        chart=chart,
        sentence=in_words(chart),
        advice=[(one.error, chart.points[one.point]) for one in advice_of(chart)],
        rows=[(work, _row(chart, work, styles, f"c{i}")) for i, work in enumerate(WORKS)],
        methods=[(method, styles[method.name].colour) for method in methods],
        endings=_endings(chart),
        standings=Counter(chart.standing(point, Quantity.CONCENTRATION) for point in chart.points),
        wrong=WRONG,
        points=[(method, list(same)) for method, same in groupby(chart.points, _method_of)],
        kernel=kernel[..., 0],
        waited=_waited(chart),
        busy=_waited(chart) > _BUSY,
        table=ledger_table(chart.entries) if chart.entries else None,
        file=chart.path,
    )
    return put_page(folder, text)


_LONG = ("scene", "left_out")
"""Stated in the file, and not repeated under the page's provenance."""


def _caveat(chart: Chart) -> str | None:
    """What a reader must know before believing the scene's results."""
    scene = parse_scene(chart.attributes["scene"], f"{chart.path}: scene")
    return None if scene.motion else CAVEATS.get(scene.physics.closure)


def _method_of(point: Charted) -> str:
    return point.sample.point.method.name


def _waited(chart: Chart) -> float:
    """Part of the wall time of all runs in which they had no processor."""
    wall, cpu = (
        sum(float(getattr(point.sample, name).sum()) for point in chart.points) for name in ("wall", "cpu")
    )
    return 1 - cpu / wall


def _endings(chart: Chart) -> list[tuple[str, str]]:
    """How runs failed, each with its sign."""
    found = {point.sample.ending for point in chart.points}
    return [(ending.replace("_", " "), sign) for ending, (_, sign) in ENDINGS.items() if ending in found]


def _row(chart: Chart, work: _Work, styles: dict[str, Style], prefix: str) -> list[Drawing]:
    """The charts of one kind of work, a quantity each."""
    return [
        _drawn(chart, work, quantity, styles, f"{prefix}-{quantity}")
        for quantity in Quantity
        if quantity in chart.quantities or quantity is Quantity.CONCENTRATION
    ]


def _drawn(chart: Chart, work: _Work, quantity: Quantity, styles: dict[str, Style], prefix: str) -> Drawing:
    x = np.array([work.of(point.sample) for point in chart.points])
    judged = np.array(chart.judged(quantity))
    with styled():
        figure = Figure(figsize=(4.2, 3.1))
        limits = {"xlim": (x.min() / 2, x.max() * 2), "ylim": _limits(chart, quantity)}
        axes = figure.add_subplot(xlabel=work.xlabel, xscale="log", yscale="log", **limits)
        _lines(axes, chart, quantity)
        for method, style in styles.items():
            own = [i for i, point in enumerate(chart.points) if _method_of(point) == method]
            envelope = [own[i] for i in front(x[own], judged[own])]
            axes.plot(x[envelope], judged[envelope], color=style.colour, linewidth=0.8, alpha=0.7)
        kept = front(x, judged)
        if kept:
            edge, end = axes.get_xlim()[1], judged[kept[-1]]
            axes.plot(
                [*x[kept], edge], [*judged[kept], end], color=INK, linewidth=1.3, drawstyle="steps-post"
            )
        for number, point in enumerate(chart.points):
            _mark(axes, chart, number, quantity, work.values(point.sample), styles[_method_of(point)].colour)
        label = f"Error of the {quantity.heading.lower()} against {work.title.lower()}"
        text = svg(figure, label, prefix).replace(_RED, "var(--fail)")
    titles = [escape(_said(chart, point, quantity)) for point in chart.points]
    named = re.sub(
        rf'(<g id="{re.escape(prefix)}-point-(\d+)"[^>]*>)',
        lambda found: f"{found[1]}<title>{titles[int(found[2])]}</title>",
        text,
    )
    return Drawing(
        "plot", quantity.heading, f"Error: {quantity.words}.", f"/points/*/error_{quantity}", named
    )


def _limits(chart: Chart, quantity: Quantity) -> tuple[float, float]:
    """Lowest and highest error shown; the rail of failed runs lies above."""
    errors = np.array([point.errors[quantity] for point in chart.points])
    errors = errors[np.isfinite(errors) & (errors > 0)]
    low, high = (errors.min(), errors.max()) if errors.size else (1e-3, 1.0)
    floor = chart.known[quantity].floor
    low = min(low, floor) if floor > low / 100 else low
    failed = any(point.sample.ending != "completed" for point in chart.points)
    return low / 3, high * 3 * ((high / low) ** 0.12 if failed else 1.0)


def _lines(axes: Axes, chart: Chart, quantity: Quantity) -> None:
    """The rail of failed runs, what is silently wrong, and up to where nothing is judged."""
    small: dict[str, Any] = {"fontsize": 7, "va": "bottom", "ha": "right"}
    right = axes.get_yaxis_transform()
    if any(point.sample.ending != "completed" for point in chart.points):
        below = 2 * _RAIL - 1  # as far from the marks as the upper edge
        axes.plot([0, 1], [below, below], color=INK, linewidth=0.4, transform=axes.transAxes)
        axes.text(0.01, 0.995, "failed", transform=axes.transAxes, fontsize=7, va="top")
    low, high = axes.get_ylim()
    if quantity is Quantity.CONCENTRATION and low < WRONG < high:
        axes.axhline(WRONG, color=_RED, linewidth=0.8, linestyle=(0, (4, 3)))
        axes.text(0.995, WRONG, "silently inaccurate", transform=right, color=_RED, **small)
    floor = chart.known[quantity].floor
    if floor > low:
        axes.axhline(floor, color=INK, linewidth=0.9, linestyle=(0, (1, 2.2)))
        axes.text(0.005, floor, "the reference's own error", transform=right, **(small | {"ha": "left"}))


def _mark(axes: Axes, chart: Chart, number: int, quantity: Quantity, values: Array, colour: str) -> None:
    """Draw one point, with the spread of its repetitions, as what it is."""
    point = chart.points[number]
    standing, x, y = chart.standing(point, quantity), float(np.median(values)), point.errors[quantity]
    gid = f"point-{number}"
    if standing is Standing.FAILED:
        marker, _ = ENDINGS[Ending(point.sample.ending)]
        axes.plot(
            x, _RAIL, marker, color=colour, markersize=6, markeredgewidth=1.6, gid=gid,
            transform=axes.get_xaxis_transform(), clip_on=False,
        )  # fmt: skip
        return
    if not (np.isfinite(y) and y > 0):
        return
    if len(values) > 1:
        axes.plot([values.min(), values.max()], [y, y], color=colour, linewidth=0.8, alpha=0.8)
    marker = _MARKERS.get(point.sample.point.method.family, "^")  # another package's family
    style: dict[str, Any] = {"color": colour, "markersize": 4.2}
    if standing is Standing.SILENT:
        style = {"color": "none", "markeredgecolor": _RED, "markersize": 5.5, "markeredgewidth": 1.3}
    elif standing is not Standing.JUDGED:
        style |= {"color": "none", "markeredgecolor": colour}
    axes.plot(x, y, marker, gid=gid, **style)


def _said(chart: Chart, point: Charted, quantity: Quantity) -> str:
    """What is read when the pointer rests on a point."""
    sample, standing = point.sample, chart.standing(point, quantity)
    said = [f"{sample.point.method.name}, {sample.point.numerics}"]
    if standing is Standing.FAILED:
        said.append(f"failed: {sample.ending.replace('_', ' ')}: {sample.message}")
    else:
        said.append(
            f"error {point.errors[quantity]:.2g}"
            + (f", {standing}" if standing is not Standing.JUDGED else "")
        )
    spread = f" ({sample.wall.min():.3g} to {sample.wall.max():.3g})" if len(sample.wall) > 1 else ""
    said.append(f"{sample.seconds:.3g} s{spread}, {np.median(sample.kernels):.3g} kernels")
    said.append(f"{sample.steps} steps, {sample.rejected} rejected, {sample.cells} cells")
    said.append(f"{sample.memory / 1e6:.3g} MB")
    return "\n".join(said)
