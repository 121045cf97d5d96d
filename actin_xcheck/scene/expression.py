"""Formulas in scenes: parsed once, checked by name, evaluated on arrays by simpleeval, never by `eval`."""

import ast
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from textwrap import shorten
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from simpleeval import SimpleEval

from actin_xcheck.core import load_scipy
from actin_xcheck.core.errors import brief

Array = NDArray[np.float64]

MAX_LENGTH = 4000
MAX_DEPTH = 100  # the evaluator spends a few Python frames a level, far below the recursion limit
MAX_CALLS = 100  # functions and powers, J counting tenfold: up to 0.2 us each and 8 us a point
MAX_ORDER = 100

_CONSTANTS = {"pi": np.float64(np.pi)}
_Slope = Callable[..., Any]


def _one(*arguments: Any) -> Any:
    return 1.0


def _zero(*arguments: Any) -> Any:
    return 0.0


@cache
def _special() -> Any:
    """scipy's special functions: few scenes have one, and every run would wait for them."""
    load_scipy()
    return import_module("scipy.special")


def _bessel(order: Any, z: Any) -> Any:
    return _special().jv(order, z)


def _bessel_slope(order: Any, z: Any) -> Any:
    return _special().jvp(order, z)


# every function beside its partial derivatives, between the kinks of those that have some
_FUNCTIONS: dict[str, tuple[Callable[..., Any], tuple[_Slope, ...]]] = {
    "sin": (np.sin, (np.cos,)),
    "cos": (np.cos, (lambda z: -np.sin(z),)),
    "tan": (np.tan, (lambda z: 1 / np.cos(z) ** 2,)),
    "exp": (np.exp, (np.exp,)),
    "log": (np.log, (lambda z: 1 / z,)),
    "sqrt": (np.sqrt, (lambda z: 0.5 / np.sqrt(z),)),
    "abs": (np.abs, (np.sign,)),
    "sinh": (np.sinh, (np.cosh,)),
    "cosh": (np.cosh, (np.sinh,)),
    "tanh": (np.tanh, (lambda z: 1 / np.cosh(z) ** 2,)),
    "arctan": (np.arctan, (lambda z: 1 / (1 + z**2),)),
    "atan": (np.arctan, (lambda z: 1 / (1 + z**2),)),
    "arctan2": (
        np.arctan2,
        (lambda z, w: w / (z**2 + w**2), lambda z, w: -z / (z**2 + w**2)),
    ),
    "minimum": (np.minimum, (lambda z, w: np.heaviside(w - z, 0.5), lambda z, w: np.heaviside(z - w, 0.5))),
    "maximum": (np.maximum, (lambda z, w: np.heaviside(z - w, 0.5), lambda z, w: np.heaviside(w - z, 0.5))),
    "heaviside": (lambda z: np.heaviside(z, 0.5), (_zero,)),
    "J": (_bessel, (_zero, _bessel_slope)),
}
_OPERATORS: dict[type[ast.AST], tuple[Callable[..., Any], tuple[_Slope, ...]]] = {
    ast.Add: (np.add, (_one, _one)),
    ast.Sub: (np.subtract, (_one, lambda z, w: -1.0)),
    ast.Mult: (np.multiply, (lambda z, w: w, lambda z, w: z)),
    ast.Div: (np.divide, (lambda z, w: 1 / w, lambda z, w: -z / w**2)),
    ast.Pow: (np.power, (lambda z, w: w * z ** (w - 1), lambda z, w: z**w * np.log(z))),
    ast.UAdd: (np.positive, (_one,)),
    ast.USub: (np.negative, (lambda z: -1.0,)),
}
_GRAMMAR = "numbers, names, + - * / ** ( ) and function calls"


@dataclass(frozen=True)
class _Moving:
    """A value and its derivative; None where there is none to enter: 0 times infinity would be nan."""

    value: Any
    rate: Any = None


def _chained(call: Callable[..., Any], slopes: tuple[_Slope, ...]) -> Callable[..., _Moving]:
    """A function of values as one of values that move, by the chain rule."""

    def moved(*arguments: _Moving) -> _Moving:
        values = [one.value for one in arguments]
        parts = [
            slope(*values) * one.rate
            for slope, one in zip(slopes, arguments, strict=True)
            if one.rate is not None
        ]
        return _Moving(call(*values), sum(parts) if parts else None)

    return moved


@cache
def _operators() -> dict[type[ast.AST], Callable[..., _Moving]]:
    return {kind: _chained(*known) for kind, known in _OPERATORS.items()}


@cache
def _functions() -> dict[str, Callable[..., _Moving]]:
    return {name: _chained(*known) for name, known in _FUNCTIONS.items()}


class _Evaluator(SimpleEval):
    """simpleeval cut down to arithmetic; numbers become float64, so that `**` can overflow but never hang."""

    def __init__(self, names: Mapping[str, _Moving]) -> None:
        super().__init__(_operators(), _functions(), names)
        self.nodes = {
            ast.Constant: lambda node: _Moving(np.float64(node.value)),
            ast.Name: self._eval_name,
            ast.UnaryOp: self._eval_unaryop,
            ast.BinOp: self._eval_binop,
            ast.Call: self._eval_call,
        }


@dataclass(frozen=True)
class Expression:
    """A formula in named variables, applied elementwise to arrays.

    Valid are numbers, `pi`, the given variables, + - * / **, parentheses and the functions sin, cos, tan,
    exp, log, sqrt, abs, sinh, cosh, tanh, arctan (or atan), arctan2(y, x), minimum, maximum, heaviside(z)
    (1/2 at z = 0) and J(m, z), the Bessel function of the first kind J_m(z), m a whole number written out.
    Length, depth and the number of functions and powers are bounded, and with them time and memory a point.

    Attributes
    ----------
    text : the formula as written.
    variables : the names it may use; a call must give all of them.

    Raises
    ------
    ValueError
        At construction, with a sentence that says what was given and what is valid.
    """

    text: str
    variables: tuple[str, ...]
    _tree: ast.expr = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        tree = _parse(self.text)
        _check(tree, self.variables)
        if (calls := sum(map(_weight, ast.walk(tree)))) > MAX_CALLS:
            raise ValueError(
                f"the expression has {calls} functions and powers, each J counting tenfold; "
                f"at most {MAX_CALLS} are valid"
            )
        object.__setattr__(self, "_tree", tree)

    def __call__(self, **values: ArrayLike) -> Array:
        """Return the values, shape: that of the given variables broadcast together.

        Arithmetic is IEEE and silent: log(-1) is nan and 1/0 is inf, for the caller to judge.
        """
        moving, shape = self._evaluated(values)
        return np.array(np.broadcast_to(moving.value, shape))

    def mentions(self, name: str) -> bool:
        """Whether a variable stands in the formula."""
        return any(isinstance(node, ast.Name) and node.id == name for node in ast.walk(self._tree))

    def degree_in(self, name: str) -> int:
        """Return 0 where the formula does not depend on a variable, 1 where it does linearly, else 2."""
        return _degree(self._tree, name)

    def rate(self, **values: ArrayLike) -> Array:
        """Return the derivative along the variable t, as `slope` does."""
        return self.slope("t", **values)

    def slope(self, along: str, **values: ArrayLike) -> Array:
        """Return the derivative along one of the variables, exact but for round-off; shape as of the values.

        At a kink it lies between those of the two sides; where it is infinite or has no value so is this.
        """
        moving, shape = self._evaluated(values, along)
        return np.array(np.broadcast_to(0.0 if moving.rate is None else moving.rate, shape))

    def _evaluated(
        self, values: Mapping[str, ArrayLike], along: str = "t"
    ) -> tuple[_Moving, tuple[int, ...]]:
        """Value and derivative along a variable, and the shape they are broadcast to."""
        if set(values) != set(self.variables):
            raise TypeError(f"expected values for {', '.join(self.variables)}, not for {', '.join(values)}")
        arrays = {name: np.asarray(value, dtype=np.float64) for name, value in values.items()}
        names = {
            name: _Moving(value, 1.0 if name == along else None)
            for name, value in (arrays | _CONSTANTS).items()
        }
        with np.errstate(all="ignore"):
            moving = _Evaluator(names).eval(self.text, previously_parsed=self._tree)
        return moving, np.broadcast_shapes(*(array.shape for array in arrays.values()))

    def __str__(self) -> str:
        return self.text

    def __reduce__(self) -> tuple[type["Expression"], tuple[str, tuple[str, ...]]]:
        return Expression, (self.text, self.variables)


def coordinates(points: Array) -> dict[str, Array]:
    """Name the coordinates of points (2, ...) as formulas do: x, y, r and theta in [-pi, pi], each (...)."""
    x, y = points
    return {"x": x, "y": y, "r": np.hypot(x, y), "theta": np.arctan2(y, x)}


def _degree(node: ast.expr, name: str) -> int:
    """Of a checked tree in a variable, as far as it can be read off; 2 stands for all that is not linear."""
    match node:
        case ast.Name(id=other):
            return int(other == name)
        case ast.UnaryOp(operand=operand):
            return _degree(operand, name)
        case ast.BinOp(left=left, op=operator, right=right):
            first, second = _degree(left, name), _degree(right, name)
            if isinstance(operator, ast.Add | ast.Sub):
                return max(first, second)
            if isinstance(operator, ast.Mult):
                return min(first + second, 2)
            return first if isinstance(operator, ast.Div) and not second else 2 * bool(first or second)
        case ast.Call(args=arguments):
            return 2 * any(_degree(one, name) for one in arguments)
    return 0


def names_in(text: str) -> set[str]:
    """Return the names of variables in a formula, known or not; ValueError where it is none."""
    tree = _parse(text)
    called = {node.func for node in ast.walk(tree) if isinstance(node, ast.Call)}
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and node not in called}


def same_formula(one: str, other: str) -> bool:
    """Whether two formulas are written alike but for spaces, brackets that do nothing and atan for arctan."""
    first, second = (ast.unparse(_parse(text)).replace("arctan(", "atan(") for text in (one, other))
    return first == second


RESERVED = frozenset({*_FUNCTIONS, *_CONSTANTS})
"""Names that mean something in every formula."""


def _parse(text: str) -> ast.expr:
    """Parse one formula of bounded length and depth."""
    if len(text) > MAX_LENGTH:
        raise ValueError(f"the expression has {len(text)} characters; at most {MAX_LENGTH} are valid")
    if foreign := next((c for c in text if not c.isascii()), None):
        # Python would read some of them as the ASCII letters they look like
        raise ValueError(f"not an expression ({brief(foreign)}, U+{ord(foreign):04X}); valid are {_GRAMMAR}")
    too_deep = f"the expression is nested too deeply; at most {MAX_DEPTH} levels are valid"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # e.g. "1if": an error below, no warning beside it
            tree = ast.parse(text.strip(), mode="eval").body
    except (RecursionError, MemoryError):
        raise ValueError(too_deep) from None
    except SyntaxError as error:
        raise ValueError(f"not an expression ({brief(error.msg)}); valid are {_GRAMMAR}") from None
    except ValueError:  # characters Python cannot even read
        raise ValueError(f"not an expression; valid are {_GRAMMAR}") from None
    if "#" in text:  # Python would drop the rest of the line without a word
        raise ValueError(f"not an expression (#); valid are {_GRAMMAR}")
    level: list[ast.AST] = [tree]
    for _ in range(MAX_DEPTH):
        level = [child for node in level for child in ast.iter_child_nodes(node)]
        if not level:
            return tree
    raise ValueError(too_deep)


def _check(node: ast.expr, variables: tuple[str, ...]) -> None:
    """Raise ValueError unless the tree is arithmetic on known names."""
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            if not _fits(number):
                raise ValueError("a number is too large; at most 1.79e308 is valid")
        case ast.Name(id=name):
            if name in _FUNCTIONS:
                raise ValueError(f"function {name} lacks its argument; valid is {_signature(name)}")
            if name not in (known := (*variables, *_CONSTANTS)):
                raise ValueError(f"unknown name {brief(name, 40)}; valid names are {', '.join(known)}")
        case ast.UnaryOp(op=operator, operand=operand) if type(operator) in _OPERATORS:
            _check(operand, variables)
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
            _check(left, variables)
            _check(right, variables)
        case ast.BinOp(op=ast.BitXor()):
            raise ValueError("^ is not valid; a power is written **")
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            if name not in _FUNCTIONS:
                valid = f"valid functions are {', '.join(_FUNCTIONS)}"
                raise ValueError(f"unknown function {brief(name, 40)}; {valid}")
            if len(arguments) != len(_FUNCTIONS[name][1]):
                raise ValueError(f"{len(arguments)} arguments for {name}; valid is {_signature(name)}")
            for argument in arguments:
                _check(argument, variables)
            if name == "J" and not _is_order(arguments[0]):
                given = shorten(ast.unparse(arguments[0]), 40)
                raise ValueError(f"J of order {given}; valid are whole numbers from 0 to {MAX_ORDER}")
        case _:
            raise ValueError(f"{shorten(ast.unparse(node), 40)} is not valid here; valid are {_GRAMMAR}")


def _fits(number: float) -> bool:
    """Whether a literal, possibly an integer of thousands of digits, is a finite float64."""
    try:
        return bool(np.isfinite(float(number)))
    except OverflowError:
        return False


def _is_order(node: ast.expr) -> bool:
    """Whether an argument of J is a whole number that any J of a disk's modes has."""
    match node:
        case ast.Constant(value=int() | float() as order):
            return order in range(MAX_ORDER + 1)
    return False


def _weight(node: ast.AST) -> int:
    """How many functions and powers a node of a checked tree counts for."""
    match node:
        case ast.Call(func=ast.Name(id="J")):
            return 10
        case ast.Call() | ast.Pow():
            return 1
    return 0


def _signature(name: str) -> str:
    """How a function is called: one argument, two, or the order and argument of J."""
    arguments = "m, z" if name == "J" else ", ".join(["z", "w"][: len(_FUNCTIONS[name][1])])
    return f"{name}({arguments})"
