"""The pages of the nights in a browser, from file://: keyboard and mouse, narrow and wide, light and dark."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page

from actin_xcheck.core.claim import ClaimKind
from actin_xcheck.core.errors import UserError
from actin_xcheck.nightly.carry_out import ended
from actin_xcheck.nightly.dashboard import lights, sparkline, write_dashboard, write_night_page
from actin_xcheck.nightly.history import FILE_NAME as HISTORY
from actin_xcheck.nightly.history import remember
from actin_xcheck.nightly.record import (
    FILE_NAME,
    Begun,
    Done,
    Kept,
    NotRun,
    Number,
    NumberKind,
    read_night,
    write_night,
)
from actin_xcheck.runs.processes import Lost
from actin_xcheck.studies.compare import FILE_NAME as COMPARISON
from actin_xcheck.studies.compare_page import write_comparison_page
from tests.claims import claim
from tests.histories import series
from tests.lab import FEM, FV
from tests.tags import SCRIPT, Tags, whole_in_itself
from tests.test_report import write_comparison_of_everything

NIGHTS = 9
CHECKS = "compare static-decay fem-p1-paper fv-coupled refine 3", "converge fitted-ring in h", "fault fv-leak"


def done(check: str, night: int, slope: float) -> Done:
    """A check with a claim about conservation, one that fails in the last night, and one without a bound."""
    file = f"checks/{check[:7]}/compare.h5"
    rough = 2.0 if night == NIGHTS - 1 and check == CHECKS[1] else 0.5
    claims = (
        claim(
            "total actin obeys the balance", 1e-15, 1e-12, kind=ClaimKind.CONSERVATION, scene="static-decay"
        ),
        claim(
            f"an order {SCRIPT}", rough, kind=ClaimKind.ORDER_H, scene=f"scene{SCRIPT}", methods=(FEM, FV),
            command="again & again", path="/studies/y", note="note",
        ),
        claim(
            "fv agrees with fem", 0.1, np.nan, kind=ClaimKind.AGREEMENT, scene="static-decay", methods=(FV,),
            note=SCRIPT,
        ),
    )  # fmt: skip
    numbers = (
        Number(f"seconds/{check}", NumberKind.TIME, 1.0 + 0.01 * (night % 3), "s"),
        Number(f"solves/{check}", NumberKind.COUNT, 100.0 if night < 5 else 150.0),
        Number(f"order/{check}", NumberKind.ORDER, slope, "", file),
    )
    if night == NIGHTS - 1 and check == CHECKS[2]:
        return ended(check, Lost("ValueError: <b>no</b> mesh", False), 1.0)
    return Done(check, claims, (file,) * 3, numbers, 1.0, "", (), "checks")


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_nights(tmp_path_factory.mktemp("reports"))


def write_nights(folder: Path) -> Path:
    """Nine nights, the last one red, work that grew in the sixth; and a night with a deliberate fault."""
    for night in range(NIGHTS + 1):
        fault = "fem-leak" if night == NIGHTS else ""
        name = f"2026-03-{night + 1:02d}"
        (folder / name).mkdir()
        commit = "a" * 40 if night < 5 else "b" * 40
        begun = Begun(
            name, f"{name}T02:00:00+00:00", {"commit": commit, "numpy": "2"}, "a machine", "nightly", 10.0,
            fault, "", CHECKS, 0.03,
        )  # fmt: skip
        checks = tuple(done(check, night, 2.0 + 1e-3 * np.sin(night)) for check in CHECKS)
        left_out = (NotRun(f"fault {SCRIPT}", "7.0 s expected, 1.0 s left"),)
        write_night(Kept(folder / name, begun, checks, left_out, 240.0, closed=True))
        if not fault:
            remember(folder / HISTORY, read_night(folder / name))
        write_night_page(folder / name)
    write_dashboard(folder)
    return folder


@pytest.fixture
def last(reports: Path) -> Path:
    return reports / f"2026-03-{NIGHTS:02d}" / "index.html"


def test_the_dashboard_says_how_it_stands_and_what_changed(reports: Path) -> None:
    text = Tags(reports / "index.html").words
    assert "3 of 5 claims hold, 1 is flaky, 1 check broke down, 1 check not run in the last night" in text
    assert "deliberate fault: fem-leak" in text
    assert "100 -> 150 (+50 %)" in text
    grew = r"2026-03-06 ?step, worse solves/compare .* ?\(\+50 %\)commit aaaaaaaaaaaa -> bbbbbbbbbbbb"
    assert re.search(grew, text)
    page = (reports / "index.html").read_text()
    assert "9 nights, red: 2026-03-09" in page
    assert re.search(r"flaky ?orders", text)  # all of its red is
    assert re.search(r"broke down ?negative controls", text)
    own = Tags(reports / f"2026-03-{NIGHTS:02d}" / "index.html").words
    assert re.search(r"flaky ?orders", own)
    assert re.search(rf"flaky ?{CHECKS[1]}", own)
    assert re.search(rf"broke down ?{CHECKS[2]}", own)
    assert page.count('<td class="line"><svg class="spark"') == 6  # claims of the last night with a number
    assert page.count('class="change"') == 2 + 2 + 1  # work grew; checks and a claim turned red


def test_the_night_says_what_fails_and_what_was_not_run(last: Path, reports: Path) -> None:
    text = Tags(last).words
    assert "3 of 5 claims hold, 1 is flaky, 1 check broke down, 1 check not run" in text
    assert "1 more was not run." in text
    assert "7.0 s expected, 1.0 s left" in text
    assert "broke down: ValueError: <b>no</b> mesh" in text
    faulty = Tags(reports / "2026-03-10" / "index.html").words
    assert "A deliberate fault was on all night: fem-leak." in faulty
    assert "/studies/y" in text
    badges = re.findall(r'<span class="badge (\w+)">', last.read_text(encoding="utf-8"))
    assert [badges.count(one) for one in ("flaky", "broken", "fail")] == [3, 3, 0]
    assert "again & again" in text


def test_pages_are_whole_in_themselves_light_and_take_no_markup(reports: Path, last: Path) -> None:
    for page in (reports / "index.html", last):
        tags = whole_in_itself(page)
        assert len(tags.scripts) == 1
        assert f"an order {SCRIPT}" in tags.text
        assert page.stat().st_size < 200_000
        drawn = [attributes for tag, attributes in tags.tags if tag == "svg" and "role" in attributes]
        assert all(attributes.get("aria-label") for attributes in drawn)


def test_links_between_pages_lead_somewhere(reports: Path, last: Path) -> None:
    for page in (reports / "index.html", last):
        for link in Tags(page).attributes("a", "href"):
            apart = not link or link.startswith("#") or "checks/" in link or link.endswith(("json", "xml"))
            if not apart:
                target, _, anchor = link.partition("#")
                found = page.parent / target
                assert found.is_file(), link
                assert not anchor or f'id="{anchor}"' in found.read_text()


def test_scenes_are_a_click_from_night_and_dashboard(reports: Path, last: Path, tmp_path: Path) -> None:
    shutil.copytree(last.parent, tmp_path / last.parent.name)
    shutil.copy(reports / HISTORY, tmp_path / HISTORY)
    night = tmp_path / last.parent.name
    (night / "checks").mkdir()
    write_comparison_of_everything(night / "checks", refine=2)
    write_comparison_page(night / "checks" / COMPARISON)
    (tmp_path / "chart-1").mkdir()
    for name in ("chart.h5", "index.html"):
        (tmp_path / "chart-1" / name).touch()
    page = write_night_page(night)
    tags = Tags(page)
    scene = "checks/index.html"
    assert tags.attributes("a", "href").count(scene) > len(CHECKS)
    assert "../chart-1/index.html" in tags.attributes("a", "href")
    pictures = tags.attributes("img", "alt")
    assert len(pictures) == len(CHECKS) - 1  # one broke down, and has no folder
    assert all(alt and alt.startswith("a of f") for alt in pictures)
    links = Tags(write_dashboard(tmp_path)).attributes("a", "href")
    assert f"{night.name}/{scene}" in links
    assert "chart-1/index.html" in links
    assert page.stat().st_size < 200_000
    (night / "checks" / "0.vtkhdf").unlink()  # without its runs a page has no picture
    assert not Tags(write_night_page(night)).attributes("img", "alt")


def test_a_folder_without_nights_and_a_damaged_one(tmp_path: Path) -> None:
    assert "No night is in the history" in write_dashboard(tmp_path).read_text()
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / FILE_NAME).write_text("nothing")
    write_dashboard(tmp_path)
    with pytest.raises(UserError, match="not a night"):
        write_night_page(tmp_path / "broken")


def test_sparklines_say_and_draw_the_same() -> None:
    line = series("key", NumberKind.ERROR, [1.0, 10.0, np.nan, 100.0])
    drawn = sparkline(line, {line.nights[3].name})
    assert "4 nights: 1 to 100, between 1 and 100; changed in 2026-03-04" in drawn
    lines = re.findall(r'points="([^"]*)"', drawn)
    heights = [float(point.split(",")[1]) for line in lines for point in line.split()]
    assert len(lines) == 2  # nothing is drawn where there is no number
    assert heights == pytest.approx([19.0, 11.0, 3.0])  # a logarithm, upwards
    level = sparkline(series("key", NumberKind.ERROR, [1.0, 1.0 + 1e-9, 1.0]))
    assert len(set(re.findall(r",([\d.]+)", level))) == 1
    assert "no number" in sparkline(series("key", NumberKind.ERROR, [np.nan]))
    assert "1 night: 2 to 2" in sparkline(series("key", NumberKind.ERROR, [2.0]))


def test_lights_are_told_apart_without_colours() -> None:
    drawn = lights([("n0", "pass"), ("n1", "fail"), ("n<2", "none")])
    heights = re.findall(r'class="(\w+)" x="\d+" y="\d+" width="5" height="(\d+)"', drawn)
    assert dict(heights)["fail"] > dict(heights)["pass"]
    assert "n&lt;2: not run" in drawn


SHOWN = "[...document.querySelectorAll('tr.claim')].filter(row => row.offsetParent).length"


def test_claims_are_filtered_by_typing_and_choosing(tab: Page, reports: Path, last: Path) -> None:
    for page in (reports / "index.html", last):
        tab.goto(page.as_uri())
        assert tab.evaluate(SHOWN) == 7
        tab.click("input[name=text]")
        tab.keyboard.type("balance")
        assert tab.evaluate(SHOWN) == 2
        assert tab.evaluate("document.querySelector('output').textContent") == "2 of 7 shown"
        tab.evaluate("document.querySelector('input[name=text]').select()")
        tab.keyboard.press("Delete")
        assert tab.evaluate(SHOWN) == 7
        tab.evaluate("document.querySelector('select').focus()")
        tab.keyboard.press("ArrowDown")
        assert tab.evaluate("document.querySelector('select').value") == "fail flaky broken"
        assert tab.evaluate(SHOWN) == 2
        heads = "[...document.querySelectorAll('tbody[data-check]')].filter(body => body.offsetParent).length"
        assert tab.evaluate(heads) == 2


def test_from_a_red_light_to_its_number_with_the_keyboard(tab: Page, reports: Path, last: Path) -> None:
    tab.goto((reports / "index.html").as_uri())
    tab.keyboard.press("Tab")
    assert tab.evaluate("document.activeElement.className") == "skip"
    tab.keyboard.press("Enter")
    assert tab.evaluate("document.activeElement.id") == "main"
    tab.goto(last.as_uri())
    tab.evaluate("document.querySelector('.failing a').focus()")
    tab.keyboard.press("Enter")
    tab.evaluate("new Promise(resolve => setTimeout(resolve, 100))")
    opened = "document.querySelector(location.hash + ' details')"
    assert tab.evaluate(f"{opened}.open")
    text = tab.evaluate(f"{opened}.innerText")
    assert "again & again" in text
    assert "compare.h5 /studies/y" in " ".join(text.split())
    tab.click("tr.claim[data-state=pass] summary")
    assert tab.evaluate("document.querySelector('tr.claim[data-state=pass] details').open")


def test_checks_are_sorted_by_a_click(tab: Page, last: Path) -> None:
    tab.goto(last.as_uri())
    names = "[...document.querySelectorAll('#checks ~ div tbody tr, [aria-labelledby=checks] tbody tr')]"
    order = f"{names}.map(row => row.cells[1].textContent).join('|')"
    before = tab.evaluate(order)
    tab.click("[aria-labelledby=checks] th:nth-child(2) button")
    assert tab.evaluate(order).split("|") == sorted(before.split("|"), reverse=True)
    assert tab.evaluate("document.querySelector('[aria-sort]').getAttribute('aria-sort')") == "descending"
    tab.click("[aria-labelledby=checks] th:nth-child(2) button")
    assert tab.evaluate(order).split("|") == sorted(before.split("|"))


def test_print_leaves_out_what_cannot_be_used(tab: Page, last: Path) -> None:
    tab.goto(last.as_uri())
    tab.emulate_media(media="print")
    assert tab.evaluate("getComputedStyle(document.querySelector('form')).display") == "none"
    assert tab.evaluate("getComputedStyle(document.querySelector('nav')).display") == "none"
    assert tab.evaluate(SHOWN) == 7
