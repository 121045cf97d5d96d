import pickle
import re
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
import pytest

from actin_xcheck.cli.conduct import warn_of
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.model import ARTICLE, Closure, Delta, Model, Rheology
from actin_xcheck.core.parameters import UNITS, DimensionalParameters, Parameters, far_from_the_article
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.resolve import resolve
from actin_xcheck.scene.scene import load_scene, parse_scene
from actin_xcheck.scene.shelf import listed, scene_text, shipped_scenes
from actin_xcheck.scene.tables import Expect

GOOD = """
name = "mine"
source = "me"
[parameters]
psi = 10
p = 0.5
[model]
delta = "full"
[initial]
a = "1 + 0.1*x"
u = ["0.1*x", "0"]
[time]
end = 1
outputs = [0.2, 0.6]
[probes]
points = [[0, 0], [0.6, 0.8]]
[as_published]
refine = 5
dt = 0.1
[expect.agreement]
bound = { h2 = 1.0 }
[expect.reference]
origin = "a table"
[expect.reference.bound]
area = { dt = 1 }
probe_a = { dt = 1 }
[[expect.reference.at]]
time = 0.6
area = 3.1
probe_a = [1.0, nan]
"""
WALL = """
name = "wall"
[parameters]
psi = 10
p = 0.5
[model]
delta = "none"
closure = "irrotational-wall"
[initial]
a = "1"
eigenmode = { m = 1, n = 1, amplitude = 1e-6 }
[time]
end = 1
[expect.growth_rate]
m = 1
n = 1
window = [0, 1]
bound = { h2 = 1 }
"""
MOVING = """
name = "moving"
[parameters]
psi = 0
p = 0
[initial]
a = "1"
[time]
end = 1
[motion]
x = "x0*exp(t)"
y = "y0"
[expect.exact]
a = "1 + x - x0 + t"
bound = { h2 = 1 }
"""
CELL = """
name = "cell"
[parameters]
psi = 240
p = 0
[model]
reaction = false
[initial]
a = "1"
eigenmode = { m = 1, n = 1, amplitude = 1e-6 }
[time]
end = 1
"""


def test_a_full_scene():
    scene = parse_scene(GOOD, "mine.toml")
    assert scene.name == "mine"
    assert scene.citation == "me"
    assert scene.source_term is None
    assert scene.parameters == Parameters(psi=10, p=0.5)
    assert scene.physics == Model(Parameters(psi=10, p=0.5), delta=Delta.FULL)
    assert scene.output_times == (0.2, 0.6, 1.0)
    assert scene.probes.points == ((0, 0), (0.6, 0.8))
    assert (scene.as_published.refine, scene.as_published.dt) == (5, 0.1)
    assert scene.expect.agreement.bound.h2 == 1
    assert scene.expect.agreement.bound.dt == 0
    assert np.isnan(scene.expect.reference.at[0].probe_a[1])
    assert scene.expect.reference.at[0].probe_x is None
    assert (scene.text, scene.origin, scene.mode) == (GOOD, "mine.toml", None)


def test_defaults_are_those_of_the_article_and_the_model():
    scene = parse_scene(MOVING, "moving.toml")
    assert scene.physics == Model(
        Parameters(0, 0), Rheology.VISCOELASTIC, Closure.REFERENCE_NORMAL, Delta.RING
    )
    assert scene.output_times == (1.0,)
    assert scene.citation == ""
    assert scene.domain.rotation == 0
    assert scene.motion.x(x0=2, y0=0, t=0) == 2


def test_motions_and_sources_end_with_the_scene():
    """Both formulas end at t = 0 and at t = 1; their velocities are limits from within."""
    ends = MOVING.replace("x0*exp(t)", "x0 + 0.1*(t*sqrt(t) + (1 - t)**1.5)")
    problem = resolve(parse_scene(ends + '[source]\na = "sqrt(1 - t) + sin(r)/r"\n', "scene.toml"))
    xi, beyond = np.array([[0.0, 0.5], [0.0, 0.5]]), np.nextafter(1.0, 2.0)
    for t, velocity in (0.0, -0.15), (0.25, 0.075 - 0.15 * np.sqrt(0.75)), (1.0, 0.15), (beyond, 0.15):
        np.testing.assert_allclose(problem.motion.velocity(xi, t), [[velocity] * 2, [0, 0]], atol=1e-8)
    assert np.isfinite(problem.motion(xi, beyond)).all()
    assert problem.source(xi[:, 1:], xi[:, 1:], beyond) == pytest.approx(np.sin(np.sqrt(0.5)) / np.sqrt(0.5))


@pytest.mark.parametrize("method", ["fem-p1-paper", "fv-coupled", "fv-order2", "fem-p2-imex3"])
def test_a_motion_whose_formula_ends_is_followed_to_its_end(method, tmp_path):
    scene = parse_scene(MOVING.replace("x0*exp(t)", "x0*(1 + 0.3*t**1.5 + 0.2*(1 - t)**1.5)"), "scene.toml")
    outcome = run(scene, Numerics(METHODS[method], 2, 0.05), tmp_path / "run.vtkhdf")
    assert outcome.ok
    film = read_run(tmp_path / "run.vtkhdf")
    assert np.isfinite(film.v).all()
    np.testing.assert_allclose(film.points[-1, 0], 1.3 * film.xi[0], atol=3e-4)
    np.testing.assert_allclose(film.v[0, 0], -0.3 * film.xi[0], atol=1e-7)


def test_source_may_be_a_table():
    text = MOVING + '[source]\na = "x*t"\ncitation = "me"\n'
    scene = parse_scene(text, "moving.toml")
    assert scene.citation == "me"
    assert scene.source_term(x=2, y=0, r=2, theta=0, x0=1, y0=0, t=3) == 6


TABLE_1 = (
    GOOD.replace("[parameters]", "[dimensional]").replace("psi = 10", "psi = 6.9e4").replace("0.5", "800")
)
TABLE_1 = TABLE_1.replace("p = 800", "p = 800\nE = 4000\nD_a = 1.6e-10\nk_a = 66\nL = 1e-3")


@pytest.mark.parametrize(
    ("given", "far"),
    [
        ("L = 1e-3", ()),  # the article's section 6
        ("L = 10", ("d = 2.424e-14 is more than 1000 times below the article's 2.424e-06 to 0.4",)),
        ("L = 1e-6", ()),  # d = 2.4, six times the article's, is a choice
        (
            "mu1 = 9.6e6\nL = 1e-3",
            ("mu1 = 2.059e+05 is more than 1000 times above the article's 2.0624 to 2.5",),
        ),
    ],
)
def test_groups_are_echoed_and_slips_of_units_are_warned_of(given, far, capsys):
    scene = parse_scene(TABLE_1.replace("L = 1e-3", given), "mine.toml")
    assert far_from_the_article(scene.parameters) == far
    warn_of(scene)
    first, *warnings = capsys.readouterr().err.splitlines()
    assert first.startswith("mine: [dimensional] makes psi = 22.43, p = 0.26, d = ")
    assert [line.split("; ")[0] for line in warnings] == [f"warning: mine: {one}" for one in far]
    assert all("D_a (cm^2/s)" in line and "L (cm)" in line for line in warnings)


def test_quantities_have_units_of_their_own(capsys):
    """Each in the units that its measurement has; the numbers are those of Table 1's units."""
    units = {"psi": "6.9 kPa", "p": "80Pa", "E": "0.4 kPa", "D_a": "0.016 µm²/s", "k_a": "66/s", "L": "10 µm"}
    units |= {"mu1": "9.615 Pa s", "mu2": "25 Pa*s"}
    bare = parse_scene(TABLE_1, "mine.toml")
    written = bare.varied({f"dimensional.{key}": value for key, value in units.items()})
    for name, value in asdict(bare.parameters).items():
        assert getattr(written.parameters, name) == pytest.approx(value, rel=1e-14)
    warn_of(written)
    assert capsys.readouterr().err.splitlines()[0].endswith("(3.1); t = 1 is 15.15 ms, x = 1 is 10 µm")


@pytest.mark.parametrize(
    ("key", "given"),
    [
        ("psi", "6.9 kg"),
        ("E", "4 stone/acre/"),
        ("E", "2**9**9 Pa"),
        ("L", "10 __import__"),
        ("L", "ten µm"),
        ("k_a", "66 s"),
        ("a_sat", "1.4 Pa"),
        ("nu", "30 percent"),
    ],
)
def test_units_of_another_kind_are_refused_in_a_line(key, given):
    message = rf"^mine.toml: dimensional.{key} = '.*': should be a number.*, in {re.escape(UNITS[key])}$"
    with pytest.raises(UserError, match=message):
        parse_scene(TABLE_1, "mine.toml").varied({f"dimensional.{key}": given})


def test_what_is_non_dimensional_already_is_not_echoed(capsys):
    warn_of(parse_scene(GOOD, "mine.toml"))
    assert capsys.readouterr().err == ""


def test_every_dimensional_key_has_a_unit_where_it_is_typed():
    assert set(UNITS) == {field.name for field in fields(DimensionalParameters)}
    for place in "README.md", "docs/scene.md":
        text = (Path(__file__).parents[1] / place).read_text(encoding="utf-8")
        for unit in {*UNITS.values()} - {"no unit"}:
            assert unit.replace("^2", "²") in text


MISTAKES = [
    # text, replaced, by, what the line must say
    (GOOD, 'name = "mine"', "", "name is missing; required keys are name, initial, time"),
    (GOOD, 'name = "mine"', "name = 3", "name = 3: should be a valid string"),
    (GOOD, '"mine"', '"../mine"', "name = '../mine': should be letters, digits"),
    (GOOD, '"mine"', '""', "name = '': should be letters, digits"),
    (MOVING, "[motion]", '[source]\na = "sqrt(x)"\n[motion]', "source.a = 'sqrt(x)': should be finite"),
    (MOVING, "[motion]", '[source]\na = "1/r**2"\n[motion]', "source.a = '1/r**2': should be finite"),
    (GOOD, 'source = "me"', 'source = { a = "log(0.5 - t)" }', "source.a = 'log(0.5 - t)': should be finite"),
    (MOVING, '"1 + x - x0 + t"', '"sqrt(x - 2)"', "expect.exact.a = 'sqrt(x - 2)': should be finite"),
    (GOOD, 'source = "me"', "source = 3", "source = 3: should be a table with keys among citation, a"),
    (GOOD, "psi = 10", "", "parameters.psi is missing; required keys are psi, p"),
    (GOOD, "psi = 10", "pssi = 10", "unknown key parameters.pssi (did you mean psi?); valid keys are psi,"),
    (GOOD, "[probes]", "[probs]", "unknown key probs (did you mean probes?); valid keys are name, source,"),
    (GOOD, "area", "aera", "unknown key expect.reference.bound.aera (did you mean area?); valid keys are"),
    (GOOD, "h2 =", "h3 =", "unknown key expect.agreement.bound.h3; valid keys are h2, dt"),
    (GOOD, "psi = 10", 'psi = "10"', "parameters.psi = '10': should be a valid number"),
    (GOOD, "psi = 10", "psi = true", "parameters.psi = True: should be a valid number"),
    (GOOD, "psi = 10", "psi = -1", "parameters.psi = -1: should be greater than or equal to 0"),
    (GOOD, "p = 0.5", "p = nan", "parameters.p = nan: should be a finite number"),
    (GOOD, "p = 0.5", "p = 0\nnu = 0.5", "parameters.nu = 0.5: should be less than 0.5"),
    (GOOD, "p = 0.5", "p = 0\nnu = -1", "parameters.nu = -1: should be greater than -1"),
    (GOOD, "p = 0.5", "p = 0\nd = -0.4", "parameters.d = -0.4: should be greater than or equal to 0"),
    (GOOD, "p = 0.5", "p = 0\nl0 = 1.0", "parameters.l0 = 1.0: should be less than 1"),
    (GOOD, "p = 0.5", "p = 0\na_sat = 0", "parameters.a_sat = 0: should be greater than 0"),
    (GOOD, "p = 0.5", "p = 0\nmu1 = 0", "parameters.mu1 = 0: should be greater than 0"),
    (GOOD, "p = 0.5", "p = 0\n[dimensional]\npsi = 0\np = 0", "dimensional = {'p': 0.0, 'psi': 0.0}: should"),
    (GOOD, "[parameters]\npsi = 10\np = 0.5", "", "parameters = 'nothing': should be a table, one of"),
    (GOOD, "[parameters]\npsi = 10", "[dimensional]\npsi = 0\nE = 0", "greater than 0, in dyn/cm^2"),
    (GOOD, "[parameters]\npsi = 10", "[dimensional]\npsi = 0\nL = '1'", "should be a valid number, in cm"),
    (GOOD, "[parameters]\npsi = 10", "[dimensional]\nL = 1", "[dimensional] is in psi (dyn/cm^2), p"),
    (GOOD, '"full"', '"rim"', "model.delta = 'rim': should be 'ring', 'membrane', 'none' or 'full'"),
    (GOOD, 'delta = "full"', "reaction = 1", "model.reaction = 1: should be a valid boolean"),
    (GOOD, '"1 + 0.1*x"', '"1 + 0.1*z"', "initial.a = '1 + 0.1*z': unknown name z; valid names are x, y, r,"),
    (GOOD, '"1 + 0.1*x"', "1", "initial.a = 1: should be an expression in quotes"),
    (GOOD, '"1 + 0.1*x"', '"1 + x"', "is 0 at (x, y) = (-1, 0)"),
    (GOOD, '"1 + 0.1*x"', '"r"', "initial.a = 'r': should be positive on the unit disk at t = 0, but is 0"),
    (GOOD, '"1 + 0.1*x"', '"1/r"', "should be positive on the unit disk at t = 0, but is inf at (x, y) ="),
    (GOOD, '["0.1*x", "0"]', '["0", "log(r)"]', "initial.u[1] = 'log(r)': should be finite on the unit disk"),
    (GOOD, '["0.1*x", "0"]', '["0"]', "initial.u[1] is missing"),
    (GOOD, '["0.1*x", "0"]', '["0", "0", "0"]', "initial.u = ['0', '0', '0']: list should have at most 2"),
    (GOOD, "end = 1", "end = 0", "time.end = 0: should be greater than 0"),
    (GOOD, "[0.2, 0.6]", "[0.6, 0.2]", "time.outputs = [0.6, 0.2]: should increase strictly from above 0"),
    (GOOD, "[0.2, 0.6]", "[0, 0.6]", "time.outputs = [0.0, 0.6]: should increase strictly from above 0"),
    (GOOD, "[0.2, 0.6]", "[0.6, 2]", "time.outputs = [0.6, 2.0]: should not go beyond time.end = 1"),
    (GOOD, "[0.2, 0.6]", "0.6", "time.outputs = 0.6: should be a valid list"),
    (GOOD, "[0.6, 0.8]", "[1, 1]", "probes.points[1] = [1, 1]: should lie in the unit disk, |xi| <= 1"),
    (GOOD, "[0.6, 0.8]", '[1, "1"]', "probes.points[1][1] = '1': should be a valid number"),
    (GOOD, "refine = 5", "refine = 11", "as_published.refine = 11: should be less than or equal to 10"),
    (GOOD, "refine = 5", "refine = 5.5", "as_published.refine = 5.5: should be a valid integer"),
    (GOOD, "dt = 0.1", "dt = 0", "as_published.dt = 0: should be greater than 0"),
    (GOOD, "h2 = 1.0", "h2 = 0", "expect.agreement.bound = {'h2': 0}: should give h2 or dt above 0"),
    (GOOD, "time = 0.6", "time = 0.5", "expect.reference.at[0].time = 0.5: should be an output time: 0.2,"),
    (GOOD, "[1.0, nan]", "[1.0]", "expect.reference.at[0].probe_a = [1.0]: should have one entry per probe,"),
    (GOOD, "area = 3.1", "area = inf", "expect.reference.at[0].area = inf: should be a number, or nan"),
    (WALL, "amplitude = 1e-6", "amplitude = inf", "initial.eigenmode.amplitude = inf: should be a finite"),
    (WALL, "amplitude = 1e-6", "amplitude = 2", "initial.a = '1': should be above the eigenmode's amplitude"),
    (WALL, "m = 1, n = 1,", "m = 0, n = 1,", "initial.eigenmode.n = 1: should be at least 2 for m = 0"),
    (WALL, "m = 1\n", "m = -1\n", "expect.growth_rate.m = -1: should be greater than or equal to 0"),
    (WALL, "[0, 1]", "[1, 1]", "expect.growth_rate.window = [1.0, 1.0]: should be [t0, t1] with 0 <= t0 <"),
    (WALL, "[0, 1]", "[0, 2]", "expect.growth_rate.window = [0.0, 2.0]: should be [t0, t1]"),
    (WALL, '"none"', '"ring"', "model.delta = 'ring': should be 'none' or 'full' where p != 0 and a mode is"),
    (MOVING, 'a = "1"\n', 'a = "1"\nu = ["0", "0"]\n', "initial.u = ['0', '0']: should not stand beside"),
    (MOVING, 'a = "1"\n', 'a = "1"\neigenmode = {m=1, n=1, amplitude=0.1}\n', "initial.eigenmode ="),
    (MOVING, 'y = "y0"', 'y = "y"', "motion.y = 'y': unknown name y; valid names are x0, y0, t, pi"),
    (MOVING, 'y = "y0"', 'y = "y0/t"', "motion.y = 'y0/t': should be finite on the unit disk at t = 0"),
    (MOVING, 'y = "y0"', 'y = "y0*(1 + sqrt(t))"', "should be moving no faster than 1e+06 on the unit"),
    (MOVING, 'y = "y0"', 'y = "y0 + sqrt(0.01 - t)"', "should be finite and at most 1e+06 on the unit"),
    (MOVING, 'y = "y0"', "", "motion.y is missing; required keys are x, y"),
    (MOVING, "x - x0 + t", "q", "expect.exact.a = '1 + q': unknown name q; valid names are x, y, r, theta,"),
    (MOVING, "end = 1", "end = 1979-05-27", "time.end = datetime.date(1979, 5, 27): should be a valid"),
    (MOVING, "end = 1", f"end{'.a' * 19} = 1", "time.end = {'a': {'a'"),
    (MOVING, "end = 1", f"end{'.a' * 3000} = 1", "a.a.a.a. is no key; at most 20 dots"),
    (MOVING, "end = 1", '"e\\nd" = 1', r"unknown key time.e\nd"),
    (MOVING, "end = 1", f"{'e' * 10**5} = 1", "eeee; valid keys are end, outputs"),
    (MOVING, "end = 1", f"end = 1{'0' * 400}", "time.end = "),
    (MOVING, "end = 1", f"end = 1{'0' * 5000}", "not valid TOML: an integer of thousands of digits"),
    (MOVING, "end = 1", f"end = 0x{'f' * 5000}", "time.end = a huge integer: should be a valid number"),
    (MOVING, "end = 1", "end = 1e300", "time.end = 1e+300: should be less than or equal to 1000000"),
    (MOVING, "end = 1", "end = 1e-9", "time.end = 1e-09: should keep 1e-06 apart from 0 and from each other"),
    (GOOD, "[0.2, 0.6]", "[0.2, 0.6, 0.6000001]", "time.outputs = 0.6000001: should keep 1e-06 apart"),
    (GOOD, "[0.6, 0.8]", "[0, 0]," * 1000, "list should have at most 1000 items"),
    (GOOD, "[1.0, nan]", "[1.0, nan]\n#" + "x" * 200_000, "characters are no scene; at most 200000"),
    (GOOD, "psi = 10", "psi = 1e300", "parameters.psi = 1e+300: should lie between 0 and 1e+09"),
    (GOOD, "p = 0.5", "p = -1e10", "parameters.p = -10000000000.0: should lie between -1e+09 and 1e+09"),
    (GOOD, "p = 0.5", "p = 0\nmu1 = 1e-300", "parameters.mu1 = 1e-300: should lie between 1e-09 and 1e+09"),
    (GOOD, "p = 0.5", "p = 0\nnu = 0.49999999", "parameters.nu = 0.49999999: should lie between -0.9999 and"),
    (GOOD, "p = 0.5", "p = 0\nl0 = 1e-300", "parameters.l0 = 1e-300: should lie between 0.001 and 0.999"),
    (GOOD, "[parameters]\npsi = 10", "[dimensional]\nL = 1e-200\npsi = 0", "dimensional = {'L': 1e-200"),
    (GOOD, "[parameters]\npsi = 10", "[dimensional]\nk_a = 1e-320\npsi = 0", "makes d = inf of (3.1), which"),
    (GOOD, '"1 + 0.1*x"', '"1e300 + x"', "should be at most 1e+06 on the unit disk at t = 0, but is 1e+300"),
    (GOOD, '["0.1*x", "0"]', '["1e300", "0"]', "initial.u[0] = '1e300': should be at most 1e+06"),
    (MOVING, 'y = "y0"', 'y = "1e300*y0"', "motion.y = '1e300*y0': should be at most 1e+06"),
    (CELL, "p = 0", "p = 0\nd = 0", "parameters.d = 0.0: should be at least (1 + (psi + |p|)/(mu1 + mu2))/1"),
    (CELL, "psi = 240", "psi = 1e9", "parameters.d = 0.4: should be at least (1 + (psi + |p|)/(mu1 + mu2))"),
    (CELL, "m = 1,", "m = 0,", "initial.eigenmode.m = 0: should be at least 1 where reaction = false"),
    (MOVING, "end = 1", "end = ", "not valid TOML: Invalid value (at line"),
    (MOVING, "end = 1", "end = " + "[" * 2000 + "]" * 2000, "not valid TOML: nested too deeply"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "old", "new", "line"), MISTAKES)
def test_a_mistake_is_one_line_that_names_its_place(text, old, new, line):
    assert text.count(old) >= 1
    with pytest.raises(UserError) as refusal:
        parse_scene(text.replace(old, new, 1), "my.toml")
    assert str(refusal.value).startswith("my.toml: ")
    assert line in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_scenes_are_loaded_from_files(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes(b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())  # as a Windows editor saves it
    assert load_scene(path).name == load_scene(str(path)).name == "mine"
    assert load_scene(path).origin == str(path)
    assert scene_text(path) == GOOD


def test_a_scene_with_other_values_is_checked_like_any():
    scene = load_scene("fig14-four-fronts")
    other = scene.varied({"parameters.psi": 3.0, "model.closure": "traction-free", "expect": None})
    assert other.parameters == replace(scene.parameters, psi=3.0)
    assert other.physics.closure == "traction-free"
    assert other.expect == Expect()
    assert other.initial == scene.initial
    assert other.origin == scene.origin
    assert scene.varied({}).text == scene.varied({"dimensional.psi": None}).text
    for changes, said in {
        ("parameters.ps", 3.0): "unknown key parameters.ps (did you mean psi?); valid keys are psi, p, d",
        ("parameters.psi", -1.0): "parameters.psi = -1.0: should be greater than or equal to 0",
        ("parameters.psi.a", 1.0): "parameters.psi.a: psi is no table; valid: a key of a table",
        ("parameters.psi", None): "parameters.psi is missing; required keys are psi, p",
    }.items():
        with pytest.raises(UserError, match=f"^fig14-four-fronts: {re.escape(said)}"):
            scene.varied(dict([changes]))


def test_an_unknown_name_lists_the_shipped_ones():
    with pytest.raises(
        UserError, match=r"unknown scene 'fig14-four-front' \(did you mean fig14-four-fronts\?\)"
    ) as refusal:
        load_scene("fig14-four-front")
    assert all(name in str(refusal.value) for name in shipped_scenes())


@pytest.mark.parametrize("name", shipped_scenes())
def test_shipped_scenes_load_are_frozen_survive_pickling_and_are_listed_as_what_they_are(name):
    scene = load_scene(name)
    assert scene.name == scene.origin == name
    assert scene.citation
    assert len(scene.probes.points) >= 5
    assert scene.text == scene_text(name)
    copy = pickle.loads(pickle.dumps(scene))
    assert repr(copy) == repr(scene)  # nan is not nan
    assert (copy.text, copy.origin) == (scene.text, scene.origin)
    with pytest.raises(ValueError, match="frozen"):
        scene.name = "other"
    p, physics = scene.parameters, scene.physics
    model = f"psi {p.psi:g}, p {p.p:g}, {physics.rheology}, {physics.closure}, delta {physics.delta}"
    own = "".join(f", {law} {getattr(scene.laws, law)}" for law in ARTICLE if getattr(scene.laws, law))
    assert listed(name) == (scene.name, scene.citation, model + own)
