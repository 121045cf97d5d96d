"""Scenes at the limit of the model, of the mesh and of what can be predicted: how each run of them ends."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, groupby

import numpy as np

from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.core.model import Array
from actin_xcheck.report.exhibits import Chapter, Line, Plot
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import command
from actin_xcheck.studies.extremes.attempt import BREAKDOWNS, Attempt, Trial, attempt
from actin_xcheck.studies.study import Report, Study, Table, Task, counted
from actin_xcheck.verdicts.orders import ELSEWHERE, uncertainty


@dataclass(frozen=True, eq=False)
class Breakdown:
    """The time at which 1 + phi reaches zero, by one method.

    Attributes
    ----------
    scene, method : what was run.
    refine, times : the meshes, coarsest first, and the times on them, (n,).
    place : material point (2,) where it happens.
    value, uncertainty : the finest time, and how far off it may be.
    how : how the uncertainty came about.
    """

    scene: str
    method: str
    refine: Array
    times: Array
    place: Array
    value: float
    uncertainty: float
    how: str


def breakdowns(attempts: Sequence[Attempt]) -> list[Breakdown]:
    """The breakdown times of all ladders whose runs end so, each on two meshes at least.

    Of meshes among which one's run does not end so only those finer than it are one ladder, whose h halves.
    """
    plain = [one for one in attempts if not one.remesh and not one.epsilon]
    ended = [one for one in plain if np.isfinite(one.breakdown)]
    ended.sort(key=lambda one: (one.scene, one.method, one.refine, one.rtol))
    found = []
    for (scene, method), group in groupby(ended, lambda one: (one.scene, one.method)):
        runs = list(group)
        finest = min(one.rtol for one in runs)
        by_refine = {one.refine: one for one in runs if one.rtol == finest}
        coarser = [
            (one, by_refine[one.refine]) for one in runs if one.rtol > finest and one.refine in by_refine
        ]
        refine = max(by_refine)
        while refine - 1 in by_refine:
            refine -= 1
        levels = [one for one in by_refine.values() if one.refine >= refine]
        if len(levels) > 1:
            found.append(_breakdown(scene, method, levels, coarser))
    return found


def _breakdown(
    scene: str, method: str, levels: Sequence[Attempt], coarser: Sequence[tuple[Attempt, Attempt]]
) -> Breakdown:
    """Of levels in h, and of runs with a larger tolerance, if any, each with the one on its mesh without."""
    order, times = METHODS[method].order_h, np.array([one.breakdown for one in levels])
    values = [times[i : i + 1] for i in range(len(times) - 1, -1, -1)][:3]
    of_h, how, _ = uncertainty(values, order, 2.0**order, True, levels[-1].rtol * float(times[-1]))
    # an error estimate controlled to a tolerance leaves an error like its power p/(p + 1)
    power = METHODS[method].order_dt / (METHODS[method].order_dt + 1)
    of_steps = sum(
        ELSEWHERE * abs(one.breakdown - beside.breakdown) / ((one.rtol / beside.rtol) ** power - 1)
        for one, beside in coarser
    )
    steps = f"{of_steps:.1e}, Fs = {ELSEWHERE:g}, tolerance times 10" if coarser else "not known"
    how = f"in h: {of_h:.1e}, {how}; in steps: {steps}"
    refine = np.array([one.refine for one in levels])
    return Breakdown(
        scene=scene,
        method=method,
        refine=refine,
        times=times,
        place=levels[-1].place,
        value=float(times[-1]),
        uncertainty=of_h + of_steps,
        how=how,
    )


def agreement(found: Sequence[Breakdown]) -> dict[str, tuple[float, float]]:
    """Per scene the relative difference of two methods that exceeds the sum of their uncertainties most."""
    worst: dict[str, tuple[float, float]] = {}
    for one, other in combinations(found, 2):
        if one.scene != other.scene:
            continue
        apart = abs(one.value - other.value) / other.value
        allowed = (one.uncertainty + other.uncertainty) / other.value
        before, permitted = worst.get(one.scene, (-1.0, 1.0))
        if apart * permitted >= before * allowed:
            worst[one.scene] = apart, allowed
    return worst


PARTED = 1e-3
"""Twins that are further apart, relative, have parted."""

SHOWN_RUNS = (
    *("scene", "rheology", "method", "refine", "remesh", "outcome", "t", "steps", "shape", "worn"),
    *("remeshings", "residual", "area", "message", "command"),
)


def extremes(trials: Sequence[Trial]) -> Study:
    """Carry out trials and read the breakdown times off."""
    attempts: list[Attempt] = yield [Task(attempt, trial, trial.seconds) for trial in trials]
    found = breakdowns(attempts)
    agreed = agreement(found)
    findings = [
        f"{one.scene}, {one.method}: 1 + div u = 0 at t = {one.value:.6g} +- {one.uncertainty:.1g}"
        for one in found
    ]
    findings += [
        f"{scene}: methods differ by {apart:.1e}, their uncertainties allow {allowed:.1e}"
        for scene, (apart, allowed) in agreed.items()
    ]
    claims = [_claim(found, scene, *agreed.get(scene, (np.nan, 0.0))) for scene in _judged(attempts, found)]
    note = "The root of the smallest 1 + div u, on the finest mesh; where it happens stands in the file."
    return Report(
        counted(claims, "breakdown times agree between methods"),
        _lead(attempts),
        {
            "breakdowns": Table(
                "When the model ends", found, note, ("scene", "method", "value", "uncertainty", "how")
            ),
            "runs": Table("Every run", attempts, "", SHOWN_RUNS),
        },
        tuple(claims),
        tuple(findings),
        tuple(_twins([one for one in attempts if one.epsilon])),
    )


def _lead(attempts: Sequence[Attempt]) -> str:
    ended = sum(one.outcome != "completed" for one in attempts)
    remeshings = sum(one.remeshings for one in attempts)
    return (
        f"{len(attempts)} runs, {ended} ended before their time, {remeshings} remeshings.\n\n"
        "The model ends where 1 + div u reaches zero: the pressure is singular there. Its time is the root "
        "of the smallest 1 + div u of a run whose steps shorten towards it, on meshes whose width halves; "
        "the uncertainty is Roache's. The mesh ends where a cell has lost its shape: it is then said to be "
        "about to fold, and with remeshing the run goes on on a new triangulation of the reference disk. "
        "Prediction ends where a run and its twin part."
    )


def _judged(attempts: Sequence[Attempt], found: Sequence[Breakdown]) -> list[str]:
    """Scenes of which several methods were asked when the model ends; agreed or not, all of them must say."""
    ladders: dict[str, set[str]] = {one.scene: set() for one in found}
    for one in attempts:
        if one.scene in BREAKDOWNS and not one.epsilon:
            ladders.setdefault(one.scene, set()).add(one.method)
    for known in found:
        ladders[known.scene].add(known.method)
    return [scene for scene, methods in ladders.items() if len(methods) > 1]


def _claim(found: Sequence[Breakdown], scene: str, apart: float, allowed: float) -> Claim:
    """The methods' breakdown times of a scene differ by no more than their uncertainties."""
    return Claim(
        kind=ClaimKind.AGREEMENT,
        quantity="breakdown_time",
        scene=scene,
        methods=tuple(one.method for one in found if one.scene == scene),
        statement="the methods agree on when 1 + div u reaches zero (largest relative difference)",
        value=apart,
        bound=allowed,
        command=command("extremes", only=scene),
        path="/tables/breakdowns",
        note="bound: the sum of their uncertainties",
    )


def _twins(twins: Sequence[Attempt]) -> list[Chapter]:
    """How twins part, if there are some."""
    if not twins:
        return []
    lines = []
    for one in twins:
        shown = (one.times > 0) & (one.apart > 0)
        label = f"{one.scene}, {one.method}, refine {one.refine}"
        lines.append(Line(label, one.times[shown], one.apart[shown]))
    times = np.unique(np.concatenate([line.x for line in lines]))
    first = twins[0]
    grown = first.epsilon * np.exp(np.minimum(first.rate * times, np.log(1 / first.epsilon)))
    guide = Line("at the largest rate of a = 1", times, grown, guide=True)
    note = (
        "Relative distance of their concentrations, against time.  Dotted: what the largest growth rate of "
        "linear theory would make of it."
    )
    title = f"Two runs that differ by {first.epsilon:g} at the start"
    plot = Plot("twins", title, note, "t", (*lines, guide), log=True)
    return [Chapter("twins", "When prediction ends", " ".join(map(_parting, twins)), (plot,))]


def _parting(one: Attempt) -> str:
    """Whether a run and its twin have parted, in words."""
    if one.apart.max() < PARTED:
        come_to = (
            "they have not parted: as far as they were run the run is predictable, beyond what the rate "
            "about a = 1 lets one fear."
        )
    else:
        come_to = "they have parted, and nothing is claimed of the run after that."
    return (
        f"{one.scene}, {one.method} at refine {one.refine}: the largest growth rate about a = 1 is "
        f"{one.rate:.4g}, so that round-off could grow to the size of a by t = {one.horizon:.2g}. Twins that "
        f"differ by {one.epsilon:g} were {one.apart.max():.1e} apart at most, and {one.apart[-1]:.1e} at "
        f"t = {one.times[-1]:.4g}: {come_to}"
    )
