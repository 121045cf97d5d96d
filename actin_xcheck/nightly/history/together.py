"""Changes that have one cause: in which night it came, where several numbers show it at once.

What slows the code down slows several of its times down in the same night.  So noisy steps of one kind and
direction, within one machine where that matters, share a night wherever one night is likely enough for all:
their log-likelihoods over the place of the step are added, and the night is the most likely of the sum.  Busy
nights are busy for all numbers, which then err together: the sum is divided by 1 + (k - 1) rho, k being how
many there are and rho the mean correlation of what is left of them without their steps (the design effect of
Kish, Survey sampling, 1965), so that k numbers that always say the same count as one.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array
from actin_xcheck.nightly.history.changes import INSIDE, Change
from actin_xcheck.nightly.history.record import Night, Series

_AGREE = -2 * np.log(1 - np.sqrt(0.95))
"""Twice the log-likelihood a step may lose in the night of others: with 95 % it loses less in its own.

Less would part what belongs together; more would join causes that lie some nights apart."""

_FAR = 3.0
"""Standard deviations of what is left at most: one bad night is no correlation."""


@dataclass(frozen=True, eq=False)
class Found:
    """A change of a series all of whose values are finite."""

    series: Series
    change: Change


@dataclass(frozen=True, eq=False)
class Cause:
    """What one or more changes come from.

    Attributes
    ----------
    shown_by : the changes, steps of one kind where there are several.
    nights : that any of their series has, in order, (n,).
    at : index of the likeliest.
    within : first and last index at 95 %.
    losses : (n,), twice the log-likelihood that is lost at each; empty where that is not known.
    """

    shown_by: tuple[Found, ...]
    nights: tuple[Night, ...]
    at: int
    within: tuple[int, int]
    losses: Array

    @property
    def exact(self) -> bool:
        """Whether there is no noise around."""
        return self.shown_by[0].change.exact

    @property
    def p(self) -> float:
        """Bound on the probability that noise shows it (Bonferroni's); 0 without noise."""
        return min(1.0, len(self.shown_by) * min(one.change.p for one in self.shown_by))

    def news(self, at: int) -> tuple[str, ...]:
        """What is not as it was in the night before, in words."""
        return self.nights[at].differences(self.nights[at - 1])


def causes(found: Iterable[Found]) -> list[Cause]:
    """Return what these changes come from, and when it came.

    A number does not change of itself: where the likeliest night has the code, libraries and machine of the
    night before, the likeliest that has not is meant, or of a drift the nearest.
    """
    found = list(found)
    steps: defaultdict[tuple[object, ...], list[Found]] = defaultdict(list)
    for one in found:
        if len(one.change.losses):
            kind = one.series.kind
            machine = one.series.nights[0].machine if kind.of_machine else ""
            steps[kind, one.change.size > 0, machine].append(one)
    return [
        *(_alone(one) for one in found if not len(one.change.losses)),
        *(_with_news(_joint(group)) for alike in steps.values() for group in _groups(alike)),
    ]


def _alone(one: Found) -> Cause:
    change = one.change
    cause = Cause((one,), one.series.nights, change.first, change.within, change.losses)
    return cause if change.exact else _with_news(cause)


def _groups(steps: Sequence[Found]) -> list[list[Found]]:
    """Which of these share a night: from the surest on, each joins those with whom it agrees best."""
    nights = _nights(steps)
    groups: list[list[Found]] = []
    sums: list[Array] = []
    for one in sorted(steps, key=lambda one: one.change.p):
        own = _losses(one, nights)
        lost = [float(np.min(known + own) - np.min(known)) for known in sums]
        if lost and min(lost) <= _AGREE:
            best = int(np.argmin(lost))
            groups[best].append(one)
            sums[best] = sums[best] + own
        else:
            groups.append([one])
            sums.append(own)
    return groups


def _joint(group: Sequence[Found]) -> Cause:
    """The cause of steps that share a night."""
    nights = _nights(group)
    losses = np.sum([_losses(one, nights) for one in group], axis=0)
    losses = (losses - losses.min()) / (1 + (len(group) - 1) * _correlation(group, nights))
    near = np.flatnonzero(losses <= INSIDE)
    return Cause(tuple(group), nights, int(np.argmin(losses)), (int(near[0]), int(near[-1])), losses)


def _nights(steps: Iterable[Found]) -> tuple[Night, ...]:
    """The nights of any of the series, in order."""
    nights = {night.name: night for one in steps for night in one.series.nights}
    return tuple(sorted(nights.values(), key=lambda night: night.date))


def _places(one: Found, nights: Sequence[Night]) -> Indices:
    """The indices of a series' nights among these."""
    index = {night.name: at for at, night in enumerate(nights)}
    return np.array([index[night.name] for night in one.series.nights])


def _losses(one: Found, nights: Sequence[Night]) -> Array:
    """What a step loses at each of these nights, (n,); in one that its series lacks, as in its next."""
    own = np.searchsorted(_places(one, nights), np.arange(len(nights)))
    return np.append(one.change.losses, np.inf)[own]


def _correlation(group: Sequence[Found], nights: Sequence[Night]) -> float:
    """The mean correlation of the series without their steps over all pairs in all nights, 0 at least."""
    left = np.full((len(group), len(nights)), np.nan)
    for row, one in zip(left, group, strict=True):
        can_be = np.flatnonzero(np.isfinite(one.change.losses))
        around = slice(can_be[0] - 1, can_be[-1] + 1)
        before, after = np.split(one.series.scaled[around], [one.change.first - around.start])
        rest = np.concatenate([before - before.mean(), after - after.mean()])
        row[_places(one, nights)[around]] = np.clip(rest / rest.std(), -_FAR, _FAR)
    count = np.isfinite(left).sum(axis=0)
    products = np.nansum(left, axis=0) ** 2 - np.nansum(left**2, axis=0)
    return max(0.0, float(products.sum() / max(1, np.sum(count * (count - 1)))))


def _with_news(cause: Cause) -> Cause:
    """The same at the likeliest night with anything new in it, where there is one within."""
    first, last = cause.within
    fresh = [at for at in range(first, last + 1) if cause.news(at)]
    if not fresh:
        return cause
    if len(cause.losses):
        return replace(cause, at=min(fresh, key=lambda at: cause.losses[at]))
    return replace(cause, at=min(fresh, key=lambda at: abs(at - cause.at)))
