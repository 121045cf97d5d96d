"""Nights, series and changes as `history` and `diff` show them: tables of a terminal, and plain values."""

import json
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from actin_xcheck.nightly.differences import Difference, Event, Shape, Turned
from actin_xcheck.nightly.history import Counted, Series
from actin_xcheck.nightly.record import plain

SHOWN = 40
"""Lines of a table of changes at most; --json has them all."""


def nights_table(nights: Sequence[Counted]) -> Table:
    """The nights that are kept."""
    table = Table("night", "begun", "commit", "machine", "hold", "fail", "not judged", "numbers", box=None)
    for one in nights:
        night, verdicts = one.night, one.verdicts
        table.add_row(
            *map(escape, (night.name, night.date, night.commit[:12], night.machine)),
            *(str(verdicts[verdict]) for verdict in ("PASS", "FAIL", "NOT JUDGED")), str(one.numbers),
        )  # fmt: skip
    return table


def series_table(series: Sequence[Series]) -> Table:
    """Numbers over the nights."""
    table = Table("number", "kind", "nights", "median", "first", "last", "unit", box=None)
    for one in series:
        middle = f"{np.nanmedian(one.values):.4g}" if np.isfinite(one.values).any() else "nan"
        first, last = (f"{one.values[at]:.4g}" for at in (0, -1))
        table.add_row(escape(one.key), one.kind, str(len(one.nights)), middle, first, last, escape(one.unit))
    return table


def events_table(found: Iterable[Event]) -> Table:
    """What changed, and when."""
    table = Table("night", "what", "number", "change", "likely within", "with", box=None)
    for event in found:
        what = str(event.shape) if event.shape is Shape.LOST else f"{event.shape}, {event.direction}"
        first, last = event.within[0].name, event.within[-1].name
        night = " to ".join(dict.fromkeys((event.night.name, event.until.name)))
        likely = first if first == last else f"{first} to {last}"
        if event.together > 1:
            likely += f", by {event.together} numbers"
        table.add_row(
            *map(escape, (night, f"{what}{', minor' if event.minor else ''}", event.key, event.change)),
            escape("exactly" if event.exact else likely),
            escape(listed(event.news)),
        )  # fmt: skip
    return table


def turned_table(claims: Iterable[Turned]) -> Table:
    """Claims whose verdict turned."""
    table = Table("claim", "was", "is", "value", "bound", box=None)
    for one in claims:
        values = f"{one.old:.3g} -> {one.new:.3g}"
        table.add_row(escape(one.key), one.was, one.now, values, f"{one.bound:.3g}")
    return table


def differences_table(numbers: Iterable[Difference]) -> Table:
    """Numbers of two nights that differ."""
    table = Table("number", "is", "change", "unit", box=None)
    for one in numbers:
        minor = ", minor" if one.weight < 1 else ""
        table.add_row(escape(one.key), f"{one.direction}{minor}", one.change, escape(one.unit))
    return table


def found_words(found: Sequence[Event], series: Sequence[Series]) -> str:
    """How much was found, in a line."""
    sure = [event for event in found if event.shape is not Shape.SUSPECT]
    of_interest = sum(not event.minor for event in sure)
    return (
        f"{len(series)} numbers: {of_interest} changes, {len(sure) - of_interest} minor ones, "
        f"{len(found) - len(sure)} suspects in the newest nights"
    )


def listed(news: Sequence[str]) -> str:
    """What is new in a night, in a line."""
    return "; ".join(news) or "same commit, versions and machine"


def say_rest(count: int) -> None:
    """Say how many lines are not shown."""
    if count > SHOWN:
        print(f"... and {count - SHOWN} smaller ones (--json)")


def plain_night(one: Counted) -> dict[str, Any]:
    """A night as plain values."""
    return asdict(one.night) | {"numbers": one.numbers, "claims": dict(one.verdicts)}


def plain_series(one: Series) -> dict[str, Any]:
    """A series as plain values."""
    points = {night.name: value for night, value in zip(one.nights, one.values.tolist(), strict=True)}
    return {"key": one.key, "kind": one.kind, "unit": one.unit, "values": points}


def plain_event(event: Event) -> dict[str, Any]:
    """A change as plain values."""
    names = {"night": event.night.name, "until": event.until.name, "commit": event.night.commit}
    named = asdict(event) | names | {"within": [night.name for night in event.within]}
    return named | {"direction": event.direction, "minor": event.minor}


def plain_difference(one: Difference) -> dict[str, Any]:
    """A difference as plain values."""
    return asdict(one) | {"direction": one.direction}


def print_json(found: dict[str, Any]) -> None:
    """Print what was found as JSON."""
    json.dump(plain(found), sys.stdout, indent=1, allow_nan=False)
    print()
