"""Pages of every kind as readers see them: nothing clipped, one over another, or without a scale."""

import csv
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page

from actin_xcheck.core.errors import Ending
from actin_xcheck.report.draw import Drawing
from actin_xcheck.report.figure import STYLES
from actin_xcheck.report.lattice import colour_of
from actin_xcheck.report.page import environment
from actin_xcheck.studies.compare import FILE_NAME, read_comparison
from actin_xcheck.studies.frontier.answers import AnswerKind
from tests.browser import SEEN, complaints, lab, linear, pale, unreadable, violations
from tests.picture import PICTURE, WIDTH, take

anchor = environment(Path()).filters["anchor"]

QUICK = (
    "closures",
    "faults",
    "night",
    "dashboard",
    "paper",
    "judge",
    "predict",
    "random",
    "side by side",
    "sweep",
    "film",
)
PAPER = 718
"""CSS pixels of A4 between margins of 10 mm."""
SLOW = ("compare", "curves", "chart", "frontier", "converge", "distort", "extremes")


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*QUICK, *(pytest.param(one, marks=pytest.mark.slow) for one in SLOW)])
def test_everything_on_a_page_can_be_read(tab: Page, page_of: Callable[[str], Path], kind: str) -> None:
    for width, theme in ((1280, "light"), (390, "dark")):
        tab.emulate_media(color_scheme=theme)
        tab.set_viewport_size({"width": width, "height": 900})
        assert complaints(tab, page_of(kind)) == []
        assert unreadable(tab) == []
        tab.emulate_media(color_scheme="dark" if theme == "light" else "light")
        assert pale(tab) == []
    tab.set_viewport_size({"width": PAPER, "height": 900})
    assert complaints(tab, page_of(kind)) == []
    tab.emulate_media(media="print", color_scheme="light")
    tab.wait_for_function("[...document.querySelectorAll('details')].every(one => one.open)")
    assert tab.evaluate(
        "[...document.querySelectorAll('nav, .copy, .save, .anchor')].every(one => !one.checkVisibility())"
    )
    assert unreadable(tab) == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*QUICK, *SLOW])
def test_no_page_shuts_anybody_out(tab: Page, page_of: Callable[[str], Path], axe: str, kind: str) -> None:
    assert complaints(tab, page_of(kind)) == []
    tab.evaluate("document.querySelectorAll('details').forEach(one => { one.open = true })")
    for theme in ("light", "dark"):
        tab.emulate_media(color_scheme=theme)
        assert violations(tab, axe) == []


@pytest.mark.slow
def test_numbers_are_saved_as_they_are_drawn_and_listed(
    tab: Page, page_of: Callable[[str], Path], tmp_path: Path
) -> None:
    def saved(click: str) -> list[list[str]]:
        with tab.expect_download() as download:
            tab.evaluate(f"document.querySelector({click!r}).click()")
        download.value.save_as(tmp_path / "saved.csv")
        assert download.value.suggested_filename.endswith(".csv")
        return list(csv.reader((tmp_path / "saved.csv").read_text("utf-8").splitlines()))

    complaints(tab, page_of("curves"))
    comparison = read_comparison(page_of("curves").parent / FILE_NAME)
    claim = comparison.claims[0]
    head, first, *more = saved(f"div:has(> .claims #{anchor(claim.key)}) > .save")
    assert (head, len(more)) == (["about", "Verdict", "Claim", "Value", "Bound"], 1)
    assert first[:2] + first[3:] == [claim.scene, "PASS", str(claim.value), str(claim.bound)]
    for part in (claim.statement, claim.command, claim.path, claim.note):
        assert part in first[2]
    head, *points = saved("figure:has([aria-label^=Area]) [aria-label$=CSV]")
    assert head == ["what", "t", "y", "± x", "± y", "said"]
    series = comparison.runs["fig14-four-fronts/fem-p1-paper"].series
    drawn = np.array([(float(t), float(y)) for what, t, y, *_ in points if what == "fem-p1-paper"])
    assert drawn == pytest.approx(np.column_stack([series["time"], series["area"]]), rel=1e-10)


@pytest.mark.slow
def test_commands_are_copied_and_claims_have_links_that_last(
    tab: Page, page_of: Callable[[str], Path]
) -> None:
    claim = read_comparison(page_of("curves").parent / FILE_NAME).claims[0]
    tab.context.grant_permissions(["clipboard-read", "clipboard-write"])
    row = f"#{anchor(replace(claim, statement='Better said').key)}"
    tab.goto(page_of("curves").as_uri() + row)
    tab.wait_for_function(f"document.querySelector('{row} .copy').checkVisibility()")  # it was folded
    tab.click(f"{row} .copy")
    tab.wait_for_function(f"document.querySelector('{row} .copy').textContent === 'copied'")
    assert tab.evaluate("navigator.clipboard.readText()") == claim.command
    assert tab.evaluate(f"document.querySelector('{row} .anchor').hash") == row


@pytest.mark.slow
def test_contents_stay_in_sight_and_say_where_one_is(tab: Page, page_of: Callable[[str], Path]) -> None:
    complaints(tab, page_of("curves"))
    tab.click("nav a[href='#scene-2']")
    tab.wait_for_function("document.querySelector('nav a[aria-current]')?.hash === '#scene-2'")
    bottom = tab.evaluate("document.querySelector('nav').getBoundingClientRect().bottom")
    top = tab.evaluate("document.querySelector('#scene-2').getBoundingClientRect().top")
    assert 0 < bottom < top < 150
    tab.set_viewport_size({"width": 390, "height": 900})
    frames = ".scroll:has(table)"
    wide, said = (
        f"[...document.querySelectorAll('{frames}')].map(one => one.checkVisibility() && {what})"
        for what in ("one.scrollWidth > one.clientWidth + 1", "one.matches('.more')")
    )
    tab.wait_for_function(f"String({wide}) === String({said}) && {wide}.includes(true)")


@pytest.mark.slow
def test_the_readmes_picture_is_a_report_in_its_colours(
    tab: Page, page_of: Callable[[str], Path], tmp_path: Path
) -> None:
    take(tab, page_of("curves").parent, tmp_path / "again.png")
    for picture in (PICTURE, tmp_path / "again.png"):
        assert picture.stat().st_size < 500_000
        with Image.open(picture) as image:
            assert (image.mode, image.width) == ("RGB", WIDTH)
            assert len(image.getcolors(image.width * image.height)) > 3000
    assert "python -m tests.picture" in (PICTURE.parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")


def chart(x: tuple[str, ...], y: tuple[str, ...], *more: dict) -> str:
    """A chart whose labels stand evenly along its axes: 0 to 3, three decades upwards."""
    across, up = (
        {"tickvals": at, "ticktext": said} for at, said in (([0, 1, 2, 3], x), ([0.1, 1, 10, 100], y))
    )
    axes = {"xaxis": {"range": [0, 3.2], **across}, "yaxis": {"type": "log", "range": [-1, 2.1], **up}}
    data = [{"type": "scatter", "x": [0, 3], "y": [1, 2]}]
    figure = {"data": data, "layout": {"height": 200, "annotations": list(more), **axes}}
    words = """{% extends "base.html" %}{% from "parts.html" import plot %}{% block title %}{% endblock %}
        {% block body %}<p>words</p>{{ plot(drawing) }}{% endblock %}"""
    drawing = Drawing("plot", "a chart", "", "", figure)
    return environment(Path()).from_string(words).render(drawing=drawing)


def text(said: str, x: float) -> dict:
    return {"text": said, "x": x, "y": 0.5, "showarrow": False, "yref": "paper"}


RIGHT = ("0", "1", "2", "3"), ("0.1", "1", "10", "1e2")


@pytest.mark.parametrize(
    ("page", "said"),
    [
        (chart(*RIGHT), ""),
        (chart(("0", "1", "1", "3"), RIGHT[1]), "equal labels"),
        (chart(RIGHT[0], ("0.1", "1", "", "")), "fewer than three labels"),
        (chart(RIGHT[0], ("0.1", "1", "30", "1e2")), '"30" stands where another number belongs'),
        (chart(("0", "1", "2", "1e-9+3.14"), RIGHT[1]), 'no number: "1e-9+3.14"'),
        (chart(*RIGHT, text("1e-9", 1), text("1e-8", 1.01)), "one over another"),
        (chart(*RIGHT, text("exact solution", 3.2)), "clipped"),
        ('<p style="width: 3000px">wide</p>', "the page is"),
        (
            '<div style="width: 40px; overflow: hidden; white-space: nowrap">too long a sentence</div>',
            "clipped",
        ),
        ('<p>below</p><p style="position: absolute; top: 1rem; margin: 0">above</p>', "one over another"),
        (
            "<style>td { padding: 0 }</style><table style='border-spacing: 0'><tr><td>12<td>34</table>",
            "run together",
        ),
        ('<p style="color: #ccc">pale</p>', "contrast"),
    ],
)
def test_what_cannot_be_read_is_noticed(tab: Page, tmp_path: Path, page: str, said: str) -> None:
    path = tmp_path / "page.html"
    path.write_text(page if "<html" in page else f"<!doctype html><p>words</p>{page}", encoding="utf-8")
    complaints(tab, path)
    found = unreadable(tab)
    assert [one for one in found if said in one] if said else found == []


def test_what_shuts_somebody_out_is_noticed(tab: Page, tmp_path: Path, axe: str) -> None:
    (tmp_path / "page.html").write_text("<!doctype html><title>t</title><img src='data:,'><input>")
    complaints(tab, tmp_path / "page.html")
    found = " ".join(violations(tab, axe))
    for fault in ("image-alt", "label", "html-has-lang"):
        assert f"{fault}: <" in found


# colours

CLASSES = [str(kind) for kind in AnswerKind if kind is not AnswerKind.FAILED]
CLASSES += [f"{AnswerKind.FAILED}: {ending}" for ending in Ending if ending is not Ending.COMPLETED]


@pytest.mark.parametrize("eye", SEEN)
def test_classes_of_runs_are_told_apart_by_every_eye(eye: str) -> None:
    seen = {label: lab(SEEN[eye] @ linear(colour_of(label))) for label in CLASSES}
    apart = {pair: float(np.linalg.norm(seen[pair[0]] - seen[pair[1]])) for pair in combinations(CLASSES, 2)}
    assert min(apart.values()) > 10, min(apart, key=apart.__getitem__)
    assert apart[AnswerKind.ACCURATE, AnswerKind.SILENT] > 40


@pytest.mark.parametrize("eye", SEEN)
def test_lines_are_told_apart_by_every_eye(eye: str) -> None:
    seen = [lab(SEEN[eye] @ linear(style.colour)) for style in STYLES]
    assert min(float(np.linalg.norm(one - other)) for one, other in combinations(seen, 2)) > 12


def test_classes_of_runs_are_told_apart_in_grey() -> None:
    grey = {label: float(lab(linear(colour_of(label)))[0]) for label in CLASSES}
    apart = {pair: abs(grey[pair[0]] - grey[pair[1]]) for pair in combinations(CLASSES, 2)}
    assert min(apart.values()) > 6, min(apart, key=apart.__getitem__)
    assert apart[AnswerKind.ACCURATE, AnswerKind.SILENT] > 25


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "button"), [("sweep", "a as PNG"), ("closures", "as SVG")])
def test_cells_of_an_exhibit_are_saved(tab: Page, page_of, kind: str, button: str, tmp_path: Path) -> None:
    complaints(tab, page_of(kind))
    with tab.expect_download() as download:
        tab.locator(f".save[aria-label$='{button}']").first.click()
    path = tmp_path / download.value.suggested_filename
    download.value.save_as(path)
    if path.suffix == ".svg":
        shapes = list(ElementTree.fromstring(path.read_text(encoding="utf-8")).findall("{*}polygon"))
        assert len(shapes) == 2 * tab.locator("figure.outlines").first.locator("svg").count() > 0
        assert all(one.get("stroke").startswith("rgb") for one in shapes)
    else:
        picture = np.asarray(Image.open(path).convert("RGB"))
        assert picture.shape[1] == 2 * (24 + 6 * (264 + 24))
        assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 50  # cells, not paper alone
