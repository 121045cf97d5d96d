"""`history` and `diff`: the nights that are kept, what changed in them, and two of them side by side."""

from pathlib import Path
from typing import Annotated

import typer

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
    from actin_xcheck.cli import history_tables as tables
    from actin_xcheck.cli.options import print_table
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

    from actin_xcheck.cli import history_tables as tables
    from actin_xcheck.cli.options import print_table
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
