"""Charts in a browser from file://: labels however far they are zoomed, mouse, keys, theme, paper, files."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page

from actin_xcheck.report.draw import draw
from actin_xcheck.report.exhibits import Intervals, Line, Plot
from actin_xcheck.report.figure import INK, RED, figure
from actin_xcheck.report.page import environment
from actin_xcheck.studies.compare import FILE_NAME, read_comparison
from tests.browser import complaints, unreadable

X = np.linspace(0, 1, 11)
RUN = "fig14-four-fronts/fem-p1-paper"


@pytest.fixture
def area(tab: Page, page_of: Callable[[str], Path]) -> Page:
    """A comparison's page, its first chart of the area in the middle of the window and called `chart`."""
    tab.goto(page_of("curves").as_uri())
    tab.evaluate(
        "chart = [...document.querySelectorAll('.chart')].find(one => one.ariaLabel.startsWith('Area'))"
    )
    tab.evaluate("chart.scrollIntoView({ block: 'center' })")
    tab.wait_for_function("chart.told")  # is drawn
    return tab


def view(tab: Page) -> list[float]:
    return tab.evaluate("[...chart.layout.xaxis.range, ...chart.layout.yaxis.range]")


def place(tab: Page, across: float, up: float) -> tuple[float, float]:
    box = tab.evaluate("chart.querySelector('.nsewdrag').getBoundingClientRect().toJSON()")
    return box["left"] + across * box["width"], box["bottom"] - up * box["height"]


@pytest.mark.slow
def test_a_box_is_zoomed_to_and_a_double_click_shows_all(area: Page) -> None:
    x0, x1, y0, y1 = first = view(area)
    area.mouse.move(*place(area, 0.25, 0.2))
    area.mouse.down()
    area.mouse.move(*place(area, 0.5, 0.4))
    area.mouse.move(*place(area, 0.75, 0.6))
    area.mouse.up()
    area.wait_for_function(f"chart.layout.xaxis.range[0] > {x0}")
    expected = [x0 + 0.25 * (x1 - x0), x0 + 0.75 * (x1 - x0), y0 + 0.2 * (y1 - y0), y0 + 0.6 * (y1 - y0)]
    assert view(area) == pytest.approx(expected, rel=0.02)
    area.mouse.dblclick(*place(area, 0.5, 0.5))
    area.wait_for_function(f"chart.layout.xaxis.range[0] < {x0 + 1e-3}")
    assert view(area) == pytest.approx(first)


@pytest.mark.slow
def test_keys_zoom_move_and_read(area: Page, page_of: Callable[[str], Path]) -> None:
    x0, x1, *_ = first = view(area)
    area.evaluate("chart.focus()")
    area.keyboard.press("+")
    nearer = view(area)
    assert nearer[1] - nearer[0] == pytest.approx((x1 - x0) / 1.5)
    area.keyboard.press("ArrowRight")
    assert view(area)[0] == pytest.approx(nearer[0] + 0.2 * (nearer[1] - nearer[0]))
    area.keyboard.press("0")
    assert view(area) == pytest.approx(first)
    for _ in range(2):
        area.keyboard.press(".")
    told = area.evaluate("chart.told.textContent")
    area.mouse.move(0, 0)
    found = re.fullmatch(r"t = (0.00\d+) · fem-p1-paper (3\.\d+)", told)
    assert found, told
    series = read_comparison(page_of("curves").parent / FILE_NAME).runs[RUN].series
    assert series["time"][1] == pytest.approx(float(found[1]), rel=1e-8)
    assert series["area"][1] == pytest.approx(float(found[2]), rel=1e-8)


@pytest.mark.slow
def test_the_wheel_zooms_where_it_is_asked_to_and_else_leaves_the_page_alone(area: Page) -> None:
    first = view(area)
    area.mouse.move(*place(area, 0.5, 0.5))
    area.mouse.wheel(0, -10)
    area.wait_for_timeout(100)
    assert view(area) == first
    area.evaluate("chart.focus({ preventScroll: true })")
    area.mouse.move(*place(area, 0.5, 0.5))
    area.mouse.wheel(0, -240)
    area.wait_for_function(f"chart.layout.xaxis.range[0] > {first[0]}")
    assert np.diff(view(area)[:2])[0] == pytest.approx(np.diff(first[:2])[0] / 2)


@pytest.mark.slow
def test_what_is_read_from_a_curve_is_what_is_stored(area: Page, page_of: Callable[[str], Path]) -> None:
    series = read_comparison(page_of("curves").parent / FILE_NAME).runs[RUN].series
    area.mouse.move(*place(area, 0.5, 0.5))
    area.wait_for_function("chart.querySelectorAll('.hoverlayer .legendtext').length === 2")
    said = area.evaluate("[...chart.querySelectorAll('.hoverlayer text')].map(one => one.textContent)")
    assert [one.split(" : ")[0] for one in said[1:]] == ["fem-p1-paper", "fv-coupled"]
    t, value = float(said[0]), float(said[1].split(" : ")[1])
    assert value == pytest.approx(series["area"][np.argmin(np.abs(series["time"] - t))], rel=1e-8)


@pytest.mark.slow
def test_buttons_have_names_and_files_are_saved(area: Page, tmp_path: Path) -> None:
    names = area.evaluate("[...chart.querySelectorAll('.modebar button')].map(one => one.ariaLabel)")
    files = ["Download plot as a PNG", "Download plot as an svg", "Download its numbers as CSV"]
    assert names == [*files, "Zoom in", "Zoom out", "Reset axes"]
    for name, beginning in (("SVG", b"<svg"), ("PNG", b"\x89PNG")):
        with area.expect_download() as saved:
            area.evaluate(f"chart.querySelector('[aria-label$={name} i]').click()")
        saved.value.save_as(tmp_path / name)
        assert (tmp_path / name).read_bytes().startswith(beginning)


@pytest.mark.slow
def test_ink_follows_the_theme_and_paper_has_no_buttons(area: Page) -> None:
    places = ("chart.querySelector('.xtick text')", "chart.querySelector('.gridlayer path')")
    looks = [f"getComputedStyle({one}).{what}" for one, what in zip(places, ("fill", "stroke"), strict=True)]
    looks += [
        f"getComputedStyle({one}).backgroundColor" for one in ("document.body", "chart.closest('figure')")
    ]
    seen = []
    for theme in ("light", "dark"):
        area.emulate_media(color_scheme=theme)
        seen.append([area.evaluate(one) for one in looks])
    assert all(light != dark for light, dark in zip(*seen, strict=True)), seen
    area.emulate_media(media="print")
    area.wait_for_function("chart.layout.width <= 340")
    assert area.evaluate("getComputedStyle(chart.querySelector('.modebar')).display") == "none"
    assert area.evaluate(
        "[...document.querySelectorAll('.chart')].every(one => one.layout || !one.clientWidth)"
    )


def page_with(*plots: Plot) -> str:
    words = """{% extends "base.html" %}{% from "parts.html" import exhibits %}
        {% block title %}{% endblock %}{% block body %}{{ exhibits(drawings) }}{% endblock %}"""
    return environment(Path()).from_string(words).render(drawings=[draw(one, "/x") for one in plots])


AXIS = """async ([log, low, high]) => {
  const ends = log ? [Math.log10(low), Math.log10(high)] : [low, high];
  const chart = document.querySelectorAll(".chart")[+log];
  await Plotly.relayout(chart, { "yaxis.range": ends });
  await new Promise(resolve => requestAnimationFrame(() => requestAnimationFrame(resolve))); // labels follow
  return [...chart.querySelectorAll(".ytick text")].filter(one => one.getBoundingClientRect().width)
    .map(one => one.textContent.replaceAll("−", "-"));
}"""


@pytest.mark.slow
def test_every_axis_has_three_labels_that_are_its_numbers(tab: Page, tmp_path: Path) -> None:
    page = tmp_path / "index.html"
    plots = [Plot("k", "t", "", "x", (Line("l", X + 1, X + 1),), log=log) for log in (False, True)]
    page.write_text(page_with(*plots), encoding="utf-8")
    assert complaints(tab, page) == []
    random = np.random.default_rng(7)
    spans = [
        [False, 2.8e-5, 5.2e-5],
        [False, 3.14033115, 3.140331151],
        [True, 1e-17, 3e-16],
        [False, 0.0, 8000.0],
    ]
    for _ in range(25):
        low, width = (10.0 ** random.uniform(-9, 6) for _ in range(2))
        spans.append([True, low, low * 10 ** random.uniform(0.01, 18)])
        spans.append(
            [False, random.choice([-1, 0, 1]) * low, random.choice([-1, 0, 1]) * low + max(width, 1e-8 * low)]
        )
    spans = [[log, min(low, high), max(low, high)] for log, low, high in spans if low != high]
    for log, low, high in spans:
        labels = tab.evaluate(AXIS, [log, low, high])
        numbers = np.array([float(one) for one in labels])
        assert len(set(labels)) == len(labels) >= 3, (log, low, high, labels)
        assert (np.diff(np.sort(numbers)) > 0).all()
        slack = 1e-4 * (high - low) if not log else 1e-6 * numbers  # of 200 pixels: none
        assert ((low - slack <= numbers) & (numbers <= high + slack)).all(), (low, high, labels)


@pytest.mark.slow
def test_axes_can_be_read_however_far_they_are_zoomed(tab: Page, tmp_path: Path) -> None:
    curves = {"area": 3.2 + 0.4 * X**2, "residual": 10.0 ** (-17 + 2 * np.sin(9 * X))}
    plots = [Plot(k, k, "", "t", (Line("l", X / 6, y),), log=k == "residual") for k, y in curves.items()]
    (tmp_path / "index.html").write_text(page_with(*plots), encoding="utf-8")
    assert complaints(tab, tmp_path / "index.html") == []
    for number in (0, 1):
        for times in (2, 6):
            tab.evaluate(f"document.querySelectorAll('.chart')[{number}].focus()")
            for _ in range(times):
                tab.keyboard.press("+")
            assert unreadable(tab) == []


def test_everything_a_line_can_say_is_drawn() -> None:
    half = np.full(11, 0.1)
    lines = (
        Line("band", X, X, y_spread=half, dashed=True),
        Line("bars", X, X, points=True, y_spread=half, x_spread=half, shape="diamond-open", red=True),
        Line("", X, 2 * X, said=tuple(f"<b>{i}</b>\n$" for i in range(11)), points=True, rail=True),
        Line("front", X, X, steps=True, guide=True),
    )
    drawn = figure(Plot("k", "t", "", "<x>", lines, levels=(("bound", 0.5),), ylabel="$y$"))
    low, high, band, bars, rail, front, bound = drawn["data"]
    assert (bound["y"], bound["opacity"]) == ([0.5], 0)
    assert np.allclose(high["y"], X + 0.1)
    assert (low["hoverinfo"], high["fill"], band["line"]["dash"]) == ("skip", "tonexty", "dash")
    assert bars["error_x"]["array"] == bars["error_y"]["array"] == [0.1] * 11
    assert (bars["marker"]["symbol"], bars["marker"]["color"]) == ("diamond-open", RED)
    assert (rail["yaxis"], set(rail["y"]), rail["showlegend"]) == ("y2", {1}, False)
    assert rail["text"][1] == "&lt;b&gt;1&lt;/b&gt;<br>&#36;"
    assert (front["line"]["shape"], front["line"]["color"]) == ("hv", INK)
    assert "dash" not in front["line"]
    layout = drawn["layout"]
    assert (layout["xaxis"]["title"]["text"], layout["yaxis"]["title"]["text"]) == (
        "&lt;x&gt;",
        "&#36;y&#36;",
    )
    assert [one.get("label", {}).get("text") for one in layout["shapes"]] == [None, "bound"]
    json.dumps(drawn, allow_nan=False)


def test_long_curves_keep_their_extremes_and_round_off_is_not_magnified() -> None:
    y = np.ones(10_000)
    y[7_777], y[5] = 9.0, np.nan
    (line,) = figure(Plot("k", "t", "", "t", (Line("l", np.arange(10_000.0), y),)))["data"]
    assert len(line["x"]) < 1100
    assert (line["x"][0], line["x"][-1], max(one for one in line["y"] if one)) == (0.0, 9_999.0, 9.0)
    flat = figure(Plot("k", "t", "", "t", (Line("l", X, 3.14 + 1e-15 * X),)))["layout"]["yaxis"]["range"]
    assert flat[1] - flat[0] == pytest.approx(3.14e-9)
    tiny = np.array([1.0, 2.0])
    one = figure(Intervals("k", "t", "", "x", ("FEM", "FV"), tiny, np.array([0.1, np.nan]), (0, -1)))
    assert [("error_x" in trace, trace["marker"]["color"]) for trace in one["data"]] == [
        (True, "#527ed4"),
        (False, INK),
    ]
