"""`sweep`: thousands of runs over ranges, on this machine or on a cluster."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from actin_xcheck.cli.options import Json, command
from actin_xcheck.core.choices import Fidelity

if TYPE_CHECKING:
    from actin_xcheck.cli.output import SweepAnswer
    from actin_xcheck.studies.sweep.study import SweepTable


def sweep_command(
    file: Annotated[Path, typer.Argument(help="A TOML file of ranges over a scene, or of scenes.")],
    method: Annotated[list[str], typer.Option(help="May be given more than once.")],
    out_dir: Annotated[
        Path | None, typer.Option("--out", help="Folder for the results; one that is there goes on.")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(help="Processes on this machine; default: its cores.", min=1, max=1024)
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            help="Address of a dask.distributed scheduler, in place of --jobs; its workers share the folder."
        ),
    ] = None,
    refine: Annotated[int | None, typer.Option(help="The mesh has 2**REFINE layers.", min=1, max=10)] = None,
    dt: Annotated[float | None, typer.Option(help="Largest time step.", min=1e-12)] = None,
    rtol: Annotated[
        float | None, typer.Option(help="Let adaptive methods choose steps with this local error.", min=1e-13)
    ] = None,
    fidelity: Annotated[
        Fidelity, typer.Option(help="How much of the model is solved; auto: what each scene needs.")
    ] = Fidelity.AUTO,
    json: Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress.")] = False,
) -> None:
    """Run a scene over ranges of its keys, or many scenes, each run a file of its own, and make one table.

    Files are named by scene, method and version: what is there is not run again, so that an interrupted sweep
    goes on when it is asked for again, and so does a larger one in the same folder.  A run that fails is a
    row like any other.  Exit code 0 when every run completed, 1 when one did not, 2 for a mistake in what was
    asked.
    """
    from actin_xcheck.cli.conduct import saying_the_cost
    from actin_xcheck.cli.progress import Progress
    from actin_xcheck.core.files import make_folder, report_folder
    from actin_xcheck.runs.executor import jobs_asked
    from actin_xcheck.runs.numerics import Wanted
    from actin_xcheck.studies.sweep.study import carry_out, runs_of

    processes = jobs_asked(jobs, scheduler)
    asked = Wanted(method[0], refine, dt, rtol, fidelity)
    folder = report_folder(out_dir, "sweep")
    runs = runs_of(file, method, asked, command())
    make_folder(folder)
    with Progress(quiet) as progress:
        tell = saying_the_cost(progress, processes)
        table, made = carry_out(runs, folder, processes, scheduler, tell, command())
    raise typer.Exit(_told(_answer(table, made), json))


def _told(answer: "SweepAnswer", json: bool) -> int:
    """Say what a sweep has made, and return the exit code."""
    from actin_xcheck.cli.output import say
    from actin_xcheck.core.outcome import Ending

    if json:
        say(answer)
    else:
        endings = ", ".join(f"{count} {ending}" for ending, count in answer.outcomes.items())
        print(f"{answer.runs} runs, {answer.made} of them made now: {endings}; table: {answer.table}")
    return 0 if set(answer.outcomes) <= {Ending.COMPLETED} else 1


def _answer(table: "SweepTable", made: int) -> "SweepAnswer":
    from actin_xcheck.cli.output import SweepAnswer
    from actin_xcheck.studies.sweep.study import CSV_NAME

    outcomes = Counter(table["outcome"].tolist())
    return SweepAnswer(
        folder=str(table.folder),
        table=str(table.folder / CSV_NAME),
        runs=len(table),
        made=made,
        outcomes=dict(outcomes.most_common()),
    )
