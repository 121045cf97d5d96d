"""Charts over time, all runs of a scene together."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from actin_xcheck.core.model import Array
from actin_xcheck.report.draw import Drawing, draw
from actin_xcheck.report.exhibits import Line, Plot
from actin_xcheck.runs.store import Run

_ROUND_OFF = 1e-17
"""Residuals below it, exact zeros above all, are drawn here: a logarithm has no place for them."""


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


def charts(runs: Sequence[Run]) -> list[Drawing]:
    """Return the charts of one scene, and where in a run's file their numbers stand."""
    measured = {name for run in runs for name in run.series}
    quantities = [q for q in (_GROWTH, *_QUANTITIES, *_GAUGED) if measured.issuperset(q.series)]
    return [draw(chart(one, runs), f"/run/series/{', '.join(one.series)}") for one in quantities]


def chart(quantity: _Quantity, runs: Sequence[Run]) -> Plot:
    """Draw one quantity of all runs."""
    lines = [
        line
        for number, run in enumerate(runs)
        if all(name in run.series for name in quantity.series)
        for line in _lines(quantity, run, number)
    ]
    key = quantity.title.lower()
    return Plot(key, quantity.title, quantity.note, "t", tuple(lines), logy=quantity.log)


def _lines(quantity: _Quantity, run: Run, style: int) -> Iterator[Line]:
    """The lines of a run, a cross where it fails, and the growth that was predicted."""
    time, method = run.series["time"], run.attributes["method_name"]
    outcome = run.attributes["outcome"]
    for number, (values, name) in enumerate(zip(quantity.lines(run), quantity.names, strict=False)):
        shown = np.clip(np.abs(values), _ROUND_OFF, None) if quantity.log else values
        yield Line(method + name, time, shown, dashed=number > 0, style=style)
        if outcome != "completed":
            said = f"{method}{name}: {outcome}"
            yield Line(said, time[-1:], shown[-1:], points=True, style=style, shape="x")
    if quantity is _GROWTH and "growth_rate_predicted" in run.attributes:
        amplitude = np.abs(quantity.lines(run)[0][0])
        growth = np.exp(float(run.attributes["growth_rate_predicted"]) * time)
        yield Line(f"{method}, predicted", time, amplitude * growth, guide=True)
