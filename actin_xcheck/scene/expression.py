"""Formulas in scenes: parsed once, checked by name, evaluated on arrays by simpleeval, never by `eval`."""

import ast
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from textwrap import shorten
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import jv
from simpleeval import SimpleEval

from actin_xcheck.core.errors import brief

Array = NDArray[np.float64]

MAX_LENGTH = 4000
MAX_DEPTH = 100  # the evaluator spends a few Python frames a level, far below the recursion limit
MAX_CALLS = 100  # functions and powers, J counting tenfold: up to 0.2 us each and 8 us a point
MAX_ORDER = 100

_CONSTANTS = {"pi": np.float64(np.pi)}
_FUNCTIONS: dict[str, tuple[int, Callable[..., Any]]] = {
    "sin": (1, np.sin),
    "cos": (1, np.cos),
    "tan": (1, np.tan),
    "exp": (1, np.exp),
    "log": (1, np.log),
    "sqrt": (1, np.sqrt),
    "abs": (1, np.abs),
    "sinh": (1, np.sinh),
    "cosh": (1, np.cosh),
    "tanh": (1, np.tanh),
    "arctan": (1, np.arctan),
    "arctan2": (2, np.arctan2),
    "minimum": (2, np.minimum),
    "maximum": (2, np.maximum),
    "heaviside": (1, lambda z: np.heaviside(z, 0.5)),
    "J": (2, jv),
}
_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.UAdd: np.positive,
    ast.USub: np.negative,
}
_GRAMMAR = "numbers, names, + - * / ** ( ) and function calls"


class _Evaluator(SimpleEval):
    """simpleeval cut down to arithmetic; numbers become float64, so that `**` can overflow but never hang."""

    def __init__(self, names: Mapping[str, Any]) -> None:
        super().__init__(_OPERATORS, {name: call for name, (_, call) in _FUNCTIONS.items()}, names)
        self.nodes = {
            ast.Constant: lambda node: np.float64(node.value),
            ast.Name: self._eval_name,
            ast.UnaryOp: self._eval_unaryop,
            ast.BinOp: self._eval_binop,
            ast.Call: self._eval_call,
        }


@dataclass(frozen=True)
class Expression:
    """A formula in named variables, applied elementwise to arrays.

    Valid are numbers, `pi`, the given variables, + - * / **, parentheses and the functions sin, cos, tan,
    exp, log, sqrt, abs, sinh, cosh, tanh, arctan, arctan2(y, x), minimum, maximum, heaviside(z) (1/2 at
    z = 0) and J(m, z), the Bessel function of the first kind J_m(z), m a whole number written out.  Length,
    depth and the number of functions and powers are bounded, and with them time and memory a point.

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
        if set(values) != set(self.variables):
            raise TypeError(f"expected values for {', '.join(self.variables)}, not for {', '.join(values)}")
        arrays = {name: np.asarray(value, dtype=np.float64) for name, value in values.items()}
        with np.errstate(all="ignore"):
            result = _Evaluator(arrays | _CONSTANTS).eval(self.text, previously_parsed=self._tree)
        shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
        return np.array(np.broadcast_to(result, shape))

    def __str__(self) -> str:
        return self.text

    def __reduce__(self) -> tuple[type["Expression"], tuple[str, tuple[str, ...]]]:
        return Expression, (self.text, self.variables)


def coordinates(points: Array) -> dict[str, Array]:
    """Name the coordinates of points (2, ...) as formulas do: x, y, r and theta in [-pi, pi], each (...)."""
    x, y = points
    return {"x": x, "y": y, "r": np.hypot(x, y), "theta": np.arctan2(y, x)}


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
            if len(arguments) != _FUNCTIONS[name][0]:
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
    arguments = "m, z" if name == "J" else ", ".join(["z", "w"][: _FUNCTIONS[name][0]])
    return f"{name}({arguments})"
