"""Which numbers changed, in which night and with which commit: steps, slow drifts, what is too new to say.

Segmentations are the best ones in least squares (`ruptures`), as many as the t test of the best single step
allows, whose threshold bounds false alarms over all places.  The nights in which a step may have come follow
Siegmund, Confidence sets in change-point problems, Int. Stat. Rev. 56 (1988).

What slows the code down slows several of its times down in the same night.  So noisy steps of one kind and
direction, within one machine where that matters, share a night wherever one night is likely enough for all:
their log-likelihoods over the place of the step are added.  Busy nights are busy for all numbers, which then
err together: the sum is divided by 1 + (k - 1) rho, k being how many there are and rho the mean correlation
of what is left of them without their steps (the design effect of Kish, Survey sampling, 1965).
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter
from scipy.stats import false_discovery_control
from scipy.stats import t as student

from actin_xcheck.core.model import Array
from actin_xcheck.nightly.differences import Event, Shape
from actin_xcheck.nightly.history import Series
from actin_xcheck.nightly.record import Night

FALSE_ALARM = 1e-3  # bound on the probability that noise of one sequence is reported as a step (Bonferroni's)
FALSE_SHARE = 0.02  # expected share of false ones among causes, or the probability of any where all are
SHORTEST = 3  # values of a segment at least: fewer at the end are `SUSPECT`, fewer within are outliers
ENOUGH = 6  # values of a noisy sequence from which on it is judged at all
_WINDOW = 7  # values of a running median, which keeps edges of `SHORTEST`
_CLIPPED = 3.0  # robust standard deviations off it at most
_STARTS = 60  # places, spread evenly, where a drift may begin or end
_SHORTEST_DRIFT = 10  # values that a drift takes at least; a shorter one is a step
_RUN = 4  # mean length of the runs of equal values in a sequence that is judged without noise
_BELIEVED = 1.645  # standard errors by which a change may fall short of interest, and a correlation of none
_FAR = 3.0  # standard deviations of what is left at most: one bad night is no correlation

INSIDE = -2 * np.log(1 - np.sqrt(0.95))
"""Twice the loss of log-likelihood within which the night of a step lies with 95 %: (1 - e^{-x/2})^2.
Steps share a night in which none loses more; more would join causes that lie some nights apart."""

_ADVANTAGE = 6.0
"""By how much more n log(RSS) a drift must explain than the steps: 20 to 1, as steps are the common case.
To it comes log(n), what Schwarz's criterion asks for a parameter more: a drift has an end as well."""


@dataclass(frozen=True)
class Change:
    """One change of a sequence.

    Attributes
    ----------
    shape : a step, a slow drift, or the last value or two standing out.
    first, last : index of the first changed value and of the first one wholly changed; equal but for a drift.
    within : first and last index at which it may have begun, at 95 %.
    old, size, error : level before, change and its standard error, 0 where there is no noise.
    p : bound on the probability of such a change in noise, anywhere in the sequence; 0 without noise.
    losses : (n,), twice the log-likelihood that a noisy step loses at each index, inf where it cannot be; or
        empty.
    """

    shape: Shape
    first: int
    last: int
    within: tuple[int, int]
    old: float
    size: float
    error: float = 0.0
    p: float = 0.0
    losses: Array = field(default_factory=lambda: np.empty(0), repr=False, compare=False)

    @property
    def exact(self) -> bool:
        """Whether the values around are equal to round-off, so that the change is certain."""
        return self.error == 0.0


def events(series: Iterable[Series]) -> list[Event]:
    """Return the changes of all series, the largest first.

    Noisy changes with one cause count as one.  Causes are kept while the false ones are expected to be at
    most `FALSE_SHARE` of them (Benjamini and Hochberg), so that many quiet series do not bring false alarms;
    changes without noise are all kept.  Times and memory are compared within one machine.
    """
    found, told, quiet = list[_Found](), list[Event](), 0
    for part in (part for one in series for part in one.by_machine):
        known = part.only(np.flatnonzero(np.isfinite(part.values)))
        if not known.nights:
            continue
        y, round_off, here = known.scaled, known.round_off, list[_Found]()
        for change in changes(y, round_off):  # but those that are clearly smaller than what is of interest
            if change.exact or abs(change.size) + _BELIEVED * change.error >= known.interest:
                here.append(_Found(known, change))
        found += here
        quiet += len(y) >= ENOUGH and not without_noise(y, round_off) and all(i.change.exact for i in here)
        if known.nights[-1] is not part.nights[-1]:
            told.append(_lost(part, known))
    causes = _causes(found)
    sure, noise = (
        [one for one in causes if one.shown_by[0].change.exact is exact] for exact in (True, False)
    )
    if noise:
        adjusted = false_discovery_control([one.p for one in noise] + [1.0] * quiet)
        sure += (one for one, p in zip(noise, adjusted, strict=False) if p <= FALSE_SHARE)
    told += (_event(one, cause) for cause in sure for one in cause.shown_by)
    return sorted(told, key=lambda one: (one.shape is Shape.SUSPECT, one.minor, -one.weight, one.key))


class _Found(NamedTuple):
    """A change of a series all of whose values are finite."""

    series: Series
    change: Change

    def places(self, nights: Sequence[Night]) -> Array:
        """The indices of its nights among these."""
        index = {night.name: at for at, night in enumerate(nights)}
        return np.array([index[night.name] for night in self.series.nights])

    def losses(self, nights: Sequence[Night]) -> Array:
        """What a step loses at each of these nights, (n,); in one that its series lacks, as in its next."""
        own = np.searchsorted(self.places(nights), np.arange(len(nights)))
        return np.append(self.change.losses, np.inf)[own]


def _lost(series: Series, known: Series) -> Event:
    """That a number could not be had any more, from the night after the last that had it."""
    last = known.nights[-1]
    at = series.nights[series.nights.index(last) + 1]
    return Event(
        key=series.key, kind=series.kind, unit=series.unit, old=float(known.values[-1]), new=math.nan,
        weight=math.inf, shape=Shape.LOST, night=at, within=(at,), until=at, news=at.differences(last),
    )  # fmt: skip


class _Cause(NamedTuple):
    """What one or more changes come from: in which of these nights, and the first and last at 95 %."""

    shown_by: Sequence[_Found]
    nights: Sequence[Night]
    at: int
    within: tuple[int, int]

    @property
    def p(self) -> float:
        """Bound on the probability that noise shows it (Bonferroni's); 0 without noise."""
        return min(1.0, len(self.shown_by) * min(one.change.p for one in self.shown_by))

    def news(self, at: int) -> tuple[str, ...]:
        """What is not as it was in the night before, in words."""
        return self.nights[at].differences(self.nights[at - 1])

    def with_news(self, losses: Array | None = None) -> "_Cause":
        """The same in that night within which loses least, or is nearest, of those with anything new."""
        off = np.abs(np.arange(len(self.nights)) - self.at) if losses is None else losses
        fresh = [at for at in range(self.within[0], self.within[1] + 1) if self.news(at)]
        return self._replace(at=min(fresh, key=lambda at: float(off[at]))) if fresh else self


def _event(found: _Found, cause: _Cause) -> Event:
    series, change = found
    levels = change.old, change.old + change.size
    old, new = map(math.exp, levels) if series.kind.logarithmic else levels
    night, (begin, end) = cause.nights[cause.at], cause.within
    return Event(
        key=series.key, kind=series.kind, unit=series.unit, old=old, new=new,
        weight=abs(change.size) / series.interest, shape=change.shape, night=night,
        within=tuple(cause.nights[begin : end + 1]), together=len(cause.shown_by),
        until=series.nights[change.last] if change.shape is Shape.DRIFT else night,
        news=cause.news(cause.at), size=change.size, p=change.p, exact=change.exact,
    )  # fmt: skip


def _causes(found: Iterable[_Found]) -> list[_Cause]:
    """What these changes come from, and when it came."""
    causes, alike = list[_Cause](), defaultdict[tuple[object, ...], list[_Found]](list)
    for one in found:
        (series, change), machine = one, one.series.nights[0].machine
        if len(change.losses):
            alike[series.kind, change.size > 0, machine if series.kind.of_machine else ""].append(one)
        else:
            cause = _Cause((one,), series.nights, change.first, change.within)
            causes.append(cause if change.exact else cause.with_news())
    return causes + [_joint(group) for steps in alike.values() for group in _groups(steps)]


def _groups(steps: Sequence[_Found]) -> list[list[_Found]]:
    """Which of these share a night: from the surest on, each joins those with whom it agrees best."""
    nights = _nights(steps)
    groups, sums = list[list[_Found]](), list[Array]()
    for one in sorted(steps, key=lambda one: one.change.p):
        own = one.losses(nights)
        lost = [float(np.min(known + own) - np.min(known)) for known in sums]
        if lost and min(lost) <= INSIDE:
            best = int(np.argmin(lost))
            groups[best].append(one)
            sums[best] = sums[best] + own
        else:
            groups.append([one])
            sums.append(own)
    return groups


def _joint(group: Sequence[_Found]) -> _Cause:
    """The cause of steps that share a night."""
    nights = _nights(group)
    losses = np.sum([one.losses(nights) for one in group], axis=0)
    losses = (losses - losses.min()) / (1 + (len(group) - 1) * _correlation(group, nights))
    near = np.flatnonzero(losses <= INSIDE)
    return _Cause(group, nights, int(np.argmin(losses)), (int(near[0]), int(near[-1]))).with_news(losses)


def _nights(steps: Iterable[_Found]) -> list[Night]:
    """The nights of any of the series, in order."""
    nights = {night.name: night for one in steps for night in one.series.nights}
    return sorted(nights.values(), key=lambda night: night.date)


def _correlation(group: Sequence[_Found], nights: Sequence[Night]) -> float:
    """The mean correlation of the series without their steps over all pairs in all nights, 0 at least."""
    left = np.full((len(group), len(nights)), np.nan)
    for row, one in zip(left, group, strict=True):
        can_be = np.flatnonzero(np.isfinite(one.change.losses))
        around = slice(can_be[0] - 1, can_be[-1] + 1)
        rest = _off_means(one.series.scaled[around], [one.change.first - around.start])
        row[one.places(nights)[around]] = np.clip(rest / rest.std(), -_FAR, _FAR)
    count = np.isfinite(left).sum(axis=0)
    products = np.nansum(left, axis=0) ** 2 - np.nansum(left**2, axis=0)
    return max(0.0, float(products.sum() / max(1, np.sum(count * (count - 1)))))


def changes(y: Array, round_off: float) -> list[Change]:
    """Return the changes of a sequence in order.

    Parameters
    ----------
    y : finite values, (n,).
    round_off : differences up to this are none.
    """
    if without_noise(y, round_off):
        return [
            Change(Shape.STEP, at, at, (at, at), float(y[before]), float(y[at] - y[before]))
            for before, at in pairwise(_runs(y, round_off))
        ]
    middle = median_filter(y, _WINDOW, mode="reflect")  # outliers are clipped towards it (Hampel's filter)
    off = y - middle
    reach = _CLIPPED * (1.4826 * np.median(np.abs(off)) or off.std())  # 0 where most values are equal
    kept = np.clip(y, middle - reach, middle + reach)
    if len(y) < ENOUGH or np.ptp(kept) <= round_off:
        return []
    found, explained = _steps(kept, round_off, float(np.mean(kept == y)))
    drift = _drift(kept, explained, round_off)
    return [drift] if drift else found + _suspect(y, kept, found[-1].first if found else 0)


def without_noise(y: Array, round_off: float) -> bool:
    """Whether values (n,) repeat to round-off, so that any change of theirs is one."""
    return _RUN * (len(_runs(y, round_off)) - 1) < len(y)


def _runs(y: Array, round_off: float) -> list[int]:
    """Where runs of equal values begin."""
    starts = [0]
    for i, value in enumerate(y):
        if abs(value - y[starts[-1]]) > round_off:
            starts.append(i)
    return starts


def _off_means(y: Array, firsts: list[int]) -> Array:
    """The values off the means of their segments."""
    return np.concatenate([one - one.mean() for one in np.split(y, firsts)])


def _spread(y: Array) -> float:
    """The sum of squares about the mean."""
    return float(len(y) * y.var())


def _price(count: int) -> float:
    """What one more step must lower n log(RSS) by: what the best of noise does with `FALSE_ALARM` at most."""
    threshold = float(student.isf(FALSE_ALARM / (2 * (count - 1)), count - 2))
    return float(count * np.log1p(threshold**2 / (count - 2)))


def _steps(y: Array, round_off: float, whole: float) -> tuple[list[Change], float]:
    """The steps of the segmentation that explains the sequence best, and n log(RSS) of it with its price.

    Means of values of which a share `whole` is unclipped are less sure by it (Tukey and McLaughlin's).
    """
    from ruptures import KernelCPD  # slow to import, and few commands need it

    def explained(firsts: list[int]) -> float:
        inside = _off_means(y, firsts)
        rss = inside @ inside + len(y) * round_off**2
        return float(len(y) * np.log(rss) + len(firsts) * _price(len(y)))

    search = KernelCPD(kernel="linear", min_size=SHORTEST).fit(((y - y.mean()) / y.std())[:, None])
    best = list[int]()
    least = explained(best)
    for count in range(1, len(y) // SHORTEST):
        if count > len(best) + 2:  # there and back, both within: two steps may be worth what one is not
            break
        firsts = search.predict(n_bkps=count)[:-1]
        if (said := explained(firsts)) < least:
            best, least = firsts, said
    edges, wider = [0, *best, len(y)], _persistence(_off_means(y, best)) / whole
    steps = (_step(y, begin, end, wider) for begin, end in zip(edges, edges[2:], strict=False))
    return [step for step in steps if step and step.p < FALSE_ALARM], least


def _persistence(noise: Array) -> float:
    """The factor by which means of this noise are less sure than those of independent noise: that of a
    first-order autoregression, where one shows (once in twenty times in independent noise).
    """
    rho = float(noise[1:] @ noise[:-1] / (noise @ noise)) if noise.any() else 0.0
    return float(np.sqrt((1 + rho) / (1 - rho))) if rho * np.sqrt(len(noise)) > _BELIEVED else 1.0


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
    step = Change(Shape.STEP, at, at, (int(near[0]), int(near[-1])), old, size)
    if error == 0:
        return step
    p = min(1.0, 2 * (len(y) - 1) * student.sf(abs(size) / error, count - 2))
    return replace(step, error=error, p=float(p), losses=losses)


@cache
def _ramps(count: int) -> tuple[Array, Array]:
    """Ramps of length one and mean zero, (m, n), and the last index before and first after each, (m, 2)."""
    places = np.unique(np.linspace(0, count - 1, min(count, _STARTS)).astype(int))
    pairs = [(s, e) for s in places for e in places if e - s >= _SHORTEST_DRIFT]
    ends = np.array(pairs, dtype=int).reshape(-1, 2)
    shapes = np.clip((np.arange(count) - ends[:, :1]) / np.diff(ends), 0.0, 1.0)
    shapes -= shapes.mean(axis=1, keepdims=True)
    return shapes / np.linalg.norm(shapes, axis=1, keepdims=True), ends


def _drift(y: Array, steps: float, round_off: float) -> Change | None:
    """The best ramp, where it explains more than the steps do (`steps`, see `_steps`); else None."""
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
    near = ends[loss - loss[best] <= INSIDE, 0]
    rise = float(np.ptp(shapes[best]))
    error = float(np.sqrt(rss[best] / (count - 2)))
    p = min(1.0, 2 * (count - 1) * student.sf(abs(along[best]) / error, count - 2))
    old, (begin, end) = float(y.mean()) + float(along[best] * shapes[best, 0]), ends[best].tolist()
    within, size = (int(near.min()) + 1, int(near.max()) + 1), float(along[best]) * rise
    return Change(Shape.DRIFT, begin + 1, end, within, old, size, error * rise, float(p))


def _suspect(y: Array, kept: Array, begin: int) -> list[Change]:
    """The last values, where they are too few for a step and all of them off those since `begin`."""
    for count in range(SHORTEST - 1, 0, -1):
        before, at = kept[begin:-count], len(y) - count
        freedom = len(before) - 1
        if freedom < ENOUGH - 1 or np.ptp(y[begin:-count]) == 0:
            continue
        noise = y[begin:-count].std(ddof=1)  # with its outliers: one more is nothing new
        old = float(before.mean())
        off = y[-count:] - old
        error = float(noise * np.sqrt(1 / count + 1 / len(before)))
        p = 2 * (SHORTEST - 1) * student.sf(abs(off.mean()) / error, freedom)
        if p < FALSE_ALARM and (off / off.mean() > 0.5).all():
            return [Change(Shape.SUSPECT, at, at, (at, at), old, float(off.mean()), error, float(p))]
    return []
