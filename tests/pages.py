"""A small page of every kind that commands write, made from what the tests of each kind make."""

from pathlib import Path

import numpy as np
import pytest

from actin_xcheck import cross_check
from actin_xcheck.report.exhibits import Exhibit, Line, Plot
from actin_xcheck.report.page import write_page
from actin_xcheck.runs.accuracy import LEVELS
from actin_xcheck.runs.executor import in_turn
from actin_xcheck.runs.method import METHODS
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.audit import ROWS, paper, write_audit_page
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.chart import chart
from actin_xcheck.studies.closures import closures
from actin_xcheck.studies.compare import FILE_NAME as COMPARISON
from actin_xcheck.studies.compare_page import write_comparison_page
from actin_xcheck.studies.converge import converge
from actin_xcheck.studies.distort import distort
from actin_xcheck.studies.distort.cases import FAMILIES
from actin_xcheck.studies.extremes import extremes
from actin_xcheck.studies.extremes.attempt import Level, Trial
from actin_xcheck.studies.faults import FAULTS, hunt
from actin_xcheck.studies.study import Report, write_report
from tests.frontiers import small
from tests.lab import FEM, FV
from tests.studies import carry
from tests.test_chart import TINY as CHARTED
from tests.test_closure_page import TINY
from tests.test_convergence import coarse
from tests.test_dashboard import write_nights
from tests.test_extremes import STRONG
from tests.test_faults import NOTHING, STILL
from tests.test_predict_report import chapters, exhibits
from tests.test_report import write_comparison_of_everything


def make(kind: str, folder: Path) -> Path:
    """Write a page of a kind into a folder, without a process beside this one, and return its path."""
    with pytest.MonkeyPatch.context() as monkeypatch, in_turn():
        return KINDS[kind](folder, monkeypatch) or folder / "index.html"


def _comparison(folder, monkeypatch):
    cross_check(["mode-11-wall", "static-decay", "growing-disk"], refine=2, out=folder)


def _curves(folder, monkeypatch):
    write_comparison_of_everything(folder, refine=2)
    return write_comparison_page(folder / COMPARISON)


def _chart(folder, monkeypatch):
    return _study("chart", chart(load_scene("static-decay"), [METHODS["fem-p1-imex2"]], CHARTED), folder)


def _study(name, study, folder, processes=None):
    carry(folder, study, processes, name)
    return write_page(folder / f"{name}.h5")


def _frontier(folder, monkeypatch):
    return _study("frontier", small(), folder)


def _closures(folder, monkeypatch):
    return _study("closures", closures(TINY), folder)


def _convergence(folder, monkeypatch):
    return _study("converge", converge(coarse("growing-disk", FEM, FV)), folder)


def _distortion(folder, monkeypatch):
    work = [(load_scene("static-decay"), [FAMILIES["slivers"]])]
    return _study("distort", distort(work, [METHODS["fem-p1-imex2"]], LEVELS[1:3]), folder)


def _extremes(folder, monkeypatch):
    levels = [Level("fem-p2-imex3", 2, 1e-4), Level("fem-p3-imex4", 2, 1e-4)]
    return _study("extremes", extremes([Trial(STRONG, level, epsilon=1e-10) for level in levels]), folder)


def _faults(folder, monkeypatch):
    return _study("faults", hunt([FAULTS["fv-leak"], NOTHING], [STILL]), folder)


def _audit(folder, monkeypatch):
    shown = tuple(one for one in exhibits() if "EVIL" not in one.key)
    finding = Finding(Judgement.MISPRINT, "3 & 4", "because", (*shown, *_lopsided()), {"x": 1.5})
    monkeypatch.setitem(ROWS, "eq3.7", Row("eq3.7", lambda: finding))
    carry(folder, paper(["eq3.7"]), name="paper")
    return write_audit_page(folder / "paper.h5")


def _predictions(folder, monkeypatch):
    write_report(
        folder / "predict.h5", "predict", Report("Linear theory", "", chapters=chapters()), "a command"
    )
    return write_page(folder / "predict.h5")


def _lopsided() -> tuple[Exhibit, ...]:
    """Plots whose numbers lie where labels are long or few: tiny, close together, in one decade or many."""
    x = np.linspace(1, 2, 9)
    spans = {
        "tiny": 2.8e-5 + 2.4e-5 * (x - 1),
        "close": 3.14033115 + 1e-9 * x,
        "large": 1e7 * x,
        "both": 1e-12 * (x - 1.3),
    }
    plain = [Plot(key, key, "", "x", (Line("l", x, y),)) for key, y in spans.items()]
    spans = {
        "decade": (0.31 * x, 4e-4 * x),
        "decades": (10.0 ** (3 * x - 3), 10.0 ** (-14 * x)),
        "none": (x / 1e3, 7 + x / 1e3),
    }
    return (*plain, *(Plot(key, key, "", "x", (Line("l", *xy),), log=True) for key, xy in spans.items()))


KINDS = {
    "compare": _comparison,
    "curves": _curves,
    "chart": _chart,
    "frontier": _frontier,
    "closures": _closures,
    "converge": _convergence,
    "distort": _distortion,
    "extremes": _extremes,
    "faults": _faults,
    "night": lambda folder, _: sorted(write_nights(folder).glob("*/index.html"))[-2],
    "dashboard": lambda folder, _: write_nights(folder) / "index.html",
    "paper": _audit,
    "predict": _predictions,
}
"""By name: makers of pages, in a folder; None where the page is the folder's `index.html`."""
