"""`run`: one scene by one method, stored; `render` and `export`: a stored run as pictures and elsewhere."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from actin_xcheck.cli.conduct import (
    DryRun,
    Dt,
    Force,
    Json,
    Quiet,
    Refine,
    Rtol,
    check_step,
    command,
    method_word,
    resuming_command,
    scene_word,
    warn_of,
)
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.parameters import FIELDS, Fidelity
from actin_xcheck.runs.method import METHODS

if TYPE_CHECKING:
    from actin_xcheck.core.errors import Outcome
    from actin_xcheck.core.mesh import Mesh
    from actin_xcheck.runs.fidelity import Reduction
    from actin_xcheck.runs.numerics import Numerics, Wanted
    from actin_xcheck.scene.scene import Scene

DEFAULT_ACCURACY = 1e-3
"""What a scene is run to where nothing is said of how."""

WORTH_SAYING = 10.0
"""Seconds from which on it is said beforehand what a run will take."""


RunScene = Annotated[
    str,
    typer.Argument(
        help="A shipped name or its beginning, or a TOML file, [dimensional] in dyn, cm, s.",
        callback=scene_word,
    ),
]
MethodWord = Annotated[
    str | None,
    typer.Option(
        help=f"One of {', '.join(METHODS)}; with --accuracy fem, to choose among its own, as without.",
        callback=lambda given: given and method_word(given),
    ),
]
OutFile = Annotated[
    Path | None, typer.Option("--out", help="The .vtkhdf file to write; default: SCENE--METHOD.vtkhdf.")
]
RunAccuracy = Annotated[
    float | None,
    typer.Option(
        help="Largest error of area, actin and probes; chooses mesh and steps.  Without --method 1e-3."
    ),
]
HowMuch = Annotated[
    Fidelity, typer.Option(help="How much of the model is solved; auto: what the scene needs.")
]
MeshFile = Annotated[
    Path | None,
    typer.Option("--mesh", help="The cell's outline: triangles in a file meshio reads (.msh, .vtu, ...)."),
]
Remesh = Annotated[
    bool, typer.Option("--remesh", help="Replace the mesh when it is about to fold, and go on.")
]
Resume = Annotated[
    bool, typer.Option("--resume", help="Go on with an interrupted run; else begin it, or leave it be.")
]


def run_command(
    scene: RunScene,
    method: MethodWord = None,
    out_file: OutFile = None,
    refine: Refine = None,
    dt: Dt = None,
    rtol: Rtol = None,
    accuracy: RunAccuracy = None,
    fidelity: HowMuch = Fidelity.AUTO,
    mesh_file: MeshFile = None,
    remesh: Remesh = False,
    resume: Resume = False,
    force: Force = False,
    dry_run: DryRun = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Run one scene with one method; exit code 1 (and a file that says why) where the run fails.

    Without --method the elements and steps are those that an --accuracy takes, 1e-3 where none is asked for.
    Ctrl-C ends it after the step, exit code 130; --resume goes on to what it would have been without, to the
    last bit, after a kill too.  So does the same command with --resume, repeated until the file is there.
    """
    from actin_xcheck.core.files import make_folder
    from actin_xcheck.runs.numerics import Wanted
    from actin_xcheck.scene.scene import load_scene

    check_step(dt)
    loaded = load_scene(scene)
    if method is None:
        _check_alone(refine, dt, rtol, mesh_file, remesh, resume)
        method, accuracy = "fem", accuracy or DEFAULT_ACCURACY
    if accuracy is not None and resume:
        raise UserError("--resume: not with --accuracy, which chooses its runs anew; valid: --force instead")
    asked = Wanted(method, refine, dt, rtol, fidelity, remesh=remesh, accuracy=accuracy)
    out_file = out_file or Path(f"{loaded.name}--{method}.vtkhdf")
    if not dry_run:
        _check_out(out_file, force, resume)
    mesh = None if mesh_file is None else _outline(mesh_file, loaded, accuracy, fidelity, json)
    if remesh:
        _check_remesh(loaded, method, fidelity, mesh_file)
    if dry_run:
        _say_what_it_takes(loaded, replace(asked, mesh=mesh), json)
    make_folder(out_file.parent)
    warn_of(loaded)
    if accuracy is not None:
        _deliver(loaded, accuracy, out_file, quiet, fidelity, json)
    _run(loaded, replace(asked, mesh=mesh).on(loaded), out_file, resume, quiet, json)


def _run(
    scene: "Scene", numerics: "Numerics", out_file: Path, resume: bool, quiet: bool, json: bool
) -> NoReturn:
    """Run, say how it ended and leave with the exit code."""
    from actin_xcheck.cli.conduct import lasting
    from actin_xcheck.cli.output import Progress
    from actin_xcheck.core.errors import Ending
    from actin_xcheck.runs.numerics import run_seconds
    from actin_xcheck.runs.processes import stop_signals
    from actin_xcheck.runs.run import run

    label, reduction = f"{scene.name} · {numerics.method.name}", numerics.reduction
    if not json:
        _say(reduction)
    with Progress(quiet) as progress, stop_signals() as stop:
        if (seconds := run_seconds(numerics, scene.output_times)) > WORTH_SAYING and not resume:
            progress.say(f"{label}: about {lasting(seconds)}")

        def tell(done: int, total: int) -> None:
            progress.report(label, done, total)

        outcome = run(scene, numerics, out_file, command(), tell, resume, stop)
    if outcome.ending is Ending.INTERRUPTED:
        place = outcome.message.split(";")[0]
        print(f"actin_xcheck: interrupted {place}; to go on: {resuming_command()}", file=sys.stderr)
        raise typer.Exit(128 + stop())
    if json:
        _answer(out_file, outcome, reduction)
    else:
        print(f"{outcome.ending}: {outcome.message or out_file}")
    raise typer.Exit(0 if outcome.ok else 1)


def _say_what_it_takes(scene: "Scene", wanted: "Wanted", json: bool) -> NoReturn:
    """Say what a run takes and run nothing; of an accuracy, what its first two levels take."""
    from actin_xcheck.cli.conduct import lasting
    from actin_xcheck.cli.output import CostAnswer, say
    from actin_xcheck.runs.accuracy import levels_of
    from actin_xcheck.runs.numerics import run_seconds

    every = [wanted.on(scene)] if wanted.accuracy is None else levels_of(scene, wanted)
    seconds = sum(run_seconds(one, scene.output_times) for one in every)
    if json:
        say(CostAnswer(command="run", tasks=len(every), seconds=seconds))
    else:
        said = " and ".join(f"{one.method.name}, {one.words}" for one in every)
        more = " at least" if wanted.accuracy is not None else ""
        print(f"{scene.name}: {said}: about {lasting(seconds)}{more}; nothing was run")
    raise typer.Exit(0)


def _check_alone(
    refine: int | None,
    dt: float | None,
    rtol: float | None,
    mesh_file: Path | None,
    remesh: bool,
    resume: bool,
) -> None:
    """UserError where numerics are given for no method."""
    chosen = {"--refine": refine, "--dt": dt, "--rtol": rtol, "--mesh": mesh_file, "--remesh": remesh or None}
    chosen["--resume"] = resume or None
    if given := [name for name, value in chosen.items() if value is not None]:
        raise UserError(f"{given[0]}: of which method? valid: with --method, or without for --accuracy")


def _check_out(out_file: Path, force: bool, resume: bool) -> None:
    from actin_xcheck.core.files import unfinished

    if out_file.suffix != ".vtkhdf":
        raise UserError(f"--out: {out_file} does not end in .vtkhdf, by which VTK knows its files")
    if out_file.stem.endswith(".partial"):
        raise UserError(f"--out: {out_file} is where an unfinished run stands; valid: without .partial")
    if out_file.is_dir():
        raise UserError(f"--out: {out_file} is a folder; valid: a file that ends in .vtkhdf")
    if force and resume:
        raise UserError("--resume goes on with what --force begins again; valid: one of them")
    if force or resume:
        return
    if out_file.exists():
        raise UserError(f"--out: {out_file} exists already; valid: another name, or --force")
    if (part := unfinished(out_file)).exists():
        raise UserError(f"--out: {part} is an interrupted run; valid: --resume, or --force to begin again")


def _answer(file: Path, outcome: "Outcome", reduction: "Reduction", error: float | None = None) -> None:
    """Say how a run ended, as one object."""
    from actin_xcheck.cli.output import RunAnswer, say

    answer = RunAnswer(
        file=str(file),
        outcome=outcome.ending,
        message=outcome.message,
        fidelity=reduction.fidelity,
        left_out=reduction.left_out,
        estimated_error=error,
    )
    say(answer)


def _outline(path: Path, scene: "Scene", accuracy: float | None, fidelity: Fidelity, json: bool) -> "Mesh":
    """The user's mesh, with what must be known of it on standard error."""
    from actin_xcheck.scene.outline import caveats, read_mesh

    if accuracy is not None:
        raise UserError(
            "--mesh: not with --accuracy, whose levels are the disk's; valid: --refine, --dt, --rtol"
        )
    if fidelity not in (Fidelity.AUTO, Fidelity.FULL):
        raise UserError(f"--mesh: not with --fidelity {fidelity}, which is part of a disk; valid: auto, full")
    mesh = read_mesh(path)
    for sentence in caveats(scene, mesh):
        print(f"warning: {sentence}", file=sys.stderr)
    if not json:
        print(f"{Fidelity.FULL}: nothing is left out, for what is cut down elsewhere is the disk")
    return mesh


def _check_remesh(scene: "Scene", method: str, fidelity: Fidelity, mesh_file: Path | None) -> None:
    from actin_xcheck.runs.run import remeshes

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


def _say(reduction: "Reduction") -> None:
    """Say how much of the model is solved, and what is left out and why."""
    for sentence in reduction.left_out:
        print(f"{reduction.fidelity}: left out {sentence}")


def _deliver(
    scene: "Scene", accuracy: float, out_file: Path, quiet: bool, fidelity: Fidelity, json: bool
) -> NoReturn:
    """Run to an accuracy, say what was reached and leave with the exit code."""
    from actin_xcheck.cli.output import Progress
    from actin_xcheck.runs.accuracy import deliver

    with Progress(quiet) as progress:
        reached = deliver(
            scene,
            accuracy,
            out_file,
            command(),
            lambda done, total: progress.report(scene.name, done, total),
            fidelity,
        )
    if json:
        error = reached.estimate if reached.outcome.ok else None
        _answer(out_file, reached.outcome, reached.reduction, error)
        raise typer.Exit(0 if reached.outcome.ok else 1)
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


Stored = Annotated[Path, typer.Argument(help="A stored run, .vtkhdf.")]
Replace = Annotated[bool, typer.Option("--force", help="Overwrite existing files.")]


def render_command(
    file: Stored,
    out_file: Annotated[
        Path | None, typer.Option("--out", help="A .png, .gif, .mp4 or .html; default: FILE with .png.")
    ] = None,
    time: Annotated[
        float | None, typer.Option(help="Output time to draw in a .png; default: the last.")
    ] = None,
    field: Annotated[str, typer.Option(help=f"One of {', '.join(FIELDS)}.")] = "a",
    force: Replace = False,
    json: Json = False,
) -> None:
    """Draw a frame of a stored run as a .png, or its film as a .gif or (where ffmpeg is found) an .mp4.

    An .html is a page that plays the film.

    Needs no display.  Curved cells are drawn curved; the grey line is the cell's rim at its start.
    """
    from actin_xcheck.cli.output import FilesAnswer, say
    from actin_xcheck.report.pictures import render
    from actin_xcheck.runs.store import read_run

    run = read_run(file)
    path = _free(out_file or file.with_suffix(".png"), "--out", force)
    times = render(run, path, time, field)
    if json:
        say(FilesAnswer(command="render", files=(str(path),), times=times))
    else:
        print(f"{path}: {len(times)} {'frame' if len(times) == 1 else 'frames'}")


def export_command(
    file: Stored,
    to: Annotated[
        Path, typer.Option("--to", help="film.xdmf (with film.h5), or film.pvd (with a .vtu a frame).")
    ],
    force: Replace = False,
    json: Json = False,
) -> None:
    """Write the film of a stored run for other tools: XDMF with straight triangles, or VTU with curved cells.

    ParaView 5.12 and later need neither: they open the .vtkhdf itself; film.pvd is for those before.
    """
    from actin_xcheck.cli.output import FilesAnswer, say
    from actin_xcheck.report.pictures import export, files_of
    from actin_xcheck.runs.store import read_run

    run = read_run(file)
    for path in files_of(run, to):
        _free(path, "--to", force)
    files = export(run, to)
    if json:
        say(FilesAnswer(command="export", files=tuple(map(str, files)), times=tuple(run.times.tolist())))
    else:
        print(f"{files[0]}: {len(run.times)} frames in {len(files)} files")


def _free(path: Path, option: str, force: bool) -> Path:
    """Return a path that may be written; UserError where something is there."""
    from actin_xcheck.core.errors import UserError
    from actin_xcheck.core.files import make_folder

    if path.exists() and not force:
        raise UserError(f"{option}: {path} exists already; valid: another name, or --force")
    make_folder(path.parent)
    return path
