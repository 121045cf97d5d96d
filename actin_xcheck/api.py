"""The commands for notebooks and scripts: what they do, with arrays in place of files and pages.

Every quantity is non-dimensional.  A mistake raises `UserError`, whose one line says what is valid; a run
that fails is a result like any other, and says so in its `outcome`.  `cross_check` and `sweep` start
processes: a script calls them under `if __name__ == "__main__":`.
"""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import make_folder, report_folder
from actin_xcheck.runs import run as runs
from actin_xcheck.runs.accuracy import deliver
from actin_xcheck.runs.executor import executor, jobs_asked
from actin_xcheck.runs.fidelity import Fidelity
from actin_xcheck.runs.method import find_methods
from actin_xcheck.runs.numerics import Wanted
from actin_xcheck.runs.store import Run, read_run
from actin_xcheck.scene.scene import Scene, load_scene, load_scenes
from actin_xcheck.studies import compare as comparison
from actin_xcheck.studies import sweep as sweeping
from actin_xcheck.studies.compare import Comparison
from actin_xcheck.studies.compare_page import write_comparison_page
from actin_xcheck.studies.study import at_work, carry_out
from actin_xcheck.studies.sweep import SweepTable

__all__ = ["cross_check", "load", "render", "run", "sweep"]


def load(path: str | Path) -> Run:
    """Return a stored run as arrays.

    Returns
    -------
    A `Run` with `times` (n_frames,); node positions `points`, displacements `u` and velocities `v`
    (n_frames, 2, N), starting at `xi` (2, N); concentrations `a_points` (n_frames, N) and their cell means
    `a_cells` (n_frames, n_cells); nodes of the `cells` (n_local, n_cells), and of the straight `triangles`
    (3, k^2 n_cells) between them for whoever plots; `series` with a row per time step: `time`, `area`,
    `total_actin` and so on; `attributes`: `outcome`, `scene`, `method_name`, `commit` and so on.

    UserError where `path` is no run.
    """
    return read_run(Path(path))


def run(
    scene: Scene | str | Path,
    method: str,
    *,
    refine: int | None = None,
    dt: float | None = None,
    rtol: float | None = None,
    accuracy: float | None = None,
    fidelity: str = Fidelity.AUTO,
    out: str | Path | None = None,
) -> Run:
    """Run a scene with a method, as the command `run` does, and return it as `load` would.

    Parameters
    ----------
    scene : a shipped name, the path of a TOML file, or what `scene.scene.load_scene` returns.
    method : a name out of `actin_xcheck.runs.method.METHODS`.
    refine, dt : the mesh has 2**refine layers, steps are of at most dt; else as published, else 5 and 100
        steps.
    rtol : largest local error of a step, for an adaptive method.
    accuracy : largest error of area, total actin and probes; method "fem" then chooses mesh and steps.
    fidelity : how much of the model is solved, a name out of `Fidelity`.
    out : a `.vtkhdf` to keep, replaced where it exists; without one nothing is kept on disk.
    """
    if not isinstance(scene, Scene):
        scene = load_scene(scene)
    asked = Wanted(method, refine, dt, rtol, _fidelity(fidelity), accuracy=accuracy)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.vtkhdf" if out is None else Path(out)
        make_folder(path.parent)
        if accuracy is None:
            runs.run(scene, asked.on(scene), path, "actin_xcheck.run")
        else:
            deliver(scene, accuracy, path, "actin_xcheck.run", wanted=asked.fidelity)
        return read_run(path)


def cross_check(
    scenes: str | Path | Sequence[str | Path] = comparison.DEFAULT_SCENES,
    methods: Sequence[str] | None = None,
    *,
    refine: int | None = None,
    dt: float | None = None,
    rtol: float | None = None,
    out: str | Path | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
) -> Comparison:
    """Hold methods against theory, exact solutions and each other, as the command `compare` does.

    Parameters
    ----------
    scenes : shipped names or paths of TOML files.
    methods : names out of `actin_xcheck.runs.method.METHODS`; None: as the command takes them.
    refine, dt, rtol : as for `run`; `rtol` for the adaptive methods among them.
    out : folder for runs and report, which goes on with what lies there; else `reports/compare-<date>`.
    jobs, scheduler : as for `sweep`.

    Returns
    -------
    The comparison: `claims`, each with `value`, `bound` and `holds`, and `runs` by "scene/method".
    """
    wanted = [scenes] if isinstance(scenes, str | Path) else scenes
    processes_asked = jobs_asked(jobs, scheduler)
    chosen = find_methods(methods) if methods else None
    runs_asked = comparison.jobs_of(load_scenes(wanted), chosen, refine, dt, rtol)
    folder = make_folder(report_folder(None if out is None else Path(out), "compare"))
    with at_work(folder), executor(processes_asked, scheduler) as processes:
        study = comparison.compare(runs_asked)
        carry_out("compare", study, folder, "actin_xcheck.cross_check", processes, lambda *told: None)
        write_comparison_page(folder / comparison.FILE_NAME)
    return comparison.read_comparison(folder / comparison.FILE_NAME)


def sweep(
    file: str | Path,
    methods: str | Sequence[str],
    *,
    out: str | Path,
    jobs: int | None = None,
    scheduler: str | None = None,
    refine: int | None = None,
    dt: float | None = None,
    rtol: float | None = None,
    accuracy: float | None = None,
    fidelity: str = Fidelity.AUTO,
) -> SweepTable:
    """Run a scene over ranges, or many scenes, as the command `sweep` does, and return the table.

    Parameters
    ----------
    file : a TOML file of ranges over a scene, or of scenes.
    methods : one or several names out of `actin_xcheck.runs.method.METHODS`.
    out : folder of the runs; what is there already is not run again.
    jobs : processes on this machine; else as many as it has cores; not with `scheduler`.
    scheduler : address of a `dask.distributed` scheduler, in place of `jobs`.
    refine, dt, rtol, accuracy, fidelity : as for `run`.

    Returns
    -------
    The table: `table["parameters.psi"]`, `table["outcome"]`, `table["area"]` are arrays with an entry a run.
    """
    processes = jobs_asked(jobs, scheduler)
    names = [methods] if isinstance(methods, str) else list(methods)
    asked = Wanted(names[0], refine, dt, rtol, _fidelity(fidelity), accuracy=accuracy)
    made_by = "actin_xcheck.sweep"
    runs, folder = sweeping.runs_of(Path(file), names, asked, made_by), make_folder(Path(out))
    table, _ = sweeping.carry_out(
        runs, folder, processes, scheduler, lambda label, over, whole: None, made_by
    )
    return table


def render(run: Run | str | Path, out: str | Path, *, time: float | None = None, field: str = "a") -> Path:
    """Draw a frame of a run as a .png, or its film as a .gif or .mp4, as the command `render` does.

    Parameters
    ----------
    run : what `run` or `load` returned, or the path of one.
    out : the picture's file, replaced where it exists.
    time : output time of a .png; else the last.
    field : a name out of `actin_xcheck.core.parameters.FIELDS`.
    """
    from actin_xcheck.report import pictures  # matplotlib is loaded where it draws

    stored = run if isinstance(run, Run) else read_run(Path(run))
    pictures.render(stored, Path(out), time, field)
    return Path(out)


def _fidelity(name: str) -> Fidelity:
    try:
        return Fidelity(name)
    except ValueError:
        raise UserError(f"fidelity: {name!r} is none; valid: {', '.join(Fidelity)}") from None
