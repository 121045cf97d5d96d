"""`chart`: error against work, method by method."""

from pathlib import Path
from typing import Annotated

import typer

from actin_xcheck.cli.options import Json, command


def chart_command(
    scene: Annotated[str, typer.Argument(help="A shipped name or the path of a TOML file.")],
    method: Annotated[list[str] | None, typer.Option(help="May be given more than once.")] = None,
    out_dir: Annotated[Path | None, typer.Option("--out", help="Folder for the results.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer points, in about a minute.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress.")] = False,
    json: Json = False,
) -> None:
    """Chart error against time, counted work and memory, and say which method to use for which error.

    Every method that moves its own nodes (--method for others) is run on finer and finer meshes, with steps
    or tolerances to match, one run after another so that nothing disturbs the clock: about five minutes, in
    which the machine is best left alone.  Given an interrupted chart's folder, it goes on there.  Runs that
    fail are part of the chart: exit code 0, and 2 for a mistake in what was asked.
    """
    from actin_xcheck.cli.output import ReportAnswer, conclude
    from actin_xcheck.cli.progress import Progress
    from actin_xcheck.runs.method import find_method
    from actin_xcheck.scene.scene import load_scene
    from actin_xcheck.studies.chart.advice import in_words
    from actin_xcheck.studies.chart.examine import default_methods, examine
    from actin_xcheck.studies.chart.page import write_chart_page
    from actin_xcheck.studies.folder import make_folder, report_folder

    loaded = load_scene(scene)
    methods = [find_method(name) for name in dict.fromkeys(method)] if method else default_methods()
    folder = report_folder(out_dir, f"chart-{loaded.name}")
    make_folder(folder)
    with Progress(quiet) as progress:
        chart = examine(loaded, methods, folder, command(), quick, progress.report)
    findings = tuple(in_words(chart).splitlines())
    conclude(ReportAnswer(command="chart", page=str(write_chart_page(folder)), findings=findings), "", json)
