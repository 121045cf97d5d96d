"""Exhibits in files and on pages: they come back as they were, and the page holds all and no markup."""

import html
import json
import re
from dataclasses import dataclass, fields
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from actin_xcheck.cli import predict
from actin_xcheck.core.mesh import disk
from actin_xcheck.report.draw import draw
from actin_xcheck.report.exhibits import (
    Chapter,
    Exhibit,
    Line,
    Outline,
    Outlines,
    Picture,
    Plot,
    Regions,
    Sheet,
    Shot,
    Shots,
    read_chapters,
    shares,
    write_exhibits,
)
from actin_xcheck.report.page import write_page
from actin_xcheck.runs.records import gathered, read_record, write_record
from actin_xcheck.runs.store import reading
from actin_xcheck.studies.study import Report, write_report
from actin_xcheck.studies.theory import DrawnChapter
from tests.tags import Tags, whole_in_itself
from tests.test_cli import cli

EVIL = "<script>console.error('injected')</script> & \"$\\frac{1}{2}$\" ψ̃"
MESH = disk(3, 0.8)


def exhibits():
    """One of every class, with everything that could break: markup, nan, empty tuples, one value only."""
    x = np.linspace(0, 3, 50)
    circle = np.linspace(0, 2 * np.pi, 25)
    lines = (
        Line(f"sin {EVIL}", x, np.where(x > 1, np.nan, np.sin(x))),
        Line("measured", x[::10], np.cos(x[::10]), points=True),
    )
    field = np.outer(np.linspace(0, 1, 9), np.cos(circle))
    shots = tuple(
        Shot(f"t = {t} {EVIL}", MESH.xi * (1 + t), MESH.triangles, 1 + t * MESH.centroids[0])
        for t in (0.0, 0.1, 0.4)
    )
    rim = np.array([np.cos(circle), np.sin(circle)])
    rims = (Outline(f"t = 1 {EVIL}", 1.2 * rim, rim, False), Outline("lost", 1.5 * rim, rim, True))
    codes = (np.arange(60)[:, None] + np.arange(80)) // 35
    names = ("stable", EVIL, "T: w1,1", "OS: w1,1", "never")
    labels = (("stable", 0.2, 0.2), (EVIL, 1.2, 0.9))
    axes = (np.linspace(0.1, 3.9, 80), np.linspace(0.05, 1.95, 60))
    return (
        Plot("curve", f"Curve {EVIL}", f"note {EVIL}", EVIL, lines, ((f"k {EVIL}", 1.5), ("k2", 2.5))),
        Plot("bare", "Bare", "", "x", (Line("constant", x, np.ones_like(x)),)),
        Picture("field", f"Field {EVIL}", field),
        Picture("positive", "Positive", 1 + field**2),
        Shots("cells", f"Cells {EVIL}", f"note {EVIL}", shots),
        Outlines("rims", f"Rims {EVIL}", f"note {EVIL}", rims),
        Regions("map", f"Map {EVIL}", f"note {EVIL}", EVIL, "p", *axes, codes, names, lines, labels),
        Regions("blank", "Blank", "", "ψ", "p", *axes, 0 * codes, ("stable",)),
        Sheet("table", f"Table {EVIL}", f"note {EVIL}", (("m", EVIL), ("0", "1.5 ± 0.5i"), (EVIL, ""))),
        Sheet("headless", "Header only", "", (("m", "ψ"),)),
    )


def same(one, other) -> bool:
    """Equal in class and in every field, arrays in type and value."""
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if hasattr(one, "__dataclass_fields__"):
        return all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    return one == other


@dataclass(frozen=True)
class Counted:
    rows: tuple[tuple[int, ...], ...]
    pairs: tuple[tuple[int, int], ...]
    holds: tuple[tuple[bool, ...], ...]
    widths: tuple[tuple[float, ...], ...]
    named: tuple[tuple[str, int, float], ...]


COUNTED = Counted(((2**62 + 1, 2), (3, 4)), ((1, 2),), ((True, False),), ((1.0, 0.5),), (("a", 1, 2.0),))


@pytest.mark.parametrize(
    ("record", "kind"),
    [
        *((one, Exhibit) for one in exhibits()),
        (DrawnChapter(exhibits()), DrawnChapter),
        (COUNTED, Counted),
        (Counted((), (), (), (), ()), Counted),
    ],
)
def test_every_record_comes_back_as_it_was(tmp_path, record, kind):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        write_record(file.create_group("one"), record)
    with h5py.File(tmp_path / "x.h5") as file:
        assert kind is not Exhibit or file["one"].attrs["class"] == type(record).__name__
        assert same(read_record(file["one"], kind), record)


def test_a_record_is_gathered_from_the_first_that_has_it():
    line = Line("first", np.zeros(1), np.ones(1), style=3)
    found = gathered(Line, Sheet("key", "t", "n", ()), line, Plot("p", "t", "n", "x", ()), y=np.zeros(1))
    assert (found.label, found.style, found.y[0], found.shape) == ("first", 3, 0, "circle")
    with pytest.raises(TypeError, match="'x' and 'y'"):
        gathered(Line, Sheet("key", "t", "n", ()), label="neither has a place")


def test_shares_leave_out_what_a_logarithm_has_no_place_for():
    plot = shares("t", "n", "x", "bound", {"some": [4.0, 0.0, np.inf, 0.5, np.nan], "none": [0.0]})
    (line,) = plot.lines
    assert (line.label, line.x.tolist(), line.y.tolist()) == ("some", [0.5, 4.0], [0.5, 1.0])
    assert plot.marks == (("bound", 1.0),)
    assert plot.log


def test_an_exhibit_that_would_not_come_back_is_refused_and_nothing_half_written_left(tmp_path):
    plot, bare, *_, table, _ = exhibits()
    twice = Chapter("same", "t", "", (plot, plot))
    with pytest.raises(ValueError, match="two exhibits"):
        write_report(tmp_path / "predict.h5", "predict", Report("", "", chapters=(twice,)), "")
    assert not list(tmp_path.iterdir())
    with h5py.File(tmp_path / "x.h5", "w") as file:
        with pytest.raises(ValueError, match=r"two exhibits have the key 'curve'"):
            write_exhibits(file.create_group("twice"), (plot, bare, plot))
        with pytest.raises(ValueError, match="not of one length"):
            write_record(file.create_group("ragged"), Sheet("t", "t", "", (("a", "b"), ("c",))))
        write_record(file.create_group("strange"), table)
        file["strange"].attrs["class"] = "Chapter"
        with pytest.raises(
            ValueError,
            match=r"Plot, Intervals, Picture, Shots, Outlines, Regions, Classes, Sheet, not 'Chapter'",
        ):
            read_record(file["strange"], Exhibit)


def chapters():
    everything = exhibits()
    return (
        Chapter("first", f"First {EVIL}", f"note {EVIL}", everything[:5]),
        Chapter("again", "Again", "", everything[4:]),
    )


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("theory")
    report = Report(f"Title {EVIL}", f"lead {EVIL}", findings=(EVIL,), chapters=chapters())
    write_report(folder / "predict.h5", "predict", report, f"python -m actin_xcheck predict report {EVIL}")
    assert [path.name for path in folder.iterdir()] == ["predict.h5"]
    return write_page(folder / "predict.h5")


def test_the_page_holds_every_exhibit_and_where_it_stands(page):
    text = Tags(page).words
    with reading(page.parent / "predict.h5", "report") as file:
        stored, stated = read_chapters(file["exhibits"]), dict(file.attrs)
    assert all(map(same, stored, chapters()))
    for chapter in stored:
        assert " ".join(chapter.title.split()) in text
        for one in chapter.exhibits:
            assert " ".join(one.title.split()) in text
            assert f"/exhibits/{chapter.key}/{one.key}" in text
    for name in ("commit", "numpy", "platform", "schema", "date"):
        assert str(stated[name]) in text
    assert stated["command"] in text
    assert "never" not in text  # a region that does not occur needs no legend


def test_the_page_is_whole_in_itself_and_takes_no_markup(page):
    tags = whole_in_itself(page)
    assert tags.text.count("<script>") > 20
    assert "\\frac" in tags.text  # nor is it mathematics
    assert all(tags.attributes("svg", "aria-label"))
    links = [link for link in tags.attributes("a", "href") if not link.startswith("#")]
    assert links == ["predict.h5"]


def test_maps_are_drawn_where_their_pixels_are():
    """The code at (x, y) has its colour and its name there, and regions that do not occur no legend."""
    *_, regions, _, _, _ = exhibits()
    pixels, *rest = draw(regions, "/x").figure["data"]
    assert np.array_equal(pixels["z"], regions.codes)
    assert (pixels["x"], pixels["y"]) == (pytest.approx(regions.x), pytest.approx(regions.y))
    assert [html.unescape(name) for name in pixels["names"]] == list(regions.names)
    colours = dict(zip(pixels["names"], [colour for _, colour in pixels["colorscale"][::2]], strict=True))
    legend = {one["name"]: one["marker"]["color"] for one in rest if "marker" in one}
    lines = [re.sub("<br>| ", "", name) for name in legend]
    assert lines == [name.replace(" ", "") for name in list(colours)[:4]]
    assert list(legend.values()) == list(colours.values())[:4]


@pytest.mark.slow
def test_threshold_names_the_lowest():
    def found(*arguments):
        done = CliRunner().invoke(predict.app, ["threshold", "--json", *arguments], catch_exceptions=False)
        return json.loads(done.stdout)

    free = found("--p", "0.26", "--closure", "traction-free", "--m", "0:1")
    zero, one = (each["psi"] for each in free["thresholds"])
    assert zero < one
    assert free["lowest"] == {"m": 0, "psi": zero, "crossing": "pair"}
    assert found("--p", "1.646", "--delta", "full", "--m", "1:1")["lowest"] is None


@pytest.mark.slow
def test_a_browser_shows_its_pictures(tab, page):
    tab.goto(page.as_uri())
    pictures = "Array.from(document.images, image => image.naturalWidth > 100)"
    assert tab.evaluate(pictures) == [True] * (2 + 3 + 3)


@pytest.mark.slow
@pytest.mark.nightly
def test_the_whole_report(tmp_path):
    done = cli("predict report --quiet --out r", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "Linear theory; report: r/index.html\n"
    with reading(tmp_path / "r/predict.h5", "report") as file:
        stored = {one.key: one for chapter in read_chapters(file["exhibits"]) for one in chapter.exhibits}
    versions = ("printed", "corrected", "reference-normal", "traction-free")
    assert {f"fig23a-{version}" for version in versions} <= stored.keys()
    for closure in ("reference-normal", "traction-free"):
        table = stored[f"thresholds-{closure}"].rows
        psi = [float(row[1]) for row in table[1:]]
        assert psi[0] == pytest.approx(100.642, abs=1e-3)
        assert all(before < after for before, after in pairwise(psi))
        assert all(abs(float(row[6].rstrip("%"))) < 0.5 for row in table[1:])
    assert (tmp_path / "r/index.html").stat().st_size < 4e6
