"""Observed orders: every level run once, orders read off the stored runs, charts of their errors."""

from collections import Counter
from collections.abc import Sequence
from itertools import groupby

import numpy as np

from actin_xcheck.report.exhibits import Chapter, Line, Plot
from actin_xcheck.studies.converge.orders import Found, claim_of, read_off
from actin_xcheck.studies.converge.plan import Refined, Refinement
from actin_xcheck.studies.study import Report, Study, Table, Task
from actin_xcheck.verdicts.orders import Verdict

READ = 0.2
"""Seconds in which an order is read off, about."""

_BELOW = 0.6
"""A guide stands under the line it is to be compared with."""

SHOWN = (
    *("verdict", "scene", "method", "refined", "quantity", "truth", "declared", "before", "last"),
    *("slope", "low", "high", "reason", "command"),
)


def converge(asked: Sequence[Refinement]) -> Study:
    """Run all levels, each once, and judge the orders that they show."""
    jobs = {job.file: job for one in asked for job in map(one.run, one.levels)}
    yield [job.task for job in jobs.values()]
    found: list[Found] = yield [Task(read_off, one, READ) for one in asked]
    orders = [one.order for one in found]
    claimed = [one for one in orders if one.claimed]
    counts = Counter(one.verdict for one in orders)
    verdicts = {str(verdict): counts[verdict] for verdict in Verdict if counts[verdict]}
    return Report(
        f"{counts[Verdict.PASS]} of {len(claimed)} claimed orders hold",
        _LEAD,
        {
            "orders": Table("Orders", orders, _ORDERS, SHOWN),
            "errors": Table("Errors", [error for one in found for error in one.errors], _ERRORS),
        },
        tuple(map(claim_of, claimed)),
        (", ".join(f"{count} {verdict}" for verdict, count in verdicts.items()),),
        tuple(
            Chapter(scene, scene, group[0].order.citation, _charts(group))
            for scene, group in ((scene, list(group)) for scene, group in groupby(found, _scene))
        ),
        links={f"runs/{file.rpartition('/')[2]}": file for file in jobs},
        verdicts=verdicts,
    )


def _scene(found: Found) -> str:
    return found.order.scene


def _charts(found: Sequence[Found]) -> tuple[Plot, ...]:
    """One chart for each quantity and what is refined, all methods together."""
    together: dict[tuple[str, str, str], list[Found]] = {}
    for one in found:
        order = one.order
        together.setdefault((order.refined, order.quantity, order.truth), []).append(one)
    return tuple(_chart(f"errors-{number}", group) for number, group in enumerate(together.values()))


def _chart(key: str, found: Sequence[Found]) -> Plot:
    order = found[0].order
    in_h = order.refined == Refined.H
    lines = [Line(one.order.method, one.width, one.sizes) for one in found]
    failed = {
        float(width)
        for one in found
        for width, error in zip(one.width, one.errors, strict=True)
        if error.ending
    }
    return Plot(
        key,
        f"{order.quantity[0].upper()}{order.quantity[1:]}, against {'h' if in_h else 'Δt'}",
        f"Error against {order.truth}.{' Dotted verticals: a run fails.' if failed else ''}",
        "h, with Δt tied to it" if in_h else "Δt",
        (*lines, *_guides(found)),
        tuple(("✕", width) for width in sorted(failed)),
        log=True,
    )


def _guides(found: Sequence[Found]) -> list[Line]:
    """A line of each declared order, under the errors of the first method that declares it."""
    guides: dict[float, Line] = {}
    for one in found:
        declared, width, errors = one.order.declared, one.width, one.sizes
        known = np.isfinite(errors) & (errors > one.order.floor)
        if not declared or declared in guides or not known.any():
            continue
        finest = np.flatnonzero(known)[-1]
        below = _BELOW * errors[finest] * (width / width[finest]) ** declared
        guides[declared] = Line(f"order {declared:g}", width, below, guide=True)
    return list(guides.values())


_LEAD = (
    "Observed orders in the mesh width h and the time step Δt, held against those the methods declare. With "
    "h goes Δt ~ h^(p/q), p and q being the declared orders in h and Δt, so that both parts of the error "
    "fall together; Δt alone is refined on one mesh, where each level is compared with the next finer one. "
    "Levels are fixed and consecutive. An order holds when the last two local orders lie within 0.15 of it "
    "(in h, numbers of the whole cell may converge faster). Beside them stands the slope of the "
    "least-squares line through all levels with its 95 % interval.\n\n"
    "“Not yet asymptotic”: the local orders approach the declared one and have not reached it, or the error "
    "of a number changes its sign. “In round-off”: too few errors stand above it. “Measured”: nothing is "
    "claimed, for the reason given."
)

_ORDERS = "Declared, the last two local orders, slope of all levels and the ends of its 95 % interval."

_ERRORS = (
    "Of each level, or between it and the next finer one; the order is that between the level before and "
    "this one. An ending is said where a run failed."
)
