"""Two tables of a scene that are more than keys.

`[dimensional]` has parameters in units of their own or in those of Table 1; `[laws]` constitutive laws in
place of the article's, with parameters of their own.
"""

import re
from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from actin_xcheck.core.model import ARGUMENTS, ARTICLE, Laws, Model
from actin_xcheck.core.parameters import UNITS, DimensionalParameters, Parameters
from actin_xcheck.scene.expression import RESERVED, Expression, names_in, same_formula
from actin_xcheck.scene.tables import Fraction, Group, NonNegative, Poisson, Positive, TomlTable, mistake

if TYPE_CHECKING:
    from pint import UnitRegistry


_POWER = r"(?:(?:\^|\*\*)-?\d)?"
_QUANTITY = re.compile(
    rf"\s*(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*"
    rf"(?P<unit>/?\s*[A-Za-zµμ]+{_POWER}(?:\s*[*/·\s]\s*[A-Za-zµμ]+{_POWER})*)?\s*"
)
"""A number and a product of units: nothing that a library would have to evaluate."""

_SUPERSCRIPTS = str.maketrans({"²": "^2", "³": "^3", "·": "*", "μ": "µ"})
_WITHOUT = ("no unit", "normalised density")


class DimensionalTable(TomlTable):
    """`[dimensional]`: `parameters.UNITS` and defaults of Table 1."""

    psi: NonNegative
    p: float
    E: Positive = DimensionalParameters.E
    nu: Poisson = DimensionalParameters.nu
    D_a: NonNegative = DimensionalParameters.D_a
    k_a: Positive = DimensionalParameters.k_a
    a_sat: Positive = DimensionalParameters.a_sat
    mu1: Positive = DimensionalParameters.mu1
    mu2: NonNegative = DimensionalParameters.mu2
    l0: Fraction = DimensionalParameters.l0
    a_c: Positive = DimensionalParameters.a_c
    L: Positive = DimensionalParameters.L

    @field_validator("*", mode="before")
    @classmethod
    def _in_units_of_table_1(cls, given: Any, info: ValidationInfo) -> Any:
        return quantity(given, UNITS[str(info.field_name)]) if isinstance(given, str) else given


def quantity(text: str, unit: str) -> float | str:
    """Return a quantity such as "6.9 kPa" as a number in a unit; ValueError says what is valid.

    A number in quotes without a unit stays a text: it is a mistake here as in other tables.
    """
    valid = f'should be a number, or a number with its unit in quotes, as "{_EXAMPLES.get(unit, "1.4")}"'
    match = _QUANTITY.fullmatch(text.strip().translate(_SUPERSCRIPTS))
    if match is None or len(text) > 80:
        raise ValueError(valid)
    number, given = float(match["number"]), match["unit"]
    if given is None:
        return text
    if unit in _WITHOUT:
        raise ValueError("should be a number without a unit")
    factor = _factor(f"1{given}" if given.startswith("/") else given, unit)
    if factor is None:
        raise ValueError(valid)
    return number * factor


_EXAMPLES = {
    "dyn/cm^2": "6.9 kPa",
    "dyn s/cm^2": "9.6 Pa s",
    "cm^2/s": "0.016 µm^2/s",
    "1/s": "66/s",
    "cm": "10 µm",
}


@cache
def _factor(given: str, unit: str) -> float | None:
    """How many of a unit make another; None where they are no units, or not of one kind."""
    import pint  # here: few scenes have units, and it takes longer to load than they do

    try:
        return float(_registry().parse_expression(given).to(_registry().parse_units(unit)).magnitude)
    except (pint.PintError, AttributeError, ArithmeticError):
        return None


@cache
def _registry() -> "UnitRegistry[Any]":
    import pint

    return pint.UnitRegistry(cache_folder=None)


KNOWN = tuple(one.name for one in fields(Parameters))
"""Parameters that every law may use."""

RANGES = {
    "a": np.append(np.geomspace(1e-3, 20, 41), 1.0)[:, None, None],
    "phi": np.linspace(-0.9, 3, 40)[:, None],
    "delta": np.array([0.0, 1.0]),
}
"""Where a law must have values: what is beyond ends a run."""


class LawsTable(TomlTable):
    """`[laws]`: formulas in `ARGUMENTS` and in parameters, and those that no other table has."""

    contractility: str | None = None
    pressure: str | None = None
    kinetics: str | None = None
    parameters: dict[str, Group] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _are_formulas(self) -> Self:
        given = {law: text for law in ARTICLE if (text := getattr(self, law)) is not None}
        for name in self.parameters:
            if name in {*RESERVED, *KNOWN, *RANGES} or not name.isidentifier():
                raise mistake(f"parameters.{name}", self.parameters[name], "should have a name of its own")
        for law, text in given.items():
            try:
                self._expression(law, text)
            except ValueError as error:
                raise mistake(law, text, f"{error}; others are to be given under [parameters]") from None
        used = {name for text in given.values() for name in names_in(text)}
        if unused := sorted(self.parameters.keys() - used):
            raise mistake(
                f"parameters.{unused[0]}",
                self.parameters[unused[0]],
                f"should be in a law, or is none of {', '.join(KNOWN)}",
            )
        return self

    @property
    def laws(self) -> Laws:
        """The laws that differ from the article's."""
        own = {
            law: self._expression(law, text)
            for law, article in ARTICLE.items()
            if (text := getattr(self, law)) is not None and not same_formula(text, article)
        }
        return Laws(**own, own=tuple(self.parameters.items()) if own else ())

    @property
    def stated(self) -> dict[str, str]:
        """What the table says, in words."""
        laws = {law: text for law in ARTICLE if (text := getattr(self, law)) is not None}
        return laws | {name: f"{value:g}" for name, value in self.parameters.items()}

    def _expression(self, law: str, text: str) -> Expression:
        return _expression(text, (*ARGUMENTS[law], *KNOWN, *self.parameters))


@cache
def _expression(text: str, variables: tuple[str, ...]) -> Expression:
    return Expression(text, variables)


def require_values(model: Model) -> None:
    """Raise unless laws of one's own have finite values in `RANGES`."""
    _require_decay(model)
    for law in ("contractility", "pressure"):
        formula = getattr(model.laws, law)
        if formula is None:
            continue
        at = [RANGES[name] for name in ARGUMENTS[law]]
        values, *places = np.broadcast_arrays(getattr(model, law)(*at), *at)
        good = np.abs(values) <= 1e12
        if not good.all():
            worst = np.unravel_index(int(np.argmin(good)), good.shape)
            where = ", ".join(
                f"{name} = {place[worst]:.4g}" for name, place in zip(ARGUMENTS[law], places, strict=True)
            )
            valid = "should be finite and at most 1e12 for a from 0.001 to 20 and phi from -0.9 to 3"
            raise mistake(f"laws.{law}", str(formula), f"{valid}, but is {values[worst]:.4g} at {where}")


def _require_decay(model: Model) -> None:
    """Raise unless kinetics are k (1 - a), k >= 0: what both codes take implicitly, and a = 1 is at rest."""
    formula = model.laws.kinetics
    if formula is None:
        return
    known = vars(model.parameters) | dict(model.laws.own)
    at_rest, rate = float(formula(**known, a=1.0)), -float(formula.slope("a", **known, a=1.0))
    linear = isinstance(formula, Expression) and formula.degree_in("a") == 1
    if not (linear and 0 <= rate <= 1e6 and abs(at_rest) <= 1e-14 * rate):
        valid = "should be linear in a, 0 at a = 1 and falling, as k*(1 - a), with k at most 1e6"
        raise mistake("laws.kinetics", str(formula), valid)


def with_own_parameters(given: Any) -> Any:
    """Return a scene's table with what is no parameter of the article's moved to [laws.parameters].

    psi and p, which laws of one's own need not use, are 0 where they are not given.
    """
    if not (isinstance(given, Mapping) and isinstance(laws := given.get("laws"), Mapping)):
        return given
    parameters = given.get("parameters", {})
    if not isinstance(parameters, Mapping) or "dimensional" in given:
        return given
    own = {name: value for name, value in parameters.items() if name not in KNOWN}
    unused = {key: 0 for key, law in (("psi", "contractility"), ("p", "pressure")) if law in laws}
    kept = {name: value for name, value in parameters.items() if name not in own}
    within = laws.get("parameters", {})
    if isinstance(within, Mapping):
        within = {**own, **within}
    return {**given, "parameters": {**unused, **kept}, "laws": {**laws, "parameters": within}}
