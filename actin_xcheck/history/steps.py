"""Which numbers changed, in which night and with which commit; and what is different between two nights."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import false_discovery_control

from actin_xcheck.history.changes import ENOUGH, Change, Shape, changes, without_noise
from actin_xcheck.history.record import Judged, Kind, Night, Number, Series

FALSE_SHARE = 0.02
"""Expected share of false ones among the noisy changes that are reported; without any, their probability."""

ROUND_OFF = 1e-9
"""Numbers that differ by less, relatively or (orders and rates) of their size, are equal."""

_BELIEVED = 1.645
"""Standard errors by which a change may fall short of interest: only what is clearly smaller is left out."""


@dataclass(frozen=True)
class Event:
    """A change of a number.

    Attributes
    ----------
    key, kind, unit : of the number.
    shape : a step, a drift, a suspect: the newest night or two stand out, too few to be sure; or lost: asked
        for and not had any more.
    night : the first that has it.
    within : nights in which it may have begun, at 95 %, in order.
    until : the night from which on it is whole; `night` but for a drift.
    news : what changed with that night: commit, versions, machine, in words.
    old, new : the number's level before and after.
    size : of the change on the number's scale, `weight` the same over the smallest of interest.
    p : bound on its probability in independent noise, over all nights; 0 where there is none.
    exact : whether the numbers around are equal to round-off, so that there is no doubt.
    """

    key: str
    kind: Kind
    unit: str
    shape: Shape
    night: Night
    within: tuple[Night, ...]
    until: Night
    news: tuple[str, ...]
    old: float
    new: float
    size: float
    weight: float
    p: float
    exact: bool

    @property
    def direction(self) -> str:
        """ "worse", "better", or "other" where neither way is."""
        return _direction(self.kind, self.size)

    @property
    def minor(self) -> bool:
        """Whether it is certain, but smaller than what is of interest."""
        return self.weight < 1.0 and self.exact

    @property
    def change(self) -> str:
        """The change in words."""
        return in_words(self.kind, self.old, self.new)


@dataclass(frozen=True)
class Difference:
    """A number that is not the same in two nights.

    Attributes
    ----------
    key, kind, unit : of the number.
    old, new : its values; nan where a night does not have it.
    weight : its change over the smallest of interest; inf where a night does not have it.
    """

    key: str
    kind: Kind
    unit: str
    old: float
    new: float
    weight: float

    @property
    def direction(self) -> str:
        """ "worse", "better", or "other" where neither way is; "gone" and "new" where a night lacks it."""
        if math.isnan(self.new) or math.isnan(self.old):
            return "gone" if math.isnan(self.new) else "new"
        return _direction(self.kind, self.new - self.old)

    @property
    def change(self) -> str:
        """The change in words."""
        return in_words(self.kind, self.old, self.new)


@dataclass(frozen=True)
class Turned:
    """A claim whose verdict is not the same in two nights.

    Attributes
    ----------
    key : of the claim.
    was, now : its verdicts; "none" where a night does not have it.
    old, new, bound : its values and its present bound; nan where a night does not have it.
    """

    key: str
    was: str
    now: str
    old: float
    new: float
    bound: float


def events(series: Iterable[Series]) -> list[Event]:
    """Return the changes of all series, the largest first.

    Noisy changes are kept while the false ones are expected to be at most `FALSE_SHARE` of them (Benjamini
    and Hochberg), so that many quiet series do not bring false alarms; changes without noise are all kept.
    Times and memory are compared within one machine.
    """
    sure: list[Event] = []
    noisy: list[Event] = []
    quiet = 0
    for part in (part for one in series for part in _parts(one)):
        found = _events(part)
        sure += (event for event in found if event.exact)
        noisy += (here := [event for event in found if not event.exact])
        quiet += not here and _noisy(part)
    if noisy:
        adjusted = false_discovery_control([event.p for event in noisy] + [1.0] * quiet)
        sure += (event for event, p in zip(noisy, adjusted, strict=False) if p <= FALSE_SHARE)
    return sorted(sure, key=_rank)


def differences(old: Iterable[Number], new: Iterable[Number]) -> list[Difference]:
    """Return the numbers that differ between two nights by more than round-off, the largest change first."""
    before, after = ({one.key: one for one in numbers} for numbers in (old, new))
    found = []
    for key, known in {**before, **after}.items():
        values = np.array([night[key].value if key in night else math.nan for night in (before, after)])
        pair = Series(key, known.kind, known.unit, (), values)
        if np.isnan(values).all():
            continue
        size = abs(float(np.diff(pair.scaled)[0]))
        if math.isnan(size) or size > _round_off(pair):
            weight = math.inf if math.isnan(size) else size / max(pair.interest, _round_off(pair))
            found.append(Difference(key, known.kind, known.unit, float(values[0]), float(values[1]), weight))
    return sorted(found, key=lambda one: (-one.weight, one.key))


def turned(old: Mapping[str, Judged], new: Mapping[str, Judged]) -> list[Turned]:
    """Return the claims whose verdicts differ, those that fail in the new night first."""
    found = []
    for key in dict.fromkeys([*old, *new]):
        (was, before, _), (now, after, bound) = (_stands(night.get(key)) for night in (old, new))
        if was != now:
            found.append(Turned(key, was, now, before, after, bound))
    return sorted(found, key=lambda one: (one.now != "FAIL", one.key))


def in_words(kind: Kind, old: float, new: float) -> str:
    """Two numbers in words: the first, the second, and by how much they differ."""
    both = f"{old:.4g} -> {new:.4g}"
    if not math.isfinite(new - old):
        return both
    if kind.logarithmic and 0.5 < abs(new / old if old else math.inf) < 2.0:
        return f"{both} ({100 * (new / old - 1):+.3g} %)"
    if kind.logarithmic and old:
        return f"{both} (x {new / old:.3g})"
    return f"{both} ({new - old:+.3g})"


def _stands(one: Judged | None) -> tuple[str, float, float]:
    """Verdict, value and bound of a claim in a night that may not have it."""
    if one is None:
        return "none", math.nan, math.nan
    return one.claim.verdict, one.claim.value, one.claim.bound


def _direction(kind: Kind, size: float) -> str:
    if math.isnan(size):  # it was asked for and could not be had
        return "worse"
    if kind.worse == 0 or size == 0:
        return "other"
    return "worse" if size * kind.worse > 0 else "better"


def _rank(event: Event) -> tuple[bool, bool, float, str]:
    """Sure before suspect, of interest before minor, large before small."""
    return event.shape is Shape.SUSPECT, event.minor, -event.weight, event.key


def _round_off(series: Series) -> float:
    if series.kind.logarithmic:
        return ROUND_OFF
    return ROUND_OFF * max(1.0, float(np.nanmax(np.abs(series.values))))


def _parts(series: Series) -> list[Series]:
    """The series, or that of each machine where machines are not comparable."""
    if not series.kind.of_machine:
        return [series]
    machines = np.array([night.machine for night in series.nights])
    return [series.only(np.flatnonzero(machines == machine)) for machine in dict.fromkeys(machines)]


def _noisy(series: Series) -> bool:
    """Whether noise could have made a change of it."""
    y = series.scaled[np.isfinite(series.values)]
    return len(y) >= ENOUGH and not without_noise(y, _round_off(series))


def _events(series: Series) -> list[Event]:
    """The changes of one series that are exact or not clearly smaller than what is of interest."""
    had = np.flatnonzero(np.isfinite(series.values))
    if len(had) == 0:
        return []
    found = []
    known = series.only(had)
    interest = max(known.interest, _round_off(known))
    for change in changes(known.scaled, _round_off(known)):
        if change.exact or abs(change.size) + _BELIEVED * change.error >= interest:
            found.append(_event(known, _placed(known, change), interest))
    if (last := had[-1]) < len(series.nights) - 1:
        found.append(_lost(series, int(last)))
    return found


def _placed(series: Series, change: Change) -> Change:
    """The change at the most likely night with anything new in it, where a likely one has.

    A number does not change of itself: where the most likely night has the code, libraries and machine of the
    night before, the nearest that has not is meant.
    """
    first, last = change.within
    fresh = [at for at in range(first, last + 1) if _news(series, at)]
    if change.exact or not fresh:
        return change
    at = min(fresh, key=lambda place: abs(place - change.first))
    return replace(change, first=at, last=max(at, change.last) if change.shape is Shape.DRIFT else at)


def _news(series: Series, at: int) -> tuple[str, ...]:
    return series.nights[at].differences(series.nights[at - 1])


def _event(series: Series, change: Change, interest: float) -> Event:
    nights, (begin, end) = series.nights, change.within
    old, new = (_value(series.kind, level) for level in (change.old, change.old + change.size))
    return Event(
        series.key, series.kind, series.unit, change.shape, nights[change.first], nights[begin : end + 1],
        nights[change.last], _news(series, change.first), old, new, change.size,
        abs(change.size) / interest, change.p, change.exact,
    )  # fmt: skip


def _value(kind: Kind, scaled: float) -> float:
    return math.exp(scaled) if kind.logarithmic else scaled


def _lost(series: Series, last: int) -> Event:
    """A number that could not be had after the night `last`."""
    at = series.nights[last + 1]
    return Event(
        series.key, series.kind, series.unit, Shape.LOST, at, (at,), at, _news(series, last + 1),
        float(series.values[last]), math.nan, math.nan, math.inf, 0.0, True,
    )  # fmt: skip
