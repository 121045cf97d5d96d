"""The runs of a chart as rows, what each is in the chart of a quantity, and the charts."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from actin_xcheck.core.errors import Ending
from actin_xcheck.core.model import Array
from actin_xcheck.report.exhibits import Chapter, Line, Plot
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.records import gathered
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.chart.measure import Sample, command_of
from actin_xcheck.studies.chart.truth import (
    WRONG,
    ChartedQuantity,
    ChartTruth,
    KnownError,
    PointKind,
    advise,
    errors_of,
    front,
    standing,
)

SHAPES = {"fem": "circle", "fv": "diamond"}
"""Markers by the code a method belongs to; that of another package is a triangle."""

SIGNS = {
    Ending.TANGLED: "x",
    Ending.SINGULAR_DILATION: "triangle-down",
    Ending.NEGATIVE_CONCENTRATION: "line-ew",
    Ending.STEP_TOO_SMALL: "triangle-up",
    Ending.NOT_CONVERGED: "cross",
    Ending.NON_FINITE: "star",
    Ending.INTERRUPTED: "square",
}
"""Markers of failed runs."""


@dataclass(frozen=True, eq=False)
class ChartRow:
    """A run of a chart.

    Attributes
    ----------
    method, refine, dt, rtol, fidelity, numerics : what was run, and in words; rtol is nan for equal steps.
    standing : what it is in the chart of the concentration, see `PointKind`.
    ending, message : of its Outcome.
    error_a, error_area, error_probes : by `Quantity`; nan where it failed or nothing is known.
    wall, cpu : median seconds of the repetitions, with the least and the most of them.
    kernels, cpu_kernels : the same in units of the reference kernel beside the run.
    steps, rejected, cells, cells_steps, factorisations, solves : counted; rejected steps are in cells_steps.
    megabytes : needed at the peak beyond what the process had before.
    command : what makes it again.
    sample : all that was measured.
    """

    method: str
    refine: int
    dt: float
    rtol: float
    fidelity: str
    numerics: str
    standing: PointKind
    ending: str
    message: str
    error_a: float
    error_area: float
    error_probes: float
    wall: float
    wall_least: float
    wall_most: float
    kernels: float
    cpu: float
    cpu_least: float
    cpu_most: float
    cpu_kernels: float
    steps: int
    rejected: int
    cells: int
    cells_steps: int
    factorisations: int
    solves: int
    megabytes: float
    command: str
    sample: Sample


def row_of(scene: Scene, truth: ChartTruth, point: Numerics, sample: Sample) -> ChartRow:
    """A point as it was measured, with its errors."""
    errors, answer = errors_of(truth, sample.answer), sample.answer
    return gathered(
        ChartRow,
        point,
        answer,
        sample,
        method=point.method.name,
        rtol=np.nan if point.rtol is None else point.rtol,
        fidelity=str(point.reduction.fidelity),
        numerics=point.words,
        standing=standing(answer, errors, ChartedQuantity.CONCENTRATION, truth.known),
        error_a=errors[ChartedQuantity.CONCENTRATION],
        error_area=errors[ChartedQuantity.AREA],
        error_probes=errors[ChartedQuantity.PROBES],
        wall=float(np.median(sample.wall)),
        wall_least=float(sample.wall.min()),
        wall_most=float(sample.wall.max()),
        kernels=float(np.median(sample.kernels)),
        cpu=float(np.median(sample.cpu)),
        cpu_least=float(sample.cpu.min()),
        cpu_most=float(sample.cpu.max()),
        cpu_kernels=float(np.median(sample.cpu_kernels)),
        megabytes=sample.memory / 1e6,
        command=command_of(point, scene),
        sample=sample,
    )


@dataclass(frozen=True)
class Chart:
    """The runs of a chart, method by method, and how each quantity is known."""

    known: Mapping[ChartedQuantity, KnownError]
    rows: Sequence[ChartRow]

    @property
    def quantities(self) -> list[ChartedQuantity]:
        """Those of which anything is known."""
        return [quantity for quantity, known in self.known.items() if np.isfinite(known.floor)]

    def standing(self, row: ChartRow, quantity: ChartedQuantity) -> PointKind:
        """What a run is in the chart of a quantity."""
        errors = {one: getattr(row, f"error_{one}") for one in ChartedQuantity}
        return standing(row.sample.answer, errors, quantity, self.known)

    def judged(self, quantity: ChartedQuantity) -> Array:
        """The errors that mean something, in the order of the rows; nan for the others."""
        return np.array([
            getattr(row, f"error_{quantity}") if self.standing(row, quantity) is PointKind.JUDGED else np.nan
            for row in self.rows
        ])  # fmt: skip

    @property
    def advice(self) -> list[tuple[float, ChartRow]]:
        """The fastest run for each L2 error of the concentration, largest error first.

        By processor time, which is wall time where the machine is quiet and does not change where it is busy:
        no method uses more than one thread.
        """
        found = advise([row.cpu_kernels for row in self.rows], self.judged(ChartedQuantity.CONCENTRATION))
        return [(error, self.rows[number]) for error, number in found]


@dataclass(frozen=True)
class Work:
    """An abscissa: its name, and one number a repetition of a run."""

    key: str
    title: str
    xlabel: str
    values: Callable[[Sample], Array]


WORKS = (
    Work("kernels", "Wall time", "wall time / reference kernel", lambda sample: sample.kernels),
    Work("cpu", "CPU time", "CPU time / reference kernel", lambda sample: sample.cpu_kernels),
    Work("cells-steps", "Cells × steps", "cells × steps", lambda sample: np.array([sample.cells_steps])),
    Work("memory", "Peak memory", "MB beyond what the process had", lambda sample: _megabytes(sample)),
)


def _megabytes(sample: Sample) -> Array:
    """Peak memory; at least a page, for a logarithm has no place for nothing."""
    return np.array([max(sample.memory, 4096) / 1e6])


def chapter_of(chart: Chart, work: Work) -> Chapter:
    """The charts of one kind of work, a quantity each."""
    shown = [
        one for one in ChartedQuantity if one in chart.quantities or one is ChartedQuantity.CONCENTRATION
    ]
    return Chapter(work.key, work.title, "", tuple(_plot(chart, work, quantity) for quantity in shown))


def _plot(chart: Chart, work: Work, quantity: ChartedQuantity) -> Plot:
    methods = list(dict.fromkeys(row.method for row in chart.rows))
    x = np.array([np.median(work.values(row.sample)) for row in chart.rows])
    judged, lines = chart.judged(quantity), list[Line]()
    for style, method in enumerate(methods):
        own = [i for i, row in enumerate(chart.rows) if row.method == method]
        edge = [own[i] for i in front(x[own], judged[own])]
        lines.append(Line("", x[edge], judged[edge], style=style, shape=_shape(method, PointKind.JUDGED)))
        lines += _marked(chart, work, quantity, own, style)
    if kept := front(x, judged):
        stairs = np.append(x[kept], 1.5 * x.max()), np.append(judged[kept], judged[kept[-1]])
        lines.append(Line("front", *stairs, steps=True, guide=True))
    return Plot(
        key=str(quantity),
        title=quantity.heading,
        note=f"Error: {quantity.words}.",
        xlabel=work.xlabel,
        lines=tuple(lines),
        log=True,
        levels=tuple(_levels(chart, quantity)),
    )


def _levels(chart: Chart, quantity: ChartedQuantity) -> Iterator[tuple[str, float]]:
    """From where on a run is wrong, and up to where nothing is judged, as far as errors come near."""
    errors = np.array([getattr(row, f"error_{quantity}") for row in chart.rows])
    errors = errors[errors > 0]
    low, high = (errors.min(), errors.max()) if errors.size else (1e-3, 1.0)
    if quantity is ChartedQuantity.CONCENTRATION and low < WRONG < 3 * high:
        yield "silently inaccurate", WRONG
    if (floor := chart.known[quantity].floor) > low / 100:
        yield "the reference's own error", floor


def _marked(
    chart: Chart, work: Work, quantity: ChartedQuantity, own: Sequence[int], style: int
) -> list[Line]:
    """The points of a method, those that are alike together: judged, not judged, wrong, failed, and how."""
    alike: dict[tuple[PointKind, str], list[ChartRow]] = {}
    for row in (chart.rows[number] for number in own):
        kind = chart.standing(row, quantity)
        alike.setdefault((kind, row.ending if kind is PointKind.FAILED else ""), []).append(row)
    lines: list[Line] = []
    for (kind, ending), rows in sorted(alike.items(), key=lambda one: one[0][0] is PointKind.FAILED):
        y = np.array([getattr(row, f"error_{quantity}") for row in rows])
        values = [work.values(row.sample) for row in rows]
        spread = np.array([np.ptp(one) / 2 for one in values])
        said = f"failed: {ending.replace('_', ' ')}" if ending else ""
        name = "" if lines else rows[0].method
        lines.append(
            Line(
                label=", ".join(filter(None, (name, said))),
                x=np.array([np.median(one) for one in values]),
                y=np.where(y > 0, y, np.nan),
                points=True,
                style=style,
                shape=SIGNS[Ending(ending)] if ending else _shape(rows[0].method, kind),
                red=kind is PointKind.SILENT,
                rail=kind is PointKind.FAILED,
                said=tuple(_said(chart, row, quantity) for row in rows),
                x_spread=spread if spread.any() and not ending else None,
            )
        )
    return lines


def _shape(method: str, kind: PointKind) -> str:
    family = METHODS[method].family if method in METHODS else ""
    return f"{SHAPES.get(family, 'triangle-up')}{'' if kind is PointKind.JUDGED else '-open'}"


def _said(chart: Chart, row: ChartRow, quantity: ChartedQuantity) -> str:
    """What is read when the pointer rests on a point."""
    kind = chart.standing(row, quantity)
    if kind is PointKind.FAILED:
        what = f"failed: {row.ending.replace('_', ' ')}: {row.message}"
    else:
        what = f"error {getattr(row, f'error_{quantity}'):.2g}"
        what += "" if kind is PointKind.JUDGED else f", {kind}"
    spread = f" ({row.wall_least:.3g} to {row.wall_most:.3g})" if len(row.sample.wall) > 1 else ""
    return "\n".join((
        f"{row.method}, {row.numerics}",
        what,
        f"{row.wall:.3g} s{spread}, {row.kernels:.3g} kernels",
        f"{row.steps} steps, {row.rejected} rejected, {row.cells} cells",
        f"{row.megabytes:.3g} MB",
    ))  # fmt: skip
