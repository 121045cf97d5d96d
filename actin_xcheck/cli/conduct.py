"""How every study is commanded: one set of options, one rule for folders, one way to say what came out.

The modules of commands import what help needs, and a command the rest when it is called: help and a mistake
in a word are there at once.
"""

import inspect
import math
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.parameters import CAVEATS, IN_UNITS, far_from_the_article

if TYPE_CHECKING:
    from actin_xcheck.cli.output import Progress
    from actin_xcheck.studies.study import Report, Study, Tell


def scene_word(given: str) -> str:
    """A word for a scene; of a shipped one the beginning is enough where no other begins so."""
    from actin_xcheck.scene.shelf import shipped_scenes

    return whole_word(given, shipped_scenes(), "scene")


def method_word(given: str) -> str:
    """A word for a method, likewise; of those of other packages nothing is known here."""
    from actin_xcheck.runs.method import METHODS

    return whole_word(given, METHODS, "method") if given != "fem" else given


def whole_word(given: str, valid: Iterable[str], kind: str) -> str:
    """The one that begins as is given; what is given where none does.  UserError where several do."""
    every = list(valid)
    found = [one for one in every if given and one.startswith(given)]
    if given in every or not found:
        return given
    if len(found) > 1:
        raise UserError(f"{kind} {given!r} begins more than one name; valid: {', '.join(found)}")
    return found[0]


def each(word: Callable[[str], str]) -> Callable[[list[str] | None], list[str] | None]:
    """The same of a list."""
    return lambda given: given and [word(one) for one in given]


SceneWord = Annotated[
    str,
    typer.Argument(help="A shipped name or its beginning, or the path of a TOML file.", callback=scene_word),
]
Scenes = Annotated[
    list[str] | None,
    typer.Argument(metavar="[SCENE]...", show_default=False, callback=each(scene_word)),
]
Methods = Annotated[
    list[str] | None,
    typer.Option("--method", help="May be given more than once.", callback=each(method_word)),
]
Only = Annotated[list[str] | None, typer.Option(help="May be given more than once.")]
Listed = Annotated[bool, typer.Option("--list", help="Print what --only takes, and end.")]
Out = Annotated[
    Path | None, typer.Option("--out", help="Folder for the results; goes on with what lies there.")
]
Jobs = Annotated[
    int | None, typer.Option(help="Processes on this machine; default: its cores.", min=1, show_default=False)
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        help="Address of a dask.distributed scheduler whose workers, in place of --jobs, share the folder."
    ),
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Say what is asked for first and what it costs.")]
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
            dry_run: DryRun = False,
            quiet: Quiet = False,
            json: Json = False,
            **asked: Any,
        ) -> None:
            from actin_xcheck.core.files import report_folder
            from actin_xcheck.runs.executor import jobs_asked

            study = asked_for(**asked)  # a mistake makes no folder
            wanted = jobs_asked(jobs, scheduler)
            if dry_run:
                say_the_cost(words or name, study, wanted, json)
            folder = report_folder(out_dir, name)
            report, page = carry_out(name, study, folder, force, jobs, scheduler, quiet, open_page)
            _say(words or name, report, page, json)

        own, common = inspect.signature(asked_for).parameters, inspect.signature(commanded).parameters
        shared = [one for one in common.values() if one.kind is not inspect.Parameter.VAR_KEYWORD]
        return as_command(commanded, asked_for, [*own.values(), *shared])

    return decorate


def as_command(
    function: Callable[..., Any], of: Callable[..., Any], parameters: Sequence[inspect.Parameter]
) -> Callable[..., Any]:
    """Return a function with the name and the words of another, which is asked for these parameters."""
    function.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    function.__annotations__ = {one.name: one.annotation for one in parameters}
    function.__name__, function.__doc__ = of.__name__, of.__doc__
    return function


def carry_out(
    name: str,
    study: "Study",
    folder: Path,
    force: bool,
    jobs: int | None,
    scheduler: str | None,
    quiet: bool,
    open_page: bool = False,
) -> tuple["Report", Path]:
    """Carry a study out in a folder and return its report and its page; with `force`, begin anew."""
    from actin_xcheck.cli.output import Progress
    from actin_xcheck.core.files import make_folder
    from actin_xcheck.runs.executor import executor, jobs_asked
    from actin_xcheck.studies import study as studies

    wanted = jobs_asked(jobs, scheduler)
    with (
        studies.at_work(make_folder(folder), force),
        Progress(quiet) as progress,
        kept_in(folder),
        executor(wanted, scheduler) as processes,
        shown(folder / "index.html", saying_the_cost(progress, processes.workers), open_page) as tell,
    ):
        report = studies.carry_out(name, study, folder, command(), processes, tell)
        return report, page_of(folder / f"{name}.h5")


@contextmanager
def shown(page: Path, tell: "Tell", wanted: bool = True) -> Iterator["Tell"]:
    """Open a page in a browser, where that is wanted: as soon as progress is told and it is there, which is
    while the work goes on, else at the end.
    """
    waiting = wanted

    def told(label: str, over: float, whole: float) -> None:
        nonlocal waiting
        tell(label, over, whole)
        if waiting and page.exists():
            waiting = False
            opened(page)

    yield told
    opened(page, waiting)


def opened(page: Path | str, wanted: bool = True) -> None:
    """Open a page in a browser, where that is wanted."""
    if wanted:
        import webbrowser

        webbrowser.open(Path(page).resolve().as_uri())


def say_the_cost(words: str, study: "Study", workers: int | None, json: bool) -> NoReturn:
    """Say what a study asks for first, and about how long that takes; what it asks next depends on it."""
    import os

    tasks = next(study)
    count = workers or os.cpu_count() or 1
    seconds = sum(one.seconds for one in tasks) / max(min(count, len(tasks)), 1)
    seconds += float(getattr(tasks, "later", 0.0)) / count
    many = f"{len(tasks)} tasks" if len(tasks) != 1 else "1 task"
    say_seconds(words, len(tasks), f"{many} at first", seconds, f"{count} processes", json)


def say_seconds(words: str, tasks: int, what: str, seconds: float, by: str, json: bool) -> NoReturn:
    """Say what so many tasks are, and about how long they take, and end."""
    from actin_xcheck.cli.output import CostAnswer, say

    if json:
        say(CostAnswer(command=words, tasks=tasks, seconds=seconds))
    else:
        print(f"{words}: {what}, about {lasting(seconds)} on {by}; nothing was run")
    raise typer.Exit(0)


def print_names(names: Iterable[str]) -> NoReturn:
    """Print what an option takes, one a line, and end."""
    print("\n".join(names))
    raise typer.Exit(0)


@contextmanager
def kept_in(folder: Path, again: str = "") -> Iterator[None]:
    """Have whatever ends the work within it say where what is finished lies, and what goes on with it."""
    try:
        yield
    except BaseException as end:
        end.add_note(f" in {folder}; {again or f'the same command with --out {folder}'} goes on")
        raise


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


def of_two(file: Path) -> bool:
    """Whether a report of `compare` lays two runs or reports side by side."""
    from actin_xcheck.runs.store import reading

    with reading(file, "report of a study") as stored:
        return "differs" in stored["tables"]


def page_of(file: Path) -> Path:
    """Write the page of a study from its file and return its path: most have the same."""
    if file.name == "paper.h5":  # each loads what its study is made of
        from actin_xcheck.studies.audit import write_audit_page as write
    elif file.name == "compare.h5" and not of_two(file):
        from actin_xcheck.studies.compare_page import write_comparison_page as write
    else:
        from actin_xcheck.report.page import write_page as write
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
            "values": [one.stated for one in report.values],
        }
    )
    conclude(answer, report.title, json)
    raise typer.Exit(1 if failed else 0)


if TYPE_CHECKING:
    from rich.table import Table

    from actin_xcheck.scene.scene import Scene

Refine = Annotated[
    int | None, typer.Option(help="The mesh has 2**REFINE layers (5: 2113 nodes).", min=1, max=10)
]
Dt = Annotated[float | None, typer.Option(help="Largest time step.")]
Accuracy = Annotated[
    float | None, typer.Option(help="Largest error of area, actin and probes; chooses mesh and steps.")
]
Rtol = Annotated[
    float | None, typer.Option(help="Let adaptive methods choose steps with this local error.", min=1e-13)
]
Seed = Annotated[int | None, typer.Option(help="Of the draws; default: the date, as 20261130.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite an existing output.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as one JSON object on one line.")]

_WHOLE = 10_000
"""Characters of the longest line that a table may have where nobody looks at it."""


def print_table(table: "Table") -> None:
    """Print a table as wide as a terminal, and in whole lines where there is none."""
    from rich.console import Console

    Console(highlight=False, width=None if sys.stdout.isatty() else _WHOLE).print(table)


def command() -> str:
    """The command this process was started with, to be typed again."""
    from actin_xcheck.runs.numerics import typed

    return typed(sys.argv[1:])


def resuming_command() -> str:
    """The one that goes on with what this process has begun."""
    from actin_xcheck.runs.numerics import typed

    words = [word for word in sys.argv[1:] if word not in ("--force", "--resume")]
    return typed([*words, "--resume"])


def warn_of(scene: "Scene") -> None:
    """Say on standard error what a user must know before believing the scene's results."""
    if caveat := CAVEATS.get(scene.physics.closure):
        print(f"warning: {scene.name}: {caveat}", file=sys.stderr)
    if scene.dimensional:
        groups = ", ".join(f"{name} = {value:.4g}" for name, value in asdict(scene.parameters).items())
        print(f"{scene.name}: [dimensional] makes {groups} (3.1); {scene.scales}", file=sys.stderr)
        for sentence in far_from_the_article(scene.parameters):
            print(f"warning: {scene.name}: {sentence}; {IN_UNITS}", file=sys.stderr)


def check_step(dt: float | None) -> None:
    """Refuse what is no time step."""
    if dt is not None and not 0 < dt < math.inf:
        raise UserError(f"--dt: {dt:g} is not a time step; valid: a number > 0")
