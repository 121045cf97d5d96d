"""The commands for notebooks and scripts: what they do, with arrays in place of files and pages.

Every quantity is non-dimensional.  A mistake raises `UserError`, whose one line says what is valid; a run
that fails is a result like any other, and says so in its `outcome`.  `cross_check` and `sweep` start
processes: a script calls them under `if __name__ == "__main__":`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import make_folder, report_folder
from actin_xcheck.runs import run as runs
from actin_xcheck.runs.accuracy import deliver
from actin_xcheck.runs.executor import executor, jobs_asked
from actin_xcheck.runs.fidelity import Fidelity
from actin_xcheck.runs.method import find_methods
from actin_xcheck.runs.numerics import Wanted
from actin_xcheck.runs.store import Run, read_run
from actin_xcheck.scene.scene import Scene, load_scene, load_scenes, parse_scene
from actin_xcheck.studies import compare as comparison
from actin_xcheck.studies import sweep as sweeping
from actin_xcheck.studies.compare import Comparison
from actin_xcheck.studies.compare_page import write_comparison_page
from actin_xcheck.studies.study import Report, Study, at_work, carry_out
from actin_xcheck.studies.sweep import SweepTable

__all__ = ["chart", "converge", "cross_check", "load", "predict", "render", "run", "sweep"]


class ShownRun(Run):
    """A run that shows itself in notebooks, and hands itself on."""

    def _repr_html_(self) -> str:
        from actin_xcheck.report.notebook import html_of_run

        return html_of_run(self)

    def to_pandas(self) -> Any:
        """The series, a row a step, as a `pandas.DataFrame`, for which pandas must be installed."""
        import pandas

        from actin_xcheck.report.notebook import columns_of

        return pandas.DataFrame(columns_of(self.series)).set_index("time")

    def to_xarray(self) -> Any:
        """The film as an `xarray.Dataset` over time, node and cell, for which xarray must be installed."""
        import xarray

        at_nodes = {"x": self.points, "u": self.u, "v": self.v}
        fields: dict[str, Any] = {
            name: (("time", "axis", "node"), values) for name, values in at_nodes.items()
        }
        fields |= {"a": (("time", "node"), self.a_points), "a_cells": (("time", "cell"), self.a_cells)}
        fields |= {"xi": (("axis", "node"), self.xi), "cells": (("corner", "cell"), self.cells)}
        said = {
            name: value for name, value in self.attributes.items() if isinstance(value, str | int | float)
        }
        return xarray.Dataset(fields, {"time": self.times, "axis": ["x", "y"]}, said)


def _shown(run: Run) -> ShownRun:
    return ShownRun(**{one.name: getattr(run, one.name) for one in fields(run)})


def load(path: str | Path) -> ShownRun:
    """Return a stored run as arrays.

    Returns
    -------
    A `Run` with `times` (n_frames,); node positions `points`, displacements `u` and velocities `v`
    (n_frames, 2, N), starting at `xi` (2, N); concentrations `a_points` (n_frames, N) and their cell means
    `a_cells` (n_frames, n_cells); nodes of the `cells` (n_local, n_cells), and of the straight `triangles`
    (3, k^2 n_cells) between them for whoever plots; `series` with a row per time step: `time`, `area`,
    `total_actin` and so on; `attributes`: `outcome`, `scene`, `method_name`, `commit` and so on.

    It shows itself in notebooks; `to_pandas` and `to_xarray` hand it on.  UserError where `path` is no run.
    """
    return _shown(read_run(Path(path)))


def run(
    scene: Scene | Mapping[str, Any] | str | Path,
    method: str,
    *,
    refine: int | None = None,
    dt: float | None = None,
    rtol: float | None = None,
    accuracy: float | None = None,
    fidelity: str = Fidelity.AUTO,
    remesh: bool = False,
    out: str | Path | None = None,
) -> ShownRun:
    """Run a scene with a method, as the command `run` does, and return it as `load` would.

    Parameters
    ----------
    scene : a shipped name, the path of a TOML file, its tables as a dict, or what `scene.scene.load_scene`
        returns.
    method : a name out of `actin_xcheck.runs.method.METHODS`.
    refine, dt : the mesh has 2**refine layers, steps are of at most dt; else as published, else 5 and 100
        steps.
    rtol : largest local error of a step, for an adaptive method.
    accuracy : largest error of area, total actin and probes; method "fem" then chooses mesh and steps.
    fidelity : how much of the model is solved, a name out of `Fidelity`.
    remesh : whether the mesh is replaced when it is about to fold.
    out : a `.vtkhdf` to keep, replaced where it exists; without one nothing is kept on disk.
    """
    scene = _scene(scene)
    asked = Wanted(method, refine, dt, rtol, _fidelity(fidelity), remesh=remesh, accuracy=accuracy)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.vtkhdf" if out is None else Path(out)
        make_folder(path.parent)
        if accuracy is None:
            runs.run(scene, asked.on(scene), path, "actin_xcheck.run")
        else:
            deliver(scene, accuracy, path, "actin_xcheck.run", wanted=asked.fidelity)
        return _shown(read_run(path))


def predict(
    scene: Scene | Mapping[str, Any] | str | Path, m: Iterable[int] = range(9), above: float = 0.0
) -> list[dict[str, Any]]:
    """Return every growth rate above a bound by angular number m: dicts with `m` and the complex `rate`.

    The scene's delta must be constant where its pressure sees it (UserError); nothing is run.
    """
    from actin_xcheck.theory.exact import DiskModes

    model = _scene(scene).physics
    try:
        return [
            {"m": number, "rate": complex(rate)}
            for number in m
            for rate in DiskModes(model, number).rates(above)
        ]
    except (ValueError, ArithmeticError) as error:
        raise UserError(f"predict: {error}") from None


def converge(
    scene: str | Path,
    methods: Sequence[str],
    *,
    out: str | Path | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    force: bool = False,
) -> Report:
    """Refine h and dt and return the report with observed orders, as the command `converge` does."""
    from actin_xcheck.studies.converge import converge as study
    from actin_xcheck.studies.converge.plan import refinements_of

    asked = refinements_of(load_scene(scene), find_methods(list(methods)))
    return _carried("converge", study(list(asked)), out, jobs, scheduler, force)


def chart(
    scene: str | Path,
    methods: Sequence[str] | None = None,
    *,
    quick: bool = False,
    out: str | Path | None = None,
    jobs: int | None = None,
    force: bool = False,
) -> Report:
    """Chart error against time, work and memory and return the report, as the command `chart` does."""
    from actin_xcheck.studies.chart import chart as study
    from actin_xcheck.studies.chart import default_methods
    from actin_xcheck.studies.chart.measure import QUICK, WHOLE

    chosen = find_methods(list(methods or default_methods()))
    asked = study(load_scene(scene), chosen, QUICK if quick else WHOLE)
    return _carried("chart", asked, out, jobs, None, force)


def _carried(
    name: str,
    study: Study,
    out: str | Path | None,
    jobs: int | None,
    scheduler: str | None,
    force: bool,
) -> Report:
    """Carry a study out in a folder, write its page and return its report."""
    from actin_xcheck.report.page import write_page

    wanted = jobs_asked(jobs, scheduler)
    folder = make_folder(report_folder(None if out is None else Path(out), name))
    with at_work(folder, force), executor(wanted, scheduler) as processes:
        report = carry_out(name, study, folder, f"actin_xcheck.{name}", processes, lambda *told: None)
        write_page(folder / f"{name}.h5")
    return report


def _scene(given: Scene | Mapping[str, Any] | str | Path) -> Scene:
    if isinstance(given, Scene):
        return given
    if isinstance(given, Mapping):
        import tomli_w

        return parse_scene(tomli_w.dumps(dict(given)), str(given.get("name", "scene")))
    return load_scene(given)


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
    force: bool = False,
) -> Comparison:
    """Hold methods against theory, exact solutions and each other, as the command `compare` does.

    Parameters
    ----------
    scenes : shipped names or paths of TOML files.
    methods : names out of `actin_xcheck.runs.method.METHODS`; None: as the command takes them.
    refine, dt, rtol : as for `run`; `rtol` for the adaptive methods among them.
    out : folder for runs and report, which goes on with what lies there; else `reports/compare-<date>`.
    jobs, scheduler : as for `sweep`.
    force : begin anew in a folder that is there.

    Returns
    -------
    The comparison: `claims`, each with `value`, `bound` and `holds`, and `runs` by "scene/method".
    """
    wanted = [scenes] if isinstance(scenes, str | Path) else scenes
    processes_asked = jobs_asked(jobs, scheduler)
    chosen = find_methods(methods) if methods else None
    runs_asked = comparison.jobs_of(load_scenes(wanted), chosen, refine, dt, rtol)
    folder = make_folder(report_folder(None if out is None else Path(out), "compare"))
    with at_work(folder, force), executor(processes_asked, scheduler) as processes:
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
    """Draw a frame of a run as a .png, or its film as a .gif, .mp4 or .html, as the command `render` does.

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
