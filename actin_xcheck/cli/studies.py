"""The commands of the studies: what each is asked, and what it is asked by default.

Options that all of them have stand in `conduct.py`; a sweep, whose answers are files, is in `sweep.py`.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from actin_xcheck.cli.conduct import (
    Accuracy,
    Dt,
    Listed,
    Methods,
    Only,
    Refine,
    Rtol,
    Scenes,
    SceneWord,
    Seed,
    check_step,
    command,
    print_names,
    scene_word,
    study_command,
    warn_of,
)
from actin_xcheck.core.errors import UserError

if TYPE_CHECKING:
    from actin_xcheck.studies.study import Study


@study_command("compare")
def compare(
    scenes: Scenes = None,
    methods: Methods = None,
    refine: Refine = None,
    dt: Dt = None,
    rtol: Rtol = None,
    accuracy: Accuracy = None,
) -> "Study":
    """Run scenes with FEM and FV, judge them against theory, exact solutions and each other, write a report.

    SCENE is a shipped name or the path of a TOML file; default: a wall mode, static-decay, growing-disk,
    Fig. 14, and two cells with no parameter of Table 2.  Default methods: elements and finite volumes, each
    with a force balance of its own, of second order, and in the article's scheme for scenes of the article.
    Where elements and volumes part, the volumes are run with the elements' force balance too: it says whether
    transport or mechanics is what differs.  With --accuracy each code is as fine as that needs.  Two runs
    (A.vtkhdf B.vtkhdf) or two folders with reports are laid side by side instead.  Exit code 0 when all
    claims hold, 1 when one fails, 2 for a mistake in what was asked.
    """
    from actin_xcheck.core.errors import UserError
    from actin_xcheck.runs.method import find_methods
    from actin_xcheck.runs.numerics import CHOSEN, Wanted
    from actin_xcheck.scene.scene import load_scenes
    from actin_xcheck.studies.accurate import checked
    from actin_xcheck.studies.compare import DEFAULT_SCENES, TO_AN_ACCURACY, compare_to, jobs_of
    from actin_xcheck.studies.compare import compare as study

    if any(Path(one).suffix == ".vtkhdf" or Path(one).is_dir() for one in scenes or ()):
        from actin_xcheck.studies.side_by_side import side_by_side

        if (methods, refine, dt, rtol, accuracy) != (None,) * 5:
            raise UserError(
                "--method, --refine, --dt, --rtol, --accuracy: are for scenes; valid: none of them"
            )
        return side_by_side(scenes or ())
    check_step(dt)
    loaded = load_scenes(scenes or DEFAULT_SCENES)
    if accuracy is not None:
        Wanted(CHOSEN, refine, dt, rtol, accuracy=accuracy)  # refuses what it would choose itself
        asked = compare_to(accuracy, loaded, checked(methods or TO_AN_ACCURACY))
    else:
        asked = study(jobs_of(loaded, find_methods(methods) if methods else None, refine, dt, rtol))
    for scene in loaded:
        warn_of(scene)
    return asked


@study_command("converge")
def converge(scenes: Scenes = None, methods: Methods = None) -> "Study":
    """Refine h and dt, read the observed orders off and hold them against those the methods declare.

    SCENE is a shipped name or the path of a TOML file; default: exact and manufactured solutions, the coupled
    model from smooth data, a mode of the cell and Fig. 14, with the methods that move their own nodes, as far
    as their orders say something there, and the one that stalls.  Scenes that are named are studied with all
    of these.  Exit code 0 when no claim fails, 1 when one does, 2 for a mistake in what was asked.
    """
    from actin_xcheck.core.errors import UserError
    from actin_xcheck.runs.method import find_methods
    from actin_xcheck.scene.scene import load_scenes
    from actin_xcheck.studies.converge import converge as study
    from actin_xcheck.studies.converge.plan import CONVERGED, moving_their_own, refinements_of

    asked = [
        one
        for scene in load_scenes(scenes or CONVERGED)
        for one in refinements_of(
            scene, find_methods(methods or moving_their_own(scene.name, named=bool(scenes)))
        )
    ]
    if not asked:
        raise UserError("--method: what is declared to stall is studied where the exact solution is known")
    return study(asked)


@study_command("paper")
def paper(
    only: Annotated[
        list[str] | None, typer.Option(help="One row, such as fig14 or eq3.7; may be given more than once.")
    ] = None,
    listed: Listed = False,
) -> "Study":
    """Hold every equation, table, figure and number of the article against what is computed here.

    Takes about a quarter of an hour on two cores.  A row's key stands beside it on the page.
    """
    from difflib import get_close_matches

    from actin_xcheck.core.errors import UserError
    from actin_xcheck.studies.audit import article

    rows = article()
    if listed:
        print_names(rows)
    for key in only or ():
        if key not in rows:
            some = ", ".join(get_close_matches(key, rows, 3) or list(rows)[:5])
            raise UserError(
                f"--only: no row is called {key!r}; valid are {some} and others, {len(rows)} in all"
            )

    from actin_xcheck.studies.audit import paper as study

    return study(list(dict.fromkeys(only or rows)), said=bool(only))


DISTORTED = {"smooth-fronts": ("perturbed", "stretched", "slivers"), "fitted-ring": ("off-ring",)}
"""Scenes whose data cost no order, and what their meshes suffer."""

DISTORTED_METHODS = ("fem-p1-paper", "fem-p2-imex3", "fem-p4-imex4", "fv-coupled", "fv-order2", "fv")


@study_command("distort")
def distort(scenes: Scenes = None, methods: Methods = None) -> "Study":
    """Chart each method's error on the disk's mesh perturbed, stretched, flattened and off the ring.

    SCENE is a shipped name or the path of a TOML file; default: the coupled model from smooth data, and one
    whose ring's pressure expands the cell.  Every distortion is run on two mesh widths, which gives an order,
    and counted in iterations; scenes that are named suffer all that apply (about four minutes on two cores).
    Runs that fail are part of the report.
    """
    from actin_xcheck.runs.method import find_methods
    from actin_xcheck.scene.scene import load_scenes
    from actin_xcheck.studies.distort import distort as study
    from actin_xcheck.studies.distort.cases import FAMILIES, check, families_of

    loaded, chosen = load_scenes(scenes or DISTORTED), find_methods(methods or DISTORTED_METHODS)
    for scene in loaded:
        check(scene, chosen)
    suffered = [
        families_of(scene) if scenes else [FAMILIES[key] for key in DISTORTED[scene.name]] for scene in loaded
    ]
    return study(list(zip(loaded, suffered, strict=True)), chosen)


@study_command("extremes")
def extremes(only: Only = None, listed: Listed = False) -> "Study":
    """Run the article's strongest contractions and Section 6 in both rheologies, and say how they end.

    When 1 + div u reaches zero the model has ended: its time is found by two kinds of elements on three
    meshes each, by finite volumes too for Fig. 18.  Where the mesh is about to fold the run is shown with and
    without remeshing.  The scene in which the article's algorithm fails is run beside a perturbed twin.
    --only takes scenes of the study.  About six minutes.  Exit code 1 where methods disagree on the end.
    """
    from actin_xcheck.core.errors import UserError
    from actin_xcheck.studies.extremes import extremes as study
    from actin_xcheck.studies.extremes.attempt import trials

    every = trials()
    known = sorted({trial.scene for trial in every})
    if listed:
        print_names(known)
    for name in only or ():
        if name not in known:
            raise UserError(f"--only: {name!r} is not in the study; valid: {', '.join(known)}")
    return study([trial for trial in every if not only or trial.scene in only])


@study_command("closures")
def closures(methods: Methods = None) -> "Study":
    """Show what current-normal and reference-normal do to ripples of the rim, and to mesh refinement.

    Growth by wave number against theory, on a rim that advances and one that retracts; then a rough cell that
    swells, on finer and finer meshes (about two minutes).  Runs that fail are what it is about.
    """
    from actin_xcheck.core.errors import UserError
    from actin_xcheck.runs.method import find_methods
    from actin_xcheck.studies.closures import METHODS, plan
    from actin_xcheck.studies.closures import closures as study

    chosen = find_methods(methods or METHODS)
    for method in chosen:
        if method.driven_by:
            raise UserError(
                f"--method: {method.name} moves its rim as another method does; valid: {', '.join(METHODS)}"
            )
    return study(plan([method.name for method in chosen]))


@study_command("faults")
def faults(only: Only = None, listed: Listed = False) -> "Study":
    """Switch deliberate faults on one by one and see that the harness turns red for each.

    Dilution dropped, signs turned, geometry stale, tolerances loose: about ninety faults, on small scenes all
    of whose claims hold without one (about three minutes).  --only takes names of faults.  Exit code 0 when
    all is green without a fault and every fault is caught, 1 when not.
    """
    from actin_xcheck.studies.checks import SUITE
    from actin_xcheck.studies.faults import FAULTS, find_faults, hunt

    if listed:
        print_names(FAULTS)
    return hunt(find_faults(only), SUITE)


FRONTIER_METHODS = ("fem-p1-paper", "fem-p4-imex4", "fv-coupled")


@study_command("frontier")
def frontier(
    scene: Annotated[
        str, typer.Option(help="A shipped name or the path of a TOML file.", callback=scene_word)
    ] = "fig14-four-fronts",
    over: Annotated[
        list[str] | None,
        typer.Option(help="One of psi,dt psi,h dt,h psi,p; may be given more than once."),
    ] = None,
    methods: Methods = None,
) -> "Study":
    """Find, per method, the borders between runs that are accurate, silently wrong, and failing.

    Every run is held against a converged one; borders are found by bisection.  Default: Fig. 14 over psi and
    dt with the article's scheme, the best finite elements and the finite volumes (about five minutes).
    """
    from actin_xcheck.runs.method import find_methods
    from actin_xcheck.scene.scene import load_scene
    from actin_xcheck.studies.frontier import frontier as study
    from actin_xcheck.studies.frontier.planes import PLANES, check, plane_of

    loaded = load_scene(scene)
    check(loaded)
    chosen = find_methods(methods or FRONTIER_METHODS)
    planes = [
        (method, plane_of(name, method)) for name in dict.fromkeys(over or PLANES[:1]) for method in chosen
    ]
    return study(loaded, planes)


@study_command("chart")
def chart(
    scene: SceneWord,
    methods: Methods = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer points, in about a minute.")] = False,
) -> "Study":
    """Chart error against time, counted work and memory, and say which method to use for which error.

    Every method that moves its own nodes (--method for others) is run on finer and finer meshes, with steps
    or tolerances to match, one run after another so that nothing disturbs the clock: about five minutes, in
    which the machine is best left alone.  Runs that fail are part of the chart.
    """
    from actin_xcheck.runs.method import find_methods
    from actin_xcheck.scene.scene import load_scene
    from actin_xcheck.studies.chart import chart as study
    from actin_xcheck.studies.chart import default_methods
    from actin_xcheck.studies.chart.measure import QUICK, WHOLE

    chosen = find_methods(methods or default_methods())
    return study(load_scene(scene), chosen, QUICK if quick else WHOLE)


@study_command("random")
def random(
    seed: Seed = None,
    count: Annotated[int, typer.Option(help="Scenes to draw.", min=1)] = 20,
    first: Annotated[int, typer.Option(help="Number of the first one.", min=0)] = 0,
) -> "Study":
    """Draw scenes over everything that a scene can say, and see that the codes agree on each.

    Each is run by both codes, by smaller models that are exact for it, turned, reflected and in other units;
    one that misses is made simpler as long as it misses, and left as a file.  Some 5 s a scene.
    """
    from actin_xcheck.studies.random_scenes import random_scenes, seed_of_today

    return random_scenes(seed_of_today() if seed is None else seed, count, first)


@study_command("coverage")
def coverage(
    methods: Methods = None,
    seed: Seed = None,
    count: Annotated[int, typer.Option(help="Scenes to draw beside known ones.", min=0)] = 0,
    accuracy: Annotated[list[float] | None, typer.Option(help="Is it delivered?  May be repeated.")] = None,
) -> "Study":
    """See how often a stated uncertainty covers the true error, and how far it is from it.

    Scenes with exact solutions, exact modes and references, and COUNT that are drawn, by every method on a
    ladder of meshes, with --accuracy modes and COUNT run to it: some two minutes a scene.  Exit code 1 where
    more than one in twenty is too small, or an accuracy is not delivered.
    """
    from actin_xcheck.runs.method import find_methods
    from actin_xcheck.runs.numerics import CHOSEN, Wanted
    from actin_xcheck.runs.numerics import command as typed
    from actin_xcheck.scene.scene import load_scenes
    from actin_xcheck.studies.coverage import KNOWN, STATING, drawn
    from actin_xcheck.studies.coverage import coverage as study
    from actin_xcheck.studies.deliveries import MODES, deliveries
    from actin_xcheck.studies.random_scenes import seed_of_today

    seed = seed_of_today() if seed is None else seed
    for one in accuracy or ():
        Wanted(methods[0] if methods else CHOSEN, accuracy=one)  # refuses what is none
    made = typed("coverage", seed=seed, count=count, accuracy=tuple(accuracy or ()))
    if accuracy:
        return deliveries([*load_scenes(MODES), *drawn(seed, count)], accuracy, made)
    return study([*load_scenes(KNOWN), *drawn(seed, count)], find_methods(methods or STATING), made)


Files = Annotated[list[Path], typer.Argument(metavar="FILE...", show_default=False)]
Steps = Annotated[list[float] | None, typer.Option(help="Of each file, in their order.", min=1e-12)]


@study_command("judge")
def judge(
    scene: SceneWord,
    files: Files,
    h: Steps = None,
    dt: Steps = None,
    order: Annotated[float | None, typer.Option(help="That the code declares, in what is given.")] = None,
    within: Annotated[float, typer.Option(help="Error up to which a number is right.", min=1e-9)] = 0.01,
    field: Annotated[str, typer.Option(help="Name of the concentration in a mesh.")] = "a",
    units: Annotated[str, typer.Option(help='As "um, s"; else numbers are non-dimensional.')] = "",
) -> "Study":
    """Hold what another code computed of a scene against the truth: errors, orders, lag, and claims.

    FILE is a CSV with the column time and any of area, total_actin, centroid_x, centroid_y, polarity,
    mode_amplitude, probe_1_a, probe_1_x, probe_1_y and so on; a .vtu, .pvd, .xdmf or .vtkhdf of triangles
    with a concentration; or a run of ours.  Several files with --h or --dt give an observed order.  The truth
    is a reference or an exact solution where the scene has one, else a run to a hundredth of the apparent
    error.
    Exit code 0 when all claims hold, 1 when one fails, 2 for a mistake in what was asked or in a file.
    """
    from actin_xcheck.scene.scene import load_scene
    from actin_xcheck.studies.judge import judge as study
    from actin_xcheck.studies.judge.theirs import read_theirs, sorted_by_step

    loaded = load_scene(scene)
    for option, steps in (("--h", h), ("--dt", dt)):
        if steps and len(steps) != len(files):
            raise UserError(f"{option}: {len(steps)} for {len(files)} files; valid: one for each, or none")
    if len({path.stem for path in files}) < len(files):
        raise UserError("two files have one name; valid: names that differ")
    given = [read_theirs(path, loaded, field, units) for path in files]
    return study(
        loaded, sorted_by_step(given, h, dt), within, float("nan") if order is None else order, command()
    )
