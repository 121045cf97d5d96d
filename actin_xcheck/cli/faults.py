"""`faults`: deliberate faults, each of which the harness must catch."""

from pathlib import Path
from typing import Annotated

import typer

from actin_xcheck.cli.options import Force, Quiet, command, report_folder, report_in
from actin_xcheck.cli.output import Json, ReportAnswer, conclude
from actin_xcheck.cli.progress import Progress
from actin_xcheck.report import write_faults_page
from actin_xcheck.studies.faults.catalogue import find_faults
from actin_xcheck.studies.faults.hunt import hunt
from actin_xcheck.studies.faults.record import FILE_NAME, write_hunt


def faults_command(
    only: Annotated[
        list[str] | None, typer.Option(help="The name of a fault; may be given more than once.")
    ] = None,
    out_dir: Annotated[Path | None, typer.Option("--out", help="Folder for the results.")] = None,
    force: Force = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Switch deliberate faults on one by one and see that the harness turns red for each.

    Dilution dropped, signs turned, geometry stale, tolerances loose: about sixty faults, on small scenes all
    of whose claims hold without one (about five minutes).  Exit code 0 when all is green without a fault and
    every fault is caught, 1 when not, 2 for a mistake in what was asked.
    """
    faults = find_faults(only)
    folder = report_folder(out_dir, "faults")
    with report_in(folder, FILE_NAME, "a hunt for faults", force):
        with Progress(quiet) as progress:
            found = hunt(faults, progress.report)
        write_hunt(folder / FILE_NAME, found, command())
        page = write_faults_page(folder)
    said = [
        f"FAIL without a fault: {clean.check.name}: {claim.statement}: "
        f"{claim.value:.3g} > {claim.bound:.3g} ({claim.note})"
        for clean in found.clean
        for claim in clean.red
    ]
    for missed in (one for one in found.found if not one.caught):
        why = missed.trouble or f"{len(missed.passed)} checks stayed green"
        said.append(f"NOT CAUGHT {missed.fault.name}: {missed.fault.sentence} ({why})")
    caught = sum(one.caught for one in found.found)
    verdicts = {"caught": caught, "not caught": len(found.found) - caught}
    answer = ReportAnswer(command="faults", page=str(page), verdicts=verdicts, findings=tuple(said))
    conclude(answer, f"{caught} of {len(found.found)} faults caught", json)
    raise typer.Exit(0 if found.holds else 1)
