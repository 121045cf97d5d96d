"""The uncertainty of a number from coarser runs: Richardson's extrapolation with a safety factor.

With declared order p and changes c1 = |fine - coarser|, c2 = |coarser - coarsest| between levels whose h
doubles, it is Roache's grid convergence index (J. Fluids Eng. 116, 1994, 405) as Oberkampf and Roy restrict
it (Verification and Validation in Scientific Computing, 2010, chapter 8):

    U = Fs max(c1, c2 / 2^p) / (2^q - 1)

* Fs = 1.25 and q = p where the observed order log2(c2/c1) lies within a tenth of p;
* else Fs = 3 and q = the observed order, at least 1/2 and at most p; with two levels Fs = 3 and q = p;
* Fs = 3 wherever meshes are not similar, so that the factor of h^p differs from level to level;
* a change smaller than order p leaves of the one before it is an accident (errors that change sign) and is
  not believed: hence the max.

To this comes what the method itself says of its steps.  Levels share errors in time that do not fall with h:
the first step has the same length on all of them, and no longer one shows what a tolerance has left.

Vectors have one uncertainty, in the largest norm.
"""

from collections.abc import Sequence

import numpy as np

from actin_xcheck.core.model import Array

ASYMPTOTIC, ELSEWHERE = 1.25, 3.0
"""Safety factors where the observed order confirms the declared one, and where it does not or cannot."""

CONFIRMED = 0.1
"""Of the declared order: how near the observed one must come."""


def uncertainty(
    values: Sequence[Array], order: float, ratio: float, similar: bool, floor: float, steps: float = 0.0
) -> tuple[float, str]:
    """The uncertainty of the first of two or three levels, and how it came about.

    Parameters
    ----------
    values : (k,) each, finest first, h doubling from one to the next.
    order : p, as declared.
    ratio : what the error grows by to the second level if it has that order; 2^p but for rounded steps.
    similar : whether meshes are similar for this quantity, so that an observed order means something.
    floor : the round-off, which is added.
    steps : the errors of the steps in time, as the method estimates them, which are added too.
    """
    size, how = _of_levels(values, order, ratio, similar, floor)
    return size + steps + floor, how + (f", errors of the steps {steps:.1e}" if steps else "")


def _of_levels(
    values: Sequence[Array], order: float, ratio: float, similar: bool, floor: float
) -> tuple[float, str]:
    """The part that levels show."""
    fine, coarse = values[:2]
    change = float(np.abs(fine - coarse).max())
    if len(values) < 3:
        return ELSEWHERE * change / (ratio - 1), f"Fs = {ELSEWHERE:g}, two levels of order {order:g}"
    before = float(np.abs(coarse - values[2]).max())
    if max(change, before) <= floor:
        return 0.0, "round-off"
    with np.errstate(divide="ignore"):
        observed = float(np.log2(before) - np.log2(change))
    confirmed = similar and abs(observed - order) <= CONFIRMED * order
    power = order if confirmed else min(max(observed, 0.5), order)
    factor = ASYMPTOTIC if confirmed else ELSEWHERE
    largest = max(change, before / 2**order)
    how = f"Fs = {factor:g}, observed order {observed:.2f} of {order:g}"
    return factor * largest / (ratio ** (power / order) - 1), how
