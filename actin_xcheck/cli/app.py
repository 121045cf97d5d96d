"""The commands.  A user's mistake is one line on standard error and exit code 2; a failed claim or run, 1."""

import sys
from pathlib import Path
from typing import NoReturn

import numpy as np
import typer
from rich.table import Column, Table

from actin_xcheck.cli import predict
from actin_xcheck.cli.chart import chart_command
from actin_xcheck.cli.closures import closures_command
from actin_xcheck.cli.compare import compare_command
from actin_xcheck.cli.converge import converge_command
from actin_xcheck.cli.distort import distort_command
from actin_xcheck.cli.extremes import extremes_command
from actin_xcheck.cli.faults import faults_command
from actin_xcheck.cli.frontier import frontier_command
from actin_xcheck.cli.history import diff_command, history_command
from actin_xcheck.cli.nightly import nightly_command
from actin_xcheck.cli.options import print_table
from actin_xcheck.cli.output import Json, ReportAnswer, conclude
from actin_xcheck.cli.paper import paper_command
from actin_xcheck.cli.render import export_command, render_command
from actin_xcheck.cli.run import run_command
from actin_xcheck.cli.sweep import sweep_command
from actin_xcheck.core.errors import LONGEST, UserError, brief
from actin_xcheck.nightly.record import FILE_NAME as NIGHT_FILE
from actin_xcheck.report import (
    write_audit_page,
    write_chart_page,
    write_closures_page,
    write_convergence_page,
    write_distortion_page,
    write_extremes_page,
    write_faults_page,
    write_frontier_page,
    write_night_page,
    write_report,
    write_theory_page,
)
from actin_xcheck.scene.scene import load_scene, scene_text, shipped_scenes
from actin_xcheck.studies.audit.record import FILE_NAME as AUDIT_FILE
from actin_xcheck.studies.chart.record import FILE_NAME as CHART_FILE
from actin_xcheck.studies.closures.record import FILE_NAME as CLOSURES_FILE
from actin_xcheck.studies.compare import FILE_NAME as COMPARISON_FILE
from actin_xcheck.studies.converge.record import FILE_NAME as CONVERGENCE_FILE
from actin_xcheck.studies.distort.record import FILE_NAME as DISTORTION_FILE
from actin_xcheck.studies.extremes.record import FILE_NAME as EXTREMES_FILE
from actin_xcheck.studies.faults.record import FILE_NAME as FAULTS_FILE
from actin_xcheck.studies.frontier.record import FILE_NAME as FRONTIER_FILE
from actin_xcheck.studies.theory.predictions import FILE_NAME as PREDICTIONS_FILE

_PAGES = {
    AUDIT_FILE: write_audit_page,
    CHART_FILE: write_chart_page,
    CLOSURES_FILE: write_closures_page,
    COMPARISON_FILE: write_report,
    CONVERGENCE_FILE: write_convergence_page,
    DISTORTION_FILE: write_distortion_page,
    EXTREMES_FILE: write_extremes_page,
    FAULTS_FILE: write_faults_page,
    FRONTIER_FILE: write_frontier_page,
    NIGHT_FILE: write_night_page,
    PREDICTIONS_FILE: write_theory_page,
}
"""What writes the page of a report, by the file that a report of its kind is kept in."""

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="A verification laboratory for a moving-cell model: two codes and theory held against each other.",
)
scenes_app = typer.Typer(invoke_without_command=True, help="List the shipped scenes, or show one.")
app.add_typer(scenes_app, name="scenes")
app.add_typer(predict.app, name="predict")
app.command("compare")(compare_command)
app.command("run")(run_command)
app.command("paper")(paper_command)
app.command("converge")(converge_command)
app.command("chart")(chart_command)
app.command("sweep")(sweep_command)
app.command("render")(render_command)
app.command("export")(export_command)
app.command("frontier")(frontier_command)
app.command("closures")(closures_command)
app.command("distort")(distort_command)
app.command("faults")(faults_command)
app.command("extremes")(extremes_command)
app.command("history")(history_command)
app.command("diff")(diff_command)
app.command("nightly")(nightly_command)


@scenes_app.callback()
def scenes_command(context: typer.Context) -> None:
    """List the shipped scenes with what they are."""
    if context.invoked_subcommand is None:
        table = Table(Column("scene", no_wrap=True), "from", "model", box=None)
        for scene in map(load_scene, shipped_scenes()):
            parameters, physics = scene.parameters, scene.physics
            numbers = f"psi {parameters.psi:g}, p {parameters.p:g}"
            model = f"{numbers}, {physics.rheology}, {physics.closure}, delta {physics.delta}"
            table.add_row(scene.name, scene.citation, model)
        print_table(table)


@scenes_app.command("show")
def scenes_show(name: str) -> None:
    """Print a scene's TOML: the start of a scene of one's own."""
    sys.stdout.write(scene_text(name))


@app.command("report")
def report_command(folder: Path, json: Json = False) -> None:
    """Write the HTML report of a comparison, an audit, a study or predictions again, from its files alone."""
    found = [page for name, page in _PAGES.items() if (folder / name).exists()]
    if not found:
        raise UserError(f"{folder}: {_holds(folder)}; valid: a folder that holds {', '.join(_PAGES)}")
    try:
        with np.errstate(all="ignore"):
            page = found[0](folder)
    except (UserError, OSError):
        raise
    except Exception as error:  # its files may hold anything
        raise UserError(f"{folder}: cannot be drawn ({type(error).__name__}: {error})") from error
    conclude(ReportAnswer(command="report", page=str(page)), "", json)


def _holds(folder: Path) -> str:
    """What is there in place of a report."""
    if not folder.is_dir():
        return "a file, no folder" if folder.exists() else "no such folder"
    names = sorted(path.name for path in folder.iterdir())
    others = f" and {len(names) - 5} others" if len(names) > 5 else ""
    return f"holds no report but {', '.join(names[:5])}{others}" if names else "an empty folder"


def main() -> None:
    """Entry point: turn a user's mistake into one line and exit code 2."""
    try:
        sys.exit(app(standalone_mode=False))
    except UserError as error:
        _refuse(str(error))
    except OSError as error:  # a full disk, or a folder that cannot be written
        _refuse(f"{error.filename or 'cannot write'}: {error.strerror or error}")
    except (KeyboardInterrupt, typer.Abort) as end:
        if isinstance(end.__cause__, EOFError):  # typer's reading of it, which is for what asks questions
            raise end.__cause__ from None
        print("actin_xcheck: interrupted; what was finished is kept", file=sys.stderr)
        sys.exit(130)
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
