"""The commands.  A user's mistake is one line on standard error and exit code 2; a failed claim or run, 1."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import copy
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Annotated, NoReturn

import typer

from actin_xcheck.cli import predict, studies
from actin_xcheck.cli.conduct import Json, page_of, print_table, scene_word
from actin_xcheck.cli.nightly import diff_command, history_command, nightly_command
from actin_xcheck.cli.run import export_command, render_command, run_command
from actin_xcheck.cli.sweep import sweep_command
from actin_xcheck.core.errors import LONGEST, UserError, brief
from actin_xcheck.runs.processes import end_all, ending_signals

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="A verification laboratory for a moving-cell model: two codes and theory held against each other.",
)
scenes_app = typer.Typer(invoke_without_command=True, help="List the shipped scenes, or show one.")
app.add_typer(scenes_app, name="scenes")
app.add_typer(predict.app, name="predict")
app.command("compare")(studies.compare)
app.command("run")(run_command)
app.command("judge")(studies.judge)
app.command("paper")(studies.paper)
app.command("converge")(studies.converge)
app.command("chart")(studies.chart)
app.command("sweep")(sweep_command)
app.command("render")(render_command)
app.command("export")(export_command)
app.command("frontier")(studies.frontier)
app.command("closures")(studies.closures)
app.command("distort")(studies.distort)
app.command("faults")(studies.faults)
app.command("extremes")(studies.extremes)
app.command("random")(studies.random)
app.command("coverage")(studies.coverage)
app.command("history")(history_command)
app.command("diff")(diff_command)
app.command("nightly")(nightly_command)


def _version(asked: bool) -> None:
    if asked:
        from actin_xcheck import __version__

        print(f"actin_xcheck {__version__}")
        raise typer.Exit(0)


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """A verification laboratory for a moving-cell model: two codes and theory held against each other."""


@scenes_app.callback()
def scenes_command(
    context: typer.Context,
    match: Annotated[str, typer.Option(help="Those alone in whose line this word stands.")] = "",
    json: Json = False,
) -> None:
    """List the shipped scenes with what they are: those of the article, then others."""
    if context.invoked_subcommand is not None:
        return
    from actin_xcheck.scene.shelf import listed, shipped_scenes

    found = [listed(name) for name in shipped_scenes()]
    found = [one for one in found if match.lower() in " ".join(one).lower()]
    if json:
        from actin_xcheck.cli.output import ListedScene, ScenesAnswer, say

        say(ScenesAnswer(scenes=tuple(ListedScene(**one._asdict()) for one in found)))
        return
    from rich.table import Column, Table

    table = Table(Column("scene", no_wrap=True), "from", "model", box=None)
    for of_the_article in (True, False):
        group = [one for one in found if one.citation.startswith("Verification") is not of_the_article]
        for one in group:
            table.add_row(*one, end_section=one is group[-1])
    print_table(table)


@scenes_app.command("show")
def scenes_show(name: Annotated[str, typer.Argument(callback=scene_word)]) -> None:
    """Print a scene's TOML: the start of a scene of one's own."""
    from actin_xcheck.scene.shelf import scene_text

    sys.stdout.write(scene_text(name))


@app.command("report")
def report_command(folder: Path, json: Json = False) -> None:
    """Write the HTML report of a comparison, an audit, a study or predictions again, from its files alone."""
    import numpy as np

    from actin_xcheck.cli.output import ReportAnswer, conclude
    from actin_xcheck.studies.study import study_file

    file, pages = study_file(folder), _pages()
    found = [page for name, page in pages.items() if (folder / name).exists()]
    if not file and not found:
        raise UserError(f"{folder}: {_holds(folder)}; valid: the folder of a command that writes a report")
    try:
        with np.errstate(all="ignore"):
            page = page_of(file) if file else found[0](folder)
    except (UserError, OSError):
        raise
    except Exception as error:  # its files may hold anything
        raise UserError(f"{folder}: cannot be drawn ({type(error).__name__}: {error})") from error
    conclude(ReportAnswer(command="report", page=str(page)), "", json)


def _pages() -> dict[str, Callable[[Path], Path]]:
    """What writes the page of a report that is no study, by the file that it is kept in."""
    from actin_xcheck.nightly.dashboard import write_night_page
    from actin_xcheck.nightly.record import FILE_NAME as NIGHT_FILE

    return {
        "comparison.h5": partial(_earlier, "comparison.h5"),
        "chart.h5": partial(_earlier, "chart.h5"),
        NIGHT_FILE: write_night_page,
    }


def _earlier(name: str, folder: Path) -> Path:
    """UserError: what made it makes it again, as it is kept now."""
    from actin_xcheck.runs.store import reading

    with reading(file := folder / name, "report") as stored:
        command = stored.attrs.get("command", "the command that made it")
    raise UserError(f"{file}: of an earlier version; valid: {command}, with --force or into another folder")


def _holds(folder: Path) -> str:
    """What is there in place of a report."""
    if not folder.is_dir():
        return "a file, no folder" if folder.exists() else "no such folder"
    names = sorted(path.name for path in folder.iterdir())
    others = f" and {len(names) - 5} others" if len(names) > 5 else ""
    return f"holds no report but {', '.join(names[:5])}{others}" if names else "an empty folder"


class _Ended(BaseException):
    """A signal has come that asks to end; not an Exception, so that nothing takes it for one of its own."""

    def __init__(self, number: int) -> None:
        self.number = signal.Signals(number)


@contextmanager
def _ending() -> Iterator[None]:
    """Within it `ending_signals` raise _Ended, and behind it no process that was started is left."""

    def end(number: int, frame: FrameType | None) -> NoReturn:
        raise _Ended(number)

    before = {number: signal.signal(number, end) for number in ending_signals()}
    try:
        yield
    finally:
        end_all()
        for number, handler in before.items():
            signal.signal(number, handler)


def _asked_for() -> typer.Typer:
    """The command that the first word names, alone: others take time to be made.  All, if it names none."""
    named = [one for one in app.registered_commands if [one.name] == sys.argv[1:2]]
    asked = copy(app)
    if named:
        asked.registered_commands, asked.registered_groups = named, []
    return asked


def main() -> None:
    """Entry point: turn a user's mistake into one line and exit code 2, and leave no process behind."""
    try:
        with _ending():
            sys.exit(_asked_for()(standalone_mode=False))
    except UserError as error:
        _refuse(str(error))
    except OSError as error:  # a full disk, or a folder that cannot be written
        _refuse(f"{error.filename or 'cannot write'}: {error.strerror or error}")
    except MemoryError as error:
        _refuse(f"the system has no more memory ({error or 'no more is known'}); what was finished is kept")
    except _Ended as end:
        said = "interrupted" if end.number == signal.SIGINT else f"ended by {end.number.name}"
        where = "".join(getattr(end, "__notes__", ()))
        print(f"actin_xcheck: {said}; what was finished is kept{where}", file=sys.stderr)
        sys.exit(128 + end.number)
    except typer.Abort as end:  # typer's reading of the end of a file, which is for what asks questions
        raise (end.__cause__ or end) from None
    except Exception as error:
        if (message := getattr(error, "format_message", None)) is None:
            raise
        # Typer's own, of a class it does not export; without a command it is the help
        if not sys.argv[1:] or type(error).__name__ == "NoArgsIsHelpError":
            print(message(), file=sys.stderr)
            sys.exit(2)
        _refuse(f"{message()} (--help says what is valid)")


def _refuse(mistake: str) -> NoReturn:
    print(f"actin_xcheck: {brief(mistake, LONGEST)}", file=sys.stderr)
    sys.exit(2)
