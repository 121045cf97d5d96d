"""What a sweep's file asks for: scenes, one a run, with the values that were varied."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
import tomli_w
from pydantic import Field, ValidationError, model_validator
from pydantic_core import ErrorDetails

from actin_xcheck.core.errors import UserError, brief
from actin_xcheck.scene.shelf import scene_text, shipped_scenes, varied
from actin_xcheck.scene.tables import Many, TomlTable, mistake

MOST_RUNS = 100_000

Value = Any
"""What TOML holds: a number, text, truth, a list or a table."""

Values = Mapping[str, Value]
"""What was varied, by dotted key of the scene."""


@dataclass(frozen=True)
class SweepPoint:
    """One run's scene, not yet checked.

    Attributes
    ----------
    scene : its name or file, as the sweep's file has it.
    text : its TOML.
    origin : where that comes from, for messages.
    values : what was varied in it.
    """

    scene: str
    text: str
    origin: str
    values: Values


class _Range(TomlTable):
    """`{ from = 1.0, to = 100.0, count = 5, scale = "log" }`, both ends among the values."""

    start: float = Field(alias="from")
    to: float
    count: int = Field(ge=2, le=MOST_RUNS)
    scale: Literal["linear", "log"] = "linear"

    @model_validator(mode="after")
    def _has_logarithms(self) -> Self:
        if self.scale == "log" and not self.start * self.to > 0:
            raise mistake("from", self.start, 'should have the sign of "to" where scale = "log"')
        return self

    def values(self) -> list[Value]:
        """The numbers."""
        space = np.geomspace if self.scale == "log" else np.linspace
        numbers: list[Value] = space(self.start, self.to, self.count).tolist()
        return numbers


class _Sweep(TomlTable):
    """A sweep's file."""

    scene: str | None = None
    scenes: Many[str] | None = Field(default=None, min_length=1, max_length=MOST_RUNS)
    combine: Literal["product", "zip"] = "product"
    over: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _has_scenes(self) -> Self:
        if (self.scene is None) == (self.scenes is None):
            raise mistake("scene", self.scene, "should name the scene to vary, or scenes a list of them")
        return self


def points_of(path: Path) -> list[SweepPoint]:
    """Return the runs that a sweep's file asks for, the last range varying fastest.

    UserError, one line that names file and key, what was given and what is valid; the scenes themselves are
    not checked yet.
    """
    try:
        sweep = _Sweep.model_validate(tomllib.loads(scene_text(path)))
    except ValidationError as error:
        raise UserError(f"{path}: {_sentence(error.errors()[0], _Sweep)}") from None
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path}: not valid TOML: {brief(str(error), 400)}") from None
    axes = {key: _axis(path, key, given) for key, given in _leaves(sweep.over)}
    names = [sweep.scene] if sweep.scene is not None else list(sweep.scenes or ())
    lengths = {key: len(values) for key, values in axes.items()}
    if sweep.combine == "zip" and len(set(lengths.values())) > 1:
        given = ", ".join(f"{key} has {length}" for key, length in lengths.items())
        raise UserError(f'{path}: over: {given}; valid with combine = "zip": as many values each')
    together = prod(lengths.values()) if sweep.combine == "product" else max(lengths.values(), default=1)
    if len(names) * together > MOST_RUNS:
        raise UserError(f"{path}: asks for {len(names) * together} runs; valid: at most {MOST_RUNS}")
    rows = product(*axes.values()) if sweep.combine == "product" else zip(*axes.values(), strict=True)
    combined = [dict(zip(axes, row, strict=True)) for row in rows] if axes else [{}]
    return [point for name in names for point in _varied(path, name, combined)]


def _leaves(table: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys of the lists and ranges in a table of tables."""
    for key, given in table.items():
        if isinstance(given, dict) and "from" not in given:
            yield from _leaves(given, f"{above}{key}.")
        else:
            yield f"{above}{key}", given


def _axis(path: Path, key: str, given: Any) -> list[Value]:
    if isinstance(given, list) and given:
        return given
    if not isinstance(given, dict):
        valid = "a list of values, or { from = ..., to = ..., count = ... }"
        raise UserError(f"{path}: over.{key} = {brief(repr(given))}; valid: {valid}")
    try:
        return _Range.model_validate(given).values()
    except ValidationError as error:
        raise UserError(f"{path}: over.{key}.{_sentence(error.errors()[0], _Range)}") from None


def _varied(path: Path, name: str, combined: Sequence[Values]) -> Iterator[SweepPoint]:
    """A scene with each of the combinations put into it."""
    given, name = name, name if name in shipped_scenes() else str(path.parent / name)
    text = scene_text(name)
    if combined == [{}]:
        yield SweepPoint(given, text, name, {})
        return
    try:
        base = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise UserError(f"{name}: not valid TOML: {brief(str(error), 400)}") from None
    for values in combined:
        said = ", ".join(f"{key} = {brief(repr(value), 40)}" for key, value in values.items())
        origin = f"{path}: {name} with {said}"
        yield SweepPoint(given, tomli_w.dumps(varied(base, values, origin)), origin, values)


def _sentence(error: ErrorDetails, table: type[TomlTable]) -> str:
    """Where a mistake is, what was given and what is valid."""
    context = error.get("ctx", {})
    key = ".".join(map(str, (*error["loc"], *([context["key"]] if "key" in context else []))))
    valid = ", ".join(field.alias or name for name, field in table.model_fields.items())
    match error["type"]:
        case "extra_forbidden":
            return f"{brief(key)}: unknown key; valid keys are {valid}"
        case "missing":
            return f"{key} is missing; keys are {valid}"
    what = error["msg"].removeprefix("Value error, ").removeprefix("Input ")
    return f"{key} = {brief(repr(context.get('given', error['input'])))}: {what}"
