"""The report: it says everything the files hold, escapes what they say, and needs nothing but itself."""

import itertools
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from actin_xcheck.core.claim import Claim
from actin_xcheck.core.contract import Frame
from actin_xcheck.core.errors import Ending, Outcome
from actin_xcheck.core.mesh import disk, signed_areas
from actin_xcheck.report.film import film_strip
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import RunWriter, read_run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.compare import FILE_NAME, read_comparison
from actin_xcheck.studies.compare_page import write_comparison_page
from tests.browser import complaints
from tests.claims import claim as any_claim
from tests.studies import write_comparison
from tests.tags import SCRIPT, Tags, whole_in_itself

TIMES = (0.0, 0.05, 0.1, 0.13, 0.1636)
SCENE = """
name = "a-scene"
source = "Fig. 14 <b>&</b> section 5.3.2"
[parameters]
psi = 318.067
p = 0.26
[model]
closure = "reference-normal"
[initial]
a = "1 + 0.1*abs(sin(x)*sin(y))"
[time]
end = 0.1636
"""
ANOTHER_STYLE = {
    **{"text.usetex": True, "savefig.bbox": "tight", "axes.xmargin": 0.3, "font.size": 30, "figure.dpi": 30},
    **{"patch.antialiased": False, "lines.antialiased": False, "figure.autolayout": True, "savefig.dpi": 20},
    **{"axes.formatter.use_locale": True, "lines.linewidth": 9, "lines.linestyle": ":"},
}
"""Of a `matplotlibrc` that someone has for pages of theirs."""

Reported = tuple[Path, Sequence[Claim]]


def write_run(
    path: Path,
    scene: str,
    method: str,
    *,
    amplitude: float = 1.0,
    bias: float = 0.0,
    growth: bool = False,
    outcome: Outcome | None = None,
    refine: int = 3,
) -> None:
    """A four-lobed cell that grows; an outcome other than success ends it at t = 0.1."""
    mesh = disk(refine, 0.8)
    times = [t for t in TIMES if outcome is None or t <= 0.1]
    attributes = {"scene": SCENE, "scene_name": scene, "method_name": method}
    attributes["family"] = METHODS[method].family if method in METHODS else "fem"
    attributes["method"] = json.dumps({"description": "a scheme that needs many words, " * 3})
    attributes |= {"command": f"python -m actin_xcheck run {scene} --method {method}", "commit": "c0ffee" * 6}
    attributes |= {"versions": json.dumps({"numpy": np.__version__, "fipy": "4.0.3"}), "refine": refine}
    if growth:
        attributes["growth_rate_predicted"] = 16.3
    r, theta = np.hypot(*mesh.xi), np.arctan2(*mesh.xi[::-1])

    def cell(t: float) -> tuple[np.ndarray, np.ndarray]:
        x = mesh.xi * (1 + 2 * amplitude * t * r * (1 + 0.5 * np.cos(4 * theta)))
        return x, 1 + amplitude * 8 * t * r**2 * np.sin(2 * theta) ** 2 + bias * t * np.sin(2 * mesh.xi[0])

    delta = (np.hypot(*mesh.centroids) > 0.8).astype(float)
    with RunWriter(path, mesh.xi, mesh.triangles, delta, {**attributes, "dt": 1e-3, "seed": 0}) as writer:
        for n in range(161):
            t = n * TIMES[-1] / 160
            if t > times[-1] + 1e-9:
                break
            x, a = cell(t)
            area = signed_areas(x, mesh.triangles).sum()
            row: dict[str, Any] = {"time": t, "dt": 1e-3, "area": area, "total_actin": area * a.mean()}
            row |= {"balance_residual": (n % 7) * 1e-16 * (-1) ** n, "centroid": (1e-3 * t, bias * t**2)}
            row |= {"polarity": 1 - t, "a_min": a.min(), "a_max": a.max(), "jacobian_min": 1.0}
            row |= {"probe_a": a[:2], "probe_x": x[:, :2].T}
            writer.record(row | ({"mode_amplitude": 1e-6 * np.exp(16 * t)} if growth else {}))
        for t in times:
            x, a = cell(t)
            writer.frame(t, Frame(x, mesh.xi, a, a[mesh.triangles].mean(axis=0)))
        writer.finish(outcome or Outcome(), wall_seconds=12.3)


def claim(scene: str, method: str, statement: str, value: float, note: str = "") -> Claim:
    command, path = f"compare {scene} --method {method}", f"/runs/{scene}/{method}/run/series/area"
    said = {"scene": scene, "methods": (method,), "command": command, "path": path, "note": note}
    return any_claim(statement, value, 2e-3, **said)


def write_comparison_of_everything(folder: Path, refine: int = 3) -> list[Claim]:
    """Scenes with two, one and three methods; one run fails, and so do two claims."""
    tangled = Outcome(Ending.TANGLED, "triangle 17 lost its orientation at t = 0.1")
    files: dict[str, Path] = {}

    def run(scene: str, method: str, **more: Any) -> None:
        files[f"{scene}/{method}"] = folder / f"{len(files)}.vtkhdf"
        write_run(files[f"{scene}/{method}"], scene, method, refine=refine, **more)

    run("fig14-four-fronts", "fv-coupled", bias=0.02)  # not in the order of the page
    run("fig14-four-fronts", "fem-p1-paper")
    run("mode-11-wall", "fem-p1-paper", growth=True, amplitude=1e-6)
    run("mode-11-wall", "fv-coupled", growth=True, amplitude=1e-6, bias=1e-8)
    run("static-decay", "fem-p1-paper", amplitude=0.0)
    run(SCRIPT, "fem-p1-paper")
    run(SCRIPT, "fv-driven", bias=-0.02)
    run(SCRIPT, "fv-tpfa", amplitude=3.0, outcome=tangled)
    claims = [
        claim("fig14-four-fronts", "fem-p1-paper", "Area equals the reference value", 1.2e-3, "2.3 h^2"),
        claim("fig14-four-fronts", "fv-coupled", "Total actin equals the reference value", 4.5e-4),
        claim("mode-11-wall", "fem-p1-paper", "The mode grows at the predicted rate", 1.9e-3),
        claim("static-decay", "fem-p1-paper", "The L2 error is of second order", 3.1e-3),
        claim(SCRIPT, "fv-tpfa", "Runs to its end", float("nan"), "no number: the run failed"),
        replace(
            claim(SCRIPT, "fem-p1-paper", "FEM and FV agree", 1e-5), methods=("fem-p1-paper", "fv-driven")
        ),
    ]
    write_comparison(folder, claims, files)
    return claims


@pytest.fixture(scope="module")
def reported(page_of: Callable[[str], Path]) -> Reported:
    page = page_of("curves")
    return page, read_comparison(page.parent / FILE_NAME).claims


def test_a_page_is_drawn_as_ever_in_whatever_style_is_the_users(
    reported: Reported,
) -> None:
    page, _ = reported
    before = page.read_bytes()
    with mpl.rc_context(ANOTHER_STYLE):
        assert write_comparison_page(page.parent / FILE_NAME).read_bytes() == before
        assert mpl.rcParams["font.size"] == 30  # and is theirs again


def test_every_claim_is_told_in_full(reported: Reported) -> None:
    page, claims = reported
    text = Tags(page).text
    assert "4 of 6 claims hold" in Tags(page).words
    for claim in claims:
        for part in (claim.scene, *claim.methods, claim.statement, claim.command, claim.path, claim.note):
            assert part in text
        assert (f"{claim.value:.3g}" if np.isfinite(claim.value) else "no number") in text
    assert (text.count("PASS"), text.count("FAIL")) == (4, 2)


def test_a_failed_run_is_shown_with_its_outcome_up_to_its_end(reported: Reported) -> None:
    tags = Tags(reported[0])
    assert "tangled" in tags.text
    assert "triangle 17 lost its orientation at t = 0.1" in tags.text
    assert "a failed run goes beyond" in tags.text
    shown = [alt for alt in tags.attributes("img", "alt") if alt and alt.startswith("a of fv-tpfa")]
    assert [re.search(r"t = ([\d.]+)", alt)[1] for alt in shown] == ["0", "0.05", "0.1"]


def test_rows_are_fem_then_fv_then_their_differences(reported: Reported) -> None:
    alts = [alt for alt in Tags(reported[0]).attributes("img", "alt") if alt]
    rows = [name for name, _ in itertools.groupby(alt.split(" at t")[0] for alt in alts)]
    assert rows[:3] == ["a of fem-p1-paper", "a of fv-coupled", "fv-coupled − fem-p1-paper"]
    last = next(alt for alt in alts if alt.startswith("fv-coupled −") and "t = 0.1636" in alt)
    assert float(last.rsplit(" ", 1)[1]) == pytest.approx(0.02 * 0.1636, rel=0.05)  # the bias put in


def test_curved_cells_are_drawn_in_pieces_and_compared_by_their_means(tmp_path: Path) -> None:
    scene = load_scene("fig14-four-fronts")
    runs = []
    for method in ("fem-p4-imex4", "fv-coupled"):
        run(scene, Numerics(METHODS[method], 2, 0.05), tmp_path / method)
        runs.append(read_run(tmp_path / method))
    strip = film_strip(runs)
    assert [row.label for row in strip.rows] == [*("fem-p4-imex4", "fv-coupled", "fv-coupled − fem-p4-imex4")]
    assert all(panel is not None for row in strip.rows for panel in row.panels)
    curved, cells = runs
    largest = np.abs(cells.a_cells[-1] - curved.a_cells[-1]).max()
    assert strip.rows[2].panels[-1].extent == f"|·| ≤ {largest:.3g}"
    pieces = curved.a_points[-1][curved.triangles].mean(axis=0)
    assert strip.rows[0].panels[-1].extent == f"{pieces.min():.3g} … {pieces.max():.3g}"
    # pictures grow with what is in them, not with the nodes
    assert sum(len(panel.webp) for row in strip.rows for panel in row.panels) < 400_000


def test_growth_is_charted_where_it_was_measured(reported: Reported) -> None:
    assert Tags(reported[0]).text.count("Mode amplitude") == 1
    assert Tags(reported[0]).text.count("Total actin ∫a") == 4


def test_the_page_is_whole_in_itself_and_takes_no_markup(reported: Reported) -> None:
    tags = whole_in_itself(reported[0])
    assert SCRIPT in tags.text
    assert "Fig. 14 <b>&</b> section" in tags.text
    assert len(tags.source) < 3e6


def test_links_lead_to_the_runs_beside_the_page(reported: Reported) -> None:
    page = reported[0]
    links = [link for link in Tags(page).attributes("a", "href") if link and not link.startswith("#")]
    assert sorted(links) == sorted(path.name for path in page.parent.glob("*.vtkhdf"))


@pytest.mark.slow
def test_a_browser_shows_its_pictures(tab: Page, reported: Reported) -> None:
    tab.goto(reported[0].as_uri())
    assert tab.evaluate("document.title").startswith("4 of 6 claims hold")
    pictures = "Array.from(document.images, image => image.naturalWidth > 100)"
    assert tab.evaluate(f"{pictures}.length") > 40
    assert tab.evaluate(f"{pictures}.every(Boolean)")


def test_a_page_with_faults_would_be_noticed(browser: Browser, tmp_path: Path) -> None:
    page = tmp_path / "faulty.html"
    page.write_text("<img src='http://127.0.0.1:9/x.png'><script>console.error('oops'); undefined()</script>")
    found = " ".join(complaints(browser.new_page(), page))
    for fault in ("request http://127.0.0.1:9/x.png", "oops", "exception"):
        assert fault in found
