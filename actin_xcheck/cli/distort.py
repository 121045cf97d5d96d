"""`distort`: what each method's error does on meshes made worse on purpose."""

from pathlib import Path
from typing import Annotated

import typer

from actin_xcheck.cli.options import command, make_folder, report_folder
from actin_xcheck.cli.output import Json, ReportAnswer, conclude
from actin_xcheck.cli.progress import Progress
from actin_xcheck.core.errors import UserError
from actin_xcheck.runs.method import find_method
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.distort.cases import FAMILIES, check, families_of
from actin_xcheck.studies.distort.examine import examine
from actin_xcheck.studies.distort.page import write_distortion_page

DEFAULT_STUDIES = {
    "smooth-fronts": ("perturbed", "stretched", "slivers"),
    "fitted-ring": ("off-ring",),
}
"""Scenes whose data cost no order, and what their meshes suffer."""

DEFAULT_METHODS = ("fem-p1-paper", "fem-p2-imex3", "fem-p4-imex4", "fv-coupled", "fv-order2")


def distort_command(
    scenes: Annotated[list[str] | None, typer.Argument(metavar="[SCENE]...", show_default=False)] = None,
    method: Annotated[list[str] | None, typer.Option(help="May be given more than once.")] = None,
    out_dir: Annotated[Path | None, typer.Option("--out", help="Folder for the results.")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress.")] = False,
    json: Json = False,
) -> None:
    """Chart each method's error on the disk's mesh perturbed, stretched, flattened and off the ring.

    SCENE is a shipped name or the path of a TOML file; default: the coupled model from smooth data, and one
    whose ring's pressure expands the cell.  Every distortion is run on two mesh widths, which gives an order,
    and counted in iterations; scenes that are named suffer all that apply (about four minutes on two cores).
    Given an interrupted report's folder, it goes on there.  Runs that fail are part of the report: exit code
    0, and 2 for a mistake in what was asked.
    """
    loaded = [load_scene(name) for name in dict.fromkeys(scenes or DEFAULT_STUDIES)]
    if len({scene.name for scene in loaded}) < len(loaded):
        raise UserError("distort: more than one scene has the same name")
    methods = [find_method(name) for name in dict.fromkeys(method or DEFAULT_METHODS)]
    for scene in loaded:
        check(scene, methods)
    studies = [
        (scene, families_of(scene) if scenes else [FAMILIES[key] for key in DEFAULT_STUDIES[scene.name]])
        for scene in loaded
    ]
    folder = report_folder(out_dir, "distort")
    make_folder(folder)
    with Progress(quiet) as progress:
        sentences = examine(studies, methods, folder, command(), progress.report)
    page = write_distortion_page(folder)
    conclude(ReportAnswer(command="distort", page=str(page), findings=tuple(sentences)), "", json)
