"""Scenes: everything physical about a run and nothing numerical, read from TOML and checked key by key."""

import re
import reprlib
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Self, get_args

import numpy as np
from pydantic import BaseModel, BeforeValidator, Field, PrivateAttr, ValidationError, model_validator
from pydantic_core import ErrorDetails

from actin_xcheck.core.errors import UserError, brief
from actin_xcheck.core.model import Closure, Delta, Model
from actin_xcheck.core.parameters import IN_UNITS, UNITS, DimensionalParameters, Parameters
from actin_xcheck.scene.expression import Expression
from actin_xcheck.scene.laws import DimensionalTable, LawsTable, require_values, with_own_parameters
from actin_xcheck.scene.shelf import MAX_SIZE, did_you_mean, read_scene, varied
from actin_xcheck.scene.tables import (
    AsPublished,
    Domain,
    Expect,
    Initial,
    MotionTable,
    ParametersTable,
    ProbesTable,
    SourceTable,
    Switches,
    Time,
    TomlTable,
    mistake,
    require_motion,
    require_term,
)

_CONSTANT = (str(Delta.NONE), str(Delta.FULL))  # the linear theory takes delta constant
_ONE_TABLE = "should be a table, one of [parameters] and [dimensional], not both"
MOST_UNSTABLE = 15_000.0
"""Of growth over diffusion: about 40 unstable modes of an angular number, listed in two seconds."""

FASTEST = 1e6
"""Bound of the rates among which those of a mode are searched for, by halving."""

MAX_DOTS = 20
"""In a key: the parser keeps every beginning of a dotted key, which takes the square of their number."""

_TOO_DOTTED = re.compile(
    rf"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{MAX_DOTS}}}"""
)


class _Given(reprlib.Repr):
    """Shows a value short, however long or deep it is."""

    def __init__(self) -> None:
        super().__init__()
        self.maxstring = self.maxother = 80

    def repr_int(self, value: int, level: int) -> str:
        """Python does not write integers of thousands of digits."""
        return super().repr_int(value, level) if value.bit_length() < 4000 else "a huge integer"


_GIVEN = _Given()


class Scene(TomlTable):
    """One physical problem on the unit disk; see `load_scene`."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=80)
    source: Annotated[
        SourceTable, BeforeValidator(lambda given: {"citation": given} if isinstance(given, str) else given)
    ] = SourceTable()
    parameters_table: ParametersTable | None = Field(default=None, alias="parameters")
    dimensional: DimensionalTable | None = None
    model: Switches = Switches()
    laws: LawsTable = LawsTable()
    initial: Initial
    time: Time
    probes: ProbesTable = ProbesTable()
    motion: MotionTable | None = None
    domain: Domain = Domain()
    as_published: AsPublished = AsPublished()
    expect: Expect = Expect()
    _text: str = PrivateAttr(default="")
    _origin: str = PrivateAttr(default="")

    @model_validator(mode="before")
    @classmethod
    def _own_parameters(cls, given: Any) -> Any:
        return with_own_parameters(given)

    @model_validator(mode="after")
    def _has_parameters(self) -> Self:
        if self.parameters_table and self.dimensional:
            raise mistake("dimensional", self.dimensional.model_dump(exclude_unset=True), _ONE_TABLE)
        if not (self.parameters_table or self.dimensional):
            raise mistake("parameters", "nothing", _ONE_TABLE)
        return self

    @model_validator(mode="after")
    def _is_in_range(self) -> Self:
        """The groups of (3.1) obey the rules of [parameters], which products and powers may leave."""
        if self.dimensional:
            given = self.dimensional.model_dump(exclude_unset=True)
            try:
                ParametersTable.model_validate(asdict(self.parameters))
            except ArithmeticError:
                raise mistake(
                    "dimensional", given, "should give numbers that are no larger than 1e308"
                ) from None
            except ValidationError as error:
                group = error.errors()[0]
                raise mistake(
                    "dimensional",
                    given,
                    f"makes {group['loc'][0]} = {group['input']:.3g} of (3.1), which {_words(group)}",
                ) from None
        return self

    @model_validator(mode="after")
    def _formulas_have_values(self) -> Self:
        require_values(physics := self.physics)
        displaced = bool(self.initial.u or self.initial.eigenmode)
        rests_until = -1.0 if displaced else 0.0 if physics.contracts or physics.pressed else self.time.end
        if self.motion:
            require_motion(self.motion, self.time)
        if term := self.source.a:
            require_term("source.a", term, self.motion, rests_until, self.time.instants)
        if exact := self.expect.exact:
            require_term("expect.exact.a", exact.a, self.motion, rests_until, self.output_times)
        return self

    @model_validator(mode="after")
    def _has_one_displacement(self) -> Self:
        valid = "should not stand beside [motion], which says where the points start"
        if self.motion and self.initial.u:
            raise mistake("initial.u", [str(component) for component in self.initial.u], valid)
        if self.motion and self.initial.eigenmode:
            raise mistake("initial.eigenmode", self.initial.eigenmode.model_dump(), valid)
        return self

    @model_validator(mode="after")
    def _theory_applies(self) -> Self:
        rate = self.expect.growth_rate
        for key, mode in {"initial.eigenmode": self.initial.eigenmode, "expect.growth_rate": rate}.items():
            if mode and self.model.closure is Closure.IRROTATIONAL_WALL and (mode.m, mode.n) == (0, 1):
                valid = "should be at least 2 for m = 0 beside a wall, since j'_{0,1} = 0 (A.1)"
                raise mistake(f"{key}.n", 1, valid)
            if mode and self.model.closure is not Closure.IRROTATIONAL_WALL:
                self._rates_can_be_listed(key, mode.m)
        if not (rate or self.initial.eigenmode):
            return self
        if self.physics.sees("delta") and self.model.delta not in _CONSTANT:
            valid = f"should be {' or '.join(map(repr, _CONSTANT))} where p != 0 and a mode is given"
            raise mistake("model.delta", str(self.model.delta), valid)
        if not self.physics.is_smooth_at_rest:
            valid = "should have slopes at a = 1, phi = 0 where a mode is given: they have a kink there"
            raise mistake("laws", self.laws.stated, valid)
        if rate and not rate.window[0] < rate.window[1] <= self.time.end:
            valid = f"should be [t0, t1] with 0 <= t0 < t1 <= time.end = {self.time.end:g}"
            raise mistake("expect.growth_rate.window", list(rate.window), valid)
        return self

    def _rates_can_be_listed(self, key: str, m: int) -> None:
        """The rates of the moving cell are counted one by one, which takes the longer the more there are."""
        p, strength = self.parameters, self.physics.strength
        if m == 0 and not self.model.reaction:
            valid = "should be at least 1 where reaction = false, for one rate of m = 0 is 0"
            raise mistake(f"{key}.m", m, valid)
        if (1 + strength / p.mu) > MOST_UNSTABLE * p.d:
            least = f"(1 + (psi + |p|)/(mu1 + mu2))/{MOST_UNSTABLE:g}"
            raise mistake("parameters.d", p.d, f"should be at least {least} where a mode is given")
        if (1 + strength) > FASTEST * p.mu1:
            valid = f"should be at least (1 + psi + |p|)/{FASTEST:g} where a mode is given"
            raise mistake("parameters.mu1", p.mu1, valid)

    @model_validator(mode="after")
    def _references_are_reached(self) -> Self:
        probes = len(self.probes.points)
        for i, values in enumerate(self.expect.reference.at if self.expect.reference else ()):
            key = f"expect.reference.at[{i}]"
            if values.time not in self.output_times:
                times = ", ".join(f"{t:g}" for t in self.output_times)
                raise mistake(f"{key}.time", values.time, f"should be an output time: {times}")
            for name, given in ("probe_a", values.probe_a), ("probe_x", values.probe_x):
                if given is not None and len(given) != probes:
                    valid = f"should have one entry per probe, {probes}, not {len(given)}"
                    raise mistake(f"{key}.{name}", list(given), valid)
        return self

    @model_validator(mode="after")
    def _references_are_judged(self) -> Self:
        reference = self.expect.reference
        for name in ("area", "total_actin", "probe_a", "probe_x") if reference else ():
            assert reference
            given = [getattr(at, name) for at in reference.at if getattr(at, name) is not None]
            known = any(np.isfinite(values).any() for values in given)
            if known != (getattr(reference.bound, name) is not None):
                has = "values but no bound" if known else "a bound but no values"
                raise mistake(f"expect.reference.bound.{name}", has, "should have both, or neither")
            if name in ("area", "total_actin") and any(value <= 0 for value in given):
                raise mistake(f"expect.reference.at.{name}", given, "should be > 0")
        return self

    @property
    def parameters(self) -> Parameters:
        """The non-dimensional parameters, whichever table gave them."""
        if self.dimensional:
            return DimensionalParameters(**self.dimensional.model_dump()).non_dimensional()
        assert self.parameters_table  # _has_parameters
        return Parameters(**self.parameters_table.model_dump())

    @property
    def scales(self) -> str:
        """What t = 1 and x = 1 are, in words; empty where nothing says so."""
        return DimensionalParameters(**self.dimensional.model_dump()).scales if self.dimensional else ""

    @property
    def physics(self) -> Model:
        """The equations with this scene's parameters and switches."""
        readings = self.model
        rheology, closure, delta = readings.rheology, readings.closure, readings.delta
        return Model(self.parameters, rheology, closure, delta, readings.reaction, self.laws.laws)

    @property
    def output_times(self) -> tuple[float, ...]:
        """The times to keep; the last is the end."""
        kept = self.time.outputs
        return kept if kept and kept[-1] == self.time.end else (*kept, self.time.end)

    @property
    def times_before_it_ends(self) -> tuple[float, ...]:
        """The output times, those alone that are before a run must end where that is expected."""
        expected = self.expect
        last = expected.at - expected.within if expected.at and expected.within else np.inf
        return tuple(t for t in self.output_times if t <= last)

    @property
    def citation(self) -> str:
        """Where the scene comes from."""
        return self.source.citation

    @property
    def source_term(self) -> Expression | None:
        """Source of the transport equation in x, y, r, theta (current position), x0, y0 and t."""
        return self.source.a

    @property
    def text(self) -> str:
        """The TOML the scene was read from."""
        return self._text

    @property
    def origin(self) -> str:
        """What `load_scene` finds the scene by: its shipped name or its path."""
        return self._origin

    @property
    def mode(self) -> tuple[int, int] | None:
        """(m, n) of the mode whose growth is measured: the expected one, else the one it starts with."""
        mode = self.expect.growth_rate or self.initial.eigenmode
        return (mode.m, mode.n) if mode else None

    def varied(self, changes: Mapping[str, Any], origin: str = "") -> "Scene":
        """Return the scene with other values, as scene.varied({"parameters.psi": 3.0, "expect": None}).

        Parameters
        ----------
        changes : by the dotted keys of its TOML; None leaves a value or a whole table out.
        origin : where the other scene is found; else this one's.

        UserError as `parse_scene`: it names the key, what was given and what is valid.
        """
        import tomli_w

        origin = origin or self.origin
        return parse_scene(tomli_w.dumps(varied(tomllib.loads(self.text), changes, origin)), origin)


def load_scene(name_or_path: str | Path) -> Scene:
    """Return a shipped scene by its name, or the scene in a file whose path ends in .toml.

    Raises
    ------
    UserError
        One line naming file and key, what was given and what is valid.
    """
    return parse_scene(*read_scene(name_or_path))


def load_scenes(names_or_paths: Iterable[str | Path]) -> list[Scene]:
    """Return several scenes, each asked for once; UserError where two of them have one name too."""
    scenes = [load_scene(one) for one in dict.fromkeys(names_or_paths)]
    names = [scene.name for scene in scenes]
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise UserError(f"more than one scene is named {', '.join(repeated)}; valid: names that differ")
    return scenes


def parse_scene(text: str, origin: str) -> Scene:
    """Return the scene a TOML text states; `origin` names its place in the UserError a mistake raises."""
    try:
        scene = Scene.model_validate(_toml(text))
    except ValidationError as error:
        # an unknown key first: often it is the misspelt one that another mistake misses
        first = min(error.errors(), key=lambda one: one["type"] != "extra_forbidden")
        raise UserError(f"{origin}: {' '.join(_sentence(first).split())}") from None  # one line
    except ValueError as error:
        raise UserError(f"{origin}: {brief(str(error), 400)}") from None
    scene._text, scene._origin = text, origin
    return scene


def _toml(text: str) -> dict[str, Any]:
    """Parse TOML of bounded size and depth; ValueError says why it cannot be read."""
    if len(text) > MAX_SIZE:
        raise ValueError(f"{len(text)} characters are no scene; at most {MAX_SIZE} are valid")
    if not _is_unicode(text):
        raise ValueError("not valid TOML: not Unicode text")
    if found := _TOO_DOTTED.search(text):
        raise ValueError(f"{brief(found[0])} is no key; at most {MAX_DOTS} dots are valid")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("not valid TOML: nested too deeply") from None
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"not valid TOML: {error}") from None
    except ValueError:  # Python reads integers of up to 4300 digits
        raise ValueError("not valid TOML: an integer of thousands of digits") from None


def _is_unicode(text: str) -> bool:
    """False for lone surrogates, which no file in UTF-8 holds."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _sentence(error: ErrorDetails) -> str:
    """Say of one pydantic error where it is, what was given and what is valid."""
    context, location = error.get("ctx", {}), error["loc"]
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    key = f"{key}.{context['key']}" if "key" in context else key
    key = brief(key.removeprefix("."), 160)
    match error["type"]:
        case "extra_forbidden":
            valid = _keys(_table_at(location[:-1]))
            hint = did_you_mean(str(location[-1]), valid)
            return f"unknown key {key}{hint}; valid keys are {', '.join(valid)}"
        case "missing":
            if isinstance(location[-1], int):
                return f"{key} is missing; valid are two entries"
            required = ", ".join(_required(_table_at(location[:-1])))
            units = f"; {IN_UNITS}" if location[:-1] == ("dimensional",) else ""
            return f"{key} is missing; required keys are {required}{units}"
        case "model_type":
            what = f"should be a table with keys among {', '.join(_keys(_table_at(location)))}"
        case "string_pattern_mismatch":
            what = "should be letters, digits, '-', '_' and '.', a letter or digit first"
        case _:
            what = _words(error)
    unit = f", in {UNITS[str(location[1])]}" if location[:-1] == ("dimensional",) else ""
    return f"{key} = {_GIVEN.repr(context.get('given', error['input']))}: {what}{unit}"


def _words(error: ErrorDetails) -> str:
    """What a value should be, in the words of TOML."""
    words = error["msg"].removeprefix("Value error, ").removeprefix("Input ")
    return words.replace(" after validation", "").replace("tuple", "list").replace("Tuple", "list")


def _table_at(location: tuple[int | str, ...]) -> type[BaseModel]:
    """Return the table that stands at a place in the document."""
    table: type[BaseModel] = Scene
    for key in location:
        if isinstance(key, str):
            field = next(field for name, field in table.model_fields.items() if key in (name, field.alias))
            table = next(_tables_in(field.annotation))
    return table


def _tables_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _tables_in(part)


def _keys(table: type[BaseModel]) -> list[str]:
    return [field.alias or name for name, field in table.model_fields.items()]


def _required(table: type[BaseModel]) -> list[str]:
    return [field.alias or name for name, field in table.model_fields.items() if field.is_required()]
