"""The page of a work-precision chart, from `chart.h5` alone."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from actin_xcheck.core.choices import CAVEATS
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.model import Array
from actin_xcheck.core.outcome import Ending
from actin_xcheck.report.draw import Drawing, draw
from actin_xcheck.report.environment import environment, put_page
from actin_xcheck.report.exhibits import Line, Plot
from actin_xcheck.scene.scene import parse_scene
from actin_xcheck.studies.chart.advice import advice_of, in_words, short
from actin_xcheck.studies.chart.front import front
from actin_xcheck.studies.chart.measure import Sample
from actin_xcheck.studies.chart.record import FILE_NAME, Chart, Charted, read_chart
from actin_xcheck.studies.chart.truth import WRONG, Quantity, Standing
from actin_xcheck.studies.ledger_table import ledger_table

_MARKERS = {"fem": "circle", "fv": "diamond"}
"""By the code a method belongs to."""

ENDINGS = {
    Ending.TANGLED: ("x-thin", "✕"),
    Ending.SINGULAR_DILATION: ("triangle-down", "▼"),
    Ending.NEGATIVE_CONCENTRATION: ("line-ew", "−"),
    Ending.STEP_TOO_SMALL: ("triangle-up", "▲"),
    Ending.NOT_CONVERGED: ("cross", "✚"),
    Ending.NON_FINITE: ("star", "★"),
    Ending.INTERRUPTED: ("square", "■"),
}
"""How a failed run is marked: in plotly.js's words and in the legend."""

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
    styles = {method.name: i for i, method in enumerate(methods)}
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
        rows=[(work, _row(chart, work, styles)) for work in WORKS],
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


def _row(chart: Chart, work: _Work, styles: dict[str, int]) -> list[Drawing]:
    """The charts of one kind of work, a quantity each."""
    return [
        draw(plot(chart, work, quantity, styles), f"/points/*/error_{quantity}")
        for quantity in Quantity
        if quantity in chart.quantities or quantity is Quantity.CONCENTRATION
    ]


def plot(chart: Chart, work: _Work, quantity: Quantity, styles: dict[str, int]) -> Plot:
    """Errors of one quantity against one kind of work: every run, and what is worth its work."""
    x = np.array([work.of(point.sample) for point in chart.points])
    judged = np.array(chart.judged(quantity))
    lines = [
        line for name, style in styles.items() for line in _of_method(chart, work, quantity, name, style)
    ]
    if kept := front(x, judged):
        edge = np.append(x[kept], x.max() * 1.5), np.append(judged[kept], judged[kept[-1]])
        lines.append(Line("front", *edge, steps=True, guide=True))
    errors = np.array([point.errors[quantity] for point in chart.points])
    errors = errors[np.isfinite(errors) & (errors > 0)]
    low, high = (errors.min(), errors.max()) if errors.size else (1e-3, 1.0)
    levels, floor = [], chart.known[quantity].floor
    if quantity is Quantity.CONCENTRATION and low < WRONG < 3 * high:
        levels.append(("silently inaccurate", WRONG))
    if floor > low / 100:
        levels.append(("the reference's own error", floor))
    note = f"Error: {quantity.words}."
    return Plot(
        f"{work.key}-{quantity}",
        quantity.heading,
        note,
        work.xlabel,
        tuple(lines),
        log=True,
        levels=tuple(levels),
    )


def _of_method(chart: Chart, work: _Work, quantity: Quantity, name: str, style: int) -> Iterator[Line]:
    """The runs of a method by their standing, what is worth its work joined by a line."""
    own = [point for point in chart.points if _method_of(point) == name]
    x = np.array([work.of(point.sample) for point in own])
    y = np.array([point.errors[quantity] for point in own])
    y = np.where(np.isfinite(y) & (y > 0), y, np.nan)
    judged = np.array(chart.judged(quantity))[[point in own for point in chart.points]]
    shape = _MARKERS.get(own[0].sample.point.method.family, "triangle-up")  # another package's family
    envelope = front(x, judged)
    yield Line("", x[envelope], judged[envelope], style=style, shape=shape)
    standings = [chart.standing(point, quantity) for point in own]
    for standing in dict.fromkeys([Standing.JUDGED, *standings]):
        for ending in sorted({point.sample.ending for point in own} if standing is Standing.FAILED else {""}):
            chosen = [
                i
                for i, point in enumerate(own)
                if standings[i] is standing and ending in ("", point.sample.ending)
            ]
            if not chosen and standing is not Standing.JUDGED:
                continue
            spread = np.array([np.ptp(work.values(own[i].sample)) / 2 for i in chosen])
            failed = standing is Standing.FAILED
            yield Line(
                name if standing is Standing.JUDGED else "",
                x[chosen],
                np.ones(len(chosen)) if failed else y[chosen],
                points=True,
                style=style,
                shape=ENDINGS[Ending(ending)][0]
                if failed
                else shape + ("" if standing is Standing.JUDGED else "-open"),
                red=standing is Standing.SILENT,
                rail=failed,
                said=tuple(_said(chart, own[i], quantity) for i in chosen),
                x_spread=spread if spread.any() and not failed else None,
            )


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
