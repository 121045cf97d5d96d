"""The film on a comparison's page, in a browser from file://: what is packed, what is clicked."""

import gzip
import json
import re
from base64 import b64decode
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page

from actin_xcheck.report.film import STEPS, _Store, common_times, film_data, film_strip
from actin_xcheck.runs.store import Run
from actin_xcheck.studies.compare import FILE_NAME, read_comparison
from actin_xcheck.studies.compare_page import write_comparison_page
from actin_xcheck.studies.sweep import read_table
from tests.browser import complaints
from tests.tags import SCRIPT
from tests.test_report import TIMES, write_comparison_of_everything

FILM = "document.querySelector('.player')"
LAST = "[...document.querySelectorAll('.player')].at(-1)"


@pytest.fixture(scope="module")
def page(page_of: Callable[[str], Path]) -> Path:
    return page_of("curves")


@pytest.fixture
def film(tab: Page, page: Path) -> Page:
    """The page just opened, its films at their first frames."""
    opened(tab, page)
    tab.evaluate(
        "document.querySelectorAll('.player input[type=range]').forEach(one => "
        "{ one.value = 0; one.dispatchEvent(new Event('input')) })"
    )
    return tab


def opened(tab: Page, page: Path) -> None:
    """Open the page; a canvas is as large as its place a moment after it is shown."""
    tab.goto(page.as_uri())
    sized = "one => one.width > 0 && one.width === Math.round(one.clientWidth * devicePixelRatio)"
    tab.wait_for_function(f"[...document.querySelectorAll('canvas')].every({sized})")


def runs_of(page: Path, scene: str) -> list[Run]:
    """FEM first, as on the page."""
    runs = [run for key, run in read_comparison(page.parent / FILE_NAME).runs.items() if scene in key]
    return sorted(runs, key=lambda run: not run.attributes["method_name"].startswith("fem"))


def pixels(tab: Page, number: int = 0) -> str:
    """What a canvas of the first film shows."""
    return tab.evaluate(f"{FILM}.querySelectorAll('canvas')[{number}].toDataURL()")


def text(tab: Page, selector: str, film: str = FILM) -> str:
    return tab.evaluate(f"{film}.querySelector({selector!r}).textContent")


def arrays(data: dict) -> list[np.ndarray]:
    """Words of all arrays: differences to those of the last one as long, low bytes before high ones."""
    raw = np.frombuffer(gzip.decompress(b64decode(data["arrays"]["packed"])), np.uint8).astype(np.uint16)
    found, last, at = [], {}, 0
    for n in data["arrays"]["words"]:
        words = raw[at : at + n] + 256 * raw[at + n : at + 2 * n] + last.get(n, np.zeros(n, np.uint16))
        found.append(words)
        last[n], at = words, at + 2 * n
    assert at == len(raw)
    return found


def unpacked(data: dict, at: int, low: float, high: float) -> np.ndarray:
    numbers = arrays(data)[at].astype(float)
    return np.where(numbers > STEPS, np.nan, low + (high - low) * numbers / STEPS)


def test_what_is_packed_is_what_is_stored(page: Path) -> None:
    runs = runs_of(page, "fig14")
    data = film_data(runs, film_strip(runs))
    fem, fv = data["runs"]
    left, bottom, right, top = data["window"]
    for i in range(len(TIMES)):
        for run, stored in zip((fem, fv), runs, strict=True):
            frame = run["frames"][i]
            found = unpacked(data, frame["x"], 0, 1).reshape(2, -1)
            expected = (stored.points[i] - [[left], [bottom]]) / [[right - left], [top - bottom]]
            assert np.abs(found - expected).max() <= 0.5001 / STEPS
            a = frame["a"]
            off = np.abs(unpacked(data, **a) - stored.a_cells[i])
            assert off.max() <= 0.5001 * (a["high"] - a["low"]) / STEPS + 1e-15
        apart = fv["frames"][i]["apart"]
        difference = runs[1].a_cells[i] - runs[0].a_cells[i]
        width = apart["high"] - apart["low"]
        assert np.abs(unpacked(data, **apart) - difference).max() <= 0.5001 * width / STEPS + 1e-15
    assert fem["triangles"] == fv["triangles"]  # packed once
    assert len({one.tobytes() for one in arrays(data)}) == len(arrays(data))


def test_times_of_a_film_are_those_that_all_runs_have_which_come_so_far(page: Path) -> None:
    run = runs_of(page, "fig14")[0]
    every, some, early = (
        replace(run, times=np.array(times)) for times in ((0, 1, 2, 4), (0, 2, 3, 4), (0, 1))
    )
    assert common_times([every, some]) == [0, 2, 4]
    assert common_times([every, early]) == [0, 1, 2, 4]
    assert common_times([some, early]) == [0, 1, 2, 3, 4]  # the last picture of each is shown


@pytest.mark.slow
def test_a_film_opens_at_the_last_time_that_all_runs_reach(tab: Page, page: Path) -> None:
    opened(tab, page)
    assert text(tab, ".time") == "t = 0.1636"
    assert text(tab, ".time", LAST) == "t = 0.1"


def test_what_is_no_number_is_packed_as_none(page: Path) -> None:
    runs = runs_of(page, "static")
    strip = film_strip(runs)
    runs[0].a_cells[-1][3] = np.nan
    data = film_data(runs, strip)
    found = unpacked(data, **data["runs"][0]["frames"][-1]["a"])
    assert np.flatnonzero(np.isnan(found)).tolist() == [3]


def test_the_infinite_is_packed_as_none() -> None:
    assert _Store().field(np.array([1.0, np.inf, 2.0, -np.inf]))["high"] == 2.0


def test_two_runs_are_told_apart_where_a_third_has_ended(page: Path) -> None:
    runs = runs_of(page, "fig14")
    early = replace(runs[0], times=runs[0].times[:1])
    data = film_data([early, *runs], film_strip(runs))
    one, other = (unpacked(data, **run["frames"][-1]["apart"]) for run in data["runs"][1:])
    assert other - one == pytest.approx(runs[1].a_cells[-1] - runs[0].a_cells[-1], abs=1e-6)


def test_a_failed_run_has_no_frame_where_it_had_ended(page: Path) -> None:
    runs = runs_of(page, SCRIPT)
    data = film_data(runs, film_strip(runs))
    failed = next(run for run in data["runs"] if run["name"] == "fv-tpfa")
    assert [frame is None for frame in failed["frames"]] == [False, False, False, True, True]
    assert failed["outcome"] == "tangled"


@pytest.mark.slow
def test_play_runs_to_the_end_and_pauses(film: Page) -> None:
    start = pixels(film)
    film.click(".player .play")
    assert text(film, ".play") == "Pause"
    film.wait_for_function(f"{FILM}.querySelector('.time').textContent.startsWith('t between')")
    assert pixels(film) != start
    film.click(".player .play")  # pauses at an output time
    assert text(film, ".play") == "Play"
    assert text(film, ".time") in {f"t = {t:.4g}" for t in TIMES}
    resting = pixels(film)
    film.wait_for_timeout(300)
    assert pixels(film) == resting
    film.evaluate(f"{FILM}.querySelector('input').focus()")
    film.keyboard.press("End")
    film.keyboard.press("ArrowLeft")
    assert text(film, ".time") == "t = 0.13"
    film.evaluate(f"{FILM}.querySelector('.play').focus()")
    film.keyboard.press(" ")
    film.wait_for_function(f"{FILM}.querySelector('.play').textContent === 'Play'")
    assert text(film, ".time") == "t = 0.1636"
    assert film.evaluate(f"{FILM}.querySelector('input').value") == "4"


@pytest.mark.slow
def test_output_times_are_stepped_through_by_arrow_keys(film: Page) -> None:
    film.evaluate(f"{FILM}.querySelector('input').focus()")
    seen = [text(film, ".time")]
    shown = {pixels(film)}
    for _ in TIMES[1:]:
        film.keyboard.press("ArrowRight")
        seen.append(text(film, ".time"))
        shown.add(pixels(film))
    assert seen == [f"t = {t:.4g}" for t in TIMES]
    assert len(shown) == len(TIMES)
    assert film.evaluate(f"{FILM}.querySelector('input').getAttribute('aria-valuetext')") == "t = 0.1636"
    label = film.evaluate(f"{FILM}.querySelector('canvas').getAttribute('aria-label')")
    assert label.startswith("a of fem-p1-paper at t = 0.1636, values ")


@pytest.mark.slow
def test_who_asked_for_less_motion_sees_output_times_alone(film: Page) -> None:
    film.emulate_media(reduced_motion="reduce")
    seen = f"new MutationObserver(() => seen.add({FILM}.querySelector('.time').textContent))"
    film.evaluate(f"seen = new Set(); {seen}.observe({FILM}.querySelector('.time'), {{ childList: true }})")
    film.click(".player .play")
    film.wait_for_function(f"{FILM}.querySelector('.play').textContent === 'Play'")
    assert set(film.evaluate("[...seen]")) <= {f"t = {t:.4g}" for t in TIMES}


@pytest.mark.slow
def test_the_mesh_is_drawn_and_taken_away(film: Page) -> None:
    without = [pixels(film, i) for i in range(3)]
    film.click(".player input[type=checkbox]")
    assert all(pixels(film, i) != without[i] for i in range(3))
    film.click(".player input[type=checkbox]")
    assert [pixels(film, i) for i in range(3)] == without


@pytest.mark.slow
def test_the_value_under_the_pointer_is_that_of_the_triangle(film: Page, page: Path) -> None:
    film.evaluate(f"{FILM}.querySelector('input').focus()")
    film.keyboard.press("End")
    film.evaluate(f"{FILM}.querySelector('canvas').scrollIntoView({{block: 'center'}})")
    box = film.evaluate(f"JSON.stringify({FILM}.querySelector('canvas').getBoundingClientRect())")
    box, runs = json.loads(box), runs_of(page, "fig14")
    left, bottom, right, top = film_data(runs, film_strip(runs))["window"]
    middle = runs[0].points[-1][:, runs[0].triangles[:, 40]].mean(axis=1)
    x = box["x"] + box["width"] * (middle[0] - left) / (right - left)
    y = box["y"] + box["height"] * (top - middle[1]) / (top - bottom)
    film.mouse.move(x, y)
    said = [text(film, f".pane:nth-child({i}) .extent") for i in (1, 2, 3)]
    values = [float(one.split("·")[-1].split()[0].replace("−", "-")) for one in said]
    a, b = (run.a_cells[-1][40] for run in runs)
    assert values[:2] == pytest.approx([a, b], rel=1e-4)
    assert values[2] == pytest.approx(b - a, rel=1e-3)
    film.evaluate(f"{FILM}.querySelector('canvas').focus()")
    marked = pixels(film)
    film.keyboard.press("ArrowRight")
    assert pixels(film) != marked
    film.keyboard.press("Escape")
    assert "mark" not in text(film, ".extent")


@pytest.mark.slow
def test_what_is_shown_is_saved_as_png_and_svg_and_the_film_as_gif(
    film: Page, page: Path, tmp_path: Path
) -> None:
    def saved(kind: str) -> Path:
        with film.expect_download() as download:
            film.click(f".player >> nth=0 >> .take:text-is('{kind}')")
        path = tmp_path / download.value.suggested_filename
        download.value.save_as(path)
        return path

    film.evaluate(f"{FILM}.querySelector('input').focus()")
    film.keyboard.press("End")
    runs = runs_of(page, "fig14")
    png, svg, moving = (saved(kind) for kind in ("PNG", "SVG", "GIF"))
    assert (png.name, svg.name) == ("fig14-four-fronts-t-0-1636.png", "fig14-four-fronts-t-0-1636.svg")
    picture = np.asarray(Image.open(png).convert("RGB")).astype(int)
    assert (picture[0, 0] == 255).all()
    with Image.open(moving) as frames:
        assert (moving.name, frames.n_frames, frames.info["loop"]) == (
            "fig14-four-fronts.gif",
            len(film_data(runs, film_strip(runs))["times"]),
            0,
        )
        first = np.asarray(frames.convert("RGB")).astype(int)
        frames.seek(frames.n_frames - 1)
        last = np.asarray(frames.convert("RGB").resize(picture.shape[1::-1])).astype(int)
    assert np.abs(last - picture).mean() < 4  # five bits of each colour, and letters
    film.evaluate(f"{FILM}.querySelector('input').focus()")
    film.keyboard.press("Home")
    before = np.asarray(Image.open(saved("PNG")).resize(first.shape[1::-1]).convert("RGB")).astype(int)
    assert np.abs(first - before).mean() < 4
    grown = np.asarray(Image.fromarray(first.astype(np.uint8)).resize(picture.shape[1::-1]))
    assert np.abs(picture - grown).mean() > 4
    root = ElementTree.fromstring(svg.read_text(encoding="utf-8"))
    cells = [
        one
        for one in root.findall("{*}path")
        if re.search(r"L.*L.*Z", one.get("d")) and one.get("fill") != "none"
    ]
    left, _, right, _ = film_data(runs, film_strip(runs))["window"]
    unit = (right - left) / 480
    areas = [
        sum(abs(np.linalg.det([b - a, c - a])) / 2 for a, b, c in corners_in(one.get("d"))) * unit**2
        for one in cells
    ]
    assert sum(areas) / 3 == pytest.approx(runs[0].series["area"][-1], rel=1e-3)  # the cell three times
    words = [one.text for one in root.findall("{*}text")]
    assert words[0] == "fig14-four-fronts, t = 0.1636"
    assert {run.attributes["method_name"] for run in runs} < set(words)


def corners_in(path: str) -> np.ndarray:
    """Corners (n, 3, 2) of the triangles in a path of SVG."""
    return np.array(re.findall(r"[-\d.]+", path), dtype=float).reshape(-1, 3, 2)


@pytest.mark.slow
def test_runs_are_chosen_where_there_are_more_than_two(film: Page) -> None:
    assert film.evaluate(f"{FILM}.querySelectorAll('select').length") == 0
    options = f"[...{LAST}.querySelectorAll('select')].map(one => one.selectedOptions[0].textContent).join()"
    assert film.evaluate(options) == "fem-p1-paper,fv-driven"
    before = film.evaluate(f"{LAST}.querySelectorAll('canvas')[1].toDataURL()")
    film.evaluate(f"{LAST}.querySelectorAll('select')[1].focus()")
    film.keyboard.press("ArrowDown")
    assert film.evaluate(options) == "fem-p1-paper,fv-tpfa"
    assert text(film, ".apart", LAST) == "fv-tpfa − fem-p1-paper"
    assert film.evaluate(f"{LAST}.querySelectorAll('canvas')[1].toDataURL()") == before  # alike at t = 0
    film.evaluate(f"{LAST}.querySelector('input').focus()")
    for _ in TIMES[1:]:
        film.keyboard.press("ArrowRight")
    assert "no frame, the run is tangled" in text(film, ".pane:nth-child(2) .extent", LAST)


@pytest.mark.slow
def test_paper_and_a_browser_without_scripts_show_the_strip(film: Page, page: Path) -> None:
    shown = (
        "[...document.querySelectorAll('.player, .frames')].map(one => one.offsetHeight > 0 ? 1 : 0).join('')"
    )
    assert film.evaluate(shown) == "10" * 4
    film.emulate_media(media="print")
    assert film.evaluate(shown) == "01" * 4
    film.emulate_media(media="screen")
    silent = page.with_name("silent.html")
    silent.write_text(re.sub("<script.*?</script>", "", page.read_text("utf-8"), flags=re.DOTALL), "utf-8")
    film.goto(silent.as_uri())
    assert film.evaluate(shown) == "01" * 4


def test_everything_that_can_be_used_has_a_name(film: Page) -> None:
    nodes = film.context.new_cdp_session(film).send("Accessibility.getFullAXTree")["nodes"]
    used = [
        (node["role"]["value"], node.get("name", {}).get("value", ""))
        for node in nodes
        if not node["ignored"]
        and node["role"]["value"] in {"button", "slider", "checkbox", "combobox", "image", "canvas"}
    ]
    assert all(name for _, name in used), used
    for expected in (
        ("button", "Play"),
        ("slider", "Output time"),
        ("checkbox", "mesh"),
        ("combobox", "left"),
    ):
        assert expected in used
    assert any(name.startswith("fv-coupled − fem-p1-paper at t = 0, values") for _, name in used)


@pytest.mark.slow
def test_a_comparison_on_the_articles_mesh_is_light(tmp_path: Path) -> None:
    write_comparison_of_everything(tmp_path, refine=5)
    assert write_comparison_page(tmp_path / FILE_NAME).stat().st_size < 5_000_000


@pytest.mark.slow
def test_from_a_point_a_picture_or_a_row_one_click_leads_to_the_film(tab: Page, page_of) -> None:
    page = page_of("sweep")
    table = read_table(page.parent)
    row = int(np.flatnonzero((table["parameters.psi"] == 1) & (table["parameters.d"] == 0.3))[0])
    film = (page.parent / str(table["film"][row])).as_uri()

    def leads(act) -> str:
        complaints(tab, page)
        with tab.expect_navigation():
            act()
        tab.wait_for_function("document.querySelector('figure.film.live canvas')?.width > 10")
        return tab.url

    def point(chart: str, x: float, y: float) -> None:
        gd = tab.locator(f"figure:has(h3:text-is('{chart}')) .chart")
        gd.scroll_into_view_if_needed()
        at = gd.evaluate(
            "(gd, [x, y]) => { const { left, top } = gd.getBoundingClientRect();"
            " const { xaxis, yaxis } = gd._fullLayout;"
            " return [left + xaxis._offset + xaxis.d2p(x), top + yaxis._offset + yaxis.d2p(y)]; }",
            [x, y],
        )
        tab.mouse.move(*at)
        tab.wait_for_timeout(200)
        tab.mouse.click(*at)

    def read_aloud() -> None:
        tab.locator("figure:has(h3:text-is('total actin')) .chart").focus()
        first = tab.evaluate("document.activeElement.data.findIndex(one => one.customdata)")
        assert first == 0
        tab.keyboard.press(".")
        tab.keyboard.press("Enter")

    assert leads(lambda: point("total actin", 1, float(table["total_actin"][row]))) == film
    assert leads(lambda: point("outcomes", 1, 0.3)) == film
    assert leads(lambda: tab.locator(".strip a").nth(row).click()) == film
    assert leads(lambda: tab.locator(f"td a[href='{table['film'][row]}']").click()) == film
    assert leads(read_aloud).startswith((page.parent / "runs").as_uri())
