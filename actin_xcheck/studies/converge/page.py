"""The page of a convergence report, from `convergence.h5` alone."""

from collections import Counter
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

import numpy as np

from actin_xcheck.report.draw import Drawing, draw
from actin_xcheck.report.environment import environment, put_page
from actin_xcheck.report.exhibits import Line, Plot
from actin_xcheck.studies.converge.record import FILE_NAME, Result, read_convergence
from actin_xcheck.verdicts.orders import Verdict

_BELOW = 0.6
"""A guide stands under the line it is to be compared with."""


def write_convergence_page(folder: Path) -> Path:
    """Write `folder/index.html` from `folder/convergence.h5` and return its path.

    UserError where the file is missing or not whole.
    """
    folder = Path(folder)
    stored = read_convergence(folder / FILE_NAME)
    sections = []
    for number, (scene, group) in enumerate(groupby(stored.results, lambda result: result.scene)):
        results = list(group)
        sections.append((scene, results, _charts(results, f"s{number}")))
    claimed = [result for result in stored.results if result.claimed]
    counts = Counter(result.observed.verdict for result in stored.results)
    html = environment(folder).get_template("convergence.html")
    text = html.render(
        attributes=stored.attributes,
        sections=sections,
        total=len(claimed),
        passed=counts[Verdict.PASS],
        counts=[(verdict, counts[verdict]) for verdict in Verdict if counts[verdict]],
        failing=[result for result in claimed if result.observed.verdict is Verdict.FAIL],
        file=stored.path,
    )
    return put_page(folder, text)


def _charts(results: Sequence[Result], prefix: str) -> list[Drawing]:
    """One chart for each quantity and what is refined, all methods together."""
    together: dict[tuple[str, str, str], list[Result]] = {}
    for result in results:
        together.setdefault((result.refined, result.quantity, result.truth), []).append(result)
    return [_chart(title, group, f"{prefix}-{i}") for i, (title, group) in enumerate(together.items())]


def _chart(title: tuple[str, str, str], results: Sequence[Result], prefix: str) -> Drawing:
    refined, quantity, truth = title
    lines = [Line(result.method, result.width, result.errors) for result in results]
    failed = {float(result.width[i]) for result in results for i, end in enumerate(result.endings) if end}
    plot = Plot(
        prefix,
        f"{quantity[0].upper()}{quantity[1:]}, against {'h' if refined == 'h' else 'Δt'}",
        f"Error against {truth}.{' Dotted verticals: a run fails.' if failed else ''}",
        "h, with Δt tied to it" if refined == "h" else "Δt",
        (*lines, *_guides(results)),
        tuple(("✕", width) for width in sorted(failed)),
        log=True,
    )
    keys = [result.key.replace(result.method, "*") for result in results]
    return draw(plot, f"/studies/{keys[0]}/errors", prefix)


def _guides(results: Sequence[Result]) -> list[Line]:
    """A line of each declared order, under the errors of the first method that declares it."""
    guides: dict[float, Line] = {}
    for result in results:
        known = np.isfinite(result.errors) & (result.errors > result.floor)
        if not result.declared or result.declared in guides or not known.any():
            continue
        finest = np.flatnonzero(known)[-1]
        shape = (result.width / result.width[finest]) ** result.declared
        guide = Line(
            f"order {result.declared:g}", result.width, _BELOW * result.errors[finest] * shape, guide=True
        )
        guides[result.declared] = guide
    return list(guides.values())
