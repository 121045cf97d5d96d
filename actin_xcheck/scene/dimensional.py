"""`[dimensional]`: parameters as they are measured, in units of their own or in those of Table 1."""

import re
from functools import cache
from typing import TYPE_CHECKING, Any

from pydantic import ValidationInfo, field_validator

from actin_xcheck.core.parameters import UNITS, DimensionalParameters
from actin_xcheck.scene.tables import Fraction, NonNegative, Poisson, Positive, TomlTable

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
