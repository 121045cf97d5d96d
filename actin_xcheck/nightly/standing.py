"""What a night comes to: what of its red is physics, what the code's or the machine's; what was not run."""

from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actin_xcheck.nightly.differences import Difference, Turned, differences, turned
from actin_xcheck.nightly.history import (
    JudgedNumber,
    Series,
    find_night,
    judged_in,
    read_claims,
    read_nights,
    read_numbers,
    read_series,
)
from actin_xcheck.nightly.items import NO_VERDICT
from actin_xcheck.nightly.record import Kept, Night, NotRun

LEAST = 4
"""Nights from which the scatter of a number is known."""


def flaky(history: Path, name: str) -> frozenset[str]:
    """The claims, by key, that hold in one night and fail in another, both of the code that a night is of.

    None of a night that is not kept, or whose code had changes that were not committed.
    """
    nights = [one.night for one in read_nights(history)] if history.exists() else []
    ours = next((one for one in nights if one.name == name), None)
    if ours is None or ours.commit.endswith("-dirty") or ours.commit == "unknown":
        return frozenset()
    seen: dict[str, set[str]] = {}
    for night in nights:
        if (night.commit, night.versions) == (ours.commit, ours.versions):
            for key, one in read_claims(history, night.name).items():
                seen.setdefault(key, set()).add(one.claim.verdict)
    return frozenset(key for key, verdicts in seen.items() if verdicts >= {"PASS", "FAIL"})


def state_of(one: JudgedNumber, unsteady: Container[str] = ()) -> str:
    """ "pass", "fail" or "not-judged"; "broken" where the check broke down, "flaky" where that is known."""
    if one.claim.verdict != "FAIL":
        return "pass" if one.claim.judged else "not-judged"
    if one.claim.statement == NO_VERDICT:
        return "broken"
    return "flaky" if one.key in unsteady else "fail"


@dataclass(frozen=True)
class Standing:
    """How many claims and checks of a night came out how.

    Attributes
    ----------
    holds, fails, flaky : claims; those alone fail of which the same code never says anything else.
    broken : checks that broke down.
    stopped, left_out : checks that the machine or the budget stopped, and those not begun.
    """

    holds: int = 0
    fails: int = 0
    flaky: int = 0
    broken: int = 0
    stopped: int = 0
    left_out: int = 0

    @property
    def state(self) -> str:
        """The worst there is, physics first; "none" where nothing was judged."""
        for name in ("fails", "broken", "flaky"):
            if getattr(self, name):
                return "fail" if name == "fails" else name
        return "pass" if self.holds else "none"

    @property
    def score(self) -> str:
        """How many of the claims that are judged hold."""
        return f"{self.holds} of {self.holds + self.fails + self.flaky + self.broken}"

    @property
    def apart(self) -> str:
        """What a headline goes on with: what does not speak against the physics, and what was not run."""
        said = [
            (self.flaky, f"{self.flaky} {'is' if self.flaky == 1 else 'are'} flaky"),
            (self.broken, f"{_checks(self.broken)} broke down"),
            (self.stopped, f"{_checks(self.stopped)} stopped"),
            (self.left_out, f"{_checks(self.left_out)} not run"),
        ]
        return "".join(f", {words}" for count, words in said if count)


def _checks(count: int) -> str:
    return f"{count} check{'s' * (count != 1)}"


def standing(
    claims: Iterable[JudgedNumber], unsteady: Container[str] = (), left_out: Sequence[NotRun] = ()
) -> Standing:
    """Count what came of a night."""
    states = Counter(state_of(one, unsteady) for one in claims)
    stopped = sum(one.stopped for one in left_out)
    return Standing(
        holds=states["pass"],
        fails=states["fail"],
        flaky=states["flaky"],
        broken=states["broken"],
        stopped=stopped,
        left_out=len(left_out) - stopped,
    )


def summary(kept: Kept, history: Path, unsteady: Container[str]) -> str:
    """Return what a night comes to in Markdown: its score, what fails, and what is worse than before.

    That is in its baseline or, where it has none, in the night that was kept before it; nothing is worse than
    in no night.
    """
    every = list(judged_in(kept.done))
    now, begun = standing(every, unsteady, kept.left_out), kept.begun
    lines = [f"## {now.score} claims hold{now.apart}", ""]
    if begun.fault:
        lines += [f"A deliberate fault was on: {begun.fault}.", ""]
    states = [(state_of(one, unsteady), one.claim) for one in every]
    if red := [(state, one) for state, one in states if state not in ("pass", "not-judged")]:
        rows = (
            (state, f"{one.scene} [{', '.join(one.methods)}]: {one.statement}", one.excess)
            for state, one in red
        )
        lines += _table(("", "claim", "value"), rows)
    nights = read_nights(history) if history.exists() else []
    earlier = [one.night for one in nights if one.night.date < begun.date]
    if not earlier or begun.name not in {one.night.name for one in nights}:
        return "\n".join(lines)
    before = find_night(nights, begun.baseline).night if begun.baseline else earlier[-1]
    return "\n".join([*lines, worse(history, before, find_night(nights, begun.name).night)])


def worse(history: Path, before: Night, after: Night) -> str:
    """Return what is worse in a night that is kept than in another, see `markdown`."""
    claims = turned(*(read_claims(history, one.name) for one in (before, after)))
    numbers = differences(*(read_numbers(history, one.name) for one in (before, after)))
    return markdown(before, after, claims, numbers, {one.key: one for one in read_series(history)})


def markdown(
    before: Night,
    after: Night,
    claims: Sequence[Turned],
    numbers: Iterable[Difference],
    series: Mapping[str, Series],
) -> str:
    """Return what is worse in a night than in the one it is held against, in Markdown, as for a pull request.

    Parameters
    ----------
    claims, numbers : what differs, see `differences`; times and memory of another machine are left out.
    series : the numbers through the nights, whose scatter says how much a change is worth.
    """
    fair = [one for one in numbers if before.machine == after.machine or not one.kind.of_machine]
    worse = [one for one in fair if one.direction in ("worse", "gone") and one.weight >= 1]
    better = [one for one in fair if one.direction == "better" and one.weight >= 1]
    red = [one for one in claims if one.now == "FAIL"]
    fixed = [one for one in claims if one.was == "FAIL" and one.now == "PASS"]
    news = "; ".join(after.differences(before)) or "same commit, versions and machine"
    lines = [f"### {len(red)} claims fail that did not, {len(worse)} numbers are worse", ""]
    lines += [f"`{after.name}` against `{before.name}`: {news}. {len(fixed)} claims hold that failed, ", ""]
    lines[-2] += f"{len(better)} numbers are better."
    if red:
        rows = ((one.key, f"{one.old:.3g} -> {one.new:.3g}", f"{one.bound:.3g}") for one in red)
        lines += _table(("fails now", "value", "bound"), rows)
    if worse:
        rows = ((one.key, one.change, _scatter(series.get(one.key), before)) for one in worse)
        lines += _table(("worse", "change", "scatter before"), rows)
    return "\n".join(lines) + "\n"


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    told = (head, ("---",) * len(head), *rows)
    return [*("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in told), ""]


def _scatter(one: Series | None, until: Night) -> str:
    """How far a number is usually off its middle, up to a night and as on its machine."""
    if one is None:
        return "not known"
    like = [
        night.date <= until.date and (night.machine == until.machine or not one.kind.of_machine)
        for night in one.nights
    ]
    scaled = one.scaled[np.array(like)]
    scaled = scaled[np.isfinite(scaled)]
    if len(scaled) < LEAST:
        return f"not known from {len(scaled)} nights"
    size = 1.4826 * float(np.median(np.abs(scaled - np.median(scaled))))  # of a normal distribution
    known = f"{100 * np.expm1(size):.2g} %" if one.kind.logarithmic else f"{size:.2g}"
    return f"± {known} in {len(scaled)} nights"
