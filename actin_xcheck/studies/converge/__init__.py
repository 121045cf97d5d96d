"""Observed orders: every level run once, orders read off the stored runs, charts of their errors."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np

from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.core.model import Array
from actin_xcheck.report.exhibits import Chapter, Line, Plot
from actin_xcheck.runs.numerics import command
from actin_xcheck.runs.records import gathered
from actin_xcheck.runs.store import Run, read_run
from actin_xcheck.studies.converge.plan import Refined, Refinement, TruthKind
from actin_xcheck.studies.study import Report, Study, Table, Task
from actin_xcheck.verdicts.known import change_between, error_of
from actin_xcheck.verdicts.orders import TOLERANCE, Verdict, observe


@dataclass(frozen=True)
class Order:
    """A refinement as it came out.

    Attributes
    ----------
    key, scene, citation, method, refined, quantity, truth : of the refinement, in words.
    measured : the quantity by its name.
    declared : the order of the method.
    claimed : whether it is claimed here.
    at_least : whether a higher order holds too.
    floor : errors up to this are round-off.
    verdict, reason, slope, low, high : see `verdicts.orders.ObservedOrder`.
    before, last : the last two local orders, where it passes of those above round-off.
    command : what refines again.
    """

    key: str
    scene: str
    citation: str
    method: str
    refined: str
    measured: str
    quantity: str
    truth: str
    declared: float
    claimed: bool
    at_least: bool
    floor: float
    verdict: Verdict
    reason: str
    before: float
    last: float
    slope: float
    low: float
    high: float
    command: str

    @property
    def name(self) -> str:
        """The order in words."""
        return f"order in {self.refined} of {self.quantity}"


@dataclass(frozen=True)
class Error:
    """An error of a refinement, of one level or between it and the next finer one.

    Attributes
    ----------
    key : of the refinement.
    refine, steps, h, dt : of the level, the coarser of two.
    error : without its sign; nan where a run gave no number.
    order : between the level before and this one; nan at the first, and in round-off.
    ending : how the run failed; empty where it completed.
    file, finer_file : the level's run, and that which it is held against; empty where that is no run.
    """

    key: str
    refine: int
    steps: int
    h: float
    dt: float
    error: float
    order: float
    ending: str
    file: str
    finer_file: str


@dataclass(frozen=True)
class FoundErrors:
    """An order with the errors that it is read off, the coarsest level first."""

    order: Order
    errors: tuple[Error, ...]

    @property
    def width(self) -> Array:
        """What the order is in, (n,): h or dt."""
        return np.array([one.h if self.order.refined == Refined.H else one.dt for one in self.errors])

    @property
    def sizes(self) -> Array:
        """The errors, (n,)."""
        return np.array([one.error for one in self.errors])


def read_off(asked: Refinement, folder: Path) -> FoundErrors:
    """Judge a refinement whose runs lie in the folder."""
    files = [asked.run(level).file for level in asked.levels]
    runs = [read_run(folder / file) for file in files]
    errors, endings = _errors(asked, runs), [_ending(run) for run in runs]
    finer = [""] * len(files)
    if asked.truth is TruthKind.RICHARDSON:
        endings = [coarse or fine for coarse, fine in pairwise(endings)]
        finer = files[1:]
    steps = [asked.steps_of(level) for level in asked.levels[: len(errors)]]
    widths = [h if asked.refined is Refined.H else dt for h, dt in steps]
    claimed = None if asked.no_claim else asked.declared
    seen = observe(widths, errors, claimed, asked.at_least, asked.floor)
    known = [one for one in seen.local if np.isfinite(one)]
    before, last = (known if seen.verdict is Verdict.PASS else seen.local)[-2:]  # behind it may be round-off
    order = gathered(
        Order,
        asked,
        asked.scene,
        seen,
        scene=asked.scene.name,
        method=asked.method.name,
        refined=str(asked.refined),
        measured=str(asked.quantity),
        quantity=asked.quantity.words,
        truth=str(asked.truth),
        declared=float(asked.declared),
        claimed=not asked.no_claim,
        reason=asked.no_claim or seen.reason,
        before=before,
        last=last,
        command=command("converge", asked.origin, method=asked.method.name),
    )
    rows = zip(asked.levels, steps, errors, (np.nan, *seen.local), endings, files, finer, strict=False)
    return FoundErrors(
        order,
        tuple(
            Error(asked.key, level.refine, level.steps, h, dt, abs(error), local, ending, file, other)
            for level, (h, dt), error, local, ending, file, other in rows
        ),
    )


def claim_of(order: Order) -> Claim:
    """A declared order as a claim: how far the last two local orders are from it.

    Without a number where it fails for another reason than that distance, without a bound where there is no
    verdict.
    """
    off = order.declared - np.array([order.before, order.last])
    value = float((np.maximum(off, 0) if order.at_least else np.abs(off)).max())
    judged = order.verdict in (Verdict.PASS, Verdict.FAIL)
    if order.verdict is Verdict.FAIL and value <= TOLERANCE:
        value = np.nan
    return Claim(
        kind=ClaimKind.ORDER_H if order.refined == Refined.H else ClaimKind.ORDER_DT,
        quantity=order.measured,
        scene=order.scene,
        methods=(order.method,),
        statement=f"the {order.name} is {order.declared:g}: {order.reason}",
        value=value,
        bound=TOLERANCE if judged else np.nan,
        command=order.command,
        path="/tables/orders",
        note=f"value: the larger distance of the last two local orders, against {order.truth}",
    )


def _errors(asked: Refinement, runs: Sequence[Run]) -> list[float]:
    """One error per level, or per pair of successive levels."""
    if asked.truth is TruthKind.RICHARDSON:
        return [change_between(asked.scene, *pair, asked.quantity) for pair in pairwise(runs)]
    return [error_of(asked.scene, run, asked.quantity) for run in runs]


def _ending(run: Run) -> str:
    """How a run failed; empty where it completed."""
    stated = run.attributes
    return "" if stated["outcome"] == "completed" else f"{stated['outcome']}: {stated['message']}"


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
    found: list[FoundErrors] = yield [Task(read_off, one, READ) for one in asked]
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


def _scene(found: FoundErrors) -> str:
    return found.order.scene


def _charts(found: Sequence[FoundErrors]) -> tuple[Plot, ...]:
    """One chart for each quantity and what is refined, all methods together."""
    together: dict[tuple[str, str, str], list[FoundErrors]] = {}
    for one in found:
        order = one.order
        together.setdefault((order.refined, order.quantity, order.truth), []).append(one)
    return tuple(_chart(f"errors-{number}", group) for number, group in enumerate(together.values()))


def _chart(key: str, found: Sequence[FoundErrors]) -> Plot:
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


def _guides(found: Sequence[FoundErrors]) -> list[Line]:
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
