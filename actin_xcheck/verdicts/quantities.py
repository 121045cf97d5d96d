"""What a study measures on stored runs: its error against a known truth, or its change between two levels."""

from enum import StrEnum
from typing import Literal

import numpy as np

from actin_xcheck.runs.store import Run
from actin_xcheck.scene.scene import Scene
from actin_xcheck.theory.eigenfields import growth_rate
from actin_xcheck.theory.growth import fit_growth
from actin_xcheck.verdicts.judge import cell_difference, l2_error, reference_errors
from actin_xcheck.verdicts.orders import ROUND_OFF


class Quantity(StrEnum):
    """What is measured at the end of a run; area, total actin and probes are series of it."""

    CONCENTRATION = "concentration"
    AREA = "area"
    TOTAL_ACTIN = "total_actin"
    PROBES = "probe_a"
    GROWTH_RATE = "growth_rate"
    AMPLITUDE = "mode_amplitude"
    """Of the mode whose growth is measured: no fit, whose rate would depend on how often the mode is seen."""

    @property
    def words(self) -> str:
        """What its error is, for a reader."""
        return _WORDS[self]

    @property
    def is_functional(self) -> bool:
        """Whether it is one number of the whole cell, which may converge faster than the field does."""
        return self not in (Quantity.CONCENTRATION, Quantity.PROBES)

    @property
    def floor(self) -> float:
        """Relative errors up to this are round-off: modes have an amplitude of 1e-6 on a = 1."""
        return 1e-8 if self in (Quantity.GROWTH_RATE, Quantity.AMPLITUDE) else ROUND_OFF


_WORDS = {
    Quantity.CONCENTRATION: "concentration (relative L2)",
    Quantity.AREA: "area (relative)",
    Quantity.TOTAL_ACTIN: "total actin (relative)",
    Quantity.PROBES: "concentration at the probes (largest)",
    Quantity.GROWTH_RATE: "growth rate (relative)",
    Quantity.AMPLITUDE: "logarithm of the mode's amplitude",
}


def error_of(scene: Scene, run: Run, quantity: Quantity) -> float:
    """Error at the end against what the scene expects; nan where the run has no such number."""
    if run.attributes["outcome"] != "completed":
        return np.nan
    match quantity:
        case Quantity.CONCENTRATION:
            return l2_error(scene, run)
        case Quantity.GROWTH_RATE:
            assert scene.mode is not None
            exact = growth_rate(scene.physics, *scene.mode)
            error = _fitted_rate(scene, run) - exact
            return float((error.real if not exact.imag else abs(error)) / abs(exact))
        case _:
            return reference_errors(scene, run)[quantity]


def change_between(scene: Scene, coarse: Run, fine: Run, quantity: Quantity) -> float:
    """Difference of two levels at the end, of single numbers with its sign; nan where one did not get there.

    Of the concentration on one mesh only, where both know it in the same cells.
    """
    if any(run.attributes["outcome"] != "completed" for run in (coarse, fine)):
        return np.nan
    match quantity:
        case Quantity.CONCENTRATION:
            return cell_difference(fine, coarse)
        case Quantity.AMPLITUDE:  # the change of rate times the time that has passed
            return float(np.log(np.abs(coarse.series[quantity][-1] / fine.series[quantity][-1])))
        case _:
            one, other = (np.asarray(run.series[quantity][-1]) for run in (coarse, fine))
            return float((one - other) / other if quantity.is_functional else np.abs(one - other).max())


def _fitted_rate(scene: Scene, run: Run) -> complex:
    """The measured growth rate of the scene's mode; nan where no exponentials fit."""
    expected = scene.expect.growth_rate
    assert expected is not None
    rate = growth_rate(scene.physics, expected.m, expected.n)
    # a start at rest excites both roots of (3.6), an eigenmode one, or a conjugate pair
    exponentials: Literal[1, 2] = 1 if scene.initial.eigenmode and not rate.imag else 2
    try:
        series = run.series
        return fit_growth(series["time"], series["mode_amplitude"], expected.window, exponentials).rate
    except ValueError:
        return complex("nan")
