"""Where a sequence of numbers changes: steps, slow drifts, and what is too new to be sure of.

Segmentations are the best ones in least squares (`ruptures`); how many segments there are follows from the
t test of the best single step, whose threshold bounds false alarms over all places where a step may be.  The
nights in which a step may have come in follow Siegmund, Confidence sets in change-point problems, Int. Stat.
Rev. 56 (1988).
"""

from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.ndimage import median_filter
from scipy.stats import t as student

from actin_xcheck.core.model import Array

FALSE_ALARM = 1e-3
"""Bound on the probability that independent noise of one sequence is reported as a step (Bonferroni's)."""

SHORTEST = 3
"""Values of a segment at least: fewer at the end are `SUSPECT`, fewer within are outliers."""

ENOUGH = 6
"""Values of a noisy sequence from which on it is judged at all."""

_WINDOW = 7
"""Values of the running median that outliers are clipped towards; it keeps edges of `SHORTEST` and more."""

_CLIPPED = 3.0
"""Robust standard deviations that a value may lie off the running median."""

INSIDE = -2 * np.log(1 - np.sqrt(0.95))
"""Twice the loss of log-likelihood within which the night of a step lies with 95 %: (1 - e^{-x/2})^2."""

_ADVANTAGE = 6.0
"""By how much more n log(RSS) a drift must explain than the steps: 20 to 1, as steps are the common case.

To it comes log(n), what Schwarz's criterion asks for a parameter more: a drift has an end as well.
"""

_STARTS = 60
"""Places, spread evenly, where a drift may begin or end in long sequences."""

_SHORTEST_DRIFT = 10
"""Values that a drift takes at least; a shorter one is a step."""

_RUN = 4
"""Mean length of the runs of equal values in a sequence that is judged without noise."""


class Shape(StrEnum):
    """How a sequence changes; `LOST`, what could not be had any more, is not for the values to say."""

    STEP = "step"
    DRIFT = "drift"
    SUSPECT = "suspect"
    LOST = "lost"


@dataclass(frozen=True)
class Change:
    """One change of a sequence.

    Attributes
    ----------
    shape : a step, a slow drift, or the last value or two standing out.
    first, last : index of the first changed value and of the first one wholly changed; equal but for a drift.
    within : first and last index at which it may have begun, at 95 %.
    old : level before.
    size : of the change; error its standard error, 0 where there is no noise.
    p : bound on the probability of such a change in noise, anywhere in the sequence; 0 without noise.
    losses : (n,), twice the log-likelihood that is lost where a noisy step is put to each index; inf where it
        cannot be.  Empty for other changes.
    """

    shape: Shape
    first: int
    last: int
    within: tuple[int, int]
    old: float
    size: float
    error: float
    p: float
    losses: Array = field(default_factory=lambda: np.empty(0), repr=False, compare=False)

    @property
    def exact(self) -> bool:
        """Whether the values around are equal to round-off, so that the change is certain."""
        return self.error == 0.0


def changes(y: Array, round_off: float) -> list[Change]:
    """Return the changes of a sequence in order.

    Parameters
    ----------
    y : finite values, (n,).
    round_off : differences up to this are none.
    """
    if without_noise(y, round_off):
        return [_exact(y, before, at) for before, at in pairwise(_runs(y, round_off))]
    kept = _clipped(y)
    if len(y) < ENOUGH or np.ptp(kept) <= round_off:
        return []
    found, explained = _steps(kept, round_off, float(np.mean(kept == y)))
    drift = _drift(kept, explained, round_off)
    if drift is not None:
        return [drift]
    return found + _suspect(y, kept, found[-1].first if found else 0)


def without_noise(y: Array, round_off: float) -> bool:
    """Whether values (n,) repeat to round-off, so that any change of theirs is one."""
    return _RUN * (len(_runs(y, round_off)) - 1) < len(y)


def threshold(count: int) -> float:
    """|t| of the best single step among `count` values that noise exceeds with `FALSE_ALARM` at most."""
    return float(student.isf(FALSE_ALARM / (2 * (count - 1)), count - 2))


def _runs(y: Array, round_off: float) -> list[int]:
    """Where runs of equal values begin."""
    starts = [0]
    for i, value in enumerate(y):
        if abs(value - y[starts[-1]]) > round_off:
            starts.append(i)
    return starts


def _exact(y: Array, before: int, at: int) -> Change:
    return Change(Shape.STEP, at, at, (at, at), float(y[before]), float(y[at] - y[before]), 0.0, 0.0)


def _clipped(y: Array) -> Array:
    """The sequence with outliers clipped towards its running median (Hampel's filter)."""
    middle = median_filter(y, _WINDOW, mode="reflect")
    off = y - middle
    reach = _CLIPPED * (1.4826 * np.median(np.abs(off)) or off.std())  # 0 where most values are equal
    return np.clip(y, middle - reach, middle + reach)


def _price(count: int) -> float:
    """What one more step must lower n log(RSS) by."""
    return float(count * np.log1p(threshold(count) ** 2 / (count - 2)))


def _explained(y: Array, firsts: list[int], round_off: float) -> float:
    """n log(RSS) of the segments, with what they cost."""
    inside = _inside(y, firsts)
    rss = inside @ inside + len(y) * round_off**2
    return float(len(y) * np.log(rss) + len(firsts) * _price(len(y)))


def _inside(y: Array, firsts: list[int]) -> Array:
    """The values off the means of their segments."""
    return np.concatenate([one - one.mean() for one in np.split(y, firsts)])


def _steps(y: Array, round_off: float, whole: float) -> tuple[list[Change], float]:
    """The steps of the segmentation that explains the sequence best for what it costs, and `_explained`.

    Means of values of which a share `whole` was left unclipped are less sure by that factor (Tukey and
    McLaughlin's).
    """
    from ruptures import KernelCPD  # slow to import, and few commands need it

    search = KernelCPD(kernel="linear", min_size=SHORTEST).fit(((y - y.mean()) / y.std())[:, None])
    best: list[int] = []
    least = _explained(y, best, round_off)
    for count in range(1, len(y) // SHORTEST):
        if count > len(best) + 2:  # there and back, both within: two steps may be worth what one is not
            break
        firsts = search.predict(n_bkps=count)[:-1]
        if (explained := _explained(y, firsts, round_off)) < least:
            best, least = firsts, explained
    edges, wider = [0, *best, len(y)], _persistence(_inside(y, best)) / whole
    steps = [_step(y, begin, end, wider) for begin, end in zip(edges, edges[2:], strict=False)]
    return [step for step in steps if step is not None and step.p < FALSE_ALARM], least


def _persistence(noise: Array) -> float:
    """The factor by which means of this noise are less sure than those of independent noise.

    That of a first-order autoregression, (1 + rho)/(1 - rho) under a root, where rho is larger than what
    independent noise shows once in twenty times: a machine that is busy is so for some nights.
    """
    rho = float(noise[1:] @ noise[:-1] / (noise @ noise)) if noise.any() else 0.0
    return float(np.sqrt((1 + rho) / (1 - rho))) if rho * np.sqrt(len(noise)) > 1.645 else 1.0


def _step(y: Array, begin: int, end: int, wider: float) -> Change | None:
    """The step between two neighbouring segments, whose means are less sure by the factor `wider`.

    None where it is best put so near to an end that a value or two make it.
    """
    count = end - begin
    cuts = np.arange(begin + 1, end)
    rss = np.array([_spread(y[begin:cut]) + _spread(y[cut:end]) for cut in cuts])
    at = int(cuts[np.argmin(rss)])
    if min(at - begin, end - at) < SHORTEST:
        return None
    losses = np.full(len(y), np.inf)
    losses[at] = 0.0
    if rss.min() > 0:
        losses[cuts] = count * np.log(rss / rss.min()) / wider**2
    near = np.flatnonzero(losses <= INSIDE)
    old = float(y[begin:at].mean())
    size = float(y[at:end].mean()) - old
    noise = (_spread(y[begin:at]) + _spread(y[at:end])) / (count - 2)
    error = wider * float(np.sqrt(noise * (1 / (at - begin) + 1 / (end - at))))
    p = min(1.0, 2 * (len(y) - 1) * student.sf(abs(size) / error, count - 2)) if error > 0 else 0.0
    return Change(
        Shape.STEP,
        at,
        at,
        (int(near[0]), int(near[-1])),
        old,
        size,
        error,
        float(p),
        losses if error > 0 else np.empty(0),
    )


def _spread(y: Array) -> float:
    """The sum of squares about the mean."""
    return float(len(y) * y.var())


@cache
def _ramps(count: int) -> tuple[Array, Array]:
    """Ramps of length one and mean zero, (m, n), and the last index before and first after each, (m, 2)."""
    places = np.unique(np.linspace(0, count - 1, min(count, _STARTS)).astype(int))
    ends = np.array([(s, e) for s in places for e in places if e - s >= _SHORTEST_DRIFT])
    if len(ends) == 0:
        return np.empty((0, count)), np.empty((0, 2), dtype=int)
    shapes = np.clip((np.arange(count) - ends[:, :1]) / np.diff(ends), 0.0, 1.0)
    shapes -= shapes.mean(axis=1, keepdims=True)
    return shapes / np.linalg.norm(shapes, axis=1, keepdims=True), ends


def _drift(y: Array, steps: float, round_off: float) -> Change | None:
    """The best ramp, where it explains more than the steps do (`steps`, see `_explained`); else None."""
    count = len(y)
    shapes, ends = _ramps(count)
    if len(ends) == 0:
        return None
    along = shapes @ y
    rss = np.maximum(_spread(y) - along**2, 0.0) + count * round_off**2
    loss = count * np.log(rss)
    best = int(np.argmin(loss))
    if loss[best] + _price(count) + _ADVANTAGE + np.log(count) >= steps:
        return None
    begin, end = (int(place) for place in ends[best])
    near = ends[loss - loss[best] <= INSIDE, 0]
    rise = float(np.ptp(shapes[best]))
    size = float(along[best]) * rise
    old = float(y.mean()) + float(along[best] * shapes[best, 0])
    error = float(np.sqrt(rss[best] / (count - 2)))
    p = min(1.0, 2 * (count - 1) * student.sf(abs(along[best]) / error, count - 2))
    return Change(
        Shape.DRIFT, begin + 1, end, (int(near.min()) + 1, int(near.max()) + 1),
        old, size, error * rise, float(p),
    )  # fmt: skip


def _suspect(y: Array, kept: Array, begin: int) -> list[Change]:
    """The last values, where they are too few for a step and all of them off those since `begin`."""
    for count in range(SHORTEST - 1, 0, -1):
        before, new = kept[begin:-count], y[-count:]
        freedom = len(before) - 1
        if freedom < ENOUGH - 1 or np.ptp(y[begin:-count]) == 0:
            continue
        noise = y[begin:-count].std(ddof=1)  # with its outliers: one more is nothing new
        old = float(before.mean())
        off = new - old
        error = float(noise * np.sqrt(1 / count + 1 / len(before)))
        p = 2 * (SHORTEST - 1) * student.sf(abs(off.mean()) / error, freedom)
        if p < FALSE_ALARM and (off / off.mean() > 0.5).all():
            at = len(y) - count
            return [Change(Shape.SUSPECT, at, at, (at, at), old, float(off.mean()), error, float(p))]
    return []
