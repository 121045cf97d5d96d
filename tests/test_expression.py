import pickle
from typing import Annotated

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError
from scipy.special import jv

from actin_xcheck.scene.expression import Expression, coordinates

PLANE = ("x", "y", "r", "theta")
GRAMMAR = "valid are numbers, names"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 + 0.1*abs(sin(x)*sin(y))", lambda x, y: 1 + 0.1 * np.abs(np.sin(x) * np.sin(y))),
        ("-x**2 + +y/2 - 3", lambda x, y: -(x**2) + y / 2 - 3),
        ("2**3**2", lambda x, y: np.full_like(x, 512)),
        ("J(1, 2.5*r)*cos(theta)", lambda x, y: jv(1, 2.5 * np.hypot(x, y)) * np.cos(np.arctan2(y, x))),
        ("minimum(x, y) - maximum(x, y)", lambda x, y: -np.abs(x - y)),
        ("arctan2(y, x) - theta + arctan(tan(0.5))", lambda x, y: np.full_like(x, 0.5)),
        ("cosh(x)**2 - sinh(x)**2 + tanh(0)", lambda x, y: np.ones_like(x)),
        ("log(exp(x)) + sqrt(y**2)", lambda x, y: x + np.abs(y)),
        ("cos(pi)", lambda x, y: -np.ones_like(x)),
        ("(\n  x\n  + y\n)", lambda x, y: x + y),
    ],
)
def test_values_are_those_of_numpy(text, expected):
    points = np.random.default_rng(1).uniform(-1, 1, (2, 3, 4))
    value = Expression(text, PLANE)(**coordinates(points))
    assert value.shape == (3, 4)
    assert value.dtype == np.float64
    np.testing.assert_allclose(value, expected(*points), rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    "text",
    [
        "sin(3*t)*cos(t) - tan(t/3) + x*exp(-t)",
        "log(1 + t) / sqrt(t) + abs(x - t)**3",
        "sinh(t) - cosh(t)*tanh(t*x) + arctan(x*t**2)",
        "arctan2(t, x)*arctan2(x, t) - (+t)",
        "minimum(t, x)*maximum(t**2, x) + heaviside(t)*t",
        "J(2, 5*t*x)*J(0, t) + t**1.5 + x**t + t**t",
    ],
)
def test_rates_are_those_of_central_differences(text):
    x, t, eps = np.linspace(0.15, 2.0, 7), 0.7, 1e-5
    formula = Expression(text, ("x", "t"))
    differences = (formula(x=x, t=t + eps) - formula(x=x, t=t - eps)) / (2 * eps)
    np.testing.assert_allclose(formula.rate(x=x, t=t), differences, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize(
    ("text", "t", "rate"),
    [
        ("log(x)/x + 1/(x - x)", 0.3, 0.0),  # however singular, what t does not enter does not move
        ("t**1.5", 0.0, 0.0),
        ("(1 - t)**1.5", 1.0, 0.0),
        ("sqrt(t)", 0.0, np.inf),
        ("x + 0.02*sin(300*t)", 0.0, 6.0),
    ],
)
def test_rates_need_no_value_on_the_other_side(text, t, rate):
    assert Expression(text, ("x", "t")).rate(x=0.5, t=t) == pytest.approx(rate, abs=1e-15)


def test_heaviside_is_one_half_at_its_step():
    assert Expression("heaviside(x)", ("x",))(x=[-2, 0, 3]).tolist() == [0, 0.5, 1]


def test_a_constant_takes_the_shape_of_the_inputs():
    value = Expression("1", ("x", "t"))(x=np.zeros((2, 1)), t=np.zeros(3))
    assert value.tolist() == [[1, 1, 1], [1, 1, 1]]
    value[0, 0] = 5  # the caller's own array, not a read-only view
    assert Expression("2", ())().shape == ()


def test_all_variables_must_be_given_and_no_others():
    with pytest.raises(TypeError, match="x, y, not for x"):
        Expression("x", ("x", "y"))(x=1)
    with pytest.raises(TypeError, match="not for x, t"):
        Expression("x", ("x",))(x=1, t=0)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("9**9**9**9**9", np.inf),
        ("(10**300)**(10**300)", np.inf),
        ("1/(x - x)", np.inf),
        ("log(0 - 1)", np.nan),
        ("(0 - 2)**0.5", np.nan),
    ],
)
def test_arithmetic_is_ieee_and_silent(text, expected):
    np.testing.assert_equal(Expression(text, ("x",))(x=1), expected)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("1 + z", "unknown name z; valid names are x, y, r, theta, pi"),
        ("1 + t", "unknown name t"),
        ("erf(x)", "unknown function erf; valid functions are sin, cos"),
        ("x(y)", "unknown function x"),
        ("__import__('os')", "unknown function __import__"),
        ("sin", r"function sin lacks its argument; valid is sin\(z\)"),
        ("sin(x, y)", r"2 arguments for sin; valid is sin\(z\)"),
        ("J(x)", r"1 arguments for J; valid is J\(m, z\)"),
        ("arctan2(x)", r"valid is arctan2\(z, w\)"),
        ("x^2", r"\^ is not valid; a power is written \*\*"),
        ("x.real", f"x.real is not valid here; {GRAMMAR}"),
        ("sin.__class__(x)", f"is not valid here; {GRAMMAR}"),
        ("x[0]", GRAMMAR),
        ("'x'", GRAMMAR),
        ("f'{x}'", GRAMMAR),
        ("True", GRAMMAR),
        ("None", GRAMMAR),
        ("1j", GRAMMAR),
        ("x < y", GRAMMAR),
        ("x and y", GRAMMAR),
        ("x if x else y", GRAMMAR),
        ("lambda: 1", GRAMMAR),
        ("[x for x in y]", GRAMMAR),
        ("(x := 1)", GRAMMAR),
        ("x // y", GRAMMAR),
        ("~x", GRAMMAR),
        ("sin(x=1)", GRAMMAR),
        ("sin(*x)", GRAMMAR),
        ("x, y", GRAMMAR),
        ("x = 1", GRAMMAR),
        ("x\n+ y", GRAMMAR),
        ("x; y", GRAMMAR),
        ("x # y", GRAMMAR),
        ("1if", GRAMMAR),
        ("x\0", GRAMMAR),
        ("", GRAMMAR),
        ("9" * 400, "a number is too large"),
        ("1e999", "a number is too large"),
        ("y" * 3999, r"unknown name y{20}\.\.\.y{20}; valid names"),
        ("y" * 3999 + "(", "not an expression"),
        ("\uff58", r"\(\uff58, U\+FF58\)"),  # a wide x, which Python reads as x
        ("\u017fin(x)", r"U\+017F"),
        ("2 + \u202ex", r"\(\\u202e, U\+202E\)"),
        ("\ud800", r"U\+D800"),
        ("J(x, r)", "J of order x; valid are whole numbers from 0 to 100"),
        ("J(-1, r)", "J of order -1; valid"),
        ("J(0.5, r)", "J of order 0.5; valid"),
        ("J(1e9, r)", "J of order 1000000000.0; valid"),
        ("+".join(["J(1, r)"] * 11), "110 functions and powers, each J counting tenfold; at most 100"),
        ("x" * 4001, "4001 characters; at most 4000"),
        ("-" * 3999 + "x", "nested too deeply; at most 100"),
        ("+".join("x" * 200), "nested too deeply; at most 100"),
        ("(" * 1000 + "x" + ")" * 1000, "too"),
    ],
)
def test_anything_but_arithmetic_is_refused_with_a_sentence(text, sentence):
    with pytest.raises(ValueError, match=sentence) as refusal:
        Expression(text, PLANE)
    assert "\n" not in str(refusal.value)


@given(st.text(alphabet="xyt09.()+-*/, sinJ^'\"[]{}\\\n", max_size=40))
def test_any_text_is_a_number_or_a_value_error(text):
    try:
        expression = Expression(text, PLANE)
    except ValueError:
        return
    assert expression(**coordinates(np.zeros((2, 5)))).shape == (5,)


def test_is_a_value():
    expression = Expression("1 + x", PLANE)
    assert str(expression) == "1 + x"
    copy = pickle.loads(pickle.dumps(expression))
    assert copy == expression
    assert hash(copy) == hash(expression)
    assert copy(x=1, y=0, r=1, theta=0) == 2
    with pytest.raises(AttributeError):
        expression.text = "2"  # type: ignore[misc]


def test_is_a_field_of_pydantic_models():
    class Table(BaseModel):
        model_config = ConfigDict(arbitrary_types_allowed=True)
        a: Annotated[Expression, BeforeValidator(lambda text: Expression(text, ("x",)))]

    assert Table(a="2*x").a(x=3) == 6  # type: ignore[arg-type]
    with pytest.raises(ValidationError, match="unknown name y"):
        Table(a="2*y")  # type: ignore[arg-type]


def test_coordinates_are_polar_and_cartesian():
    named = coordinates(np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -2.0]]))
    assert named["r"].tolist() == [0, 1, 2]
    assert named["theta"].tolist() == [0, np.pi, -np.pi / 2]
