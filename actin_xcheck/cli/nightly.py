"""`nightly`: the verification suite within a budget, kept, judged, and drawn on the dashboard."""

import time
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from actin_xcheck.cli.options import Json, command

if TYPE_CHECKING:
    from actin_xcheck.cli.output import NightAnswer
    from actin_xcheck.nightly.record import Kept

SUMMARY, JUNIT = "summary.json", "junit.xml"

PAGES = 0.08
"""Share of a budget that is left for pages and the history."""


def nightly_command(
    budget: Annotated[
        float | None, typer.Option(help="Minutes in all; what is not expected to fit is not begun.", min=0.01)
    ] = None,
    baseline: Annotated[
        str | None, typer.Option(metavar="NIGHT", help="Fail where a number is worse than in that night.")
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(metavar="GLOB", help="Checks by name; may be given more than once.")
    ] = None,
    failed: Annotated[bool, typer.Option("--failed", help="Only what failed when it was run last.")] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the night that was interrupted.")
    ] = False,
    jobs: Annotated[int | None, typer.Option(help="Processes; default: one a core.", min=1)] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            help="Address of a dask.distributed scheduler, in place of --jobs; its workers share the folder, "
            "and costs are measured here."
        ),
    ] = None,
    fault: Annotated[
        str | None, typer.Option(help="Switch a deliberate fault on, to see the lights turn red.")
    ] = None,
    out_dir: Annotated[Path, typer.Option("--out", help="Folder of all nights.")] = Path("reports"),
    as_json: Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress.")] = False,
) -> None:
    """Run the verification suite, keep its numbers, and draw the dashboard: index.html over all nights.

    Conservation, exact solutions, modes, reference values, FEM against FV, orders, negative controls, work
    and times: first what failed last, then what is cheapest.  Exit code 0 when all is green, 1 when not, 2
    for a mistake in what was asked.  A night with a deliberate fault is no part of the history.
    """
    from contextlib import ExitStack
    from dataclasses import replace
    from datetime import UTC, datetime

    from actin_xcheck.cli.output import say
    from actin_xcheck.cli.progress import Progress
    from actin_xcheck.core.errors import UserError
    from actin_xcheck.core.files import locked, replace_file
    from actin_xcheck.nightly.carry_out import Work, carry_out, work_through
    from actin_xcheck.nightly.checks import night_long
    from actin_xcheck.nightly.dashboard import write_dashboard, write_night_page, write_scene_pages
    from actin_xcheck.nightly.history.database import find_night, read_nights
    from actin_xcheck.nightly.junit import junit
    from actin_xcheck.nightly.night import (
        against_baseline,
        begin,
        check_same_code,
        fault_missed,
        gone_on_with,
        without_watching,
    )
    from actin_xcheck.nightly.nights import HISTORY, new_folder, remember, unfinished
    from actin_xcheck.nightly.plan import chosen, past, suite
    from actin_xcheck.nightly.record import FILE_NAME, Journal, Kept, read_night
    from actin_xcheck.nightly.remote import carry_out_elsewhere
    from actin_xcheck.runs.executor import executor, jobs_asked
    from actin_xcheck.runs.machine import reference_kernel
    from actin_xcheck.studies.folder import make_folder

    history, count = out_dir / HISTORY, jobs_asked(jobs, scheduler)
    if resume and (only or failed or fault or baseline):
        raise UserError(
            "--resume: goes on with what the night was begun with; "
            "valid: without --only, --failed, --fault and --baseline"
        )
    make_folder(out_dir)
    kernel = float(reference_kernel()[0])
    known = past(history, kernel)
    plan = chosen(without_watching(suite()) if fault else suite(), only or (), failed, known)
    if fault:
        with night_long(fault):
            plan = replace(plan, controls=(), costs=())
    if baseline:
        find_night(read_nights(history), baseline)
    begun_at = time.time()
    with ExitStack() as opened:
        processes = opened.enter_context(executor(count, scheduler))  # before there is a folder
        folder = unfinished(out_dir).folder if resume else new_folder(out_dir, datetime.now(UTC))
        opened.enter_context(locked(folder / FILE_NAME))
        journal = Journal(folder / FILE_NAME)
        if resume:
            kept = read_night(folder)
            plan = gone_on_with(kept, suite())
            check_same_code(kept)
        else:
            begun = begin(folder, plan, budget, fault or "", baseline or "", command(), kernel)
            kept = Kept(folder, begun)
            journal.begin(kept.begun)
        minutes = budget or kept.begun.minutes
        spent = 0.0 if budget else kept.seconds
        deadline = begun_at + 60 * minutes * (1 - PAGES) - spent
        work: Work = carry_out
        if scheduler:
            work, kept = carry_out_elsewhere, replace(kept, folder=folder.resolve())
        with Progress(quiet, deadline - time.time()) as progress:
            over, left_out = work_through(
                plan, kept, journal, known, processes, work, deadline, progress.report
            )
        kept = replace(kept, done=tuple(over), left_out=tuple(left_out))
        for found in (against_baseline(history, kept), fault_missed(kept)):
            if found:
                journal.keep(found, kept.seconds + time.time() - begun_at)
                kept = replace(kept, done=(*kept.done, found))
        kept = replace(kept, seconds=kept.seconds + time.time() - begun_at)
        if not kept.begun.fault:
            remember(history, kept)
        journal.close(left_out, kept.seconds)
        kept = read_night(folder)
        replace_file(folder / JUNIT, junit(kept))
        write_scene_pages(folder)
        page = write_night_page(folder)
        answer = _answer(kept, page)
        replace_file(folder / SUMMARY, answer.model_dump_json(indent=1).encode("utf-8"))
    index = write_dashboard(out_dir)
    if as_json:
        say(answer)
    else:
        _print(kept, answer, index)
    raise typer.Exit(0 if kept.green else 1)


def _answer(kept: "Kept", page: Path) -> "NightAnswer":
    from actin_xcheck.cli.output import FailedClaim, NightAnswer
    from actin_xcheck.nightly.groups import group_of

    verdicts = Counter(claim.verdict for claim in kept.claims)
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
        claims=dict(verdicts),
        failed=tuple(failing),
        troubles={done.name: done.trouble for done in kept.done if done.trouble},
        not_run={one.name: one.why for one in kept.left_out},
        checks={done.name: done.seconds for done in kept.done},
        commit=kept.begun.versions["commit"],
        machine=kept.begun.machine,
    )


def _print(kept: "Kept", answer: "NightAnswer", index: Path) -> None:
    from actin_xcheck.core.claim import excess

    if kept.begun.fault:
        print(f"deliberate fault: {kept.begun.fault}")
    for one in answer.failed:
        print(f"FAIL {one.scene} [{', '.join(one.methods)}]: {one.statement}: ", end="")
        print(f"{excess(one.value, one.bound)} ({one.note})")
    for name, trouble in answer.troubles.items():
        print(f"FAIL {name}: {trouble}")
    for left in kept.left_out:
        if left.seconds:  # it was begun
            print(f"NOT RUN {left.name}: {left.why}")
    holding, failing = answer.claims.get("PASS", 0), answer.claims.get("FAIL", 0)
    print(f"{holding} of {holding + failing} claims hold in {len(kept.done)} checks", end="")
    print(f", {len(answer.troubles)} checks broke down" if answer.troubles else "", end="")
    print(f", {len(kept.left_out)} not run" if kept.left_out else "", end="")
    print(f"; {kept.seconds / 60:.1f} min; report: {answer.page}; all nights: {index}")
