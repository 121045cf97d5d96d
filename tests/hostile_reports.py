"""Small folders of reports, to be damaged: a comparison with its run, a study."""

import functools
import tempfile
from pathlib import Path

import numpy as np

from actin_xcheck.report.exhibits import Chapter, Line, Picture, Plot, Sheet
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.study import Report, write_report
from tests.claims import claim
from tests.studies import write_comparison


@functools.cache
def a_report(kind: str) -> dict[str, bytes]:
    """The files of a report's folder by their relative names, the one that names its kind first."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        main = {"comparison": _comparison, "predict": _study}[kind](folder)
        files = sorted((path for path in folder.rglob("*.*5") if path.is_file()), key=lambda one: one != main)
        files += [path for path in folder.rglob("*.vtkhdf") if path.is_file()]
        return {str(path.relative_to(folder)): path.read_bytes() for path in files}


REPORTS = ("comparison", "predict")


def _comparison(folder: Path) -> Path:
    scene, path = load_scene("static-decay"), folder / "runs" / "decay.vtkhdf"
    path.parent.mkdir()
    run(scene, Numerics(METHODS["fem-p1-paper"], 1, 0.25), path)
    made = claim("conserves", 1e-15, 1e-12, scene=scene.name, methods=("fem-p1-paper",))
    return write_comparison(folder, [made], {f"{scene.name}/fem-p1-paper": path})


def _study(folder: Path) -> Path:
    x = np.linspace(1, 2, 5)
    exhibits = (
        Plot("k", "t", "n", "x", (Line("l", x, x**2),), (("m", 1.5),)),
        Picture("p", "t", np.outer(x, np.ones(9))),
        Sheet("s", "t", "n", (("a", "b"), ("1", "2"))),
    )
    report = Report("t", "l", findings=("f",), chapters=(Chapter("c", "t", "n", exhibits),))
    write_report(folder / "predict.h5", "predict", report, "predict report")
    return folder / "predict.h5"
