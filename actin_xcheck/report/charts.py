"""Charts over time, all runs of a scene together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from actin_xcheck.core.model import Array
from actin_xcheck.report.svg import INK, STYLES, calm, styled, svg
from actin_xcheck.runs.store import Run

_ROUND_OFF = 1e-17
"""Residuals below it, exact zeros above all, are drawn here: a logarithm has no place for them."""


@dataclass(frozen=True)
class Chart:
    """One chart as inline SVG, its title, and what its lines are and where their numbers stand."""

    title: str
    note: str
    path: str
    svg: str


@dataclass(frozen=True)
class _Quantity:
    """What a chart shows: series of `/run/series`, or components of one; `names` tell its lines apart."""

    title: str
    note: str
    series: tuple[str, ...]
    component: tuple[int, ...] = ()
    log: bool = False
    names: tuple[str, ...] = ("", "")

    def lines(self, run: Run) -> list[Array]:
        """Return the lines (n,) of one run."""
        if self.component:
            return [run.series[self.series[0]][:, i] for i in self.component]
        return [run.series[name] for name in self.series]


_QUANTITIES = (
    _Quantity("Area |Ω|", "", ("area",)),
    _Quantity("Polarity", "minor over major axis of the smallest ellipse around the rim", ("polarity",)),
    _Quantity("Centroid", "x solid, y dashed", ("centroid",), component=(0, 1), names=(" x", " y")),
    _Quantity(
        "Extrema of a", "largest solid, smallest dashed", ("a_max", "a_min"), names=(" largest", " smallest")
    ),
    _Quantity("Total actin ∫a", "", ("total_actin",)),
    _Quantity("|Balance residual|", "of total actin, relative, per step", ("balance_residual",), log=True),
)
_GROWTH = _Quantity("Mode amplitude", "predicted growth dotted", ("mode_amplitude",), log=True)
_GAUGED = (
    _Quantity(
        "Net force", "that the gauge carries; x solid, y dashed", ("net_force",), (0, 1), names=(" x", " y")
    ),
    _Quantity("Net torque", "that the gauge carries, about the centroid", ("net_torque",)),
)
_DASHES = ("-", (0, (4, 2)))


def charts(runs: Sequence[Run], prefix: str) -> list[Chart]:
    """Return the charts of one scene; `prefix` keeps ids apart from those of other scenes on the page."""
    measured = {name for run in runs for name in run.series}
    quantities = [q for q in (_GROWTH, *_QUANTITIES, *_GAUGED) if measured.issuperset(q.series)]
    with styled():
        return [_chart(quantity, runs, f"{prefix}-{i}") for i, quantity in enumerate(quantities)]


def _chart(quantity: _Quantity, runs: Sequence[Run], prefix: str) -> Chart:
    figure = Figure(figsize=(4.2, 2.5))
    axes = figure.add_subplot(xlabel="t", yscale="log" if quantity.log else "linear")
    for run, style in zip(runs, STYLES * len(runs), strict=False):
        if not all(name in run.series for name in quantity.series):
            continue
        time = run.series["time"]
        method = run.attributes["method_name"]
        for values, dash, name in zip(quantity.lines(run), _DASHES, quantity.names, strict=False):
            shown = np.clip(np.abs(values), _ROUND_OFF, None) if quantity.log else values
            axes.plot(
                time, shown, color=style.colour, linewidth=style.width, linestyle=dash, label=method + name
            )
            if run.attributes["outcome"] != "completed":
                axes.plot(time[-1:], shown[-1:], "x", color=style.colour, markersize=7, markeredgewidth=2)
        if quantity is _GROWTH and "growth_rate_predicted" in run.attributes:
            _predict(
                axes, time, np.abs(quantity.lines(run)[0]), float(run.attributes["growth_rate_predicted"])
            )
    calm(axes)
    return Chart(
        quantity.title,
        quantity.note,
        f"/run/series/{', '.join(quantity.series)}",
        svg(figure, f"{quantity.title} over time", prefix),
    )


def _predict(axes: Axes, time: Array, amplitude: Array, rate: float) -> None:
    """Draw exp(rate t) through the first amplitude."""
    axes.plot(
        time, amplitude[0] * np.exp(rate * time), color=INK, linewidth=1.1, linestyle=(0, (1, 2.2)), zorder=3,
        label="predicted",
    )  # fmt: skip
