"""`history` and `diff`: the nights that are kept, what changed in them, and two of them side by side."""

import json
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.markup import escape
from rich.table import Table

from actin_xcheck.nightly.differences import Difference, Event, Shape, Turned
from actin_xcheck.nightly.history import Counted, Series
from actin_xcheck.nightly.record import plain

DEFAULT_PATH = Path("reports") / "history.sqlite"

File = Annotated[Path, typer.Option("--file", help="The history.")]
Json = Annotated[bool, typer.Option("--json", help="The same as JSON, whole.")]


def history_command(
    key: Annotated[
        str | None, typer.Option(help="Show the numbers whose keys match, such as 'seconds/*'.")
    ] = None,
    steps: Annotated[bool, typer.Option("--steps", help="Find the nights in which numbers changed.")] = False,
    file: File = DEFAULT_PATH,
    as_json: Json = False,
) -> None:
    """List the nights that are kept; with --key the numbers that match, with --steps what changed and when.

    Steps are found on the logarithm (orders and rates: as they are) among all numbers, or those of --key.
    """
    from actin_xcheck.cli import history as tables
    from actin_xcheck.cli.conduct import print_table
    from actin_xcheck.core.errors import UserError
    from actin_xcheck.nightly.changes import events
    from actin_xcheck.nightly.history import read_nights, read_series

    nights = read_nights(file)
    series = read_series(file, key or "*") if steps or key else []
    if key and not series:
        kinds = sorted({f"{one.key.split('/')[0]}/*" for one in read_series(file)})
        raise UserError(
            f"--key: no number is called {key!r}; valid: such as {', '.join(kinds)}; * and ? match"
        )
    found = events(series) if steps else []
    if as_json:
        tables.print_json(
            {"nights": [tables.plain_night(one) for one in nights]}
            | ({"series": [tables.plain_series(one) for one in series]} if key else {})
            | ({"steps": [tables.plain_event(event) for event in found]} if steps else {})
        )
        return
    if not steps and key is None:
        print_table(tables.nights_table(nights))
    if key is not None:
        print_table(tables.series_table(series))
    if steps:
        print(tables.found_words(found, series))
        print_table(tables.events_table(found[: tables.SHOWN]))
        tables.say_rest(len(found))


def diff_command(
    old: Annotated[str, typer.Argument(metavar="NIGHT", help="A night, or how its name begins.")],
    new: Annotated[str, typer.Argument(metavar="NIGHT", help="Another, to compare with it.")],
    file: File = DEFAULT_PATH,
    as_json: Json = False,
) -> None:
    """Compare two nights: claims whose verdict turned, and numbers that differ, the largest change first."""
    from dataclasses import asdict

    from actin_xcheck.cli import history as tables
    from actin_xcheck.cli.conduct import print_table
    from actin_xcheck.nightly.differences import differences, turned
    from actin_xcheck.nightly.history import find_night, read_claims, read_nights, read_numbers

    nights = read_nights(file)
    before, after = (find_night(nights, name).night for name in (old, new))
    claims = turned(read_claims(file, before.name), read_claims(file, after.name))
    numbers = differences(read_numbers(file, before.name), read_numbers(file, after.name))
    news = after.differences(before)
    if as_json:
        tables.print_json(
            {"old": before.name, "new": after.name, "news": news}
            | {
                "claims": [asdict(one) for one in claims],
                "numbers": [tables.plain_difference(one) for one in numbers],
            }
        )
        return
    print(f"{before.name} ({before.date}) -> {after.name} ({after.date}): {tables.listed(news)}")
    print(f"{len(claims)} claims turned")
    if claims:
        print_table(tables.turned_table(claims))
    print(f"{len(numbers)} numbers differ, {sum(one.weight >= 1 for one in numbers)} by what is of interest")
    if numbers:
        print_table(tables.differences_table(numbers[: tables.SHOWN]))
    tables.say_rest(len(numbers))


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
