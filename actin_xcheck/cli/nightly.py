"""`nightly`: the verification suite within a budget, kept, judged, and drawn on the dashboard.

`history` and `diff`: the nights that are kept, what changed in them, and two of them side by side.
"""

import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from actin_xcheck.cli import conduct

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from contextlib import AbstractContextManager

    from actin_xcheck.cli.output import NightAnswer
    from actin_xcheck.nightly.differences import Difference, Event, Turned
    from actin_xcheck.nightly.history import Counted, Series
    from actin_xcheck.nightly.items import Item
    from actin_xcheck.nightly.plan import Wish
    from actin_xcheck.nightly.record import Kept
    from actin_xcheck.runs.executor import Executor

SUMMARY, JUNIT = "summary.json", "junit.xml"


Checks = Annotated[
    list[str] | None, typer.Option(metavar="GLOB", help="Checks by name; may be given more than once.")
]


def nightly_command(
    budget: Annotated[
        float | None, typer.Option(help="Minutes in all; what is not expected to fit is not begun.", min=0.01)
    ] = None,
    baseline: Annotated[
        str | None, typer.Option(metavar="NIGHT", help="Fail where a number is worse than in that night.")
    ] = None,
    only: Checks = None,
    listed: conduct.Listed = False,
    failed: Annotated[bool, typer.Option("--failed", help="Only what failed when it was run last.")] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the night that was interrupted.")
    ] = False,
    jobs: conduct.Jobs = None,
    scheduler: conduct.Scheduler = None,
    fault: Annotated[
        str | None, typer.Option(help="Switch a deliberate fault on, to see the lights turn red.")
    ] = None,
    out_dir: Annotated[Path, typer.Option("--out", help="Folder of all nights.")] = Path("reports"),
    as_json: conduct.Json = False,
    quiet: conduct.Quiet = False,
    dry_run: conduct.DryRun = False,
    markdown: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write what it comes to, as for a pull request.")
    ] = None,
    open_page: conduct.Open = False,
) -> None:
    """Run the verification suite, keep its numbers, and draw the dashboard: index.html over all nights.

    Conservation, exact solutions, modes, reference values, FEM against FV, orders, negative controls, work
    and times: first what failed last, then what is cheapest.  Exit code 0 when all is green, 1 when not, 2
    for a mistake in what was asked.  A night with a deliberate fault is no part of the history.  Costs are
    measured on this machine, with --scheduler too.
    """
    from actin_xcheck.nightly.plan import Wish, cost, suite
    from actin_xcheck.runs.executor import executor, jobs_asked

    if listed:
        conduct.print_names(item.name for item in suite())
    wish = Wish(
        out_dir, budget, fault or "", baseline or "", tuple(only or ()), failed, resume, conduct.command()
    )
    if dry_run:
        count, seconds, fit = cost(wish, suite(), workers := jobs_asked(jobs, scheduler))
        by = f"{workers} processes" + (f"; {fit} of them fit" if fit < count else "")
        conduct.say_seconds("nightly", count, f"{count} checks", seconds, by, as_json)
    processes, away = executor(jobs_asked(jobs, scheduler), scheduler), scheduler is not None
    raise typer.Exit(
        spend(wish, suite(), processes, away, as_json, quiet, markdown=markdown, open_page=open_page)
    )


def spend(
    wish: "Wish",
    suite: "Sequence[Item]",
    processes: "AbstractContextManager[Executor]",
    away: bool = False,
    as_json: bool = False,
    quiet: bool = True,
    kernel: float | None = None,
    markdown: Path | None = None,
    open_page: bool = False,
    **how: Any,
) -> int:
    """Carry a night out, write all that is read of it, say what it came to, and return the exit code.

    Parameters
    ----------
    wish, suite : what is asked for, of what there is.
    processes, away : has processes for its checks, once it is entered; whether they are a cluster's.
    kernel : seconds that the reference kernel takes; None: to be measured.
    markdown, open_page : a file for its summary; whether to open its page.
    how : see `carry_through`.
    """
    from actin_xcheck.cli.output import Progress, say
    from actin_xcheck.core.files import replace_file
    from actin_xcheck.nightly.carry_out import carry_through
    from actin_xcheck.nightly.dashboard import write_dashboard, write_night_page, write_scene_pages
    from actin_xcheck.nightly.plan import begun
    from actin_xcheck.nightly.record import junit
    from actin_xcheck.nightly.standing import summary
    from actin_xcheck.runs.provenance import reference_kernel

    seconds = kernel or float(reference_kernel()[0])
    with processes as workers, begun(wish, suite, seconds) as tonight:
        left = tonight.deadline - time.time()
        with Progress(quiet, left) as progress, conduct.kept_in(tonight.kept.folder, "nightly --resume"):
            tell = conduct.saying_the_cost(progress, workers.workers, left)
            kept = carry_through(tonight, wish.history, workers, tell, away, **how)
        replace_file(kept.folder / JUNIT, junit(kept))
        write_scene_pages(kept.folder)
        answer = _answer(kept, write_night_page(kept.folder), wish.history)
        replace_file(kept.folder / SUMMARY, answer.model_dump_json(indent=1).encode("utf-8"))
    index = write_dashboard(wish.reports)
    if markdown:
        replace_file(markdown, summary(kept, wish.history, answer.flaky).encode("utf-8"))
    conduct.opened(answer.page, open_page)
    if as_json:
        say(answer)
    else:
        _print(kept, answer, index)
    return 0 if kept.green else 1


def _answer(kept: "Kept", page: Path, history: Path) -> "NightAnswer":
    from actin_xcheck.cli.output import FailedClaim, NightAnswer
    from actin_xcheck.nightly.items import group_of
    from actin_xcheck.nightly.standing import flaky

    failing = [
        FailedClaim(check=done.name, group=group_of(claim), key=claim.key, file=file, **asdict(claim))
        for done in kept.done
        for claim, file in zip(done.claims, done.files, strict=True)
        if claim.verdict == "FAIL" and not done.trouble
    ]
    return NightAnswer(
        night=kept.begun.name,
        folder=str(kept.folder),
        page=str(page),
        green=kept.green,
        fault=kept.begun.fault,
        seconds=kept.seconds,
        claims=dict(Counter(claim.verdict for claim in kept.claims)),
        failed=tuple(failing),
        flaky=() if kept.begun.fault else tuple(sorted(flaky(history, kept.begun.name))),
        troubles={done.name: done.trouble for done in kept.done if done.trouble},
        not_run={one.name: one.why for one in kept.left_out},
        checks={done.name: done.seconds for done in kept.done},
        commit=kept.begun.versions["commit"],
        machine=kept.begun.machine,
    )


def _print(kept: "Kept", answer: "NightAnswer", index: Path) -> None:
    from actin_xcheck.core.claim import excess
    from actin_xcheck.nightly.history import judged_in
    from actin_xcheck.nightly.standing import standing

    if kept.begun.fault:
        print(f"deliberate fault: {kept.begun.fault}")
    for one in answer.failed:
        verdict = "FLAKY" if f"{one.key} · {one.check}" in answer.flaky else "FAIL"
        print(f"{verdict} {one.scene} [{', '.join(one.methods)}]: {one.statement}: ", end="")
        print(f"{excess(one.value, one.bound)} ({one.note})")
    for name, trouble in answer.troubles.items():
        print(f"FAIL {name}: {trouble}")
    for left in kept.left_out:
        if left.seconds:  # it was begun
            print(f"NOT RUN {left.name}: {left.why}")
    now = standing(judged_in(kept.done), answer.flaky, kept.left_out)
    print(f"{now.score} claims hold in {len(kept.done)} checks{now.apart}", end="")
    print(f"; {kept.seconds / 60:.1f} min; report: {answer.page}; all nights: {index}")


DEFAULT_PATH = Path("reports") / "history.sqlite"

File = Annotated[Path, typer.Option("--file", help="The history.")]
Whole = Annotated[bool, typer.Option("--json", help="The same as JSON, whole.")]


def history_command(
    key: Annotated[
        str | None, typer.Option(help="Show the numbers whose keys match, such as 'seconds/*'.")
    ] = None,
    steps: Annotated[bool, typer.Option("--steps", help="Find the nights in which numbers changed.")] = False,
    file: File = DEFAULT_PATH,
    as_json: Whole = False,
) -> None:
    """List the nights that are kept; with --key the numbers that match, with --steps what changed and when.

    Steps are found on the logarithm (orders and rates: as they are) among all numbers, or those of --key.
    """
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
        print_json(
            {"nights": [plain_night(one) for one in nights]}
            | ({"series": [plain_series(one) for one in series]} if key else {})
            | ({"steps": [plain_event(event) for event in found]} if steps else {})
        )
        return
    if not steps and key is None:
        _show(nights_table(nights))
    if key is not None:
        _show(series_table(series))
    if steps:
        print(found_words(found, series))
        _show(events_table(found[:SHOWN]))
        say_rest(len(found))


def diff_command(
    old: Annotated[str, typer.Argument(metavar="NIGHT", help="A night, or how its name begins.")],
    new: Annotated[str, typer.Argument(metavar="NIGHT", help="Another, to compare with it.")],
    file: File = DEFAULT_PATH,
    as_json: Whole = False,
    markdown: Annotated[
        bool, typer.Option("--markdown", help="What is worse, with its usual scatter, for a pull request.")
    ] = False,
) -> None:
    """Compare two nights: claims whose verdict turned, and numbers that differ, the largest change first."""
    from actin_xcheck.nightly.differences import differences, turned
    from actin_xcheck.nightly.history import find_night, read_claims, read_nights, read_numbers

    nights = read_nights(file)
    before, after = (find_night(nights, name).night for name in (old, new))
    if markdown:
        from actin_xcheck.nightly.standing import worse

        print(worse(file, before, after), end="")
        return
    claims = turned(read_claims(file, before.name), read_claims(file, after.name))
    numbers = differences(read_numbers(file, before.name), read_numbers(file, after.name))
    news = after.differences(before)
    if as_json:
        print_json(
            {"old": before.name, "new": after.name, "news": news}
            | {
                "claims": [asdict(one) for one in claims],
                "numbers": [asdict(one) | {"direction": one.direction} for one in numbers],
            }
        )
        return
    print(f"{before.name} ({before.date}) -> {after.name} ({after.date}): {listed(news)}")
    print(f"{len(claims)} claims turned")
    if claims:
        _show(turned_table(claims))
    print(f"{len(numbers)} numbers differ, {sum(one.weight >= 1 for one in numbers)} by what is of interest")
    if numbers:
        _show(differences_table(numbers[:SHOWN]))
    say_rest(len(numbers))


SHOWN = 40
"""Lines of a table of changes at most; --json has them all."""

Rows = Iterator[tuple[str, ...]]
"""Of a table, its header first."""


def _show(rows: Rows) -> None:
    """Print a table."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(*next(rows), box=None)
    for row in rows:
        table.add_row(*map(escape, row))
    conduct.print_table(table)


def nights_table(nights: "Sequence[Counted]") -> Rows:
    """The nights that are kept."""
    yield "night", "begun", "commit", "machine", "hold", "fail", "not judged", "numbers"
    for one in nights:
        night, judged = one.night, (str(one.verdicts[name]) for name in ("PASS", "FAIL", "NOT JUDGED"))
        yield night.name, night.date, night.commit[:12], night.machine, *judged, str(one.numbers)


def series_table(series: "Sequence[Series]") -> Rows:
    """Numbers over the nights."""
    import numpy as np

    yield "number", "kind", "nights", "median", "first", "last", "unit"
    for one in series:
        middle = f"{np.nanmedian(one.values):.4g}" if np.isfinite(one.values).any() else "nan"
        first, last = (f"{one.values[at]:.4g}" for at in (0, -1))
        yield one.key, one.kind, str(len(one.nights)), middle, first, last, one.unit


def events_table(found: "Iterable[Event]") -> Rows:
    """What changed, and when."""
    from actin_xcheck.nightly.differences import Shape

    yield "night", "what", "number", "change", "likely within", "with"
    for event in found:
        what = str(event.shape) if event.shape is Shape.LOST else f"{event.shape}, {event.direction}"
        first, last = event.within[0].name, event.within[-1].name
        night = " to ".join(dict.fromkeys((event.night.name, event.until.name)))
        likely = first if first == last else f"{first} to {last}"
        if event.together > 1:
            likely += f", by {event.together} numbers"
        minor, exactly = ", minor" if event.minor else "", "exactly" if event.exact else likely
        yield night, f"{what}{minor}", event.key, event.change, exactly, listed(event.news)


def turned_table(claims: "Iterable[Turned]") -> Rows:
    """Claims whose verdict turned."""
    yield "claim", "was", "is", "value", "bound"
    for one in claims:
        yield one.key, one.was, one.now, f"{one.old:.3g} -> {one.new:.3g}", f"{one.bound:.3g}"


def differences_table(numbers: "Iterable[Difference]") -> Rows:
    """Numbers of two nights that differ."""
    yield "number", "is", "change", "unit"
    for one in numbers:
        yield one.key, f"{one.direction}{', minor' if one.weight < 1 else ''}", one.change, one.unit


def found_words(found: "Sequence[Event]", series: "Sequence[Series]") -> str:
    """How much was found, in a line."""
    from actin_xcheck.nightly.differences import Shape

    sure = [event for event in found if event.shape is not Shape.SUSPECT]
    of_interest = sum(not event.minor for event in sure)
    return (
        f"{len(series)} numbers: {of_interest} changes, {len(sure) - of_interest} minor ones, "
        f"{len(found) - len(sure)} suspects in the newest nights"
    )


def listed(news: "Sequence[str]") -> str:
    """What is new in a night, in a line."""
    return "; ".join(news) or "same commit, versions and machine"


def say_rest(count: int) -> None:
    """Say how many lines are not shown."""
    if count > SHOWN:
        print(f"... and {count - SHOWN} smaller ones (--json)")


def plain_night(one: "Counted") -> dict[str, Any]:
    """A night as plain values."""
    return asdict(one.night) | {"numbers": one.numbers, "claims": dict(one.verdicts)}


def plain_series(one: "Series") -> dict[str, Any]:
    """A series as plain values."""
    points = {night.name: value for night, value in zip(one.nights, one.values.tolist(), strict=True)}
    return {"key": one.key, "kind": one.kind, "unit": one.unit, "values": points}


def plain_event(event: "Event") -> dict[str, Any]:
    """A change as plain values."""
    names = {"night": event.night.name, "until": event.until.name, "commit": event.night.commit}
    named = asdict(event) | names | {"within": [night.name for night in event.within]}
    return named | {"direction": event.direction, "minor": event.minor}


def print_json(found: dict[str, Any]) -> None:
    """Print what was found as JSON."""
    import json
    import sys

    from actin_xcheck.nightly.record import plain

    json.dump(plain(found), sys.stdout, indent=1, allow_nan=False)
    print()
