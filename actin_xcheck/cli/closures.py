"""`closures`: why `reference-normal` is the default reading of the moving rim."""

from pathlib import Path
from typing import Annotated

import typer

from actin_xcheck.cli.options import command, make_folder, report_folder
from actin_xcheck.cli.output import Json, ReportAnswer, conclude
from actin_xcheck.cli.progress import Progress
from actin_xcheck.core.errors import UserError
from actin_xcheck.runs.method import find_method
from actin_xcheck.studies.closures.examine import METHODS, examine, plan
from actin_xcheck.studies.closures.findings import reason
from actin_xcheck.studies.closures.page import write_closures_page


def closures_command(
    method: Annotated[list[str] | None, typer.Option(help="May be given more than once.")] = None,
    out_dir: Annotated[Path | None, typer.Option("--out", help="Folder for the results.")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress.")] = False,
    json: Json = False,
) -> None:
    """Show what current-normal and reference-normal do to ripples of the rim, and to mesh refinement.

    Growth by wave number against theory, on a rim that advances and one that retracts; then a rough cell that
    swells, on finer and finer meshes.  Runs that fail are what it is about: exit code 0, and 2 for a mistake
    in what was asked.  Given an interrupted report's folder, it goes on there.
    """
    methods = list(dict.fromkeys(method or METHODS))
    for name in methods:
        if find_method(name).driven_by:
            raise UserError(
                f"--method: {name} moves its rim as another method does; valid: {', '.join(METHODS)}"
            )
    folder = report_folder(out_dir, "closures")
    make_folder(folder)
    with Progress(quiet) as progress:
        found = examine(plan(methods), folder, command(), progress.report)
    page = write_closures_page(folder)
    conclude(ReportAnswer(command="closures", page=str(page), findings=(reason(found),)), "", json)
