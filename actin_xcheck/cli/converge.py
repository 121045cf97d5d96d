"""`converge`: observed orders, study by study."""

import math
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from actin_xcheck.cli.options import Json, command

DEFAULT_SCENES = {
    "static-decay": 2,
    "growing-disk": 3,
    "stirred": 2,
    "stirred-static": 2,
    "manufactured-moving": 4,
    "manufactured-static": 4,
    "fitted-ring": 3,
    "fitted-ring-elastic": 2,
    "smooth-fronts": 1,
    "mode-0-cell": 2,
    "fig14-four-fronts": 1,
}
"""Scenes and the highest order of their elements: above it nothing is claimed, or one level takes minutes."""

EXHIBITED = "manufactured-moving"
"""Where the exhibits of what stalls are shown unless they are asked for."""


def converge_command(
    scenes: Annotated[list[str] | None, typer.Argument(metavar="[SCENE]...", show_default=False)] = None,
    method: Annotated[list[str] | None, typer.Option(help="May be given more than once.")] = None,
    out_dir: Annotated[Path | None, typer.Option("--out", help="Folder for the results.")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress.")] = False,
    json: Json = False,
) -> None:
    """Refine h and dt, read the observed orders off and hold them against those the methods declare.

    SCENE is a shipped name or the path of a TOML file; default: exact and manufactured solutions, the coupled
    model from smooth data, a mode of the cell and Fig. 14, with the methods that move their own nodes, as far
    as their orders say something there, and the one that stalls.  Scenes that are named are studied with all
    of these.  Given an interrupted report's folder, it goes on there.  Exit code 0 when no claim
    fails, 1 when one does, 2 for a mistake in what was asked.
    """
    from actin_xcheck.cli.output import ReportAnswer, conclude
    from actin_xcheck.cli.progress import Progress
    from actin_xcheck.core.errors import UserError
    from actin_xcheck.runs.method import find_method
    from actin_xcheck.scene.scene import load_scene
    from actin_xcheck.studies.converge.examine import examine
    from actin_xcheck.studies.converge.page import write_convergence_page
    from actin_xcheck.studies.converge.studies import studies_of
    from actin_xcheck.studies.folder import make_folder, report_folder
    from actin_xcheck.verdicts.orders import Verdict

    chosen = {
        name: [find_method(one) for one in dict.fromkeys(method or _default_methods(name, bool(scenes)))]
        for name in dict.fromkeys(scenes or DEFAULT_SCENES)
    }
    names = Counter(load_scene(name).name for name in chosen)
    if repeated := sorted(name for name, count in names.items() if count > 1):
        raise UserError(f"converge: more than one scene is named {', '.join(repeated)}")
    folder = report_folder(out_dir, "converge")
    make_folder(folder)
    studies = [study for name, methods in chosen.items() for study in studies_of(name, methods, folder)]
    if not studies:
        raise UserError("--method: what is declared to stall is studied where the exact solution is known")
    with Progress(quiet) as progress:
        results = examine(studies, folder, command(), progress.report)
    page = write_convergence_page(folder)
    failed = [result for result in results if result.observed.verdict is Verdict.FAIL]
    said = tuple(
        f"FAIL {one.scene} [{one.method}]: {one.quantity} in {one.refined}: {one.observed.reason}"
        for one in failed
    )
    counts = Counter(result.observed.verdict for result in results)
    found = ", ".join(f"{counts[verdict]} {verdict}" for verdict in Verdict if counts[verdict])
    verdicts = {str(verdict): counts[verdict] for verdict in Verdict if counts[verdict]}
    answer = ReportAnswer(command="converge", page=str(page), verdicts=verdicts, findings=said)
    conclude(answer, found, json)
    raise typer.Exit(1 if failed else 0)


def _default_methods(scene: str, named: bool) -> list[str]:
    """Those that move their own nodes: driven ones repeat their scheme, or stall and are shown once."""
    from actin_xcheck.runs.method import METHODS

    highest = math.inf if named else DEFAULT_SCENES[scene]
    return [
        one.name
        for one in METHODS.values()
        if (one.driven_by is None and one.space <= highest) or (scene == EXHIBITED and not one.order_h)
    ]
