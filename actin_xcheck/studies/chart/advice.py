"""Which method to use for which error, as a chart's points have it."""

from itertools import groupby

import numpy as np

from actin_xcheck.studies.chart.front import Advice, advise
from actin_xcheck.studies.chart.record import Chart
from actin_xcheck.studies.chart.truth import Quantity


def advice_of(chart: Chart) -> list[Advice]:
    """Return the fastest point for each L2 error of the concentration, largest error first.

    By processor time, which is wall time where the machine is quiet and does not change where it is busy: no
    method uses more than one thread.
    """
    work = [float(np.median(point.sample.cpu_kernels)) for point in chart.points]
    return advise(work, chart.judged(Quantity.CONCENTRATION))


def in_words(chart: Chart) -> str:
    """The advice as one sentence, with seconds of one processor."""
    advice = advice_of(chart)
    if not advice:
        if Quantity.CONCENTRATION not in chart.quantities:
            return f"No advice: runs are held against {chart.known[Quantity.CONCENTRATION].source}."
        return "No run comes within an error of 1e-2."
    said = []
    for number, same in groupby(advice, lambda one: one.point):
        sample = chart.points[number].sample
        errors = " or ".join(short(one.error) for one in same)
        numerics = f"{sample.point.numerics}; {np.median(sample.cpu):.2g} s"
        said.append(f"{errors} use {sample.point.method.name} ({numerics})")
    return f"For an L2 error of {', of '.join(said)}."


def short(value: float) -> str:
    """A number to one digit, its exponent without the zeros nobody reads."""
    mantissa, exponent = f"{value:.0e}".split("e")
    return f"{mantissa}e{int(exponent)}"
