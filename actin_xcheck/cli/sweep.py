"""The command of a sweep, whose answers are files: it has options of its own."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from actin_xcheck.cli.conduct import (
    Accuracy,
    DryRun,
    Dt,
    Force,
    Jobs,
    Json,
    Open,
    Out,
    Quiet,
    Refine,
    Rtol,
    Scheduler,
    command,
    each,
    method_word,
)
from actin_xcheck.core.parameters import Fidelity

if TYPE_CHECKING:
    from actin_xcheck.cli.output import SweepAnswer
    from actin_xcheck.studies.sweep import SweepTable


def sweep_command(
    file: Annotated[Path, typer.Argument(help="A TOML file of ranges over a scene, or of scenes.")],
    method: Annotated[
        list[str], typer.Option(help="May be given more than once.", callback=each(method_word))
    ],
    out_dir: Out = None,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    refine: Refine = None,
    dt: Dt = None,
    rtol: Rtol = None,
    accuracy: Accuracy = None,
    fidelity: Annotated[
        Fidelity, typer.Option(help="How much of the model is solved; auto: what each scene needs.")
    ] = Fidelity.AUTO,
    force: Force = False,
    open_page: Open = False,
    dry_run: DryRun = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Run a scene over ranges of its keys, or many scenes, each run a file of its own, and make one table.

    Files are named by what was varied, scene, method and version: what is there is not run again, so that an
    interrupted sweep goes on when it is asked for again, and so does a larger one in the same folder; --force
    runs all again.  A run that fails is a row like any other.  Exit code 0 when every run completed, 1 when
    one did not, 2 for a mistake in what was asked.
    """
    from actin_xcheck.cli.conduct import check_step, kept_in, say_the_cost, saying_the_cost, shown
    from actin_xcheck.cli.output import Progress
    from actin_xcheck.core.files import make_folder, report_folder
    from actin_xcheck.runs.executor import jobs_asked
    from actin_xcheck.runs.numerics import Wanted
    from actin_xcheck.studies.sweep import carry_out, runs_of
    from actin_xcheck.studies.sweep import sweep as study

    check_step(dt)
    processes = jobs_asked(jobs, scheduler)
    asked = Wanted(method[0], refine, dt, rtol, fidelity, accuracy=accuracy)
    folder = report_folder(out_dir, "sweep")
    runs = runs_of(file, method, asked, command())
    if dry_run:
        say_the_cost("sweep", study(runs, [run.task for _, run in runs]), processes, json)
    make_folder(folder)
    with Progress(quiet) as progress, kept_in(folder):
        tell = saying_the_cost(progress, processes)
        with shown(folder / "index.html", tell, open_page) as told:
            table, made = carry_out(runs, folder, processes, scheduler, told, command(), force)
    raise typer.Exit(_told(_answer(table, made), json))


def _told(answer: "SweepAnswer", json: bool) -> int:
    """Say what a sweep has made, and return the exit code."""
    from actin_xcheck.cli.output import say
    from actin_xcheck.core.errors import Ending

    if json:
        say(answer)
    else:
        endings = ", ".join(f"{count} {ending}" for ending, count in answer.outcomes.items())
        made = f"{answer.runs} runs, {answer.made} of them made now: {endings}"
        print(f"{made}; table: {answer.table}; report: {answer.page}")
    return 0 if set(answer.outcomes) <= {Ending.COMPLETED} else 1


def _answer(table: "SweepTable", made: int) -> "SweepAnswer":
    from actin_xcheck.cli.output import SweepAnswer
    from actin_xcheck.studies.sweep import CSV_NAME

    outcomes = dict(Counter(table["outcome"].tolist()).most_common())
    folder, runs = table.folder, len(table)
    table_in, page = str(folder / CSV_NAME), str(folder / "index.html")
    return SweepAnswer(folder=str(folder), table=table_in, page=page, runs=runs, made=made, outcomes=outcomes)
