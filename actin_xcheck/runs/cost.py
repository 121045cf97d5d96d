"""About how long a run takes, before it is begun: by this tasks are sorted, and the time to come is said.

Fitted to processor seconds of runs of Fig. 14 and of the exact solutions on refine 1 to 5, to within a factor
of two for most.
"""

from collections.abc import Sequence
from dataclasses import replace

from actin_xcheck.core.choices import Fidelity
from actin_xcheck.runs.march import step_count
from actin_xcheck.runs.method import Method, find_method
from actin_xcheck.runs.numerics import Numerics

KERNEL = 0.055
"""Seconds that the reference kernel takes on the machine of which seconds are these."""

STAGE = {"fem": (2.2e-3, 1e-5), "fv": (7e-3, 1.5e-5)}
"""Seconds of a stage of a step, by the code of a method: on any mesh, and for each cell of a quarter of the
disk; those of another package are taken to be as those of the finite elements."""

SET_UP = 0.02, 1e-4
"""Seconds of what comes before the steps, on any mesh and for each of these cells."""

FIRST, LATER = 8, 0.035
"""Steps of chosen size: those with which every run begins; and the rest over order^2 rtol^(-1/order)."""


def seconds_of(method: Method, refine: int, steps: float) -> float:
    """Seconds of so many steps on a mesh of 2**refine layers, set-up included, on one core."""
    cells = 4.0**refine
    fixed, per_cell = STAGE.get(method.family, STAGE["fem"])
    step = max(method.order_dt, 1) * (fixed + per_cell * cells * method.space**3)
    alone = SET_UP[0] + SET_UP[1] * cells * method.space**2 + steps * step
    driver = seconds_of(find_method(method.driven_by), refine, steps) if method.driven_by else 0.0
    return alone + driver


def steps_of(numerics: Numerics, output_times: Sequence[float]) -> float:
    """Steps that a run takes: about, where their size is chosen."""
    if numerics.rtol is None:
        return step_count(numerics.dt, output_times)
    return chosen_steps(numerics.method, numerics.rtol)


def chosen_steps(method: Method, rtol: float) -> float:
    """Steps of which each makes a local error of at most rtol, about."""
    order = method.order_dt
    return FIRST + LATER * order**2 * rtol ** (-1 / order)


def run_seconds(numerics: Numerics, output_times: Sequence[float]) -> float:
    """Seconds of a run on one core: half a cell takes half as long, a ray or a few modes next to nothing."""
    steps, reduction = steps_of(numerics, output_times), numerics.reduction
    if reduction.fidelity is Fidelity.SECTOR:
        return seconds_of(numerics.method, numerics.refine, steps) / 2
    if reduction.fidelity is not Fidelity.FULL:
        return seconds_of(replace(numerics.method, driven_by=None), 0, steps)
    return seconds_of(numerics.method, numerics.refine, steps)
