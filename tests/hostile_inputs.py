"""Hostile inputs, drawn by a seed: scenes, files of runs, reports and commands that nobody should send."""

import functools
import random
import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actin_xcheck.report.exhibits import Chapter, Line, Picture, Plot, Sheet
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.scene.shelf import scene_text, shipped_scenes
from actin_xcheck.studies.study import Report, write_report
from tests.claims import claim
from tests.studies import write_comparison


@functools.cache
def a_report(kind: str) -> dict[str, bytes]:
    """The files of a report's folder by their relative names, the one that names its kind first."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        main = {"comparison": _comparison, "predict": _study}[kind](folder)
        files = sorted((path for path in folder.rglob("*.*5") if path.is_file()), key=lambda one: one != main)
        files += [path for path in folder.rglob("*.vtkhdf") if path.is_file()]
        return {str(path.relative_to(folder)): path.read_bytes() for path in files}


REPORTS = ("comparison", "predict")


def _comparison(folder: Path) -> Path:
    scene, path = load_scene("static-decay"), folder / "runs" / "decay.vtkhdf"
    path.parent.mkdir()
    run(scene, Numerics(METHODS["fem-p1-paper"], 1, 0.25), path)
    made = claim("conserves", 1e-15, 1e-12, scene=scene.name, methods=("fem-p1-paper",))
    return write_comparison(folder, [made], {f"{scene.name}/fem-p1-paper": path})


def _study(folder: Path) -> Path:
    x = np.linspace(1, 2, 5)
    exhibits = (
        Plot("k", "t", "n", "x", (Line("l", x, x**2),), (("m", 1.5),)),
        Picture("p", "t", np.outer(x, np.ones(9))),
        Sheet("s", "t", "n", (("a", "b"), ("1", "2"))),
    )
    report = Report("t", "l", findings=("f",), chapters=(Chapter("c", "t", "n", exhibits),))
    write_report(folder / "predict.h5", "predict", report, "predict report")
    return folder / "predict.h5"


SMALL = """name = "h"
source = "me"
[parameters]
psi = 10.0
p = 0.1
[model]
delta = "ring"
[initial]
a = "1 + 0.1*x"
[time]
end = 0.1
outputs = [0.05]
[probes]
points = [[0, 0], [1, 0]]
"""
MODE = """name = "h"
[parameters]
psi = 240
p = 0
[model]
delta = "none"
[initial]
a = "1"
eigenmode = { m = 1, n = 1, amplitude = 1e-3 }
[time]
end = 0.1
"""
FORMULAS = {
    "a": "{} + 0.1*x",
    "u": '[initial]\nu = ["{}", "0"]',
    "motion": '[motion]\nx = "{}"\ny = "y0"',
    "source": '[source]\na = "{}"',
}
TAGS = (
    *("<script>alert(1)</script>", '"onload="x', "</svg>", "]]>", "<img src=x onerror=y>", "&lt;", "'\"><b>"),
)
NAMES = (
    *("../up", "a/b", "/etc/passwd", "..", ".", "a\\\\b", "C:x", "~", "$HOME", "-rf", "", " ", "a b", "CON"),
    *("a\\nb", "a\\u0000b", "é", "\\u202Ex", "x" * 81, "x" * 5000, "a..", "a.toml", "a--fem", *TAGS),
)
NUMBERS = (
    *("0", "-0.0", "1e300", "-1e300", "1e-300", "5e-324", "inf", "-inf", "nan", "true", "1979-05-27"),
    *("07:32:00", '"1"', "[]", "{}", "[1]", "9" * 400, "9" * 5000, "0x" + "f" * 5000, "-1", "1", "0.5"),
    *("1e9", "1e-9", "100", "0.9999999999999999", "0.49999999999999994", "1e6", "1e-6", "3", "11", "1_0"),
    *("0b1", "1e400", "'x'"),
)
ATOMS = (
    *("x", "y", "r", "theta", "x0", "y0", "t", "pi", "0", "1", "2", "0.5", "1e308", "1e-308", "9" * 400),
    *("1e999", "nan", "inf", "1j", "True", "None", "...", "'a'", "b'a'", "f'{x}'", "__import__", "os"),
    *("self", "_tree", "ｘ", "ſin", "π", "\\u202e", "\\u0000", "\\u001b[2J", "J", "sin", "eval", "print"),
    *("0x1p3", "1_0", "lambda: 1"),
)
SHAPES = (
    *("({} + {})", "{} - {}", "{}*{}", "{}/{}", "{}**{}", "-{}", "+{}", "sin({})", "exp({})", "log({})"),
    *("sqrt({})", "abs({})", "arctan2({}, {})", "minimum({}, {})", "heaviside({})", "J(1, {})", "J({}, {})"),
    *("J(1e9, {})", "{}.__class__", "{}[0]", "{}({})", "[{} for x in {}]", "(x := {})", "{} if {} else 1"),
    *("not {}", "{}^{}", "{} // {}", "{} % {}", "{} << {}", "{} @ {}", "{}; {}", "{} # {}", "{}, {}"),
    *("sin(*{})", "{}\\n{}"),
)
BOMBS: tuple[Callable[[int], str], ...] = (
    lambda n: "(" * n + "x" + ")" * n,
    lambda n: "-" * n + "x",
    lambda n: "not " * n + "x",
    lambda n: "1" + "+1" * n,
    lambda n: "x" + "**x" * n,
    lambda n: "9" + "**9" * min(n, 900),
    lambda n: "x" + ".a" * n,
    lambda n: "x" + "[0]" * n,
    lambda n: "sin(" * n + "x" + ")" * n,
    lambda n: "x" * n,
    lambda n: "1" + "+J(71, 119+x)" * min(n, 300),
    lambda n: "1" + "+cos(9e99*x)" * min(n, 300),
    lambda n: "'a'*" + "9" * n,
)
DOCUMENTS: tuple[Callable[[int], str], ...] = (
    lambda n: SMALL + "z = " + "[" * n + "]" * n,
    lambda n: SMALL + "z = " + "{a=" * n + "1" + "}" * n,
    lambda n: SMALL + "z" + ".a" * n + " = 1",
    lambda n: SMALL + "[z" + ' . "a"' * n + "]",
    lambda n: SMALL + "\n".join(f"[z{'.a' * 15}.b{i}]" for i in range(n // 20)),
    lambda n: SMALL + "\n".join(f"k{i} = 1" for i in range(n)),
    lambda n: SMALL.replace("[0.05]", "[" + ",".join(f"{i + 1}e-9" for i in range(n)) + "]"),
    lambda n: SMALL.replace("[1, 0]", "[1, 0]," * n),
    lambda n: SMALL.replace("[1, 0]", "[]," * n),
    lambda n: SMALL + "[[expect.reference.at]]\ntime = 0.1\n" * n,
    lambda n: SMALL + "#" * n,
    lambda n: SMALL.replace('"me"', '"' + "m" * n + '"'),
    lambda n: SMALL.replace("0.1\nout", "0x" + "f" * n + "\nout"),
)
WORDS = (
    *("run", "compare", "report", "scenes", "show", "predict", "modes", "nothing", "-", "--", "", "\u202e"),
    "a\nb",
)
OPTIONS = (
    *("--refine", "--dt", "--rtol", "--method", "--out", "--accuracy", "--psi", "--p", "--m", "--above"),
    *("--nope", "--refine=99999999999999999999", "--dt=nan", "--dt=-1", "--m=0:0:0", "--nu=0.5"),
    *("--psi=1e999", "--quiet=1"),
)


@dataclass(frozen=True)
class Input:
    """One hostile input: the bytes of a scene file, of a run's file, the words of a command, or a folder."""

    kind: str
    content: bytes = b""
    words: tuple[str, ...] = ()
    files: tuple[tuple[str, bytes], ...] = ()


def formula(draw: random.Random, depth: int = 3) -> str:
    """An expression, mostly not one of arithmetic."""
    if depth == 0 or draw.random() < 0.2:
        return draw.choice(ATOMS[:14] if draw.random() < 0.7 else ATOMS)
    shape = draw.choice(SHAPES[:17] if draw.random() < 0.8 else SHAPES)
    return shape.format(*(formula(draw, depth - 1) for _ in range(shape.count("{}"))))


def _size(draw: random.Random) -> int:
    """Mostly small, sometimes 100 kB."""
    return int(10 ** draw.uniform(0.5, 5.3 if draw.random() < 0.1 else 3.5))


def _expression(draw: random.Random) -> Input:
    text = formula(draw, draw.randint(1, 5)) if draw.random() < 0.8 else draw.choice(BOMBS)(_size(draw))
    place = draw.choice(list(FORMULAS))
    if place == "a":
        document = SMALL.replace(
            "1 + 0.1*x", draw.choice(["{}", "2 + 0.1*({})", "abs({}) + 1e-3"]).format(text)
        )
    elif place == "u":
        document = SMALL.replace("[initial]", FORMULAS["u"].format(text))
    else:
        document = SMALL.replace('source = "me"\n', "") + FORMULAS[place].format(text)
    return Input("expression", document.encode())


def _document(draw: random.Random) -> Input:
    return Input("document", draw.choice(DOCUMENTS)(_size(draw)).encode())


def _value(draw: random.Random) -> Input:
    text = draw.choice([SMALL, MODE, SMALL.replace("[parameters]", "[dimensional]"), _shipped(draw)])
    keys = list(re.finditer(r"(?m)^(\w+) *= *(.+)$", text))
    for key in draw.sample(keys, min(len(keys), draw.randint(1, 2))):
        text = text.replace(key[0], f"{key[1]} = {draw.choice(NUMBERS)}", 1)
    extra = draw.choice(["d", "a_sat", "mu1", "mu2", "nu", "l0", "L", "E", "k_a", "D_a", "a_c"])
    if draw.random() < 0.5:
        text = text.replace("\np = ", f"\n{extra} = {draw.choice(NUMBERS)}\np = ", 1)
    return Input("value", text.encode())


def _name(draw: random.Random) -> Input:
    text = SMALL.replace('"h"', f'"{draw.choice(NAMES)}"') if draw.random() < 0.7 else SMALL
    tag = draw.choice(TAGS)
    return Input(
        "name", text.replace('"me"', f"'''{tag}'''" if "'" not in tag else '"' + "<" * 99 + '"').encode()
    )


def _shipped(draw: random.Random) -> str:
    return scene_text(draw.choice(shipped_scenes()))


def _mutated(draw: random.Random) -> Input:
    content = bytearray(_shipped(draw).encode())
    for _ in range(draw.choice([1, 1, 1, 2, 5, 20])):
        at, length = draw.randrange(len(content)), draw.randint(1, 12)
        match draw.randrange(5):
            case 0:
                content[at] = draw.randrange(256)
            case 1:
                del content[at : at + length]
            case 2:
                content[at:at] = content[(other := draw.randrange(len(content))) : other + length]
            case 3:
                content[at:at] = draw.choice(
                    [*NUMBERS, *ATOMS, "[", "]", "{", '"', "'''", ".", "=", "\n", "-"]
                ).encode()
            case _:
                lines = bytes(content).splitlines(keepends=True)
                lines.insert(draw.randrange(len(lines)), lines.pop(draw.randrange(len(lines))))
                content = bytearray(b"".join(lines))
        content = content or bytearray(b"x")
    return Input("mutated", bytes(content))


def _encoded(draw: random.Random) -> Input:
    text = draw.choice([SMALL, _shipped(draw)])
    changed = [
        text.encode("utf-16"),
        text.replace("me", "mé").encode("latin-1", "replace"),
        b"\xef\xbb\xbf" + text.encode(),
        text.encode() + b"\0",
        text.replace("\n", "\r").encode(),
        text.replace("\n", "\r\n").encode(),
        text.encode()[: draw.randrange(len(text))],
        text.replace('"', "\ud800").encode("utf-8", "surrogatepass"),
        draw.randbytes(draw.randrange(300)),
    ]
    return Input("encoding", draw.choice(changed))


def _command(draw: random.Random) -> Input:
    words = [draw.choice(WORDS[:7] if draw.random() < 0.8 else WORDS)]
    for _ in range(draw.randint(0, 4)):
        words.append(
            draw.choice([*WORDS, *OPTIONS, *OPTIONS, *NUMBERS[:20], "/dev/null", "..", "in", "in/h.toml"])
        )
    if "run" in words or "compare" in words:
        words += ["--method", "nothing"]  # commands are judged by their words, not by what they would compute
    if "report" in words[1:]:
        words[0] = "report"
    if draw.random() < 0.1:
        words = ["predict", "modes", "--psi", draw.choice(NUMBERS), "--p", draw.choice(NUMBERS), "--m", "1"]
    return Input("command", words=tuple(words))


def _stored(draw: random.Random) -> Input:
    return Input("stored run", _damaged(draw, a_run()))


def _report(draw: random.Random) -> Input:
    """A report's folder, one of its files damaged."""
    files = a_report(draw.choice(REPORTS))
    victim = draw.choice([*files, next(iter(files))])
    damaged = ((name, _damaged(draw, one) if name == victim else one) for name, one in files.items())
    return Input("stored report", files=tuple(damaged))


def _damaged(draw: random.Random, whole: bytes) -> bytes:
    content = bytearray(whole)
    if draw.random() < 0.4:
        del content[draw.randrange(len(content)) :]
    for _ in range(draw.choice([0, 1, 3, 30])):
        if content:
            content[draw.randrange(min(len(content), draw.choice([100, 3000, 10**6])))] = draw.randrange(256)
    return bytes(content)


KINDS: dict[Callable[[random.Random], Input], int] = {
    _expression: 28, _document: 6, _value: 20, _name: 8, _mutated: 20, _encoded: 4, _command: 7, _stored: 5,
    _report: 2,
}  # fmt: skip
"""How inputs are made, and how many in a hundred."""


def draw_input(draw: random.Random) -> Input:
    """An input of some kind."""
    return draw.choices(list(KINDS), list(KINDS.values()))[0](draw)


@functools.cache
def a_run() -> bytes:
    """The file of a run."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.vtkhdf"
        run(load_scene("static-decay"), Numerics(METHODS["fem-p1-paper"], 1, 0.25), path)
        return path.read_bytes()
