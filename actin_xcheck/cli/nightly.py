"""`nightly`: the verification suite within a budget, kept, judged, and drawn on the dashboard."""

import time
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from actin_xcheck.cli.conduct import Json, Quiet, command

if TYPE_CHECKING:
    from collections.abc import Sequence
    from contextlib import AbstractContextManager

    from actin_xcheck.cli.output import NightAnswer
    from actin_xcheck.nightly.items import Item
    from actin_xcheck.nightly.plan import Wish
    from actin_xcheck.nightly.record import Kept
    from actin_xcheck.runs.executor import Executor

SUMMARY, JUNIT = "summary.json", "junit.xml"


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
    quiet: Quiet = False,
) -> None:
    """Run the verification suite, keep its numbers, and draw the dashboard: index.html over all nights.

    Conservation, exact solutions, modes, reference values, FEM against FV, orders, negative controls, work
    and times: first what failed last, then what is cheapest.  Exit code 0 when all is green, 1 when not, 2
    for a mistake in what was asked.  A night with a deliberate fault is no part of the history.
    """
    from actin_xcheck.nightly.plan import Wish, suite
    from actin_xcheck.runs.executor import executor, jobs_asked

    patterns, again = tuple(only or ()), command()
    wish = Wish(out_dir, budget, fault or "", baseline or "", patterns, failed, resume, again)
    processes = executor(jobs_asked(jobs, scheduler), scheduler)
    raise typer.Exit(spend(wish, suite(), processes, scheduler is not None, as_json, quiet))


def spend(
    wish: "Wish",
    suite: "Sequence[Item]",
    processes: "AbstractContextManager[Executor]",
    away: bool = False,
    as_json: bool = False,
    quiet: bool = True,
    kernel: float | None = None,
    **how: Any,
) -> int:
    """Carry a night out, write all that is read of it, say what it came to, and return the exit code.

    Parameters
    ----------
    wish, suite : what is asked for, of what there is.
    processes, away : what has processes for its checks, once it is entered; whether they are a cluster's.
    kernel : seconds that the reference kernel takes; None: to be measured.
    how : see `carry_through`.
    """
    from actin_xcheck.cli.conduct import saying_the_cost
    from actin_xcheck.cli.output import Progress, say
    from actin_xcheck.core.files import replace_file
    from actin_xcheck.nightly.carry_out import carry_through
    from actin_xcheck.nightly.dashboard import junit, write_dashboard, write_night_page, write_scene_pages
    from actin_xcheck.nightly.plan import begun
    from actin_xcheck.runs.provenance import reference_kernel

    seconds = kernel or float(reference_kernel()[0])
    with processes as workers, begun(wish, suite, seconds) as tonight:
        left = tonight.deadline - time.time()
        with Progress(quiet, left) as progress:
            tell = saying_the_cost(progress, workers.workers, left)
            kept = carry_through(tonight, wish.history, workers, tell, away, **how)
        replace_file(kept.folder / JUNIT, junit(kept))
        write_scene_pages(kept.folder)
        answer = _answer(kept, write_night_page(kept.folder))
        replace_file(kept.folder / SUMMARY, answer.model_dump_json(indent=1).encode("utf-8"))
    index = write_dashboard(wish.reports)
    if as_json:
        say(answer)
    else:
        _print(kept, answer, index)
    return 0 if kept.green else 1


def _answer(kept: "Kept", page: Path) -> "NightAnswer":
    from actin_xcheck.cli.output import FailedClaim, NightAnswer
    from actin_xcheck.nightly.items import group_of

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
