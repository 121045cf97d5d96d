"""The commands.  A user's mistake is one line on standard error and exit code 2; a failed claim or run, 1."""

import math
import sys
from pathlib import Path
from typing import Annotated, NoReturn

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from actin_xcheck import compare as comparison
from actin_xcheck import predict
from actin_xcheck.accuracy import deliver
from actin_xcheck.atlas.predictions import FILE_NAME as PREDICTIONS_FILE
from actin_xcheck.audit.record import FILE_NAME as AUDIT_FILE
from actin_xcheck.chart import chart_command
from actin_xcheck.charting.record import FILE_NAME as CHART_FILE
from actin_xcheck.closures.record import FILE_NAME as CLOSURES_FILE
from actin_xcheck.closures_command import closures_command
from actin_xcheck.command_line import command, make_folder, report_folder, resuming_command
from actin_xcheck.converge import converge_command
from actin_xcheck.convergence.record import FILE_NAME as CONVERGENCE_FILE
from actin_xcheck.distort import distort_command
from actin_xcheck.distorting.record import FILE_NAME as DISTORTION_FILE
from actin_xcheck.errors import LONGEST, UserError, brief
from actin_xcheck.extremes.record import FILE_NAME as EXTREMES_FILE
from actin_xcheck.extremes_command import extremes_command
from actin_xcheck.faults.record import FILE_NAME as FAULTS_FILE
from actin_xcheck.faults_command import faults_command
from actin_xcheck.fidelity import FULL, Fidelity, Reduction, reduced
from actin_xcheck.files import locked, unfinished
from actin_xcheck.frontier.record import FILE_NAME as FRONTIER_FILE
from actin_xcheck.geometry import Mesh
from actin_xcheck.history_command import diff_command, history_command
from actin_xcheck.model import CAVEATS
from actin_xcheck.nightly.record import FILE_NAME as NIGHT_FILE
from actin_xcheck.nightly_command import nightly_command
from actin_xcheck.outline import caveats, read_mesh
from actin_xcheck.paper import paper_command
from actin_xcheck.progress import Progress
from actin_xcheck.registry import METHODS, find_method
from actin_xcheck.render_command import export_command, render_command
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
from actin_xcheck.result import Ending
from actin_xcheck.runs import numerics, remeshes, run
from actin_xcheck.scene import Scene, load_scene, scene_text, shipped_scenes
from actin_xcheck.survey import frontier_command
from actin_xcheck.sweep_command import sweep_command

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

Refine = Annotated[
    int | None, typer.Option(help="The mesh has 2**REFINE layers (5: 2113 nodes).", min=1, max=10)
]
Dt = Annotated[float | None, typer.Option(help="Largest time step.")]
Rtol = Annotated[
    float | None, typer.Option(help="Let adaptive methods choose steps with this local error.", min=1e-13)
]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite an existing output.")]


def _warn_of(scene: Scene) -> None:
    """Say on standard error what a user must know before believing the scene's results."""
    if caveat := CAVEATS.get(scene.physics.closure):
        print(f"warning: {scene.name}: {caveat}", file=sys.stderr)


def _positive(dt: float | None) -> None:
    if dt is not None and not 0 < dt < math.inf:
        raise UserError(f"--dt: {dt:g} is not a time step; valid: a number > 0")


@app.command("compare")
def compare_command(
    scenes: Annotated[list[str] | None, typer.Argument(metavar="[SCENE]...", show_default=False)] = None,
    method: Annotated[list[str] | None, typer.Option(help="May be given more than once.")] = None,
    out_dir: Annotated[Path | None, typer.Option("--out", help="Folder for the results.")] = None,
    refine: Refine = None,
    dt: Dt = None,
    rtol: Rtol = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Run scenes with FEM and FV, judge them against theory, exact solutions and each other, write a report.

    SCENE is a shipped name or the path of a TOML file; default: a wall mode, static-decay, growing-disk and
    Fig. 14.  Exit code 0 when all claims hold, 1 when one fails, 2 for a mistake in what was asked.
    """
    _positive(dt)
    loaded = [load_scene(name) for name in scenes or comparison.DEFAULT_SCENES]
    if repeated := {s.name for s in loaded if [t.name for t in loaded].count(s.name) > 1}:
        raise UserError(f"compare: more than one scene is named {', '.join(sorted(repeated))}")
    methods = [find_method(name) for name in dict.fromkeys(method or comparison.DEFAULT_METHODS)]
    folder = report_folder(out_dir, "compare")
    if (folder / "comparison.h5").exists() and not force:
        raise UserError(f"--out: {folder} holds a comparison already; valid: another folder, or --force")
    make_folder(folder)
    with locked(folder / "comparison.h5"):
        for stale in ("comparison.h5", "index.html"):  # a page must never stand beside runs it is not made of
            (folder / stale).unlink(missing_ok=True)
        jobs = comparison.jobs_of(loaded, methods, folder, refine, dt, rtol)
        for scene in loaded:
            _warn_of(scene)
        with Progress(quiet) as progress:
            claims = comparison.compare(jobs, folder, command(), progress.report)
        page = write_report(folder)
    judged = [claim for claim in claims if claim.judged]
    failed = [claim for claim in judged if not claim.holds]
    for claim in failed:
        print(f"FAIL {claim.scene} [{', '.join(claim.methods)}]: {claim.statement}: ", end="")
        print(f"{claim.value:.3g} > {claim.bound:.3g} ({claim.note})")
    print(f"{len(judged) - len(failed)} of {len(judged)} claims hold; report: {page}")
    raise typer.Exit(1 if failed else 0)


@app.command("run")
def run_command(
    scene: Annotated[str, typer.Argument(help="A shipped name or the path of a TOML file.")],
    method: Annotated[
        str,
        typer.Option(help=f"One of {', '.join(METHODS)}; with --accuracy fem, to choose among its own."),
    ],
    out_file: Annotated[Path, typer.Option("--out", help="The .vtkhdf file to write.")],
    refine: Refine = None,
    dt: Dt = None,
    rtol: Rtol = None,
    accuracy: Annotated[
        float | None, typer.Option(help="Largest error of area, actin and probes; chooses mesh and steps.")
    ] = None,
    fidelity: Annotated[
        Fidelity, typer.Option(help="How much of the model is solved; auto: what the scene needs.")
    ] = Fidelity.AUTO,
    mesh_file: Annotated[
        Path | None,
        typer.Option(
            "--mesh", help="The cell's outline: triangles in a file meshio reads (.msh, .vtu, ...)."
        ),
    ] = None,
    remesh: Annotated[
        bool, typer.Option("--remesh", help="Replace the mesh when it is about to fold, and go on.")
    ] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with an interrupted run; else begin it, or leave it be.")
    ] = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Run one scene with one method; exit code 1 (and a file that says why) where the run fails.

    Ctrl-C ends it after the step, exit code 130; --resume goes on to what it would have been without, to the
    last bit, after a kill too.  So does the same command with --resume, repeated until the file is there.
    """
    _positive(dt)
    loaded = load_scene(scene)
    if accuracy is not None:
        _check_accuracy(accuracy, method, refine, dt, rtol, resume)
    elif rtol is not None and not find_method(method).adaptive:
        adaptive = ", ".join(name for name, known in METHODS.items() if known.adaptive)
        raise UserError(f"--rtol: {method} takes equal steps; valid with {adaptive}, or --dt instead")
    if out_file.suffix != ".vtkhdf":
        raise UserError(f"--out: {out_file} does not end in .vtkhdf, by which VTK knows its files")
    if out_file.is_dir():
        raise UserError(f"--out: {out_file} is a folder; valid: a file that ends in .vtkhdf")
    if force and resume:
        raise UserError("--resume goes on with what --force begins again; valid: one of them")
    if out_file.exists() and not (force or resume):
        raise UserError(f"--out: {out_file} exists already; valid: another name, or --force")
    if unfinished(out_file).exists() and not (force or resume):
        raise UserError(
            f"--out: {unfinished(out_file)} is an interrupted run; valid: --resume, or --force to begin again"
        )
    mesh = None if mesh_file is None else _outline(mesh_file, loaded, accuracy, fidelity)
    if remesh:
        _check_remesh(loaded, method, fidelity, mesh_file)
    make_folder(out_file.parent)
    _warn_of(loaded)
    if accuracy is not None:
        _deliver(loaded, accuracy, out_file, quiet, fidelity)
    chosen = find_method(method)
    divided = refine or 0
    refine, dt = numerics(loaded, refine, dt)
    refine = refine if mesh is None else divided
    job = comparison.Job(loaded, chosen, refine, dt, out_file, rtol)
    reduction = reduced(loaded, chosen, fidelity, rtol) if mesh is None and not remesh else FULL
    _say(reduction)
    with Progress(quiet) as progress:
        outcome = run(
            loaded,
            chosen,
            refine,
            dt,
            out_file,
            command(),
            lambda done, total: progress.report(job.label, done, total),
            rtol,
            reduction,
            resume,
            heeds_signals=True,
            mesh=mesh,
            remesh=remesh,
        )
    if outcome.ending is Ending.INTERRUPTED:
        place = outcome.message.split(";")[0]
        print(f"actin_xcheck: interrupted {place}; to go on: {resuming_command()}", file=sys.stderr)
        raise typer.Exit(130)
    print(f"{outcome.ending}: {outcome.message or out_file}")
    raise typer.Exit(0 if outcome.ok else 1)


def _outline(path: Path, scene: Scene, accuracy: float | None, fidelity: Fidelity) -> Mesh:
    """The user's mesh, with what must be known of it on standard error."""
    if accuracy is not None:
        raise UserError(
            "--mesh: not with --accuracy, whose levels are the disk's; valid: --refine, --dt, --rtol"
        )
    if fidelity not in (Fidelity.AUTO, Fidelity.FULL):
        raise UserError(f"--mesh: not with --fidelity {fidelity}, which is part of a disk; valid: auto, full")
    mesh = read_mesh(path)
    for sentence in caveats(scene, mesh):
        print(f"warning: {sentence}", file=sys.stderr)
    print(f"{Fidelity.FULL}: nothing is left out, for what is cut down elsewhere is the disk")
    return mesh


def _check_remesh(scene: Scene, method: str, fidelity: Fidelity, mesh_file: Path | None) -> None:
    if method not in (valid := [name for name, known in METHODS.items() if remeshes(known)]):
        raise UserError(f"--remesh: not for {method}; valid with {', '.join(valid)}")
    if scene.motion is not None:
        raise UserError(
            f"--remesh: {scene.origin} prescribes its motion; valid: one moved by the force balance"
        )
    if mesh_file is not None:
        raise UserError("--remesh: not with --mesh; valid: the disk")
    if fidelity not in (Fidelity.AUTO, Fidelity.FULL):
        raise UserError(f"--remesh: the whole cell is solved, not --fidelity {fidelity}; valid: auto, full")


def _check_accuracy(
    accuracy: float, method: str, refine: int | None, dt: float | None, rtol: float | None, resume: bool
) -> None:
    if resume:
        raise UserError("--resume: not with --accuracy, which chooses its runs anew; valid: --force instead")
    if not 0 < accuracy < 1:
        raise UserError(f"--accuracy: {accuracy:g} is no error; valid: a number between 0 and 1")
    if method != "fem":
        raise UserError(f"--accuracy: not with --method {method}; valid: --method fem, which then chooses")
    chosen = {"--refine": refine, "--dt": dt, "--rtol": rtol}
    if given := [name for name, value in chosen.items() if value is not None]:
        raise UserError(f"--accuracy: chooses {', '.join(given)} itself; valid: without")


def _say(reduction: Reduction) -> None:
    """Say how much of the model is solved, and what is left out and why."""
    for sentence in reduction.left_out:
        print(f"{reduction.fidelity}: left out {sentence}")


def _deliver(scene: Scene, accuracy: float, out_file: Path, quiet: bool, fidelity: Fidelity) -> None:
    """Run to an accuracy, say what was reached and leave with the exit code."""
    with Progress(quiet) as progress:
        reached = deliver(
            scene,
            accuracy,
            out_file,
            command(),
            lambda done, total: progress.report(scene.name, done, total),
            fidelity,
        )
    _say(reached.reduction)
    if not reached.outcome.ok:
        print(f"{reached.outcome.ending}: {reached.outcome.message}")
        raise typer.Exit(1)
    print(
        f"completed: {out_file}; estimated error {reached.estimate:.1e} "
        f"(--method {reached.level.method.name} --refine {reached.level.refine} "
        f"--rtol {reached.level.rtol:g})"
    )
    raise typer.Exit(0)


@scenes_app.callback()
def scenes_command(context: typer.Context) -> None:
    """List the shipped scenes with what they are."""
    if context.invoked_subcommand is None:
        table = Table("scene", "from", "psi", "p", "rheology", "closure", "delta", box=None)
        for scene in map(load_scene, shipped_scenes()):
            parameters, physics = scene.parameters, scene.physics
            table.add_row(
                scene.name, scene.citation, f"{parameters.psi:g}", f"{parameters.p:g}",
                physics.rheology, physics.closure, physics.delta,
            )  # fmt: skip
        Console(soft_wrap=True, highlight=False, width=160).print(table)


@scenes_app.command("show")
def scenes_show(name: str) -> None:
    """Print a scene's TOML: the start of a scene of one's own."""
    sys.stdout.write(scene_text(name))


@app.command("report")
def report_command(folder: Path) -> None:
    """Write the HTML report of a comparison, an audit, a study or predictions again, from its files alone."""
    pages = {
        AUDIT_FILE: write_audit_page,
        CHART_FILE: write_chart_page,
        CLOSURES_FILE: write_closures_page,
        CONVERGENCE_FILE: write_convergence_page,
        DISTORTION_FILE: write_distortion_page,
        EXTREMES_FILE: write_extremes_page,
        FAULTS_FILE: write_faults_page,
        FRONTIER_FILE: write_frontier_page,
        NIGHT_FILE: write_night_page,
        PREDICTIONS_FILE: write_theory_page,
    }
    write = next((page for name, page in pages.items() if (folder / name).exists()), write_report)
    try:
        with np.errstate(all="ignore"):
            page = write(folder)
    except (UserError, OSError):
        raise
    except Exception as error:  # its files may hold anything
        raise UserError(f"{folder}: cannot be drawn ({type(error).__name__}: {error})") from error
    print(f"report: {page}")


def main() -> None:
    """Entry point: turn a user's mistake into one line and exit code 2."""
    try:
        sys.exit(app(standalone_mode=False))
    except UserError as error:
        _refuse(str(error))
    except OSError as error:  # a full disk, or a folder that cannot be written
        _refuse(f"{error.filename or 'cannot write'}: {error.strerror or error}")
    except (KeyboardInterrupt, typer.Abort):
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
