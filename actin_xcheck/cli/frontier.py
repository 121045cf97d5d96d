"""`frontier`: where runs are accurate, silently wrong, or fail."""

from pathlib import Path
from typing import Annotated

import typer

from actin_xcheck.cli.options import command, make_folder, report_folder
from actin_xcheck.cli.output import Json, ReportAnswer, conclude
from actin_xcheck.cli.progress import Progress
from actin_xcheck.runs.executor import jobs_asked
from actin_xcheck.runs.method import find_method
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.frontier.examine import examine
from actin_xcheck.studies.frontier.page import write_frontier_page
from actin_xcheck.studies.frontier.planes import PLANES, check, plane_of

DEFAULT_SCENE = "fig14-four-fronts"
DEFAULT_METHODS = ("fem-p1-paper", "fem-p4-imex4", "fv-coupled")


def frontier_command(
    scene: Annotated[str, typer.Option(help="A shipped name or the path of a TOML file.")] = DEFAULT_SCENE,
    over: Annotated[
        list[str] | None, typer.Option(help=f"One of {' '.join(PLANES)}; may be given more than once.")
    ] = None,
    method: Annotated[list[str] | None, typer.Option(help="May be given more than once.")] = None,
    out_dir: Annotated[Path | None, typer.Option("--out", help="Folder for the results.")] = None,
    jobs: Annotated[
        int | None, typer.Option(help="Processes on this machine; default: its cores.", min=1, max=1024)
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a dask.distributed scheduler, in place of --jobs.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress.")] = False,
    json: Json = False,
) -> None:
    """Find, per method, the borders between runs that are accurate, silently wrong, and failing.

    Every run is held against a converged one; borders are found by bisection.  Default: Fig. 14 over psi and
    dt with the article's scheme, the best finite elements and the finite volumes.  Given an interrupted
    report's folder, it goes on there.
    """
    processes = jobs_asked(jobs, scheduler)
    loaded = load_scene(scene)
    check(loaded)
    methods = [find_method(name) for name in dict.fromkeys(method or DEFAULT_METHODS)]
    planes = list(dict.fromkeys(over or PLANES[:1]))
    for name in planes:
        plane_of(name, methods[0])
    folder = report_folder(out_dir, "frontier")
    make_folder(folder)
    with Progress(quiet) as progress:
        maps = examine(loaded, methods, planes, folder, command(), processes, scheduler, progress.report)
    findings = tuple(f"{one.method} over ({one.plane.name}): {one.words}" for one in maps)
    page = write_frontier_page(folder)
    conclude(ReportAnswer(command="frontier", page=str(page), findings=findings), "", json)
