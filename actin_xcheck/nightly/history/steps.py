"""Which numbers changed, in which night and with which commit; and what is different between two nights."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import false_discovery_control

from actin_xcheck.nightly.history.changes import ENOUGH, Shape, changes, without_noise
from actin_xcheck.nightly.history.record import Judged, Kind, Night, Number, Series
from actin_xcheck.nightly.history.together import Cause, Found, causes

FALSE_SHARE = 0.02
"""Expected share of false ones among the causes of noisy changes, or the probability of any where all are."""

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
    together : numbers that say so, this one included (`history.together`).
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
    together: int
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

    Noisy changes with one cause count as one (`history.together`).  Causes are kept while the false ones are
    expected to be at most `FALSE_SHARE` of them (Benjamini and Hochberg), so that many quiet series do not
    bring false alarms; changes without noise are all kept.
    Times and memory are compared within one machine.
    """
    found: list[Found] = []
    lost: list[Event] = []
    quiet = 0
    for part in (part for one in series for part in _parts(one)):
        found += (here := _found(part))
        lost += _lost(part)
        quiet += _noisy(part) and all(one.change.exact for one in here)
    known = causes(found)
    sure, noisy = ([one for one in known if one.exact is exact] for exact in (True, False))
    if noisy:
        adjusted = false_discovery_control([one.p for one in noisy] + [1.0] * quiet)
        sure += (one for one, p in zip(noisy, adjusted, strict=False) if p <= FALSE_SHARE)
    return sorted([_event(one, cause) for cause in sure for one in cause.shown_by] + lost, key=_rank)


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


def _found(series: Series) -> list[Found]:
    """The changes of one series that are exact or not clearly smaller than what is of interest."""
    known = series.only(np.flatnonzero(np.isfinite(series.values)))
    return [
        Found(known, change)
        for change in (changes(known.scaled, _round_off(known)) if known.nights else ())
        if change.exact or abs(change.size) + _BELIEVED * change.error >= _interest(known)
    ]


def _interest(series: Series) -> float:
    return max(series.interest, _round_off(series))


def _event(found: Found, cause: Cause) -> Event:
    series, change = found.series, found.change
    begin, end = cause.within
    old, new = (_value(series.kind, level) for level in (change.old, change.old + change.size))
    night = cause.nights[cause.at]
    return Event(
        series.key, series.kind, series.unit, change.shape, night, cause.nights[begin : end + 1],
        len(cause.shown_by), series.nights[change.last] if change.shape is Shape.DRIFT else night,
        cause.news(cause.at), old, new, change.size, abs(change.size) / _interest(series), change.p,
        change.exact,
    )  # fmt: skip


def _value(kind: Kind, scaled: float) -> float:
    return math.exp(scaled) if kind.logarithmic else scaled


def _lost(series: Series) -> list[Event]:
    """That a number could not be had any more, from the night after the last that had it."""
    had = np.flatnonzero(np.isfinite(series.values))
    if len(had) == 0 or (last := int(had[-1])) == len(series.nights) - 1:
        return []
    nights = series.nights
    at = nights[last + 1]
    return [
        Event(
            series.key, series.kind, series.unit, Shape.LOST, at, (at,), 1, at, at.differences(nights[last]),
            float(series.values[last]), math.nan, math.nan, math.inf, 0.0, True,
        )
    ]  # fmt: skip
