"""When the model ends: breakdown times of one method on three meshes, and whether two methods agree."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, groupby

import numpy as np

from actin_xcheck.core.model import Array
from actin_xcheck.runs.method import METHODS
from actin_xcheck.studies.extremes.attempt import Attempt
from actin_xcheck.verdicts.uncertainty import ELSEWHERE, uncertainty


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
    of_h, how = uncertainty(values, order, 2.0**order, True, levels[-1].rtol * float(times[-1]))
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
