"""`compare`: scenes by both codes, judged."""

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from actin_xcheck.cli.options import Dt, Force, Json, Quiet, Refine, Rtol, check_step, command, warn_of


def compare_command(
    scenes: Annotated[list[str] | None, typer.Argument(metavar="[SCENE]...", show_default=False)] = None,
    method: Annotated[list[str] | None, typer.Option(help="May be given more than once.")] = None,
    out_dir: Annotated[Path | None, typer.Option("--out", help="Folder for the results.")] = None,
    refine: Refine = None,
    dt: Dt = None,
    rtol: Rtol = None,
    force: Force = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Run scenes with FEM and FV, judge them against theory, exact solutions and each other, write a report.

    SCENE is a shipped name or the path of a TOML file; default: a wall mode, static-decay, growing-disk and
    Fig. 14.  Exit code 0 when all claims hold, 1 when one fails, 2 for a mistake in what was asked.
    """
    from actin_xcheck.cli.output import ReportAnswer, conclude
    from actin_xcheck.cli.progress import Progress
    from actin_xcheck.core.errors import UserError
    from actin_xcheck.runs.method import find_method
    from actin_xcheck.scene.scene import load_scene
    from actin_xcheck.studies import compare as comparison
    from actin_xcheck.studies.compare_page import write_report
    from actin_xcheck.studies.folder import report_folder, report_in
    from actin_xcheck.verdicts.known_to import in_words, read_known_to

    check_step(dt)
    loaded = [load_scene(name) for name in scenes or comparison.DEFAULT_SCENES]
    if repeated := {s.name for s in loaded if [t.name for t in loaded].count(s.name) > 1}:
        raise UserError(f"compare: more than one scene is named {', '.join(sorted(repeated))}")
    methods = [find_method(name) for name in dict.fromkeys(method or comparison.DEFAULT_METHODS)]
    folder = report_folder(out_dir, "compare")
    with report_in(folder, comparison.FILE_NAME, "a comparison", force):
        jobs = comparison.jobs_of(loaded, methods, refine, dt, rtol)
        for scene in loaded:
            warn_of(scene)
        with Progress(quiet) as progress:
            claims = comparison.compare(jobs, folder, command(), progress.report)
        page = write_report(folder)
    judged = [claim for claim in claims if claim.judged]
    failed = [claim for claim in judged if not claim.holds]
    said = tuple(
        f"FAIL {claim.scene} [{', '.join(claim.methods)}]: {claim.statement}: {claim.excess} ({claim.note})"
        for claim in failed
    )
    verdicts = dict(Counter(claim.verdict for claim in claims))
    known = read_known_to(folder / "comparison.h5")
    answer = ReportAnswer(
        command="compare",
        page=str(page),
        verdicts=verdicts,
        findings=said,
        known_to_percent={
            scene: {name: 100 * error for name, error in found.items()} for scene, found in known.items()
        },
    )
    to = "".join(f"{scene}: {in_words(found)}\n" for scene, found in known.items())
    conclude(answer, f"{to}{len(judged) - len(failed)} of {len(judged)} claims hold", json)
    raise typer.Exit(1 if failed else 0)
