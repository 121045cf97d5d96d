"""Bad input: one printable line, in bounded time and memory, and nothing written where nobody asked."""

import os
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from actin_xcheck.core.errors import LONGEST, Ending, Outcome, UserError, brief
from actin_xcheck.report.draw import draw
from actin_xcheck.report.exhibits import Line, Plot, Sheet
from actin_xcheck.report.page import environment
from actin_xcheck.scene.expression import MAX_CALLS, Expression, coordinates
from actin_xcheck.scene.scene import Scene, load_scene, parse_scene
from actin_xcheck.scene.shelf import MAX_SIZE, scene_text
from actin_xcheck.studies.compare_page import write_comparison_page
from tests.claims import claim
from tests.hostile import MEGABYTES, campaign, summary
from tests.hostile_inputs import DOCUMENTS, NAMES, SMALL, TAGS, formula
from tests.lab import refusal
from tests.processes import posix
from tests.studies import write_comparison
from tests.tags import Tags
from tests.test_report import SCENE, write_run

PLANE = ("x", "y", "r", "theta")
QUICK = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])


@pytest.mark.slow
def test_a_campaign_of_hostile_inputs_finds_nothing():
    answers, grown = campaign(300, seed=11)
    assert not [answer for answer in answers if answer.problem], summary(answers, grown)
    assert grown < MEGABYTES
    # a campaign that never got past the loader, or always did, would have tried nothing
    endings = {answer.ending for answer in answers}
    assert endings >= {"refused", "completed", "tangled", "exit 2", "read"}


@pytest.mark.slow
@pytest.mark.nightly
def test_ten_thousand_hostile_inputs_find_nothing():
    answers, grown = campaign(10_000, seed=1)
    assert not [answer for answer in answers if answer.problem], summary(answers, grown)
    assert grown < MEGABYTES


def test_a_campaign_sees_what_it_looks_for(monkeypatch, tmp_path):
    """An input that is believed, or a file written elsewhere, is a problem of the campaign."""
    elsewhere = tmp_path / "elsewhere"

    def careless(path: Path) -> Scene:
        elsewhere.write_text("written")
        raise KeyError(path)

    monkeypatch.setattr("tests.hostile.load_scene", careless)
    monkeypatch.setattr("tests.hostile._warm_up", lambda out: None)
    answers, _ = campaign(20, seed=2)
    found = [answer for answer in answers if not answer.kind.startswith(("command", "stored"))]
    assert all(str(elsewhere) in answer.problem for answer in found)
    assert {answer.ending for answer in found} == {"exception"}


@given(st.randoms(use_true_random=False))
@QUICK
def test_an_expression_is_arithmetic_or_refused_in_a_sentence(random):
    text = formula(random, 4)
    sentence = refusal(Expression, text, PLANE)
    assert len(sentence) < 400
    if not sentence:
        assert Expression(text, PLANE)(**coordinates(np.ones((2, 3)))).shape == (3,)


@given(st.text(st.characters(codec=None), max_size=40))
@example("\ud800")
@example("\u202e\u2028\x1b[2J\0")
@QUICK
def test_any_text_fits_a_line(text):
    assert brief(text).isprintable()
    assert str(UserError(text)).isprintable()
    if text.isprintable():
        assert brief(text) == text


def test_a_mistake_is_never_longer_than_a_line():
    assert len(str(UserError("x" * 10**7))) <= LONGEST + 3


@given(st.sampled_from(["name", "source", "initial.a", "time.end", "probes.points", "key"]), st.data())
@QUICK
def test_any_value_for_any_key_is_taken_or_refused(key, data):
    """Values of the wrong type, size or range, as TOML writes them."""
    text = data.draw(st.text(st.characters(codec="utf-8", exclude_characters="'\n\r"), max_size=60))
    numbers = st.one_of(st.integers(), st.floats(), st.booleans(), st.dates())
    value = data.draw(st.one_of(st.just(f"'{text}'"), numbers.map(lambda one: str(one).lower())))
    old, new = {
        "name": ('name = "h"', f"name = {value}"),
        "source": ('source = "me"', f"source = {value}"),
        "initial.a": ('a = "1 + 0.1*x"', f"a = {value}"),
        "time.end": ("end = 0.1", f"end = {value}"),
        "probes.points": ("[1, 0]", f"[{value}, 0]"),
        "key": ("end = 0.1", f"end = 0.1\n'{text}' = 1"),
    }[key]
    assert old in SMALL
    line = refusal(parse_scene, SMALL.replace(old, new), "h.toml")
    assert line.isprintable()
    assert not line or line.startswith("h.toml: ")
    if not line:
        name = parse_scene(SMALL.replace(old, new), "h.toml").name
        assert Path("out", name).resolve().parent == Path("out").resolve()


@pytest.mark.parametrize("size", [10, 3000, MAX_SIZE // 20])
@pytest.mark.parametrize("document", DOCUMENTS)
def test_documents_of_any_size_are_taken_or_refused(document, size):
    assert len(refusal(parse_scene, document(size), "h.toml")) < 600


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("CON", "a..", "a.toml", "a--fem")])
def test_a_name_stays_in_its_folder_and_out_of_the_markup(name):
    quote = "'" if '"' in name else '"'
    line = refusal(parse_scene, SMALL.replace('"h"', f"{quote}{name.replace(quote, '')}{quote}"), "h.toml")
    assert line.startswith("h.toml: name = ")
    assert line.isprintable()


@posix
def test_files_that_are_no_files(tmp_path):
    """Nothing waits for a pipe, follows a loop of links or reads a device without an end."""
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "loop.toml").symlink_to(tmp_path / "loop.toml")
    (tmp_path / "endless.toml").symlink_to("/dev/zero")
    (tmp_path / "empty.toml").touch()
    (tmp_path / "large.toml").write_bytes(b"#" * (MAX_SIZE + 1))
    for name, reason in {
        "pipe": "not a regular file",
        "loop": "levels of symbolic links",
        "endless": "not a regular file",
        "empty": "name is missing",
        "large": f"larger than {MAX_SIZE} bytes",
        "a\nb": "No such file",
    }.items():
        with pytest.raises(UserError, match=reason) as refusal:
            load_scene(tmp_path / f"{name}.toml")
        assert str(refusal.value).isprintable()


def test_files_that_are_no_scenes(tmp_path):
    folder, text = tmp_path / "folder.toml", tmp_path / "latin.toml"
    folder.mkdir()
    text.write_bytes("name = 'é'".encode("latin-1"))
    with pytest.raises(UserError, match=re.escape(f"{folder}: cannot be read (Is a directory)")):
        load_scene(folder)
    with pytest.raises(UserError, match=re.escape(f"{text}: not UTF-8 text")):
        load_scene(text)
    with pytest.raises(UserError, match=r"absent.toml: cannot be read \(No such file or directory\)"):
        scene_text(tmp_path / "absent.toml")
    with pytest.raises(UserError, match="cannot be read"):
        load_scene("a\0b.toml")


def test_the_bound_on_work_leaves_room_for_what_scenes_need():
    """Ten Bessel functions or a hundred powers, and not one more."""
    Expression("+".join(["J(2, 3*r)"] * 10), PLANE)
    Expression(f"({'+'.join(['x**2'] * 50)}) + ({'+'.join(['sin(x)'] * 50)})", PLANE)
    with pytest.raises(ValueError, match=f"101 functions and powers.*at most {MAX_CALLS}"):
        Expression(f"({'+'.join(['x**2'] * 50)}) + ({'+'.join(['sin(x)'] * 51)})", PLANE)


def elements(page: Tags) -> list[tuple[str, tuple[str, ...]]]:
    """Tags of a page, and the names of their attributes."""
    return [(tag, tuple(attributes)) for tag, attributes in page.tags]


def _page_with(tag: str, folder: Path) -> str:
    """The page of a comparison whose citation, outcome, claim and method carry some text."""
    folder.mkdir()
    outcome = Outcome(Ending.TANGLED, f"triangle {tag}")
    path, method = folder / "run.vtkhdf", f"fem-{tag.replace('/', '')}"
    write_run(path, "a-scene", method, refine=1, outcome=outcome)
    said = {"command": f"compare {tag}", "path": f"/runs/{tag}", "note": tag, "quantity": tag}
    made = claim(tag, 1.0, 2.0, scene="a-scene", methods=(method,), **said)
    file = write_comparison(folder, [made], {"a-scene/m": path}, f"python {tag}")
    return write_comparison_page(file).read_text(encoding="utf-8")


def test_hostile_words_make_no_markup_in_a_comparison(tmp_path, monkeypatch):
    """The page has the same elements and attributes whatever is said in it."""
    plain = Tags(_page_with("harmless", tmp_path / "plain"))
    tags = " ".join(TAGS)
    citation = tags.replace('"', '\\"')
    monkeypatch.setattr("tests.test_report.SCENE", SCENE.replace("Fig. 14 <b>&</b> section 5.3.2", citation))
    page = Tags(_page_with(tags, tmp_path / "hostile"))
    assert elements(page) == elements(plain)
    assert page.text.count(tags) >= 5


@pytest.mark.parametrize("tag", TAGS)
def test_hostile_words_make_no_markup_in_an_exhibit(tag):
    """Titles, notes, labels, marks and cells of tables, in HTML and in SVG."""

    def shown(word: str) -> Tags:
        x = np.array([1.0, 2.0])
        plot = Plot("k", word, word, word, (Line(word, x, x),), ((word, 1.5),), log=False)
        sheet = Sheet("s", word, word, ((word, word), (word, "1")))
        macro = environment(Path()).from_string(
            '{% from "parts.html" import exhibits %}{{ exhibits(drawings) }}'
        )
        return Tags(macro.render(drawings=[draw(one, word) for one in (plot, sheet)]))

    plain, hostile = shown("harmless"), shown(tag)
    assert elements(hostile) == elements(plain)
    assert hostile.text.count(tag) >= 9
