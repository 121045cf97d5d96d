"""Pages of every kind as readers see them: nothing clipped, one over another, or without a scale."""

from collections.abc import Callable
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from actin_xcheck.core.outcome import Ending
from actin_xcheck.report.lattice import colour_of
from actin_xcheck.report.svg import STYLES
from actin_xcheck.report.ticks import ticks
from actin_xcheck.studies.frontier.classes import Kind
from tests.chromium import Browser
from tests.colours import SEEN, lab, linear
from tests.legible import unreadable
from tests.picture import PICTURE, WIDTH, take

QUICK = ("compare", "curves", "closures", "faults", "night", "dashboard", "paper", "predict")
SLOW = ("chart", "frontier", "converge", "distort", "extremes")


@pytest.mark.parametrize("kind", [*QUICK, *(pytest.param(one, marks=pytest.mark.slow) for one in SLOW)])
def test_everything_on_a_page_can_be_read(
    browser: Browser, page_of: Callable[[str], Path], kind: str
) -> None:
    for theme in ("light", "dark"):
        browser.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": theme}])
        for width in (1280, 390):
            screen = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600}
            browser.ask("Emulation.setDeviceMetricsOverride", **screen)
            assert browser.complaints(page_of(kind)) == []
            assert unreadable(browser) == []


def test_the_readmes_picture_is_a_report_in_its_colours(
    browser: Browser, page_of: Callable[[str], Path], tmp_path: Path
) -> None:
    take(page_of("curves").parent, tmp_path / "again.png")
    for picture in (PICTURE, tmp_path / "again.png"):
        assert picture.stat().st_size < 400_000
        with Image.open(picture) as image:
            assert (image.mode, image.width) == ("RGB", WIDTH)
            assert len(image.getcolors(image.width * image.height)) > 3000
    assert "python -m tests.picture" in (PICTURE.parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")


AXES = """'{"box": [50, 10, 250, 90], "x": ["linear", 0, 3], "y": ["log", 0.1, 100], "names": ["", ""]}'"""


def drawing(x: tuple[str, ...], y: tuple[str, ...], more: str = "") -> str:
    """A page with one drawing, whose labels stand evenly along its axes: 0 to 3, three decades upwards."""
    across = (
        f'<text class="tick x" x="{50 + 200 * i / 3}" y="105" text-anchor="middle">{one}</text>'
        for i, one in enumerate(x)
    )
    up = (
        f'<text class="tick y" x="45" y="{93 - 80 * i / 3}" text-anchor="end">{one}</text>'
        for i, one in enumerate(y)
    )
    style = "svg { width: 300px } text { font: 9px sans-serif }"
    drawn = "".join((*across, *up, more))
    return f'<style>{style}</style><svg viewBox="0 0 300 120" data-axes={AXES}>{drawn}</svg>'


RIGHT = ("0", "1", "2", "3"), ("0.1", "1", "10", "1e2")


@pytest.mark.parametrize(
    ("page", "said"),
    [
        (drawing(*RIGHT), ""),
        (drawing(("0", "1", "1", "3"), RIGHT[1]), "equal labels"),
        (drawing(RIGHT[0], ("0.1", "1", "", "")), "fewer than three labels"),
        (drawing(RIGHT[0], ("0.1", "1", "30", "1e2")), '"30" stands where another number belongs'),
        (drawing(("0", "1", "2", "1e-9+3.14"), RIGHT[1]), 'no number: "1e-9+3.14"'),
        (drawing(*RIGHT, '<text x="112" y="107">1e-9</text>'), "one over another"),
        (drawing(*RIGHT, '<text x="-20" y="50">exact solution</text>'), "clipped"),
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
def test_what_cannot_be_read_is_noticed(browser: Browser, tmp_path: Path, page: str, said: str) -> None:
    browser.ask(
        "Emulation.setDeviceMetricsOverride", width=1280, height=900, deviceScaleFactor=1, mobile=False
    )
    browser.ask("Emulation.setEmulatedMedia", features=[])
    path = tmp_path / "page.html"
    path.write_text(f"<!doctype html><p>words</p>{page}", encoding="utf-8")
    browser.complaints(path)
    found = unreadable(browser)
    assert [one for one in found if said in one] if said else not found


def test_labels_that_were_rounded_to_one_digit() -> None:
    assert [label for _, label in ticks("linear", 2.8e-5, 5.2e-5, 120, False)] == [
        *("3e−5", "3.5e−5", "4e−5", "4.5e−5", "5e−5")
    ]
    assert [label for _, label in ticks("linear", 3.14033115, 3.140331151, 200, True)] == [
        *("3.1403311500", "3.1403311505", "3.1403311510")
    ]
    assert [label for _, label in ticks("log", 1e-17, 3e-16, 120, False)] == [
        *("1e−17", "3e−17", "1e−16", "3e−16")
    ]
    assert [label for _, label in ticks("linear", 0, 8000, 200, True)] == [
        "0",
        "2000",
        "4000",
        "6000",
        "8000",
    ]


SIZE = st.floats(-12, 8).map(lambda power: 10**power)


@given(
    low=st.one_of(SIZE, SIZE.map(lambda size: -size), st.just(0.0)),
    width=SIZE,
    scale=st.sampled_from(["linear", "log"]),
    across=st.booleans(),
)
def test_every_axis_has_three_labels_that_are_its_numbers(
    low: float, width: float, scale: str, across: bool
) -> None:
    if scale == "log":
        low = abs(low) or 1e-17
    width = max(width, 1e-9 * abs(low))  # what drawings magnify at most
    found = ticks(scale, low, low + width, 200.0, across)
    labels = [label for _, label in found]
    values = np.array([value for value, _ in found])
    assert len(set(labels)) == len(labels) >= 3
    measure = np.log if scale == "log" else np.asarray
    start, *places, end = measure([low, *values, low + width])  # beyond the ends round-off alone may lie
    assert min(places) >= start - 1.01e-6 * (end - start)
    assert max(places) <= end + 1.01e-6 * (end - start)
    said = np.array([float(label.replace("−", "-")) for label in labels])
    assert (np.abs(said - values) <= 0.01 * np.diff(values).min()).all()


# colours

CLASSES = [str(kind) for kind in Kind if kind is not Kind.FAILED]
CLASSES += [f"{Kind.FAILED}: {ending}" for ending in Ending if ending is not Ending.COMPLETED]


@pytest.mark.parametrize("eye", SEEN)
def test_classes_of_runs_are_told_apart_by_every_eye(eye: str) -> None:
    seen = {label: lab(SEEN[eye] @ linear(colour_of(label))) for label in CLASSES}
    apart = {pair: float(np.linalg.norm(seen[pair[0]] - seen[pair[1]])) for pair in combinations(CLASSES, 2)}
    assert min(apart.values()) > 10, min(apart, key=apart.__getitem__)
    assert apart[Kind.ACCURATE, Kind.SILENT] > 40


@pytest.mark.parametrize("eye", SEEN)
def test_lines_are_told_apart_by_every_eye(eye: str) -> None:
    seen = [lab(SEEN[eye] @ linear(style.colour)) for style in STYLES]
    assert min(float(np.linalg.norm(one - other)) for one, other in combinations(seen, 2)) > 12


def test_classes_of_runs_are_told_apart_in_grey() -> None:
    grey = {label: float(lab(linear(colour_of(label)))[0]) for label in CLASSES}
    apart = {pair: abs(grey[pair[0]] - grey[pair[1]]) for pair in combinations(CLASSES, 2)}
    assert min(apart.values()) > 6, min(apart, key=apart.__getitem__)
    assert apart[Kind.ACCURATE, Kind.SILENT] > 25
