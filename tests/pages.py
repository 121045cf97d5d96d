"""A small page of every kind that commands write, made from what the tests of each kind make."""

from pathlib import Path

import numpy as np
import pytest

from actin_xcheck.api import cross_check, render, run, sweep
from actin_xcheck.report.exhibits import Exhibit, Line, Plot
from actin_xcheck.report.page import write_page
from actin_xcheck.runs.executor import in_turn
from actin_xcheck.studies.audit import AuditRow, Finding, Judgement, paper, rows, write_audit_page
from actin_xcheck.studies.compare import FILE_NAME as COMPARISON
from actin_xcheck.studies.compare_page import write_comparison_page
from actin_xcheck.studies.side_by_side import side_by_side
from actin_xcheck.studies.study import Report, answered, write_report
from tests.studies import carry
from tests.test_dashboard import write_nights
from tests.test_judge import files, judged
from tests.test_predict_report import chapters, exhibits
from tests.test_report import write_comparison_of_everything


def make(kind: str, folder: Path) -> Path:
    """Write a page of a kind that is no small study's into a folder, in this process, and return its path."""
    with pytest.MonkeyPatch.context() as monkeypatch, in_turn():
        return KINDS[kind](folder, monkeypatch) or folder / "index.html"


def _comparison(folder, monkeypatch):
    cross_check(["mode-11-wall", "growing-disk"], refine=2, out=folder)


def _curves(folder, monkeypatch):
    write_comparison_of_everything(folder, refine=2)
    return write_comparison_page(folder / COMPARISON)


def _audit(folder, monkeypatch):
    shown = tuple(one for one in exhibits() if "EVIL" not in one.key)
    finding = Finding(Judgement.MISPRINT, "3 & 4", "because", (*shown, *_lopsided()), {"x": 1.5})
    monkeypatch.setitem(rows(), "eq3.7", AuditRow("eq3.7", lambda: finding))
    carry(folder, paper(["eq3.7"]), name="paper")
    return write_audit_page(folder / "paper.h5")


def _predictions(folder, monkeypatch):
    write_report(
        folder / "predict.h5", "predict", Report("Linear theory", "", chapters=chapters()), "a command"
    )
    return write_page(folder / "predict.h5")


def _sweep(folder, monkeypatch):
    asked = 'scene = "static-decay"\n[over.parameters]\npsi = [0, 1, 2]\nd = [0.1, 0.3]\n'
    (folder / "ranges.toml").write_text(asked, encoding="utf-8")
    sweep(folder / "ranges.toml", "fem-p1-paper", out=folder, jobs=1, refine=1, dt=0.1)


def _film(folder, monkeypatch):
    return render(run("static-decay", "fem-p2-imex3", refine=2, dt=0.1), folder / "index.html")


def _side_by_side(folder, monkeypatch):
    for name in "fem-p2-imex3", "fv":
        run("static-decay", name, refine=2, dt=0.1, out=folder / f"{name}.vtkhdf")
    files = [str(path) for path in sorted(folder.glob("*.vtkhdf"))]
    write_report(
        folder / "compare.h5", "compare", answered(side_by_side(files), lambda tasks: []), "a command"
    )
    return write_page(folder / "compare.h5")


def _judge(folder, monkeypatch):
    report, _ = judged(files(folder, 0.1, 0.05, 0.025), within=1e-3)
    write_report(folder / "judge.h5", "judge", report, "a command")
    return write_page(folder / "judge.h5")


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
    "night": lambda folder, _: sorted(write_nights(folder).glob("*/index.html"))[-2],
    "dashboard": lambda folder, _: write_nights(folder) / "index.html",
    "paper": _audit,
    "predict": _predictions,
    "sweep": _sweep,
    "film": _film,
    "side by side": _side_by_side,
    "judge": _judge,
}
"""By name: makers of pages, in a folder; None where the page is the folder's `index.html`."""
