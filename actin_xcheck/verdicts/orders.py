"""Observed orders out of errors on successive levels, and what they say about a declared one.

The rules, for the orders p_i = log(e_i/e_{i+1}) / log(s_i/s_{i+1}) between successive levels:

* a level without a number (its run failed) proves nothing: FAIL;
* levels whose error is at most the round-off floor are not judged; with fewer than two local orders above it
  the verdict is `in round-off`;
* PASS when the last two local orders lie within 0.15 of the declared one;
* `not yet asymptotic` when the last three approach it, each closer than the one before and the last by at
  least a quarter of the distance: a next term of the error, h^(1/2) relative to the leading one or higher,
  lets that distance fall by 0.71 a level or faster; and when the error of a single number changes its sign
  once among the last four levels, where its leading terms cancel, and the last two orders are far apart;
* FAIL when an error rises out of round-off again;
* FAIL in every other case: they have settled elsewhere, or not at all.

The slope of the least-squares line through all levels above the floor is reported with its interval, and
decides nothing: it holds the coarse levels too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import linregress, t

from actin_xcheck.core.model import Array

TOLERANCE = 0.15
"""Of the last two local orders about the declared one."""

APPROACHES = 0.75
"""The most that may be left, from one level to the next, of a local order's distance to the declared one."""

CONFIDENCE = 0.95
ROUND_OFF = 1e-12
"""Relative errors of this size are round-off unless a study says otherwise."""


class Verdict(StrEnum):
    """What observed orders say about a declared one."""

    PASS = "PASS"
    FAIL = "FAIL"
    IN_ROUND_OFF = "in round-off"
    """Too few errors stand above the floor to read an order off."""
    NOT_YET_ASYMPTOTIC = "not yet asymptotic"
    """The local orders approach the declared one and have not reached it on these levels."""
    MEASURED = "measured"
    """Nothing is declared."""


@dataclass(frozen=True)
class ObservedOrder:
    """What a sequence of errors shows.

    Attributes
    ----------
    slope, low, high : of log error over log step by least squares, with the ends of its 95 % confidence
        interval; nan where there are too few levels.
    local : orders between successive levels, one fewer than levels; nan where one of the two is no number or
        in round-off.
    verdict, reason : see the rules of this module.
    """

    slope: float
    low: float
    high: float
    local: tuple[float, ...]
    verdict: Verdict
    reason: str


def local_orders(steps: ArrayLike, errors: ArrayLike, floor: float = 0.0) -> Array:
    """Orders (n - 1,) between successive levels with steps (n,) and errors (n,).

    nan where an error is no number or no larger than `floor`.
    """
    s, e = np.asarray(steps, dtype=float), np.asarray(errors, dtype=float)
    log_e = np.log(np.where(_above(e, floor), e, np.nan))
    return np.asarray(np.diff(log_e) / np.diff(np.log(s)))


def observe(
    steps: Sequence[float],
    errors: Sequence[float],
    declared: float | None,
    at_least: bool = False,
    floor: float = ROUND_OFF,
) -> ObservedOrder:
    """Read the order off errors and judge it.

    Parameters
    ----------
    steps : h or dt of the levels, decreasing, (n,) with n >= 3.
    errors : relative, (n,), with their signs where they are of single numbers; nan where a run gave none.
    declared : the order claimed, or None where nothing is claimed.
    at_least : whether a higher order holds too: functionals may superconverge.
    floor : errors up to this are round-off.

    ValueError where there are fewer than three levels or the steps do not decrease.
    """
    if len(steps) < 3 or len(steps) != len(errors) or np.any(np.diff(steps) >= 0):
        raise ValueError(f"steps {list(steps)} must decrease, be three or more and have an error each")
    s, e = np.asarray(steps, dtype=float), np.asarray(errors, dtype=float)
    local = local_orders(steps, np.abs(e), floor)
    verdict, reason = _judge(e, local, declared, at_least, floor)
    return ObservedOrder(*_fit(s, np.abs(e), floor), tuple(local.tolist()), verdict, reason)


def _above(errors: Array, floor: float) -> NDArray[np.bool_]:
    """Which errors are numbers above the floor; an error of 0 never is."""
    return np.isfinite(errors) & (errors > max(floor, 0.0))


def _fit(steps: Array, errors: Array, floor: float) -> tuple[float, float, float]:
    """Least-squares slope and its interval by Student's t with n - 2 degrees of freedom."""
    used = _above(errors, floor)
    if used.sum() < 2:
        return np.nan, np.nan, np.nan
    if used.sum() == 2:
        return float(local_orders(steps[used], errors[used])[0]), np.nan, np.nan
    fit = linregress(np.log(steps[used]), np.log(errors[used]))
    half = float(t.ppf((1 + CONFIDENCE) / 2, used.sum() - 2) * fit.stderr)
    return float(fit.slope), float(fit.slope - half), float(fit.slope + half)


def _judge(
    errors: Array, local: Array, declared: float | None, at_least: bool, floor: float
) -> tuple[Verdict, str]:
    """The verdict and a sentence for it."""
    if declared is None:
        return Verdict.MEASURED, "no order is claimed"
    if missing := int((~np.isfinite(errors)).sum()):
        return Verdict.FAIL, f"{missing} of {len(errors)} levels gave no number"
    above = _above(np.abs(errors), floor)
    if np.any(above[1:] & ~above[:-1]):
        return Verdict.FAIL, "an error rises out of round-off again"
    known = local[np.isfinite(local)]
    if len(known) < 2:
        return Verdict.IN_ROUND_OFF, f"fewer than two local orders stand above errors of {floor:.0e}"
    distance = np.maximum(declared - known, 0) if at_least else np.abs(known - declared)
    last = " and ".join(f"{one:.2f}" for one in known[-2:])
    if np.all(distance[-2:] <= TOLERANCE):
        return Verdict.PASS, f"the last two local orders are {last}"
    if len(known) > 2 and distance[-1] <= APPROACHES * distance[-2] and distance[-2] < distance[-3]:
        return Verdict.NOT_YET_ASYMPTOTIC, f"the local orders approach {declared:g}; the last two are {last}"
    turns = np.count_nonzero(np.diff(np.sign(errors[above][-4:])))
    if turns == 1 and abs(known[-1] - known[-2]) > TOLERANCE:
        return Verdict.NOT_YET_ASYMPTOTIC, f"the error changes its sign; the last two local orders are {last}"
    return Verdict.FAIL, f"the last two local orders are {last}, not {declared:g}"
