"""`extremes`: scenes that break the model or the mesh, carried through or ended with time and place."""

from pathlib import Path
from typing import Annotated

import typer

from actin_xcheck.cli.options import Force, Quiet, command, report_folder, report_in
from actin_xcheck.cli.output import Json, ReportAnswer, conclude
from actin_xcheck.cli.progress import Progress
from actin_xcheck.core.errors import UserError
from actin_xcheck.report import write_extremes_page
from actin_xcheck.studies.extremes.breakdown import agreement
from actin_xcheck.studies.extremes.examine import examine
from actin_xcheck.studies.extremes.plan import tasks
from actin_xcheck.studies.extremes.record import FILE_NAME


def extremes_command(
    only: Annotated[
        list[str] | None, typer.Option(help="A scene of the study; may be given more than once.")
    ] = None,
    out_dir: Annotated[Path | None, typer.Option("--out", help="Folder for the results.")] = None,
    force: Force = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Run the article's strongest contractions and Section 6 in both rheologies, and say how they end.

    When 1 + div u reaches zero the model has ended: its time is found by two kinds of elements on three
    meshes each, by finite volumes too for Fig. 18.  Where the mesh is about to fold the run is shown with and
    without remeshing.  The scene in which the article's algorithm fails is run beside a perturbed twin.
    About six minutes.  Exit code 0 when it is done, whatever ended; 2 for a mistake in what was asked.
    """
    every = tasks()
    known = sorted({task.scene for task in every})
    for name in only or ():
        if name not in known:
            raise UserError(f"--only: {name!r} is not in the study; valid: {', '.join(known)}")
    chosen = [task for task in every if not only or task.scene in only]
    folder = report_folder(out_dir, "extremes")
    with report_in(folder, FILE_NAME, "a study of extremes", force):
        with Progress(quiet) as progress:
            _, found = examine(chosen, folder, command(), progress.report)
        page = write_extremes_page(folder)
    findings = [
        f"{one.scene}, {one.method}: 1 + div u = 0 at t = {one.value:.6g} +- {one.uncertainty:.1g}"
        for one in found
    ]
    findings += [
        f"{scene}: methods differ by {apart:.1e}, their uncertainties allow {allowed:.1e}"
        for scene, (apart, allowed) in agreement(found).items()
    ]
    conclude(ReportAnswer(command="extremes", page=str(page), findings=tuple(findings)), "", json)
