"""Charts that are zoomed and read, in a browser from file://: curves, error against work, maps."""

import json
import re
from collections.abc import Callable, Iterator
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.figure import Figure

import actin_xcheck
from actin_xcheck.report.svg import styled, svg
from actin_xcheck.runs.store import read_comparison
from tests.chromium import Browser
from tests.legible import unreadable
from tests.test_dashboard import click, press

STATIC = Path(actin_xcheck.__file__).parent / "report" / "static"
CURVES, WORK, MAP = "curves", "chart", "frontier"

Pages = Callable[[str], Path]
"""Makes a page of a kind, once: a comparison, a work-precision chart or a frontier."""


@pytest.fixture(autouse=True)
def without_exceptions(browser: Browser) -> Iterator[None]:
    """No script breaks down in a test, whatever is clicked."""
    browser.events.clear()
    yield
    assert not [event for event in browser.events if event["method"] == "Runtime.exceptionThrown"]


class Zoomed:
    """One chart of the page that is open, by a part of its name."""

    def __init__(self, browser: Browser, name: str) -> None:
        self.browser = browser
        self.svg = (
            f"[...document.querySelectorAll('.zoomable > svg')].find(one => one.ariaLabel.includes({name!r}))"
        )
        self.frame = f"{self.svg}.parentElement"
        browser.evaluate(f"{self.frame}.scrollIntoView({{block: 'center'}})")
        self.axes = json.loads(browser.evaluate(f"{self.svg}.dataset.axes"))
        browser.evaluate(f"{self.frame}.id = 'zoomed'")

    def place(self, across: float, up: float) -> tuple[float, float]:
        """Where parts of the axes are in the window, from their lower left corner."""
        left, top, right, bottom = self.axes["box"]
        where = f"({left + across * (right - left)}, {bottom - up * (bottom - top)})"
        found = f"new DOMPoint{where}.matrixTransform({self.svg}.getScreenCTM())"
        x, y = json.loads(self.browser.evaluate(f"(p => JSON.stringify([p.x, p.y]))({found})"))
        return x, y

    def mouse(self, kind: str, across: float, up: float, **more: object) -> None:
        x, y = self.place(across, up)
        self.browser.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        held = {"button": "left", "buttons": 1, "clickCount": 1}
        self.mouse("mousePressed", *start, **held)
        self.mouse("mouseMoved", *(np.add(start, end) / 2), **held)
        self.mouse("mouseMoved", *end, **held)
        self.mouse("mouseReleased", *end, **held)

    @property
    def view(self) -> list[float]:
        """Ends of the two axes; those they have at first where nothing was zoomed yet."""
        said = self.browser.evaluate(f"{self.svg}.dataset.view")
        return [float(one) for one in said.split()] if said else [*self.axes["x"][1:], *self.axes["y"][1:]]

    @property
    def said(self) -> str:
        return self.browser.evaluate(f"{self.frame}.querySelector('output').textContent")

    @property
    def markup(self) -> str:
        """The drawing without what is put over and under it."""
        without = "copy.querySelector('.ticks').remove(), copy.lastElementChild.remove()"
        copied = f"(copy => ({without}, copy.innerHTML))({self.svg}.cloneNode(true))"
        return self.browser.evaluate(copied).replace(' style=""', "")


def opened(browser: Browser, page: Path, name: str) -> Zoomed:
    assert browser.complaints(page) == []
    return Zoomed(browser, name)


NAMES = {CURVES: "Area |Ω|", WORK: "Error of the concentration against cpu", MAP: "over (ψ, Δt)"}


@pytest.mark.parametrize(
    "kind", [CURVES, *(pytest.param(one, marks=pytest.mark.slow) for one in (WORK, MAP))]
)
def test_a_box_is_zoomed_to_and_a_double_click_shows_all(browser: Browser, page_of: Pages, kind: str) -> None:
    chart = opened(browser, page_of(kind), NAMES[kind])
    chart.mouse("mouseMoved", 0.5, 0.5)
    first = chart.view
    before = chart.markup
    chart.drag((0.25, 0.2), (0.75, 0.6))
    for axis, (low, high) in (("x", (0.25, 0.75)), ("y", (0.2, 0.6))):
        scale, *ends = chart.axes[axis]
        there, back = (np.log, np.exp) if scale == "log" else (np.asarray, np.asarray)
        start, end = there(ends)
        expected = back([start + low * (end - start), start + high * (end - start)])
        shown = chart.view[:2] if axis == "x" else chart.view[2:]
        assert there(shown) == pytest.approx(there(expected), abs=0.02 * abs(end - start))
    labels = browser.evaluate(f"[...{chart.svg}.querySelectorAll('.ticks text')].length")
    assert labels >= 3
    assert chart.markup != before
    for count in (1, 2):
        for event in ("mousePressed", "mouseReleased"):
            chart.mouse(event, 0.5, 0.5, button="left", clickCount=count)
    assert chart.view == pytest.approx(first)
    assert chart.markup == before
    assert browser.evaluate(f"{chart.svg}.querySelectorAll('.ticks text').length") == 0


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        *((CURVES, one) for one in ("Area |Ω|", "Centroid", "|Balance residual|")),
        ("paper", "close"),
        ("paper", "decades"),
        *(pytest.param(one, NAMES[one], marks=pytest.mark.slow) for one in (WORK, MAP)),
    ],
)
def test_axes_can_be_read_however_far_they_are_zoomed(
    browser: Browser, page_of: Pages, kind: str, name: str
) -> None:
    page = page_of(kind)
    assert browser.complaints(page) == []
    browser.evaluate("document.querySelectorAll('details').forEach(one => { one.open = true })")
    chart = Zoomed(browser, name)
    browser.evaluate(f"{chart.frame}.focus()")
    for _ in range(8):
        press(browser, "+", 187, "+")
        assert browser.evaluate(f"{chart.svg}.matches('.zoomed')")
        assert unreadable(browser) == []


def test_buttons_zoom(browser: Browser, page_of: Pages) -> None:
    chart = opened(browser, page_of(CURVES), "Area |Ω|")
    low, high = chart.view[:2]
    disabled = f"[...{chart.frame}.querySelectorAll('button')].map(one => +one.disabled).join('')"
    assert browser.evaluate(disabled) == "011"
    click(browser, "#zoomed button:nth-child(1)")
    assert np.diff(chart.view[:2])[0] == pytest.approx((high - low) / 2)
    assert browser.evaluate(disabled) == "000"
    click(browser, "#zoomed button:nth-child(1)")
    click(browser, "#zoomed button:nth-child(2)")
    assert np.diff(chart.view[:2])[0] == pytest.approx((high - low) / 2)
    click(browser, "#zoomed button:nth-child(3)")
    assert chart.view[:2] == pytest.approx([low, high])
    assert browser.evaluate(disabled) == "011"


def test_keys_zoom_move_and_read(browser: Browser, page_of: Pages) -> None:
    chart = opened(browser, page_of(CURVES), "Area |Ω|")
    low, high = chart.view[:2]
    browser.evaluate(f"{chart.frame}.focus()")
    press(browser, "+", 187, "+")
    nearer = chart.view[:2]
    assert nearer[1] - nearer[0] == pytest.approx((high - low) / 1.5)
    press(browser, "ArrowRight", 39)
    assert chart.view[0] > nearer[0]
    assert "t 0.0" in chart.said
    press(browser, "0", 48, "0")
    assert chart.view[:2] == pytest.approx([low, high])
    press(browser, ".", 190, ".")
    assert chart.said.startswith("t = 0 · fem-p1-paper ")
    press(browser, ".", 190, ".")
    assert not chart.said.startswith("t = 0 ·")
    assert browser.evaluate(f"{chart.frame}.querySelector('output').ariaLive") == "polite"


def test_the_wheel_zooms_where_it_is_asked_to_and_else_leaves_the_page_alone(
    browser: Browser, page_of: Pages
) -> None:
    chart = opened(browser, page_of(CURVES), "Area |Ω|")
    first = chart.view
    chart.mouse("mouseWheel", 0.5, 0.5, deltaX=0, deltaY=-10)
    assert chart.view == first
    browser.evaluate(f"{chart.frame}.focus({{preventScroll: true}})")
    chart.mouse("mouseWheel", 0.5, 0.5, deltaX=0, deltaY=-240)
    browser.evaluate("new Promise(resolve => setTimeout(resolve, 100))")
    assert np.diff(chart.view[:2])[0] == pytest.approx(np.diff(first[:2])[0] / 2)


def test_what_is_read_from_a_curve_is_what_is_stored(browser: Browser, page_of: Pages) -> None:
    chart = opened(browser, page_of(CURVES), "Area |Ω|")
    runs = read_comparison(page_of(CURVES).parent / "comparison.h5").runs
    series = runs["fig14-four-fronts/fem-p1-paper"].series
    for across in (0.2, 0.5, 0.8):
        chart.mouse("mouseMoved", across, 0.5)
        found = re.fullmatch(r"t = (\S+) · fem-p1-paper (\S+) · fv-coupled (\S+)", chart.said)
        assert found, chart.said
        t, area, other = map(float, found.groups())
        expected = np.interp(t, series["time"], series["area"])
        assert area == pytest.approx(expected, rel=2e-4)
        assert other == pytest.approx(area, rel=2e-4)
    assert browser.evaluate(f"{chart.svg}.querySelectorAll('.mark').length") == 2


def test_nothing_is_read_from_a_gap(browser: Browser, tmp_path: Path) -> None:
    """A run that failed has no number, and none of its neighbours' may pass for one."""
    with styled():
        figure = Figure()
        axes = figure.add_subplot(xlim=(0, 4), ylim=(0, 6))
        axes.plot([0, 1, 2, 3, 4], [1, 1, 1, 1, 1], label="all")
        axes.plot([0, 1, 2, 3, 4], [2, 2, np.nan, 5, 5], label="some")
        drawn = svg(figure, "a gap", "g")
    scripts = [(STATIC / name).read_text(encoding="utf-8") for name in ("d3-scale.min.js", "zoom.js")]
    page = tmp_path / "index.html"
    page.write_text(drawn + "".join(f"<script>{one}</script>" for one in scripts), encoding="utf-8")
    chart = opened(browser, page, "a gap")
    for across, names in ((0.125, "all some"), (0.5, "all"), (0.9, "all some")):
        chart.mouse("mouseMoved", across, 0.5)
        assert [part.split()[0] for part in chart.said.split(" · ")[1:]] == names.split()


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "word"), [(WORK, "kernels"), (MAP, "steps, refine")])
def test_points_say_what_they_are(browser: Browser, page_of: Pages, kind: str, word: str) -> None:
    chart = opened(browser, page_of(kind), NAMES[kind])
    browser.evaluate(f"{chart.frame}.focus()")
    press(browser, ".", 190, ".")
    seen = {chart.said}
    for _ in range(40):
        press(browser, ".", 190, ".")
        seen.add(chart.said)
    told = [one for one in seen if word in one]
    titles = re.findall(r"<title>(.*?)</title>", page_of(kind).read_text("utf-8"), re.DOTALL)
    assert len(told) > 1
    assert set(told) <= {unescape(title).replace("\n", ", ") for title in titles}


def test_buttons_have_names_and_paper_has_none_of_them(browser: Browser, page_of: Pages) -> None:
    chart = opened(browser, page_of(CURVES), NAMES[CURVES])
    nodes = browser.ask("Accessibility.getFullAXTree")["nodes"]
    buttons = [
        node["name"]["value"]
        for node in nodes
        if not node["ignored"] and node["role"]["value"] == "button" and node.get("name")
    ]
    assert {one.split(":")[0] for one in buttons} >= {"Zoom in", "Zoom out", "Show all"}
    browser.ask("Emulation.setEmulatedMedia", media="print")
    bar = f"getComputedStyle({chart.frame}.querySelector('.zoombar')).display"
    assert browser.evaluate(bar) == "none"
    browser.ask("Emulation.setEmulatedMedia", media="")
    assert browser.evaluate(bar) == "flex"


def test_a_drawing_says_what_follows_its_axes() -> None:
    with styled(), rc_context({"figure.constrained_layout.use": False}):
        figure = Figure(figsize=(4, 2))
        axes = figure.add_axes((0.25, 0.5, 0.5, 0.4), xlabel="x <1>", xlim=(1, 100), ylim=(0, 2))
        axes.set_xscale("log")
        axes.plot([1, 10], [0, 1], label='a "name" & more')
        axes.axhline(1)
        axes.plot([0, 1], [0.5, 0.5], transform=axes.transAxes)
        axes.annotate("mark", (10, 1), (0, 2), ("data", "axes fraction"), "offset points")
        drawn = svg(figure, "a drawing", "p")
    said = json.loads(unescape(re.search("data-axes='([^']*)'", drawn)[1]))
    assert said["box"] == pytest.approx([72, 0.1 * 144, 216, 72])
    assert (said["x"], said["y"], said["names"]) == (["log", 1, 100], ["linear", 0, 2], ["x <1>", ""])
    assert sorted(re.findall('data-zoom="(\\w+)"', drawn)) == ["x", "xy", "y"]
    assert 'data-name="a &quot;name&quot; &amp; more"' in drawn
