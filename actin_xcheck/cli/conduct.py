"""How every study is commanded: one set of options, one rule for folders, one way to say what came out."""

import inspect
import math
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from actin_xcheck.cli.options import Force, Json, Quiet, command

if TYPE_CHECKING:
    from actin_xcheck.cli.progress import Progress
    from actin_xcheck.studies.study import Report, Study, Tell

Scenes = Annotated[list[str] | None, typer.Argument(metavar="[SCENE]...", show_default=False)]
Methods = Annotated[list[str] | None, typer.Option("--method", help="May be given more than once.")]
Only = Annotated[list[str] | None, typer.Option(help="May be given more than once.")]
Out = Annotated[
    Path | None, typer.Option("--out", help="Folder for the results; goes on with what lies there.")
]
Jobs = Annotated[
    int | None, typer.Option(help="Processes on this machine; default: its cores.", min=1, show_default=False)
]
Scheduler = Annotated[
    str | None, typer.Option(help="Address of a dask.distributed scheduler whose workers are to be used.")
]
Open = Annotated[bool, typer.Option("--open", help="Open the page in a browser.")]


def study_command(name: str, words: str = "") -> Callable[[Callable[..., "Study"]], Callable[..., None]]:
    """Make a command of a function that returns a study: its own parameters, then those of all studies.

    `words` are what the user types where that is not the study's name.
    """

    def decorate(asked_for: Callable[..., "Study"]) -> Callable[..., None]:
        def commanded(
            out_dir: Out = None,
            force: Force = False,
            jobs: Jobs = None,
            scheduler: Scheduler = None,
            open_page: Open = False,
            quiet: Quiet = False,
            json: Json = False,
            **asked: Any,
        ) -> None:
            from actin_xcheck.core.files import report_folder
            from actin_xcheck.runs.executor import jobs_asked

            study = asked_for(**asked)  # a mistake makes no folder
            jobs_asked(jobs, scheduler)
            folder = report_folder(out_dir, name)
            report, page = carry_out(name, study, folder, force, jobs, scheduler, quiet)
            if open_page:
                import webbrowser

                webbrowser.open(page.resolve().as_uri())
            _say(words or name, report, page, json)

        own, common = inspect.signature(asked_for).parameters, inspect.signature(commanded).parameters
        shared = [one for one in common.values() if one.kind is not inspect.Parameter.VAR_KEYWORD]
        parameters = [*own.values(), *shared]
        commanded.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        commanded.__annotations__ = {one.name: one.annotation for one in parameters}
        commanded.__name__, commanded.__doc__ = asked_for.__name__, asked_for.__doc__
        return commanded

    return decorate


def carry_out(
    name: str,
    study: "Study",
    folder: Path,
    force: bool,
    jobs: int | None,
    scheduler: str | None,
    quiet: bool,
) -> tuple["Report", Path]:
    """Carry a study out in a folder and return its report and its page; with `force`, begin anew."""
    from actin_xcheck.cli.progress import Progress
    from actin_xcheck.core.files import make_folder
    from actin_xcheck.runs.executor import executor, jobs_asked
    from actin_xcheck.studies import study as studies

    wanted = jobs_asked(jobs, scheduler)
    with studies.at_work(make_folder(folder), force), Progress(quiet) as progress:
        with executor(wanted, scheduler) as processes:
            tell = saying_the_cost(progress, processes.workers)
            report = studies.carry_out(name, study, folder, command(), processes, tell)
        return report, page_of(folder / f"{name}.h5")


def saying_the_cost(progress: "Progress", workers: int, most: float = math.inf) -> "Tell":
    """Tell progress, and first of all what is to come: what is asked for first, shared by so many workers, or
    all the seconds there are.
    """
    said = False

    def tell(label: str, over: float, whole: float) -> None:
        nonlocal said
        if not said and whole > over:
            progress.say(f"{label}: about {lasting(min((whole - over) / workers, most))}")
        said = True
        progress.report(label, over, whole)

    return tell


def lasting(seconds: float) -> str:
    """An estimate of a time in words: "40 s" or "5 min"."""
    return f"{max(seconds, 1):.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


def page_of(file: Path) -> Path:
    """Write the page of a study from its file and return its path: most have the same."""
    if file.name == "paper.h5":  # each loads what its study is made of
        from actin_xcheck.studies.audit.study import write_audit_page as write
    elif file.name == "compare.h5":
        from actin_xcheck.studies.compare_page import write_comparison_page as write
    else:
        from actin_xcheck.studies.page import write_page as write
    return write(file)


def _say(words: str, report: "Report", page: Path, json: bool) -> None:
    """Say what a study came to; exit code 1 where a claim fails."""
    from actin_xcheck.cli.output import ReportAnswer, conclude

    failed = [claim for claim in report.claims if claim.judged and not claim.holds]
    said = [f"FAIL {claim.sentence}" for claim in failed]
    verdicts = dict(report.verdicts or Counter(claim.verdict for claim in report.claims))
    findings = (*said, *report.findings)
    answer = ReportAnswer.model_validate(
        {
            "command": words,
            "page": str(page),
            "verdicts": verdicts,
            "findings": findings,
            "known_to_percent": report.known,
        }
    )
    conclude(answer, report.title, json)
    raise typer.Exit(1 if failed else 0)
