"""The page of the study of extremes, from `extremes.h5` alone."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

import numpy as np

from actin_xcheck.report.draw import Drawing, draw
from actin_xcheck.report.environment import environment, put_page
from actin_xcheck.report.exhibits import Line, Plot
from actin_xcheck.studies.extremes.attempt import Attempt
from actin_xcheck.studies.extremes.breakdown import agreement
from actin_xcheck.studies.extremes.record import FILE_NAME, read_extremes


def write_extremes_page(folder: Path) -> Path:
    """Write `folder/index.html` from `folder/extremes.h5` and return its path.

    UserError where the file is missing or not whole.
    """
    folder = Path(folder)
    stored = read_extremes(folder / FILE_NAME)
    agreed = agreement(stored.breakdowns)
    twins = [one for one in stored.attempts if one.epsilon]
    text = (
        environment(folder)
        .get_template("extremes.html")
        .render(
            attributes=stored.attributes,
            breakdowns=[
                (scene, list(group), agreed.get(scene))
                for scene, group in groupby(stored.breakdowns, lambda one: one.scene)
            ],
            holding=sum(apart <= allowed for apart, allowed in agreed.values()),
            compared=len(agreed),
            runs=stored.attempts,
            ended=sum(one.outcome != "completed" for one in stored.attempts),
            remeshings=sum(one.remeshings for one in stored.attempts),
            twins=twins,
            drawing=_drawing(twins) if twins else None,
            file=stored.path,
        )
    )
    return put_page(folder, text)


def _drawing(twins: Sequence[Attempt]) -> Drawing:
    """How twins part."""
    lines = []
    for one in twins:
        shown = (one.times > 0) & (one.apart > 0)
        label = f"{one.scene}, {one.method}, refine {one.refine}"
        lines.append(Line(label, one.times[shown], one.apart[shown]))
    times = np.unique(np.concatenate([line.x for line in lines]))
    first = twins[0]
    grown = first.epsilon * np.exp(np.minimum(first.rate * times, np.log(1 / first.epsilon)))
    guide = Line("at the largest rate of a = 1", times, grown, guide=True)
    plot = Plot(
        "twins",
        f"Two runs that differ by {first.epsilon:g} at the start",
        "Relative distance of their concentrations, against time.  Dotted: what the largest growth "
        "rate of linear theory would make of it.",
        "t",
        (*lines, guide),
        log=True,
    )
    return draw(plot, f"/runs/{first.key}/apart", "twins")
