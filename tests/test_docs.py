"""The site: it builds without a warning, says what the code says, and every example on it runs as printed."""

import doctest
import json
import os
import re
import shlex
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path
from types import SimpleNamespace

import pytest
import typer
import yaml
from markdown_it import MarkdownIt
from PIL import Image

from actin_xcheck.cli.app import app
from actin_xcheck.cli.output import schemas
from actin_xcheck.core.errors import Ending
from actin_xcheck.core.model import Closure, Delta, Rheology
from actin_xcheck.runs.method import METHODS
from actin_xcheck.scene.scene import Scene, load_scene, parse_scene
from actin_xcheck.scene.shelf import shipped_scenes
from actin_xcheck.scene.tables import Expect, ReferenceValues
from actin_xcheck.theory.errata import errata
from actin_xcheck.verdicts.known import known
from actin_xcheck.verdicts.orders import Verdict
from benchmarks import gallery
from tests.test_cli import SERIES

ROOT = Path(__file__).parents[1]
STORED = {
    name
    for source in (ROOT / "actin_xcheck").rglob("*.py")
    for name in re.findall(r'^FILE_NAME = "(\w+\.h5)"$', source.read_text(encoding="utf-8"), re.MULTILINE)
}
PAGES = sorted((ROOT / "docs").glob("*.md"))
LONG = ("chart", "closures", "distort", "extremes", "faults", "frontier", "history", "nightly")
"""Commands of a minute and more, and what reads their files: their examples are run every night."""
TEN_LINES = ROOT / "examples" / "ten_lines.toml"


def page(name):
    return (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")


def blocks(path):
    """Language, title and text of every fenced block; snippets are put in place as the site does."""

    def snippet(line):
        return (ROOT / line[1]).read_text(encoding="utf-8").rstrip("\n")

    for token in MarkdownIt().parse(path.read_text(encoding="utf-8")):
        if token.type == "fence":
            language, _, rest = token.info.partition(" ")
            title = re.fullmatch(r'title="(.+)"', rest)
            text = re.sub(r'^--8<-- "(.+)"$', snippet, token.content, flags=re.MULTILINE)
            yield language, title[1] if title else "", text


def tables_of(model):
    """Names of all keys of a table and of the tables in it."""
    for name, field in model.model_fields.items():
        yield field.alias or name
        inner = [one for one in (field.annotation, *getattr(field.annotation, "__args__", ())) if one]
        for one in inner:
            if hasattr(one, "model_fields"):
                yield from tables_of(one)


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_a_page_has_only_blocks_that_are_tested(path):
    before = ""
    for language, title, text in blocks(path):
        assert language in ("console", "python", "toml", "text"), (language, text)
        if language == "text" and not text.startswith("python -m venv"):  # setting up is the CI's own test
            assert before == "python", text
        if language == "console":
            assert text.startswith("$ python -m "), text
        before = language if not title else ""


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("model", [*Closure, *Delta, *Rheology]),
        ("methods", [name for name in METHODS if name.startswith("fv")]),
        ("scene", [*tables_of(Scene), *tables_of(Expect), *tables_of(ReferenceValues)]),
        ("files", [*STORED, "compare.h5", *SERIES]),
        ("questions", Ending),
        ("reports", [*Ending, *Verdict, "NOT JUDGED"]),
    ],
)
def test_a_page_leaves_nothing_out(name, words):
    missing = [word for word in words if not re.search(rf"\b{re.escape(str(word))}\b", page(name))]
    assert not missing


def test_the_ten_line_scene_has_ten_lines_and_is_one():
    assert len(TEN_LINES.read_text(encoding="utf-8").splitlines()) == 10
    assert load_scene(TEN_LINES).name == "ten-lines"


# as printed


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    """An environment of its own that sees what is installed here: a page may install more."""
    folder = tmp_path_factory.mktemp("environment")
    builder = venv.EnvBuilder(with_pip=False)
    context = builder.ensure_directories(folder)
    builder.create(folder)
    paths = {"base": str(folder), "platbase": str(folder)}
    scheme = "venv" if "venv" in sysconfig.get_scheme_names() else sysconfig.get_default_scheme()
    own = Path(sysconfig.get_path("purelib", scheme, paths))
    here = sysconfig.get_path("purelib")
    (own / "here.pth").write_text(f"import site; site.addsitedir({here!r})\n", encoding="utf-8")
    return context.env_exe


class Reader:
    """Does what a page says, in a folder of its own."""

    def __init__(self, python, folder):
        self.python, self.folder, self.printed = python, folder, ""

    def file(self, title, text):
        path = self.folder / title
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")

    def run(self, *words, limit=240):
        # 0: build with what is installed, which this option's variable says by a no to its yes
        environment = {"PIP_NO_BUILD_ISOLATION": "0", "PIP_DISABLE_PIP_VERSION_CHECK": "1", "COLUMNS": "200"}
        done = subprocess.run(
            [self.python, *words],
            cwd=self.folder,
            env=os.environ | environment,
            capture_output=True,
            encoding="utf-8",
            timeout=limit,
            check=False,
        )
        self.printed = done.stdout + done.stderr
        assert done.returncode in (0, 2), self.printed

    def expect(self, text, where):
        """`...` stands for anything; nothing expected, nothing asked."""
        flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
        if text and not doctest.OutputChecker().check_output(text, self.printed, flags):
            pytest.fail(f"{where}\nsays:\n{text}\nbut it is:\n{self.printed}")

    def console(self, text, long=False):
        for part in re.split(r"^\$ python ", text, flags=re.MULTILINE)[1:]:
            command, _, said = part.partition("\n")
            words = shlex.split(command)
            if (words[1] == "actin_xcheck" and words[2] in LONG) is not long:
                continue
            self.run(*words, limit=1200 if long else 240)
            self.expect(said, command)


@pytest.mark.slow
@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_every_example_runs_as_printed(path, python, tmp_path):
    reader, after = Reader(python, tmp_path), ""
    for language, title, text in blocks(path):
        if title:
            reader.file(title, text)
        elif language == "toml":  # a table that is added to the scene above it
            parse_scene(TEN_LINES.read_text(encoding="utf-8") + text, f"{path.name}: {text}")
        elif language == "console":
            reader.console(text)
        elif language == "python":
            reader.run("-c", text)
        elif after == "python":
            reader.expect(text, "the Python above it")
        after = language


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["every-command", "every-night"])
def test_every_long_example_runs_as_printed(name, python, tmp_path):
    reader = Reader(python, tmp_path)
    for language, _, text in blocks(ROOT / "docs" / f"{name}.md"):
        if language == "console":
            reader.console(text, long=True)


def test_long_examples_stand_where_they_are_run():
    for path in PAGES:
        commands = re.findall(
            r"^\$ python -m actin_xcheck (\S+)", path.read_text(encoding="utf-8"), re.MULTILINE
        )
        assert not set(LONG) & set(commands) or path.stem in ("every-command", "every-night"), path
    assert set(LONG) <= set(re.findall(r"actin_xcheck (\w+)", page("every-command") + page("every-night")))


def commands_of(group, name=""):
    """Every command with its options, subcommands by both names."""
    for word, command in getattr(group, "commands", {}).items():
        whole = f"{name} {word}".strip()
        yield whole, {option for one in command.params for option in one.opts}
        yield from commands_of(command, whole)


def test_every_command_is_on_a_page_and_every_answer_has_a_schema():
    said = {
        word
        for schema in schemas().values()
        for command in [schema["properties"]["command"]]
        for word in command.get("enum", (command.get("const"),))
    }
    by_hand = page("json") + page("every-night")
    for name, options in commands_of(typer.main.get_command(app)):
        assert re.search(rf"\b{name.split()[0]}\b", "".join(map(page, (one.stem for one in PAGES)))), name
        if {"--json", "--open"} <= options:  # a study's: all of them say the one answer
            assert name in said, name
        if "--json" in options:
            assert name in said or f"`{name}`" in by_hand, name


def test_the_walk_through_the_house_names_files_that_are_there():
    text, places = page("architecture"), (ROOT, ROOT / "actin_xcheck")
    named = re.findall(r"`((?:\w+/)+(?:\w+\.py)?)`", text)
    assert [name for name in named if not any((place / name).exists() for place in places)] == []
    walk, said = re.search(r"(?s)\n1\. (.*)Those are the (\d+) files", text).groups()
    assert len({name for name in named if name.endswith(".py") and f"`{name}`" in walk}) == int(said) == 25


# the gallery

HUNG = json.loads((gallery.FOLDER / "scenes.json").read_text(encoding="utf-8"))


def test_the_gallery_shows_every_shipped_scene_as_it_is():
    assert list(HUNG) == list(shipped_scenes())
    assert {name: one["digest"] for name, one in HUNG.items()} == {
        name: gallery.digest_of(name) for name in HUNG
    }
    pictures = {path.stem: Image.open(path) for path in gallery.FOLDER.glob("*.webp")}
    assert pictures.keys() == HUNG.keys()
    for name, picture in pictures.items():
        *_, ink = picture.convert("RGBA").split()
        assert ink.getextrema() == (0, 255), name  # a cell, and room around it
        assert min(picture.size) > 150, name


def test_numbers_of_the_gallery_are_true_to_their_uncertainty():
    told = 0
    for name, one in HUNG.items():
        said = re.match(r"area (\d+\.(\d+))(?: ± ([\d.]+))?", one["comes_to"])
        scene = load_scene(name)
        truth = said and known(scene, "area", scene.output_times[-1])
        if truth:
            known_to = float(said[3] or 0) + truth.uncertainty + 10.0 ** -len(said[2])
            assert abs(float(said[1]) - truth.values[0]) <= known_to, name
            told += 1
    assert told >= 8


@pytest.mark.slow
def test_a_scene_is_hung_again_as_it_hangs(tmp_path):
    found = gallery.hung("growing-disk", tmp_path)
    (tmp_path / "gallery").mkdir()
    gallery.hang([found], tmp_path / "gallery")
    (again,) = json.loads((tmp_path / "gallery" / "scenes.json").read_text(encoding="utf-8")).values()
    (now, known_to), (then, known_then) = (
        map(float, re.match(r"area ([\d.]+) ± ([\d.]+)", one["comes_to"]).groups())
        for one in (again, HUNG["growing-disk"])
    )
    assert abs(now - then) <= known_to + known_then
    assert [again[key] for key in ("digest", "verdict")] == [
        HUNG["growing-disk"][key] for key in ("digest", "verdict")
    ]
    assert (tmp_path / "gallery" / "growing-disk.webp").stat().st_size < 20_000


# as built


def build(docs, site):
    """Build the site as CI does."""
    config = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    config |= {"docs_dir": str(docs), "hooks": [str(ROOT / "docs" / "hooks.py")]}
    config["markdown_extensions"][-2]["pymdownx.snippets"]["base_path"] = [str(ROOT)]
    written = site.with_suffix(".yml")
    written.write_text(yaml.safe_dump(config), encoding="utf-8")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(written), "-d", str(site)]
    return subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("docs") / "site"
    done = build(ROOT / "docs", folder)
    assert done.returncode == 0, done.stderr
    return SimpleNamespace(
        **{one.stem: one.read_text(encoding="utf-8") for one in folder.glob("*.html") if one.stem != "404"}
    )


@pytest.mark.slow
def test_the_site_is_whole_and_needs_no_network(site):
    for name, text in vars(site).items():
        fetched = re.findall(r'<(?:link|script|img)[^>]+(?:src|href)="?(?:https?:)?//[^">]+', text)
        assert not fetched, name
        assert "<!-- table" not in text, name
        assert "arithmatex" not in text, name
        assert page(name).count("$$") // 2 == text.count('display="block"') if name != "commands" else True
    assert site.model.count("<tr>") > len(errata())
    for command in typer.main.get_command(app).commands:
        assert f"python -m actin_xcheck {command}</code></h2>" in re.sub(
            r'<a class="headerlink".*?</a>', "", site.commands
        )
    for method in METHODS.values():
        assert method.description in site.methods
    assert site.gallery.count('src="gallery/') == len(shipped_scenes())
    problems = re.findall(r"(?m)^\| `([\w-]+)` \|", page("benchmark"))
    assert len(problems) == 8
    templates = re.findall(r'class="filename">([\w-]+)\.csv<', site.benchmark)
    assert templates == problems


@pytest.mark.slow
@pytest.mark.parametrize(
    ("added", "said"),
    [
        ("[a](nowhere.md) [b](model.md#nowhere)", "nowhere.md|model.md#nowhere"),
        ("<!-- table: nothing -->", "nothing is not a table"),
        (r"$\nocommand x$", "nocommand"),
    ],
)
def test_a_mistake_on_a_page_is_an_error(added, said, tmp_path):
    docs = tmp_path / "docs"
    docs.mkdir()
    for path in PAGES:
        (docs / path.name).write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    (docs / "index.md").write_text(f"{page('index')}\n\n{added}\n", encoding="utf-8")
    done = build(docs, tmp_path / "site")
    assert done.returncode != 0
    assert [one for one in said.split("|") if one not in done.stderr] == []
