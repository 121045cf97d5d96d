"""Laws of a scene's own: the article's written out are the article's, others obey their own linear theory."""

import pickle

import numpy as np
import pytest

from actin_xcheck.core.errors import Ending, UserError
from actin_xcheck.core.model import ARGUMENTS, ARTICLE, Laws, Model
from actin_xcheck.core.parameters import Closure, Delta, Fidelity, Parameters
from actin_xcheck.runs.fidelity import FULL, reduced
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.expression import Expression
from actin_xcheck.scene.laws import KNOWN
from actin_xcheck.scene.resolve import TERMS, resolve, starts_from_steady_state
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.theory.dispersion import active_slope, stiffness
from actin_xcheck.theory.eigenfields import growth_rate
from actin_xcheck.theory.exact import DiskModes, threshold
from fem.linearised import AngularMode
from fem.radial import Ray
from tests.lab import after, film_of, numbers_at, play, scene_of

SATURATING = "mode-1-saturating-cell"
POINTS = np.array([[0, 0], [0.4, 0], [0.8, 0], [0, 1], [-0.3, 0.6]]).T
PARTS = "psi = 300\np = 2.0\na_half = 0.7\nstiff = 1.3"
OWN = """[laws]
contractility = "psi*a**2/(a_half + a**2)"
pressure = "p*(1 + delta*tanh(a)) - stiff*log(1 + phi)"
[model]
delta = "full"
"""
"""Laws that differ from the article's in each argument: neither slope is the article's."""


def own_laws(a="1", end=0.1, more=""):
    return scene_of(PARTS, a, end, OWN + more)


@pytest.mark.parametrize(
    "name", ["fig14-four-fronts", "fig16-uniform-expansion", "sec6-realistic", "mode-1-cell"]
)
def test_the_articles_laws_written_out_are_the_articles(name):
    scene = load_scene(name)
    written = scene.varied({f"laws.{law}": text.replace("arctan", "atan") for law, text in ARTICLE.items()})
    assert written.physics == scene.physics
    assert written.physics.laws == Laws()


def test_formulas_have_the_bits_of_the_articles_arithmetic():
    """Where nothing recognises them as the article's, too."""
    model, random = Model(Parameters(200.0, 0.26)), np.random.default_rng(3)
    a, phi = random.uniform(0, 5, (6, 500)), random.uniform(-0.5, 2, (6, 500))
    delta = random.integers(0, 2, 500).astype(float)
    parsed = model.varied(
        laws=Laws(**{law: Expression(text, (*ARGUMENTS[law], *KNOWN)) for law, text in ARTICLE.items()})
    )
    assert parsed.laws != model.laws
    assert np.array_equal(parsed.active_stress(a, phi, delta), model.active_stress(a, phi, delta))
    assert parsed.slopes(1.3, 0.2, 1.0) == pytest.approx(model.slopes(1.3, 0.2, 1.0), rel=1e-14)


def test_a_run_has_the_bits_of_the_articles_too():
    """The finite elements and volumes with the formulas that nothing recognises."""
    scene = scene_of("psi = 200\np = 0.26", "1 + 0.1*x", 0.02)
    same = scene.varied({"laws.contractility": "(psi*1)*a**2*exp(-a/a_sat)"})
    assert same.physics.laws != Laws()
    for method in ("fem-p2-imex3", "fv"):
        one, other = (play(either, method, 3, 0.01).last for either in (scene, same))
        assert np.array_equal(one.a, other.a)
        assert np.array_equal(one.x, other.x)


def test_slopes_are_those_of_the_formulas():
    model = own_laws().physics
    psi, p, a_half, stiff = 300, 2.0, 0.7, 1.3
    of_a = psi * 2 * a_half / (a_half + 1) ** 2 + p / np.cosh(1) ** 2
    assert active_slope(model) == pytest.approx(of_a, rel=1e-13)
    assert stiffness(model) == pytest.approx(1 + model.parameters.nu_prime - stiff, rel=1e-13)
    assert model.varied(psi=0.0).slopes(delta=0.0) == pytest.approx((0, -stiff), abs=1e-13)


@pytest.mark.parametrize(
    "closure",
    [
        Closure.IRROTATIONAL_WALL,
        pytest.param(Closure.REFERENCE_NORMAL, marks=pytest.mark.slow),
        pytest.param(Closure.TRACTION_FREE, marks=pytest.mark.slow),
    ],
)
def test_exact_modes_are_those_of_the_linearised_elements(closure):
    """The determinant of Bessel functions and the elements' eigenvalues know the laws by themselves."""
    model = own_laws().physics.varied(closure=closure)
    found = np.linalg.eigvals(AngularMode(model, Ray.on(0.8, 3, 10), 1).generator)
    expected = growth_rate(model, 1, 1)
    assert np.abs(found - expected).min() < 1e-7 * abs(expected)


@pytest.mark.slow
def test_thresholds_follow_the_laws():
    """a/(a + 1) has a quarter of psi as its slope, the article's law 0.629 of it: so are their thresholds."""
    model = load_scene(SATURATING).physics
    slope = active_slope(model.varied(psi=1.0, laws=Laws()))
    found = 4 * slope * threshold(model.varied(laws=Laws()), 1).psi
    assert DiskModes(model.varied(psi=1.001 * found), 1).count(0.0) > 0
    assert DiskModes(model.varied(psi=0.999 * found), 1).count(0.0) == 0


@pytest.mark.parametrize(
    ("a", "fidelity", "tolerance"),
    [
        ("1 + 0.2*exp(-4*r**2)", Fidelity.RADIAL, 3e-6),
        ("1 + 0.1*x", Fidelity.SECTOR, 3e-6),
        ("1 + 1e-5*x*(1 - r**2)**2", Fidelity.MODAL, 1e-8),
    ],
)
def test_smaller_models_are_exact_for_them(a, fidelity, tolerance):
    scene, method = own_laws(a, 0.02), METHODS["fem-p4-imex4"]
    part = reduced(scene, method, fidelity, 1e-6)
    assert part.fidelity is fidelity
    small, whole = (bind(scene, Numerics(method, 3, 0.005, reduction=one)) for one in (part, FULL))
    found = [numbers_at(POINTS, one, after(one, 0.02, 4)) for one in (small, whole)]
    assert np.abs(found[0] - found[1]).max() < tolerance


def test_laws_with_a_kink_at_rest_have_no_linear_theory():
    scene = own_laws().varied({"laws.contractility": "psi*a_half*maximum(a, 1)"})
    assert not starts_from_steady_state(scene)
    with pytest.raises(ValueError, match="kink"):
        growth_rate(scene.physics, 1, 1)
    with pytest.raises(UserError, match="no steady state"):
        reduced(scene, METHODS["fem-p4-imex4"], Fidelity.MODAL, 1e-6)
    with pytest.raises(UserError, match=r"laws = .*should have slopes at a = 1"):
        scene.varied({"initial.eigenmode": {"m": 1, "n": 1, "amplitude": 1e-6}})


@pytest.mark.parametrize("method", ["fem-p2-imex3", "fv"])
def test_a_pressure_of_ones_own_ends_runs_where_it_has_no_value(method):
    """Shrunk to 1 + phi < 0 from the start; a pressure without phi does not mind."""
    scene = own_laws(end=0.01, more="").varied({"initial.u": ["-0.6*x", "-0.6*y"]})
    solver = bind(scene, Numerics(METHODS[method], 2, 0.01))
    _, outcome = film_of(solver, 0.01, [0.01])
    assert outcome.ending is Ending.SINGULAR_DILATION
    assert "the pressure is singular there" in outcome.message
    other = scene.varied({"laws.pressure": "p*delta*a*stiff"})
    assert play(other, method, 2, 0.01).last.t == 0.01


@pytest.mark.parametrize("method", ["fem-p1-paper", "fem-p3-imex4", "fv", "fv-paper"])
def test_kinetics_of_ones_own_relax_at_their_rate(method):
    """Uniform at rest: a - 1 = (a_0 - 1) exp(-k t), by both codes and orders; linear theory says k, too."""
    scene = scene_of("psi = 0\np = 0\nfast = 3.0", "2", 0.1, '[laws]\nkinetics = "fast*(1 - a)"\n')
    assert scene.physics.reaction_rate() == 3
    assert growth_rate(scene.physics.varied(closure=Closure.IRROTATIONAL_WALL, delta=Delta.NONE), 0, 1) == -3
    film = play(scene, method, 2, 0.001)
    assert film.last.a == pytest.approx(1 + np.exp(-0.3), rel=6e-4)
    assert film.residual < 1e-12


def test_dropping_a_term_drops_its_law():
    problem = resolve(own_laws())
    contraction, pressure = TERMS[:2]
    assert contraction.there(problem)
    assert not contraction.drop(problem).model.contracts
    assert not pressure.drop(problem).model.pressed
    assert pressure.drop(problem).model.contracts


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"laws.contractility": "psi*b"}, "laws.contractility = .psi[*]b.: unknown name b; valid"),
        ({"laws.contractility": "phi*psi*a_half"}, "unknown name phi"),
        ({"laws.pressure": "stiff*__import__('os')"}, "laws.pressure = .*unknown function __import__"),
        ({"laws.pressure": "stiff/(a - 1)"}, "laws.pressure = .*should be finite .* but is"),
        ({"laws.pressure": 3}, "laws.pressure = 3: should be a valid string"),
        ({"laws.kinetics": "a*(1 - a)"}, "laws.kinetics = .*should be linear in a, 0 at a = 1"),
        ({"laws.kinetics": "2 - a"}, "laws.kinetics = '2 - a': should be linear in a, 0 at a = 1"),
        ({"laws.kinetics": "a - 1"}, "laws.kinetics = 'a - 1': should be linear .* falling"),
        ({"laws.friction": "a"}, "unknown key laws.friction; valid keys are contractility, pressure"),
        ({"parameters.spare": 1.0}, "laws.parameters.spare = 1.0: should be in a law"),
        ({"laws.parameters": {"spare": 1.0}}, "laws.parameters.spare = 1.0: should be in a law"),
        ({"laws.parameters": {"exp": 1.0}}, "laws.parameters.exp = 1.0: should have a name of its own"),
        ({"parameters.stiff": "soft"}, "laws.parameters.stiff = 'soft': should be a valid number"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_law_is_one_line(changes, message):
    with pytest.raises(UserError, match=message):
        own_laws().varied(changes)


def test_scenes_with_laws_of_their_own_can_be_varied_and_kept():
    scene = own_laws().varied(
        {"parameters.a_half": 0.5, "parameters.psi": None, "laws.contractility": "a_half*a"}
    )
    assert dict(scene.physics.laws.own)["a_half"] == 0.5
    assert scene.parameters.psi == 0  # which no law uses
    assert scene.physics.contracts
    assert pickle.loads(pickle.dumps(scene.physics)) == scene.physics
